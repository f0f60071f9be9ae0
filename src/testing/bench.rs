//! Where a chain is run, and what is compared: one question at a time.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::answer::{Answer, Sameness};
use super::chain::{Chain, DeclaredNeeds};
use super::made::MadeScan;
use super::promise::Promise;
use super::setup::Setup;
use super::split::SplitSource;
use super::witness::{MemoryTaken, Violation, Witness};
use crate::engine::Watch;
use crate::error::shown;
use crate::graph::Overrides;
use crate::memory::channel;
use crate::point::PointBatch;
use crate::{Error, ErrorKind, Result};

/// How often each of two unequal runs is repeated before they count as unequal.
const REPEATS: usize = 3;
/// Memory that a tight run is tried with first, doubled up to what others have.
const LEAST: u64 = 24 << 20;
const AMPLE: u64 = 8 << 30;

/// A question to a scan: whether a promise holds.
#[derive(Debug, Clone)]
pub(super) struct Probe {
    pub promise: Promise,
    pub kind: ProbeKind,
}

#[derive(Debug, Clone)]
pub(super) enum ProbeKind {
    /// A run of this setup shows nothing that breaks a promise.
    Alone(Setup),
    /// Two setups give the same.
    Same(Setup, Setup, Sameness),
    /// A run of this setup that is stopped when it asks for the n-th time, as a part of all
    /// its questions, leaves nothing; the plain run gives the same before and behind it.
    Stopped(Setup, f64),
}

impl ProbeKind {
    /// What it runs by.
    pub fn setups_mut(&mut self) -> Vec<&mut Setup> {
        match self {
            ProbeKind::Alone(setup) | ProbeKind::Stopped(setup, _) => vec![setup],
            ProbeKind::Same(a, b, _) => vec![a, b],
        }
    }
}

/// How a probe ended.
#[derive(Debug)]
pub(super) enum ProbeOutcome {
    Holds,
    /// The scan was refused, or the setup cannot be.
    NotAsked,
    Breaks(Violation, [Setup; 2]),
}

/// A run and what was seen of it.
#[derive(Debug, Clone)]
pub(super) struct Ran {
    pub answer: Result<Answer, (ErrorKind, String)>,
    pub violation: Option<Violation>,
    pub memory: MemoryTaken,
    /// How often it asked whether it should stop.
    asked: u64,
}

/// A chain, what its stages say, and a folder for what its runs spill.
pub(super) struct Bench {
    pub chain: Chain,
    pub declared: DeclaredNeeds,
    scratch: SpillFolder,
}

impl Bench {
    /// # Errors
    ///
    /// Stages that cannot be made, and a folder for scratch that the system refuses.
    pub fn new(chain: Chain) -> Result<Bench> {
        Ok(Bench { declared: chain.declared()?, chain, scratch: SpillFolder::new()? })
    }

    /// Runs the chain on `scan`.
    pub fn run(&self, scan: &MadeScan, setup: &Setup) -> Ran {
        self.run_until(scan, setup, u64::MAX)
    }

    fn run_until(&self, scan: &MadeScan, setup: &Setup, stop: u64) -> Ran {
        let witness = Arc::new(Witness::new(setup.tile_points.is_none()));
        let mut memory = if setup.is_tight { LEAST } else { AMPLE };
        let asked = Arc::new(AtomicU64::new(0));
        let answer = loop {
            asked.store(0, Ordering::Relaxed);
            let answer = self.answer((scan, setup), memory, &witness, &asked, stop);
            match &answer {
                Err(error) if error.kind() == ErrorKind::Memory && memory < AMPLE => memory *= 2,
                _ => break answer,
            }
        };
        let mut violation = witness.violation();
        if let Err(error) = &answer
            && error.kind() == ErrorKind::Internal
            && violation.is_none()
        {
            violation = Some(Violation { promise: Promise::Answers, told: error.to_string() });
        }
        if let (Ok(answer), None) = (&answer, &violation) {
            violation = self.made_up(scan, answer);
        }
        let answer = answer.map_err(|error| (error.kind(), error.to_string()));
        let asked = asked.load(Ordering::Relaxed);
        Ran { answer, violation, memory: witness.memory(), asked }
    }

