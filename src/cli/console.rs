//! What a command says while it works: bars, text or events on stderr, as loud as the user wants.

use std::fmt::Display;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::Instant;

use serde_json::Value;

use super::arguments::{Command, Progress};
use super::events::Events;
use super::progress::Bars;
use super::words::{Told, Words};
use super::{interrupt, print};
use crate::engine::{Done, Watch};
use crate::error::shown;
use crate::host::lock;
use crate::plan::Plan;
use crate::report::{Decision, Short};
use crate::{Error, Result};

/// Where all that a command says goes through; called from several threads.
pub(super) struct Console {
    voice: Voice,
    words: Words,
    quiet: bool,
    verbose: bool,
    /// The phase of which `verbose` tells the time when it ends.
    phase: Mutex<Option<(&'static str, Instant)>>,
    /// Set by Ctrl-C, once a run listens to it.
    interrupted: OnceLock<Arc<AtomicBool>>,
    /// Said behind what a run chose by itself.
    hint: OnceLock<&'static str>,
    /// The sign of the unit that lengths of the planned run are in.
    unit: Mutex<Option<&'static str>>,
}

enum Voice {
    Text(Bars),
    Json(Events),
}

impl Console {
    /// As the arguments of a command ask for, in its words; one that has none of these speaks
    /// plainly.
    pub fn new(command: &Command) -> Self {
        let common = command.common();
        let progress = common.map_or(Progress::Never, |common| common.progress);
        let quiet = common.is_some_and(|common| common.quiet);
        Console {
            voice: match progress {
                Progress::Json => Voice::Json(Events::new()),
                Progress::Auto | Progress::Never => {
                    Voice::Text(Bars::new(progress == Progress::Auto && !quiet))
                }
            },
            words: Words::of(command),
            quiet,
            verbose: common.is_some_and(|common| common.verbose),
            phase: Mutex::new(None),
            interrupted: OnceLock::new(),
            hint: OnceLock::new(),
            unit: Mutex::new(None),
        }
    }

    /// From now on Ctrl-C asks the run to stop, rather than ending the process.
    pub fn hear_interrupts(&self) {
        self.interrupted.get_or_init(interrupt::flag);
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
        *lock(&self.unit) = plan.unit();
        match &self.voice {
            Voice::Json(events) if !self.quiet => events.planned(&outline, &plan.to_string()),
            Voice::Text(_) if self.verbose => {
                print::message(plan);
                print::message(format_args!("scratch  {}", shown(&outline.scratch)));
            }
            _ => {}
        }
    }

    /// A run is done.
    pub fn done(&self, done: &Done) {
        self.end();
        match &self.voice {
            Voice::Json(events) if !self.quiet => events.done(done),
            Voice::Text(_) if self.verbose => {
                for decision in &done.report.result.decisions {
                    let (stage, name, value) = (&decision.stage, &decision.name, &decision.value);
                    print::message(format_args!("decided  {stage}: {name} = {value}"));
                }
            }
            _ => {}
        }
    }

    /// Tells an error, whatever is wanted.
    pub fn error(&self, error: &Error) {
        self.end();
        let told = Told::of(error, &self.words);
        match &self.voice {
            Voice::Json(events) => events.error(&told),
            Voice::Text(_) => print::error(&told),
        }
    }

    /// No bar is left, and the time of the last phase is told.
    pub fn end(&self) {
        if let Voice::Text(bars) = &self.voice {
            bars.clear();
        }
        let ended = lock(&self.phase).take();
        if let Some((name, since)) = ended {
            print::message(format_args!("{name:8} {:.1} s", since.elapsed().as_secs_f64()));
        }
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

impl Watch for Console {
    fn phase(&self, name: &'static str, total: Option<u64>) {
        self.end();
        match &self.voice {
            Voice::Json(events) if !self.quiet => events.phase(name, total),
            Voice::Json(_) => {}
            Voice::Text(bars) => {
                if self.verbose {
                    let mut phase = lock(&self.phase);
                    *phase = Some((name, Instant::now()));
                }
                bars.phase(name, total);
            }
        }
    }

    fn advance(&self, points: u64) {
        match &self.voice {
            Voice::Json(events) if !self.quiet => events.advance(points),
            Voice::Json(_) => {}
            Voice::Text(bars) => bars.advance(points),
        }
    }

    fn warn(&self, message: &str) {
        let message = &self.words.told(message);
        match &self.voice {
            _ if self.quiet => {}
            Voice::Json(events) => events.warn(message),
            Voice::Text(bars) => bars.beside(|| print::warning(message)),
        }
    }

    fn chose(&self, values: &[Decision]) {
        match &self.voice {
            _ if self.quiet => {}
            Voice::Json(events) => events.chose(values),
            Voice::Text(bars) => {
                let unit = *lock(&self.unit);
                let each = values.iter().map(|decision| in_words(decision, unit));
                let all = each.chain(self.hint.get().map(|hint| (*hint).to_owned()));
                let line = all.collect::<Vec<String>>().join(", ");
                bars.beside(|| print::message(format_args!("chosen   {line}")));
            }
        }
    }

    fn cancelled(&self) -> bool {
        self.interrupted.get().is_some_and(|flag| flag.load(Ordering::Relaxed))
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
