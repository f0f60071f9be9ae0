//! What a run is expected to use and to leave: by arithmetic where its own leases decide, by a
//! trial on a part of the scan where that and the machine do.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use super::fitted::Plan;
use super::trial::{Trial, TrialRun, Tried};
use crate::Result;
use crate::budget::Bytes;
use crate::engine::Watch;
use crate::engine::pass::StreamOp;
use crate::engine::phase::LOOK;
use crate::engine::shares::Shares;
use crate::error::shown;
use crate::graph::Graph;
use crate::host::process::processors;
use crate::report::{Grouped, Short};
use crate::stage::CreateSink;

/// The origin of what needs no trial.
const HEADERS: &str = "headers and the division of the memory";
/// Threads that share the work of a run are busy for this part of its time, as measured.
const BUSY: f64 = 0.95;
/// Records for each of which a run looks at one of a sample, and how many it looks at in all, at
/// least and at most: see `engine/forecast.rs`.
const LOOKED_AT: (f64, f64, f64) = (4096.0, 32.0, 256.0);

/// What a run is expected to use and to leave, and what each figure is estimated from.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Prediction {
    /// Peak resident memory of the process that runs the plan, in bytes.
    pub peak_memory_bytes: u64,
    /// What it is estimated from, in words.
    pub peak_memory_from: String,
    /// Bytes that are written to scratch files.
    pub scratch_bytes: u64,
    /// What they are estimated from.
    pub scratch_from: String,
    /// What each sink is expected to get, in their order.
    pub outputs: Vec<PredictedOutput>,
    /// What these are estimated from, or why they are not known.
    pub outputs_from: String,
    /// CPU seconds of all threads; None where it is not known.
    pub cpu_seconds: Option<f64>,
    /// Wall-clock seconds on processors that have nothing else to do; None likewise.
    pub seconds: Option<f64>,
    /// CPU seconds of reading and of each phase, in the order of the run; none likewise.
    pub phases: Vec<PredictedPhase>,
    /// What the times are estimated from, or why they are not known.
    pub time_from: String,
    /// The trial, if there was one.
    pub trial: Option<Trial>,
}

/// What a sink is expected to get.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PredictedOutput {
    /// Its path; a folder where each input has an output of its own.
    pub path: PathBuf,
    /// Records; None where it is not known.
    pub points: Option<u64>,
    /// Bytes of the file, or of all files of the folder; None likewise, and where it writes none.
    pub bytes: Option<u64>,
}

/// What a phase is expected to take.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PredictedPhase {
    /// As reports name it; `read` is the reading of the inputs, which is a part of the first phase
    /// there, and `look` that at samples.
    pub name: String,
    /// CPU seconds of all threads.
    pub cpu_seconds: f64,
}

impl Plan {
    /// What the headers tell of the run: the memory and, where nothing is removed, the points of
    /// outputs. No point is read.
    ///
    /// # Errors
    ///
    /// None that planning did not have.
    pub fn predict(&self) -> Result<Prediction> {
        self.prediction(&Err("no trial was made".to_owned()))
    }

    /// The same and, by a trial on a part of the scan, the size of outputs and the time that the
    /// run will take. `again` is the pipeline of this plan once more: its stages run on some
    /// 100,000 to 500,000 points, with the threads and the memory of the plan, and settle by what
    /// they see of these.
    ///
    /// Scratch files of the trial are in the plan's scratch folder or that of the system, and gone
    /// when it ends.
    ///
    /// # Errors
    ///
    /// [`ErrorKind::Interrupted`](crate::ErrorKind::Interrupted) where `watch` asked to stop. A
    /// trial that fails otherwise is told in the prediction.
    pub fn predict_by_trial(&self, again: Graph, watch: &dyn Watch) -> Result<Prediction> {
        self.prediction(&self.try_on_some(again, watch)?)
    }

    /// The prediction by a trial, or without one and why.
    pub(super) fn prediction(&self, tried: &Tried) -> Result<Prediction> {
        let shares = self.task.demands.divide()?;
        let of = Extrapolation { plan: self, tried: tried.as_ref() };
        let (scratch_bytes, scratch_from) = of.scratch(&shares);
        let phases = of.phases();
        let cpu_seconds =
            tried.is_ok().then(|| phases.iter().map(|phase| phase.cpu_seconds).sum::<f64>());
        Ok(Prediction {
            peak_memory_bytes: self.task.demands.expected_peak(&shares).0,
            peak_memory_from: HEADERS.to_owned(),
            scratch_bytes,
            scratch_from,
            outputs: self.task.sinks.iter().enumerate().map(|(n, s)| of.output(n, &**s)).collect(),
            outputs_from: of.outputs_from(),
            cpu_seconds,
            seconds: cpu_seconds.map(|cpu| cpu / at_once(self.task.threads)),
            phases,
            time_from: of.words(),
            trial: tried.as_ref().ok().map(|tried| tried.trial.clone()),
        })
    }

    /// True if every record that is read is written, to all outputs.
    fn keeps_all(&self) -> bool {
        let removes = |stage: &StreamOp| stage.transform.needs().removes;
        let streams = || self.task.transforms.iter().chain(&self.task.filters);
        self.ops.is_empty() && !streams().any(removes) && !self.task.drops_nonfinite()
    }
}

/// From a part of the scan to all of it.
struct Extrapolation<'a> {
    plan: &'a Plan,
    tried: std::result::Result<&'a TrialRun, &'a String>,
}

