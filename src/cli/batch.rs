//! Many conversions, one for each output: several at once if there are many small ones. One that
//! fails keeps no other from running, and what became of each is told and can be written down.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::{Value, json};

use super::console::Console;
use super::print;
use crate::budget::Bytes;
use crate::engine::{Done, Trouble, publish_bytes};
use crate::error::shown;
use crate::graph::{Graph, Overrides, RunSettings};
use crate::host::process::{default_memory, processors};
use crate::report::Grouped;
use crate::{Error, ErrorKind, Result};

/// Inputs that are no larger than this are converted several at once: with one at a time, threads
/// would wait for files to be opened and to reach the disk.
const SMALL: u64 = 64 << 20;

/// So many failed inputs are named at the end.
const NAMED: usize = 10;

/// One conversion.
pub(super) struct BatchRun {
    pub input: PathBuf,
    /// None where the input's name is no text, of which there can be no pipeline.
    pub output: Option<PathBuf>,
    pub work: BatchWork,
}

/// What is to be done about an input.
pub(super) enum BatchWork {
    Convert(Box<Graph>),
    /// Its output is what the conversion would write.
    Current,
    Refused(Error),
}

/// What became of an input.
enum BatchOutcome {
    Done(Box<Done>),
    Current,
    /// Converted or not, it is not what was wanted.
    Failed(Option<Box<Done>>, Error),
    NotBegun,
}

/// What became of all.
pub(super) struct BatchDone {
    files: Vec<(PathBuf, Option<PathBuf>, BatchOutcome)>,
    seconds: f64,
}

/// How many conversions run at once, where nobody says it.
pub(super) fn jobs_for(inputs: &[PathBuf], threads: usize) -> usize {
    let is_small = |input: &PathBuf| std::fs::metadata(input).is_ok_and(|m| m.len() <= SMALL);
    match inputs.len() >= 2 * threads && inputs.iter().all(is_small) {
        true => threads,
        false => 1,
    }
}

/// The threads of a run with these settings.
pub(super) fn threads_of(settings: &RunSettings) -> usize {
    settings.threads.map_or_else(processors, NonZeroUsize::get)
}

/// Runs all, `jobs` at once, which share memory and threads.
pub(super) fn run_all(runs: Vec<BatchRun>, jobs: usize, console: &Console) -> BatchDone {
    let began = std::time::Instant::now();
    let (jobs, is_alone) = (jobs.clamp(1, runs.len().max(1)), runs.len() == 1);
    if jobs > 1 {
        console.tell_several(runs.len());
    }
    let next = AtomicUsize::new(0);
    let (mut places, mut works) = (Vec::new(), Vec::new());
    for BatchRun { input, output, work } in runs {
        places.push((input, output));
        works.push(Mutex::new((Some(work), BatchOutcome::NotBegun)));
    }
    let work = || {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let (Some(place), Some(work)) = (places.get(number), works.get(number)) else { return };
            if console.cancelled() {
                return;
            }
            let Ok(mut slot) = work.lock() else { return };
            let Some(work) = slot.0.take() else { return };
            slot.1 = one(work, &place.0, (jobs, is_alone), console);
            console.one_done();
        }
    };
    std::thread::scope(|scope| {
        // A system that refuses a thread leaves the work to the others.
        let helpers = (1..jobs).map(|_| std::thread::Builder::new().spawn_scoped(scope, work));
        let helpers: Vec<_> = helpers.collect();
        work();
        drop(helpers);
    });
    console.all_done();
    let outcome = |slot: Mutex<(_, BatchOutcome)>| match slot.into_inner() {
        Ok((_, outcome)) => outcome,
        Err(_) => BatchOutcome::NotBegun,
    };
    let files = places.into_iter().zip(works);
    let files = files.map(|((input, output), slot)| (input, output, outcome(slot))).collect();
    BatchDone { files, seconds: began.elapsed().as_secs_f64() }
}

/// Converts one, of `jobs` at once; the error of one that is all there is, is told in the end.
fn one(
    work: BatchWork,
    input: &Path,
    (jobs, is_alone): (usize, bool),
    console: &Console,
) -> BatchOutcome {
    let named = (!is_alone).then_some(input);
    let done = match work {
        BatchWork::Current => return BatchOutcome::Current,
        BatchWork::Refused(error) => Err(error),
        BatchWork::Convert(graph) => mill(*graph, named, jobs, console),
    };
    let (done, error) = match done {
        Ok(done) => match done.accepted() {
            Ok(()) => return BatchOutcome::Done(Box::new(done)),
            Err(error) => (Some(Box::new(done)), error),
        },
        Err(error) if error.kind() == ErrorKind::Interrupted => return BatchOutcome::NotBegun,
        Err(error) => (None, error),
    };
    let error = if is_alone { error } else { error.at(input) };
    if !is_alone {
        console.error(&error);
    }
    BatchOutcome::Failed(done, error)
}

/// Plans and runs a pipeline, of `jobs` at once; warnings name the input.
fn mill(graph: Graph, named: Option<&Path>, jobs: usize, console: &Console) -> Result<Done> {
    console.hear_interrupts();
    let mut overrides = Overrides::default();
    if jobs > 1 {
        let memory = graph.settings.memory.unwrap_or_else(default_memory);
        overrides.memory = Some(memory / jobs as u64);
        let threads = threads_of(&graph.settings) / jobs;
        overrides.threads = NonZeroUsize::new(threads).or(Some(NonZeroUsize::MIN));
    }
    console.run_of(named, graph.plan(&overrides)?)
}

