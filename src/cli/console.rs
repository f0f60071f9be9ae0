//! What a command says while it works: bars, text or events on stderr, as loud as the user wants.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use serde_json::Value;

use super::arguments::{Command, Progress};
use super::draw::{Draw, Nothing, of_input, watched};
use super::events::{Events, RunEvents, error_keys};
use super::progress::{Bars, FileBar, ManyBars};
use super::words::{Told, Words};
use super::{interrupt, print};
use crate::engine::{Done, Watch};
use crate::error::shown;
use crate::host::standard;
use crate::language::Registry;
use crate::plan::{FittedSize, Plan};
use crate::report::{Decision, Short};
use crate::{Error, Result};

/// Where all that a command says goes through.
pub(super) struct Console {
    voice: Voice,
    words: Words,
    quiet: bool,
    verbose: bool,
    /// Set by Ctrl-C, once a run listens to it.
    interrupted: OnceLock<Arc<AtomicBool>>,
    /// Said behind what a run chose by itself.
    hint: OnceLock<&'static str>,
    /// True while several runs work at once: of each only warnings and errors are told.
    several: AtomicBool,
    /// Their bars, where there are any.
    bars: OnceLock<ManyBars>,
}

enum Voice {
    /// With bars, if they are wanted.
    Text(bool),
    Json(Events),
}

impl Console {
    /// As the arguments of a command ask for, in its words; one that has none of these speaks
    /// plainly.
    pub fn new(command: &Command, registry: &Registry) -> Self {
        let common = command.common();
        // A look at a file has bars on a terminal, and is silent else.
        let (usual, quiet) = match command {
            Command::Validate(all) => (Progress::Auto, all.quiet),
            _ => (Progress::Never, common.is_some_and(|common| common.quiet)),
        };
        let progress = common.map_or(usual, |common| common.progress);
        Console {
            voice: match progress {
                Progress::Json => Voice::Json(Events::new()),
                Progress::Auto | Progress::Never => Voice::Text(progress == Progress::Auto),
            },
            words: Words::of(command, registry),
            quiet,
            verbose: common.is_some_and(|common| common.verbose),
            interrupted: OnceLock::new(),
            hint: OnceLock::new(),
            several: AtomicBool::new(false),
            bars: OnceLock::new(),
        }
    }

    /// From now on several runs work at once, `files` in all: a bar each, and no phases.
    pub fn tell_several(&self, files: usize) {
        self.several.store(true, Ordering::Relaxed);
        if let (false, Voice::Text(true)) = (self.quiet, &self.voice)
            && let Some(bars) = ManyBars::new(files)
        {
            self.bars.get_or_init(|| bars);
        }
    }

    /// One of several runs is over.
    pub fn one_done(&self) {
        self.bars.get().into_iter().for_each(ManyBars::done);
    }

    /// All of them are.
    pub fn all_done(&self) {
        self.bars.get().into_iter().for_each(ManyBars::end);
    }

    /// Calls `print` while no bar of several runs is in its way.
    fn beside(&self, print: impl FnOnce()) {
        match self.bars.get() {
            Some(bars) => bars.beside(print),
            None => print(),
        }
    }

    /// An error as JSON, in the words of the command.
    pub fn in_words(&self, error: &Error) -> Value {
        error_keys(&Told::of(error, &self.words))
    }

    /// From now on Ctrl-C asks the run to stop, rather than ending the process.
    pub fn hear_interrupts(&self) {
        let flag = self.interrupted.get_or_init(interrupt::flag);
        standard::wait_until(Arc::clone(flag));
    }

    /// Behind what a run chooses by itself, say this.
    pub fn hint(&self, hint: &'static str) {
        self.hint.get_or_init(|| hint);
    }

    /// Prints a result on stdout, unless nothing is wanted there.
    pub fn result(&self, text: impl Display) -> Result<()> {
        if self.quiet { Ok(()) } else { print::result(text) }
    }

    /// Tells what a plan decided.
    pub fn planned(&self, plan: &Plan) {
        let outline = plan.outline();
        match &self.voice {
            Voice::Json(events) if !self.quiet => events.planned(&outline, &plan.to_string()),
            Voice::Text(_) if self.verbose => {
                print::message(plan);
                print::message(format_args!("scratch  {}", shown(&outline.scratch)));
            }
            _ => {}
        }
    }

    /// Runs a plan and tells what it does, until it is told to stop.
    pub fn run(&self, plan: Plan) -> Result<Done> {
        self.run_of(None, plan)
    }

    /// The same for one `input` of many, which warnings name.
    pub fn run_of(&self, input: Option<&Path>, plan: Plan) -> Result<Done> {
        self.planned(&plan);
        let unit = plan.unit();
        self.watched_of(input, unit, |watch| plan.run(watch)).inspect(|done| self.done(done))
    }

    /// The same, for outputs that are to take so many bytes.
    pub fn run_to_size(&self, plan: Plan, bytes: RangeInclusive<u64>) -> Result<FittedSize> {
        self.planned(&plan);
        let unit = plan.unit();
        let fitted = self.watched(unit, |watch| plan.run_to_size(bytes, watch))?;
        if let FittedSize::Done(done) = &fitted {
            self.done(done);
        }
        Ok(fitted)
    }

    /// Tells something of interest, as text alone.
    pub fn note(&self, text: impl Display) {
        if let (false, Voice::Text(_)) = (self.quiet, &self.voice) {
            print::message(text);
        }
    }

    /// What `run` comes to, telling what it does in lengths of this unit.
    pub fn watched<T>(
        &self,
        unit: Option<&'static str>,
        run: impl FnOnce(&dyn Watch) -> Result<T>,
    ) -> Result<T> {
        self.watched_of(None, unit, run)
    }