impl Extrapolation<'_> {
    /// How many times as many records the scan has as were tried.
    fn times(&self, TrialRun { trial, .. }: &TrialRun) -> f64 {
        trial.of_points as f64 / trial.points.max(1) as f64
    }

    /// What a figure of the trial is estimated from, or why it is not known.
    fn words(&self) -> String {
        match self.tried {
            Err(why) => format!("not known: {why}"),
            Ok(TrialRun { trial, .. }) => {
                let Trial { points, of_points, density, seconds, .. } = trial;
                let (points, of, took) = (Grouped(*points), Grouped(*of_points), Short(*seconds));
                let doubt = match trial.is_thin() {
                    true => format!(
                        "; points of one place are all over the input, and it saw {:.0} % of \
                         those in its places: expect otherwise",
                        100.0 * density
                    ),
                    false => String::new(),
                };
                format!("a trial on {points} of {of} points, which took {took} s{doubt}")
            }
        }
    }

    /// Bytes of scratch files and what they are estimated from.
    fn scratch(&self, shares: &Shares) -> (u64, String) {
        let task = &self.plan.task;
        let by_headers = if task.mills { task.spilled(shares) } else { 0 };
        match self.tried {
            Ok(tried) if by_headers > 0 => {
                let all = (tried.spilled as f64 * self.times(tried)) as u64;
                (all.saturating_sub(task.kept_in_memory(shares)), self.words())
            }
            _ => (by_headers, HEADERS.to_owned()),
        }
    }

    fn output(&self, number: usize, sink: &dyn CreateSink) -> PredictedOutput {
        let keeps_all = self.plan.keeps_all();
        let mut points = keeps_all.then(|| self.plan.task.source.points());
        let mut bytes = None;
        if let Some((tried, got)) = self.tried.ok().and_then(|t| Some((t, t.outputs.get(number)?)))
        {
            let times = self.times(tried) * tried.density;
            let all = |part: u64| (part as f64 * times).round() as u64;
            points = points.or(Some(all(got.points)));
            bytes = sink.is_file().then(|| all(got.bytes));
        }
        PredictedOutput { path: sink.path().to_owned(), points, bytes }
    }

    fn outputs_from(&self) -> String {
        match self.tried {
            Err(why) if self.plan.keeps_all() => {
                format!("headers, which tell the points; bytes are not known: {why}")
            }
            _ => self.words(),
        }
    }

    /// CPU seconds by phase; none without a trial.
    fn phases(&self) -> Vec<PredictedPhase> {
        let mut phases: Vec<PredictedPhase> = Vec::new();
        let Ok(tried) = self.tried else { return phases };
        let Trial { read_points, points, of_points, .. } = tried.trial;
        let reading = tried.reading * of_points as f64 / read_points.max(1) as f64;
        let each = tried.phases.iter().map(|(name, cpu)| {
            let times = match *name {
                LOOK => looks(of_points) / looks(points),
                "publish" => 1.0,
                _ => self.times(tried),
            };
            (*name, cpu * times)
        });
        for (name, cpu_seconds) in std::iter::once(("read", reading)).chain(each) {
            match phases.iter_mut().find(|phase| phase.name == name) {
                Some(phase) => phase.cpu_seconds += cpu_seconds,
                None => phases.push(PredictedPhase { name: name.to_owned(), cpu_seconds }),
            }
        }
        phases
    }
}

/// How many CPU seconds a run of so many threads takes in a second, where it is alone.
fn at_once(threads: usize) -> f64 {
    match threads.min(processors()) {
        1 => 1.0,
        several => several as f64 * BUSY,
    }
}

/// Samples that a look at a scan of so many records takes.
fn looks(records: u64) -> f64 {
    let (each, least, most) = LOOKED_AT;
    (records as f64 / each).clamp(least, most)
}

impl fmt::Display for Prediction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (peak, scratch) = (Bytes(self.peak_memory_bytes), Bytes(self.scratch_bytes));
        writeln!(f, "expected {peak} of memory at its peak, from {}", self.peak_memory_from)?;
        match self.scratch_bytes {
            0 => writeln!(f, "         no scratch files, from {}", self.scratch_from)?,
            _ => writeln!(f, "         {scratch} in scratch files, from {}", self.scratch_from)?,
        }
        for PredictedOutput { path, points, bytes } in &self.outputs {
            let bytes = bytes.map(|bytes| format!(" in {}", Bytes(bytes))).unwrap_or_default();
            if let Some(points) = points {
                writeln!(f, "         {} points{bytes} in {}", about(*points), shown(path))?;
            }
        }
        writeln!(f, "         outputs: {}", self.outputs_from)?;
        if let (Some(cpu), Some(seconds)) = (self.cpu_seconds, self.seconds) {
            let each: Vec<String> = self
                .phases
                .iter()
                .map(|phase| format!("{} {}", phase.name, Short(phase.cpu_seconds)))
                .collect();
            writeln!(
                f,
                "         {} s, {} CPU s: {}",
                Short(seconds),
                Short(cpu),
                each.join(", ")
            )?;
        }
        write!(f, "         time: {}", self.time_from)
    }
}

/// A number in three digits, as far as an estimate goes.
fn about(points: u64) -> String {
    let digits = points.checked_ilog10().unwrap_or_default();
    let step = 10u64.pow(digits.saturating_sub(2));
    Grouped((points + step / 2) / step * step).to_string()
}
