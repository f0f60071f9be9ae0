//! `--progress json`: what a run does as one JSON object a line on stderr. The events and their
//! keys are documented in docs/formats.md.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::exit::exit_number;
use super::print;
use super::words::Told;
use crate::ErrorKind;
use crate::engine::Done;
use crate::plan::Outline;
use crate::report::Decision;

/// Least time between two events of progress.
const EVERY: Duration = Duration::from_millis(250);

/// Prints events; called from several threads.
pub(super) struct Events {
    start: Instant,
    phase: Mutex<Option<OpenPhase>>,
    done: AtomicU64,
}

struct OpenPhase {
    name: &'static str,
    total: Option<u64>,
    told: Instant,
}

impl Events {
    /// Counts seconds from now.
    pub fn new() -> Self {
        Events { start: Instant::now(), phase: Mutex::new(None), done: AtomicU64::new(0) }
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

    /// A phase begins, with `total` points to do.
    pub fn phase(&self, name: &'static str, total: Option<u64>) {
        self.end_phase();
        self.done.store(0, Ordering::Relaxed);
        *self.open() = Some(OpenPhase { name, total, told: Instant::now() });
        self.tell("phase", json!({ "name": name, "total": total }));
    }

    /// `points` more are done.
    pub fn advance(&self, points: u64) {
        let done = self.done.fetch_add(points, Ordering::Relaxed).saturating_add(points);
        // Whoever finds another thread at it leaves the telling to that one.
        let Ok(mut phase) = self.phase.try_lock() else { return };
        let Some(phase) = phase.as_mut().filter(|phase| phase.told.elapsed() >= EVERY) else {
            return;
        };
        phase.told = Instant::now();
        self.progress(phase, done);
    }

    /// Something the user should know.
    pub fn warn(&self, message: &str) {
        self.tell("warning", json!({ "message": message }));
    }

    /// Stages chose values of keys by what they saw of the scan.
    pub fn chose(&self, values: &[Decision]) {
        self.tell("chosen", json!({ "values": values }));
    }

    /// A run is done and its outputs are in place.
    pub fn done(&self, done: &Done) {
        self.end_phase();
        let (result, run) = (&done.report.result, &done.report.run);
        self.tell(
            "done",
            json!({
                "ledger": result.ledger,
                "classes": result.classes,
                "totals": result.totals,
                "decisions": result.decisions,
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
        let error = told.error;
        let kind = match error.kind() {
            ErrorKind::Io => "io",
            ErrorKind::Data => "data",
            ErrorKind::Pipeline => "pipeline",
            ErrorKind::Memory => "memory",
            ErrorKind::Interrupted => "interrupted",
            ErrorKind::Internal => "internal",
        };
        self.tell(
            "error",
            json!({
                "kind": kind,
                "message": told.message,
                "causes": told.causes,
                "file": error.path().map(|path| path.display().to_string()),
                "byte": error.byte(),
                "help": told.help,
                "exit_code": exit_number(error),
            }),
        );
    }

    /// The last event of the open phase, if there is one.
    fn end_phase(&self) {
        if let Some(phase) = self.open().take() {
            self.progress(&phase, self.done.load(Ordering::Relaxed));
        }
    }

    fn progress(&self, phase: &OpenPhase, done: u64) {
        let OpenPhase { name, total, .. } = phase;
        self.tell("progress", json!({ "phase": name, "done": done, "total": total }));
    }

    fn open(&self) -> std::sync::MutexGuard<'_, Option<OpenPhase>> {
        self.phase.lock().unwrap_or_else(PoisonError::into_inner)
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
