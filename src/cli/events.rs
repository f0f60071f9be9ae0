//! `--progress json`: what a run does as one JSON object a line on stderr. The events and their
//! keys are documented in docs/formats.md.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::draw::{Draw, of_input};
use super::exit::exit_number;
use super::print;
use super::words::{Told, Words};
use crate::ErrorKind;
use crate::engine::Done;
use crate::plan::Outline;
use crate::report::Decision;

/// The time between two events of progress, at least.
const EVERY: Duration = Duration::from_millis(250);

/// Prints events.
pub(super) struct Events {
    start: Instant,
}

impl Events {
    /// Counts seconds from now.
    pub fn new() -> Self {
        Events { start: Instant::now() }
    }

    /// A run is planned and begins.
    pub fn planned(&self, outline: &Outline, text: &str) {
        let name = |path: &std::path::PathBuf| path.display().to_string();
        self.tell(
            "plan",
            json!({
                "inputs": outline.inputs,
                "points": outline.points,
                "outputs": outline.outputs.iter().map(name).collect::<Vec<String>>(),
                "report": outline.report.as_ref().map(name),
                "threads": outline.threads,
                "memory_bytes": outline.memory_bytes,
                "scratch": name(&outline.scratch),
                "text": text,
            }),
        );
    }

    /// Something the user should know.
    pub fn warn(&self, message: &str) {
        self.tell("warning", json!({ "message": message }));
    }

    /// A run is done and its outputs are in place.
    pub fn done(&self, done: &Done) {
        let (result, run) = (&done.report.result, &done.report.run);
        self.tell(
            "done",
            json!({
                "ledger": result.ledger,
                "classes": result.classes,
                "totals": result.totals,
                "decisions": result.decisions,
                "accept": result.accept,
                "outputs": run.outputs,
                "report": done.report_path.as_ref().map(|path| path.display().to_string()),
                "memory_bytes": run.memory_bytes,
                "peak_memory_bytes": run.peak_memory_bytes,
                "spill_bytes": run.spill_bytes,
                "run_seconds": run.seconds,
                "cpu_seconds": run.cpu_seconds,
                "phases": run.phases,
            }),
        );
    }

    /// A failure, with the exit code that it leads to.
    pub fn error(&self, told: &Told<'_>) {
        self.tell("error", error_keys(told));
    }

    /// Prints an event with its name and time before its own keys.
    fn tell(&self, event: &str, keys: Value) {
        let seconds = (self.start.elapsed().as_secs_f64() * 1000.0).round() / 1000.0;
        let mut object = serde_json::Map::new();
        object.insert("event".to_owned(), event.into());
        object.insert("seconds".to_owned(), seconds.into());
        if let Value::Object(keys) = keys {
            object.extend(keys);
        }
        print::event(&Value::Object(object));
    }
}

/// What is told of an error, in the words of a command.
pub(super) fn error_keys(told: &Told<'_>) -> Value {
    let error = told.error;
    let kind = match error.kind() {
        ErrorKind::Io => "io",
        ErrorKind::Data => "data",
        ErrorKind::Pipeline => "pipeline",
        ErrorKind::Memory => "memory",
        ErrorKind::NotAccepted => "not accepted",
        ErrorKind::Interrupted => "interrupted",
        ErrorKind::Internal => "internal",
    };
    json!({
        "kind": kind,
        "message": told.message,
        "causes": told.causes,
        "file": error.path().map(|path| path.display().to_string()),
        "byte": error.byte(),
        "help": told.help,
        "exit_code": exit_number(error),
    })
}

/// Tells what a run does as events, in the words of a command.
pub(super) struct RunEvents<'a> {
    events: &'a Events,
    words: &'a Words,
    /// The phase that it is in, its points, and how many of them were told to be done.
    phase: Option<(&'static str, Option<u64>, u64)>,
    /// The input, where it is one of many.
    input: Option<String>,
}

impl<'a> RunEvents<'a> {
    /// Of a run that has no phase yet.
    pub fn new(events: &'a Events, words: &'a Words, input: Option<String>) -> Self {
        RunEvents { events, words, phase: None, input }
    }

    fn progress(&mut self, done: u64) {
        if let Some((name, total, told)) = &mut self.phase {
            *told = done;
            let keys = json!({ "phase": name, "done": done, "total": total });
            self.events.tell("progress", keys);
        }
    }
}

impl Draw for RunEvents<'_> {
    fn every(&self) -> Duration {
        EVERY
    }

    fn begin(&mut self, name: &'static str, total: Option<u64>) {
        self.phase = Some((name, total, 0));
        self.events.tell("phase", json!({ "name": name, "total": total }));
    }

    fn advance(&mut self, done: u64) {
        if self.phase.is_some_and(|(.., told)| told != done) {
            self.progress(done);
        }
    }

    fn end(&mut self, done: u64) {
        self.progress(done);
        self.phase = None;
    }

    fn warn(&mut self, message: &str) {
        let message = of_input(self.input.as_deref(), message);
        self.events.warn(&self.words.told(&message));
    }

    fn chose(&mut self, values: &[Decision]) {
        self.events.tell("chosen", json!({ "values": values }));
    }
}