    fn answer(
        &self,
        (scan, setup): (&MadeScan, &Setup),
        memory: u64,
        witness: &Arc<Witness>,
        asked: &Arc<AtomicU64>,
        stop: u64,
    ) -> Result<Answer> {
        let scan = setup.shuffled.map_or_else(|| scan.clone(), |seed| scan.shuffled(seed));
        let (parts, batch, metadata) = (setup.parts, setup.batch, scan.metadata());
        let schema = scan.schema.clone();
        let source = SplitSource { scan, metadata, parts, batch };
        let columns = &self.declared.columns;
        let names: Vec<&str> = columns.iter().flat_map(|kind| kind.parts().to_vec()).collect();
        let (sink, received) = channel(4, &names);
        let settings = setup.settings(memory, self.scratch.path());
        let sink = sink.in_order(setup.order);
        let graph = self.chain.graph((setup, settings), source, sink, witness)?;
        let watch = Asked { times: asked.clone(), stop };
        let mut pulled = graph.plan(&Overrides::default())?.pull(received, watch);
        let batches = pulled.by_ref().collect::<Result<Vec<PointBatch>>>()?;
        let done = pulled.finish()?;
        Ok(Answer::of(&schema, columns, &batches, &done.report.result))
    }

    /// A record in the answer that stages made of one that came in, and did not say so.
    fn made_up(&self, scan: &MadeScan, answer: &Answer) -> Option<Violation> {
        let input: Vec<Vec<u8>> = scan.iter().map(<[u8]>::to_vec).collect();
        let told = answer.made_up(&input, &self.declared.changed)?;
        Some(Violation { promise: Promise::Changes, told })
    }

    /// Asks whether a promise holds on `scan`; `plain` is what the plain setup gave, where that is
    /// known.
    pub fn ask(&self, probe: &Probe, scan: &MadeScan, plain: Option<&Ran>) -> ProbeOutcome {
        match &probe.kind {
            ProbeKind::Alone(setup) => self.verdict(&self.run(scan, setup), setup),
            ProbeKind::Same(a, b, same) => self.compare(probe.promise, [a, b], same, scan, plain),
            ProbeKind::Stopped(setup, part) => self.stop(setup, *part, scan, plain),
        }
    }

    fn verdict(&self, ran: &Ran, setup: &Setup) -> ProbeOutcome {
        match (&ran.violation, &ran.answer) {
            (Some(seen), _) => ProbeOutcome::Breaks(seen.clone(), [setup.clone(), setup.clone()]),
            (None, Ok(_)) => ProbeOutcome::Holds,
            (None, Err(_)) => ProbeOutcome::NotAsked,
        }
    }

    fn run_as(&self, setup: &Setup, scan: &MadeScan, plain: Option<&Ran>) -> Ran {
        match (plain, setup.altered) {
            (Some(ran), None) if *setup == Setup::PLAIN => ran.clone(),
            (_, Some(seed)) => self.run(&scan.altered(&self.declared.looked_at, seed), setup),
            _ => self.run(scan, setup),
        }
    }

    fn compare(
        &self,
        promise: Promise,
        [a, b]: [&Setup; 2],
        same: &Sameness,
        scan: &MadeScan,
        plain: Option<&Ran>,
    ) -> ProbeOutcome {
        let alike = matches!(same, Sameness::Dimensions(_)).then(|| scan.distinct());
        let (scan, plain) = match &alike {
            Some(scan) => (scan, None),
            None => (scan, plain),
        };
        let (first, second) = (self.run_as(a, scan, plain), self.run_as(b, scan, None));
        for (ran, setup) in [(&first, a), (&second, b)] {
            if ran.violation.is_some() {
                return self.verdict(ran, setup);
            }
        }
        let is_refused = |ran: &Ran, kind| ran.answer.as_ref().err().is_some_and(|e| e.0 == kind);
        let cannot_be = is_refused(&second, ErrorKind::Pipeline) && *same == Sameness::Records;
        if cannot_be || [&first, &second].iter().any(|ran| is_refused(ran, ErrorKind::Memory)) {
            return ProbeOutcome::NotAsked;
        }
        let Some(told) = self.difference(&first, &second, same) else {
            return if first.answer.is_ok() { ProbeOutcome::Holds } else { ProbeOutcome::NotAsked };
        };
        for (ran, setup) in [(&first, a), (&second, b)] {
            if let Some(told) = self.chance(ran, setup, scan) {
                return ProbeOutcome::Breaks(told, [setup.clone(), setup.clone()]);
            }
        }
        ProbeOutcome::Breaks(Violation { promise, told }, [a.clone(), b.clone()])
    }