impl BatchDone {
    fn done(&self) -> impl Iterator<Item = &Done> {
        self.files.iter().filter_map(|(.., outcome)| match outcome {
            BatchOutcome::Done(done) | BatchOutcome::Failed(Some(done), _) => Some(&**done),
            _ => None,
        })
    }

    fn failures(&self) -> impl Iterator<Item = (&Path, &Error)> {
        self.files.iter().filter_map(|(input, _, outcome)| match outcome {
            BatchOutcome::Failed(_, error) => Some((&**input, error)),
            _ => None,
        })
    }

    fn count(&self, is_it: impl Fn(&BatchOutcome) -> bool) -> usize {
        self.files.iter().filter(|(.., outcome)| is_it(outcome)).count()
    }

    fn left(&self) -> usize {
        self.count(|outcome| matches!(outcome, BatchOutcome::NotBegun))
    }

    /// True if any output is in place.
    pub fn has_outputs(&self) -> bool {
        self.done().next().is_some() || self.count(|one| matches!(one, BatchOutcome::Current)) > 0
    }

    /// The error in the end, of the first failure's kind, rather than that a result is not
    /// accepted, or that the pipeline is wrong for some of the files; it names the inputs.
    pub fn outcome(self) -> Result<()> {
        if self.left() > 0 {
            return Err(Error::interrupted());
        }
        let all = self.files.len();
        let mut failures: Vec<(PathBuf, Error)> = Vec::new();
        for (input, _, outcome) in self.files {
            if let BatchOutcome::Failed(_, error) = outcome {
                failures.push((input, error));
            }
        }
        if all == 1 {
            return failures.pop().map_or(Ok(()), |(_, error)| Err(error));
        }
        let is_worse = |(_, error): &&(PathBuf, Error)| error.kind() != ErrorKind::NotAccepted;
        let Some((_, worst)) = failures.iter().find(is_worse).or(failures.first()) else {
            return Ok(());
        };
        let names = failures.iter().take(NAMED).map(|(input, _)| shown(input).to_string());
        let mut names = names.collect::<Vec<_>>().join(", ");
        let failed = failures.len();
        if failed > NAMED {
            names += &format!(" and {} more", failed - NAMED);
        }
        // What is wrong for some files of several is not the command.
        let kind = match worst.kind() {
            ErrorKind::Pipeline if failed < all => ErrorKind::Data,
            kind => kind,
        };
        Err(Error::new(kind, format!("{failed} of {all} conversions failed: {names}")))
    }

    /// The closing table.
    pub fn told(&self, folder: &str) -> String {
        let outputs = || self.done().flat_map(|done| &done.report.run.outputs);
        let points = self.done().map(|done| done.report.result.ledger.kept).sum();
        let bytes = outputs().filter_map(|output| output.bytes).sum();
        let mut told = format!("files      {}\n", self.done().count());
        let current = self.count(|one| matches!(one, BatchOutcome::Current));
        let failed = self.failures().count();
        for (name, count) in [("unchanged ", current), ("failed    ", failed)] {
            if count > 0 {
                told += &format!("{name} {count}\n");
            }
        }
        if self.left() > 0 {
            told += &format!("incomplete {} were not converted\n", self.left());
        }
        told += &format!("points     {}\n", Grouped(points));
        let peak = self.done().filter_map(|done| done.report.run.peak_memory_bytes).max();
        if let Some(peak) = peak {
            told += &format!("memory     {} at most\n", Bytes(peak));
        }
        let seconds = self.seconds;
        told + &format!("time       {seconds:.1} s\noutput     {folder}, {}\n", Bytes(bytes))
    }

    /// What became of each input, as JSON.
    pub fn summary(&self, console: &Console) -> Value {
        let text = |path: &Path| path.to_string_lossy().into_owned();
        let error = |error: &Error| console.in_words(error);
        let file = |(input, output, outcome): &(PathBuf, Option<PathBuf>, BatchOutcome)| {
            let mut told = json!({ "input": text(input) });
            if let Some(output) = output {
                told["output"] = text(output).into();
            }
            let (name, done) = match outcome {
                BatchOutcome::Done(done) => ("converted", Some(done)),
                BatchOutcome::Current => ("unchanged", None),
                BatchOutcome::NotBegun => ("not converted", None),
                BatchOutcome::Failed(done, failure) => {
                    told["error"] = error(failure);
                    ("failed", done.as_ref())
                }
            };
            told["outcome"] = name.into();
            if let Some(done) = done {
                let run = &done.report.run;
                told["points"] = done.report.result.ledger.kept.into();
                told["bytes"] = run.outputs.iter().filter_map(|o| o.bytes).sum::<u64>().into();
                told["seconds"] = run.seconds.into();
                told["warnings"] = json!(run.warnings);
            }
            told
        };
        json!({
            "pointmill": env!("CARGO_PKG_VERSION"),
            "inputs": self.files.len(),
            "converted": self.count(|one| matches!(one, BatchOutcome::Done(_))),
            "unchanged": self.count(|one| matches!(one, BatchOutcome::Current)),
            "failed": self.failures().count(),
            "not_converted": self.left(),
            "seconds": self.seconds,
            "files": self.files.iter().map(file).collect::<Vec<Value>>(),
        })
    }

    /// Writes the summary to `path`, which has it whole or as it was before.
    pub fn write_summary(&self, path: &Path, console: &Console) -> Result<()> {
        let text = print::json_escaped(&format!("{:#}\n", self.summary(console)));
        let trouble = Trouble::default();
        publish_bytes(path, text.as_bytes(), &trouble)
    }
}
