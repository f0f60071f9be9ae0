//! What a check comes to.

use std::collections::BTreeMap;
use std::fmt;

use super::bench::Probe;
use super::made::MadeScan;
use super::promise::Promise;
use super::setup::Setup;
use super::witness::MemoryTaken;
use crate::Result;
use crate::memory::Records;

/// Points of a case that are printed.
const PRINTED: usize = 20;

/// What a stage was asked and held.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Conduct {
    /// The stage's kind.
    pub stage: String,
    /// How many scans were made.
    pub scans: usize,
    /// How many of them the stage refused: what it said then is not looked at.
    pub refused: usize,
    /// For each promise how many questions were answered.
    pub answers: BTreeMap<Promise, u64>,
    /// The call that took the most memory of those on a scan of many points; none if it was not
    /// measured, since the program has no [`CountingAllocator`](super::CountingAllocator).
    pub memory: Option<MemoryTaken>,
}

impl fmt::Display for Conduct {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Conduct { stage, scans, refused, answers, memory } = self;
        write!(f, "the stage `{stage}` kept its promises on {} scans", scans - refused)?;
        if *refused > 0 {
            write!(f, " and refused {refused}")?;
        }
        for (promise, count) in answers {
            write!(f, "\n{count:>6} times it {promise}")?;
        }
        match memory {
            None => f.write_str(
                "\nmemory was not measured: the program has no `CountingAllocator` as its global \
                 allocator",
            ),
            Some(MemoryTaken { points, declared_bytes, taken_bytes }) => write!(
                f,
                "\nit took {taken_bytes} bytes for {points} points and declares {declared_bytes}"
            ),
        }
    }
}

/// A promise that a stage broke, and the smallest case that was found. As a text it says all of it.
pub struct Broken(Box<Case>);

/// What broke a promise.
pub(super) struct Case {
    pub stage: String,
    pub promise: Promise,
    pub told: String,
    /// The setups whose answers differ; the same twice where one run shows it.
    pub setups: Option<[Setup; 2]>,
    /// The smallest scan, and how many points the one had that it is a part of.
    pub scan: Option<(MadeScan, usize)>,
    /// Dimensions of records that are of interest.
    pub named: Vec<String>,
    pub seed: u64,
}

impl Broken {
    pub(super) fn new(case: Case) -> Broken {
        Broken(Box::new(case))
    }

    /// The promise.
    pub fn promise(&self) -> Promise {
        self.0.promise
    }

    /// How many points the smallest case has that was found; none where it takes no scan to see it.
    pub fn points(&self) -> Option<usize> {
        self.0.scan.as_ref().map(|(scan, _)| scan.len())
    }

    /// The records of that case, for a test of your own.
    pub fn records(&self) -> Option<Result<Records>> {
        let (scan, _) = self.0.scan.as_ref()?;
        let records = Records::new((*scan.schema).clone(), scan.records.to_vec());
        Some(records.map(|records| records.with_metadata(scan.metadata())))
    }
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Case { stage, promise, told, setups, scan, named, seed } = &*self.0;
        write!(f, "the stage `{stage}` breaks the promise that it {promise}: {told}")?;
        match setups {
            Some([a, b]) if a == b => write!(f, "\nin a run with {a}")?,
            Some([a, b]) => write!(f, "\nfirst run: {a}\nsecond run: {b}")?,
            None => {}
        }
        let Some((scan, of)) = scan else { return Ok(()) };
        let (points, called) = (scan.len(), scan.arrangement.called());
        write!(f, "\nthe smallest case found has {points} of {of} points ({called})")?;
        if points <= PRINTED {
            scan.iter().try_for_each(|record| write!(f, "\n  {}", scan.told(record, named)))?;
        }
        write!(f, "\nthe same check with `seed({seed})` finds it again")
    }
}

impl fmt::Debug for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // What `unwrap` prints is to be read by people.
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for Broken {}

/// The same question with smaller figures, the smallest first.
pub(super) fn simpler(probe: &Probe) -> Vec<Probe> {
    let figures = [1, 2, 3].map(|points| {
        let mut simpler = probe.clone();
        for setup in simpler.kind.setups_mut() {
            setup.tile_points = setup.tile_points.map(|most| most.min(points));
            setup.threads = setup.threads.min(1 + points);
            setup.parts = setup.parts.min(1 + points);
        }
        simpler
    });
    figures.to_vec()
}