    /// A difference between a run and one that is the same in everything.
    fn chance(&self, ran: &Ran, setup: &Setup, scan: &MadeScan) -> Option<Violation> {
        (0..REPEATS).find_map(|_| {
            let again = self.run_as(setup, scan, None);
            let told = self.difference(ran, &again, &Sameness::Everything)?;
            Some(Violation { promise: Promise::Time, told })
        })
    }

    fn difference(&self, first: &Ran, second: &Ran, same: &Sameness) -> Option<String> {
        match (&first.answer, &second.answer) {
            (Ok(a), Ok(b)) => a.difference(b, same, &self.declared.looked_at),
            (Err(_), Err(_)) => None,
            (Ok(_), Err((_, told))) => Some(format!("the second fails: {told}")),
            (Err((_, told)), Ok(_)) => Some(format!("the first fails: {told}")),
        }
    }

    fn stop(&self, setup: &Setup, part: f64, scan: &MadeScan, plain: Option<&Ran>) -> ProbeOutcome {
        let before = self.run_as(&Setup::PLAIN, scan, plain);
        let whole = self.run(scan, setup);
        if before.answer.is_err() || whole.answer.is_err() {
            return ProbeOutcome::NotAsked;
        }
        let stop = (whole.asked as f64 * part) as u64;
        let stopped = self.run_until(scan, setup, stop);
        let breaks = |told: String| {
            let violation = Violation { promise: Promise::Stops, told };
            ProbeOutcome::Breaks(violation, [setup.clone(), Setup::PLAIN])
        };
        match &stopped.answer {
            Err((ErrorKind::Interrupted, _)) | Ok(_) => {}
            Err((_, told)) => return breaks(format!("a run that is stopped fails: {told}")),
        }
        if let Some(left) = self.scratch.left() {
            return breaks(format!("a run that was stopped left {}", shown(&left)));
        }
        let behind = self.run(scan, &Setup::PLAIN);
        match self.difference(&before, &behind, &Sameness::Everything) {
            Some(told) => {
                breaks(format!("a run before one that is stopped, and one after: {told}"))
            }
            None => ProbeOutcome::Holds,
        }
    }
}

/// Counts how often a run asks whether it should stop, and says so from some time on.
struct Asked {
    times: Arc<AtomicU64>,
    stop: u64,
}

impl Watch for Asked {
    fn phase(&self, _name: &'static str, _total: Option<u64>) {}
    fn advance(&self, _points: u64) {}
    fn warn(&self, _message: &str) {}

    fn cancelled(&self) -> bool {
        self.times.fetch_add(1, Ordering::Relaxed) >= self.stop
    }
}

/// A folder of its own, removed with what is in it.
struct SpillFolder(PathBuf);

impl SpillFolder {
    fn new() -> Result<SpillFolder> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let name = format!("pointmill-testing-{}-{number}", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::create_dir(&path).map_err(|e| Error::io(&path, "create this folder", e))?;
        Ok(SpillFolder(path))
    }

    fn path(&self) -> &Path {
        &self.0
    }

    /// Something that is in it.
    fn left(&self) -> Option<PathBuf> {
        let mut entries = std::fs::read_dir(&self.0).ok()?;
        entries.next()?.ok().map(|entry| entry.path())
    }
}

impl Drop for SpillFolder {
    fn drop(&mut self) {
        // What cannot be removed is in the folder for what may be lost.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