    fn watched_of<T>(
        &self,
        input: Option<&Path>,
        unit: Option<&'static str>,
        run: impl FnOnce(&dyn Watch) -> Result<T>,
    ) -> Result<T> {
        let input = input.map(|input| shown(input).to_string());
        let cancelled = || self.cancelled();
        match &self.voice {
            _ if self.quiet => watched(&mut Nothing, &cancelled, run),
            _ if self.several.load(Ordering::Relaxed) => {
                let name = input.as_deref().unwrap_or_default();
                let bar = self.bars.get().map(|bars| bars.one(name));
                watched(&mut OneOfMany { console: self, input, bar }, &cancelled, run)
            }
            Voice::Json(events) => {
                watched(&mut RunEvents::new(events, &self.words, input), &cancelled, run)
            }
            Voice::Text(bars) => {
                let bars = Bars::new(*bars, self.verbose);
                let mut text = RunText { console: self, input, unit, bars };
                let done = watched(&mut text, &cancelled, run);
                text.bars.end();
                done
            }
        }
    }

    fn done(&self, done: &Done) {
        match &self.voice {
            Voice::Json(events) if !self.quiet => events.done(done),
            Voice::Text(_) if self.verbose => {
                for decision in &done.report.result.decisions {
                    let (stage, name, value) = (&decision.stage, &decision.name, &decision.value);
                    print::message(format_args!("decided  {stage}: {name} = {value}"));
                }
                print::message(format_args!("at peak  {}", done.report.run.memory_holders));
            }
            _ => {}
        }
    }

    /// Tells something that the user should know, unless nothing is wanted.
    pub fn warn(&self, message: &str) {
        let message = &self.words.told(message);
        match &self.voice {
            _ if self.quiet => {}
            Voice::Json(events) => events.warn(message),
            Voice::Text(_) => self.beside(|| print::warning(message)),
        }
    }

    /// True once the user wants the run to stop.
    pub fn cancelled(&self) -> bool {
        self.interrupted.get().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// Tells an error, whatever is wanted.
    pub fn error(&self, error: &Error) {
        let told = Told::of(error, &self.words);
        match &self.voice {
            Voice::Json(events) => events.error(&told),
            Voice::Text(_) => self.beside(|| print::error(&told)),
        }
    }
}

/// Tells what one of several runs warns of, and how far it is, and nothing else.
struct OneOfMany<'a> {
    console: &'a Console,
    input: Option<String>,
    bar: Option<FileBar>,
}

impl Draw for OneOfMany<'_> {
    fn every(&self) -> Duration {
        if self.bar.is_some() { Bars::EVERY } else { Duration::from_secs(1) }
    }

    fn begin(&mut self, name: &'static str, total: Option<u64>) {
        self.bar.iter_mut().for_each(|bar| bar.begin(name, total));
    }

    fn advance(&mut self, done: u64) {
        self.bar.iter().for_each(|bar| bar.advance(done));
    }

    fn end(&mut self, _done: u64) {
        self.bar.iter_mut().for_each(FileBar::end);
    }

    fn warn(&mut self, message: &str) {
        self.console.warn(&of_input(self.input.as_deref(), message));
    }
}

/// Tells what a run does as text.
struct RunText<'a> {
    console: &'a Console,
    input: Option<String>,
    /// The sign of the unit that lengths are in.
    unit: Option<&'static str>,
    bars: Bars,
}

impl Draw for RunText<'_> {
    fn every(&self) -> Duration {
        Bars::EVERY
    }

    fn begin(&mut self, name: &'static str, total: Option<u64>) {
        self.bars.begin(name, total);
    }

    fn advance(&mut self, done: u64) {
        self.bars.advance(done);
    }

    fn end(&mut self, _done: u64) {
        self.bars.end();
    }

    fn warn(&mut self, message: &str) {
        let message = of_input(self.input.as_deref(), message);
        self.bars.beside(|| self.console.warn(&message));
    }

    fn chose(&mut self, values: &[Decision]) {
        let each = values.iter().map(|decision| in_words(decision, self.unit));
        let all = each.chain(self.console.hint.get().map(|hint| (*hint).to_owned()));
        let line = all.collect::<Vec<String>>().join(", ");
        self.bars.beside(|| print::message(format_args!("chosen   {line}")));
    }
}

/// A value that a run chose, in the words of flags: `min spacing 0.64 m`.
fn in_words(Decision { name, value, .. }: &Decision, unit: Option<&str>) -> String {
    let unit = match name.as_str() {
        _ if !value.is_number() => None,
        "max_angle" => Some("rad"),
        "side" | "max_side" | "min_spacing" => unit,
        _ => None,
    };
    let unit = unit.map_or(String::new(), |unit| format!(" {unit}"));
    format!("{} {}{unit}", name.replace('_', " "), in_short(value))
}

/// A value in as many digits as say something to a reader.
fn in_short(value: &Value) -> String {
    match (value, value.as_f64()) {
        (Value::String(text), _) => text.clone(),
        (Value::Number(written), Some(number)) if written.is_f64() => Short(number).to_string(),
        _ => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn what_is_chosen_is_told_in_words_and_units() {
        let told = |name: &str, value: Value, unit| {
            let (stage, name) = ("cells".to_owned(), name.to_owned());
            in_words(&Decision { stage, name, value }, unit)
        };
        assert_eq!(told("min_spacing", json!(0.6401), Some("m")), "min spacing 0.640 m");
        assert_eq!(told("min_spacing", json!("none"), Some("m")), "min spacing none");
        assert_eq!(told("side", json!(2.0), None), "side 2.00");
        assert_eq!(told("max_angle", json!(0.1), Some("m")), "max angle 0.100 rad");
        assert_eq!(told("keep", json!(20_000), Some("m")), "keep 20000");
    }
}
