//! The check of a stage: scans are made, questions are asked, and the first promise that does not
//! hold is told with the smallest case.

use super::allocator::counts;
use super::answer::Sameness;
use super::bench::{Bench, Probe, ProbeKind, Ran, Verdict};
use super::broken::{Broken, Case, Conduct, simpler};
use super::chain::{Chain, StageMaker};
use super::made::{Arrangement, MadeScan};
use super::probes::probes;
use super::promise::Promise;
use super::setup::Setup;
use super::shrink::smallest;
use super::witness::Violation;
use crate::stage::{Role, RoleName, StageKind};
use crate::synth::Random;
use crate::{Error, Result};

/// Scans that are made unless another number is asked for.
const RUNS: usize = 30;
/// Points of a scan at most.
const POINTS: usize = 160;
/// Points of the scan that memory is measured on.
const MANY: usize = 20_000;
/// Scans that are looked at again at the end.
const AGAIN: usize = 10;

/// The check of a stage, to be called from a test of its author. See the
/// [module](crate::testing).
#[derive(Clone)]
pub struct Conformance {
    chain: Chain,
    runs: usize,
    seed: u64,
    streams: bool,
}

impl Conformance {
    /// The check of a stage of a kind. It is made anew for every run from its keys, as a pipeline
    /// file would give them.
    pub fn of<K: StageKind>(stage: K) -> Conformance {
        Conformance::new(StageMaker::of(&stage))
    }

    /// The check of a stage of no kind, which `make` makes for every run; `kind` is what messages
    /// call it.
    pub fn of_role(kind: &str, make: impl Fn() -> Role + Send + Sync + 'static) -> Conformance {
        Conformance::new(StageMaker::of_role(kind, make))
    }

    fn new(proven: StageMaker) -> Conformance {
        let chain = Chain { above: Vec::new(), proven, below: Vec::new() };
        Conformance { chain, runs: RUNS, seed: 0, streams: false }
    }

    /// The stage stands behind this one, and behind those that were given before: one that computes
    /// what it reads.
    #[must_use]
    pub fn after<K: StageKind>(mut self, stage: K) -> Self {
        self.chain.above.push(StageMaker::of(&stage));
        self
    }

    /// This stage stands behind it, and behind those that were given before: one by which its work
    /// is seen, if it removes nothing, changes nothing and computes no column.
    #[must_use]
    pub fn before<K: StageKind>(mut self, stage: K) -> Self {
        self.chain.below.push(StageMaker::of(&stage));
        self
    }

    /// The stage streams by these keys, though its kind says that it works on tiles, as it does by
    /// others.
    #[must_use]
    pub fn streams(mut self) -> Self {
        self.streams = true;
        self
    }

    /// Makes other scans, and sets their runs up otherwise.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Makes so many scans instead of 30; ten have each arrangement of points once.
    #[must_use]
    pub fn runs(mut self, runs: usize) -> Self {
        self.runs = runs;
        self
    }

    /// Runs the stage on scans, each in about 20 ways that must not matter.
    ///
    /// # Errors
    ///
    /// The first promise that did not hold.
    pub fn check(self) -> std::result::Result<Conduct, Broken> {
        self.check_role()?;
        let wrong = |error: &Error| self.broken(Promise::Answers, error.to_string());
        let bench = Bench::new(self.chain.clone()).map_err(|error| wrong(&error))?;
        let mut conduct = Conduct { stage: self.chain.proven.kind.clone(), ..Conduct::default() };
        let mut refusal = None;
        let mut first = Vec::new();
        for run in 0..self.runs {
            let scan = self.scan(&bench, run).map_err(|error| wrong(&error))?;
            let plain = bench.run(&scan, &Setup::PLAIN);
            conduct.scans += 1;
            if let Err((_, told)) = &plain.answer {
                conduct.refused += 1;
                refusal = Some(told.clone());
            }
            for probe in probes(&bench.declared, seed_of(self.seed, run)) {
                self.ask(&bench, &probe, &scan, &plain, &mut conduct)?;
            }
            if first.len() < AGAIN {
                first.push((scan, plain));
            }
        }
        self.look_again(&bench, &first)?;
        if let Some(told) = refusal.filter(|_| conduct.refused == conduct.scans) {
            return Err(self.broken(Promise::Answers, format!("it refuses every scan: {told}")));
        }
        self.measure(&bench, &mut conduct)?;
        Ok(conduct)
    }

    /// Refuses roles that are none of stages between a source and a sink, and kinds that say one
    /// role and play another.
    fn check_role(&self) -> std::result::Result<(), Broken> {
        let StageMaker { says, .. } = self.chain.proven;
        let plays = match self.chain.proven.make() {
            Ok(role) => role.name(),
            Err(error) => return Err(self.broken(Promise::Answers, error.to_string())),
        };
        let told = match (says, plays) {
            (_, RoleName::Source | RoleName::Sink | RoleName::Merge) => {
                "it neither streams nor works on tiles, which is all that a check can prove"
            }
            (Some(RoleName::OnTiles), RoleName::Transform) if !self.streams => {
                "its kind says that it works on tiles, and it streams; if it works on tiles by \
                 other keys, say `streams()` of these"
            }
            (Some(says), plays) if says != plays && !self.streams => {
                "its kind says another role than the one that it plays"
            }
            (_, RoleName::OnTiles) if self.streams => {
                "it is said to stream by these keys, and works on tiles"
            }
            _ => return Ok(()),
        };
        Err(self.broken(Promise::Role, told.to_owned()))
    }

    /// The scan of run number `run`.
    fn scan(&self, bench: &Bench, run: usize) -> Result<MadeScan> {
        let seed = seed_of(self.seed, run);
        let most = 2 + (Random::new(seed, 0).unit() * (POINTS - 1) as f64) as usize;
        let arrangement = Arrangement::ALL[run % Arrangement::ALL.len()];
        MadeScan::of(arrangement, most, &bench.declared.looked_at, seed)
    }

    fn ask(
        &self,
        bench: &Bench,
        probe: &Probe,
        scan: &MadeScan,
        plain: &Ran,
        conduct: &mut Conduct,
    ) -> std::result::Result<(), Broken> {
        match bench.ask(probe, scan, Some(plain)) {
            Verdict::Holds => *conduct.answers.entry(probe.promise).or_default() += 1,
            Verdict::NotAsked => {}
            Verdict::Breaks(violation, setups) => {
                return Err(self.smallest(bench, probe, scan, (violation, setups)));
            }
        }
        Ok(())
    }

    /// The smallest case of a violation that was found.
    fn smallest(
        &self,
        bench: &Bench,
        probe: &Probe,
        scan: &MadeScan,
        found: (Violation, [Setup; 2]),
    ) -> Broken {
        let promise = found.0.promise;
        let breaks = |probe: &Probe, scan: &MadeScan| match bench.ask(probe, scan, None) {
            Verdict::Breaks(violation, setups) if violation.promise == promise => {
                Some((violation, setups))
            }
            _ => None,
        };
        let is_simpler = |probe: Probe| breaks(&probe, scan).map(|found| (probe, found));
        let simpler = simpler(probe).into_iter().find_map(is_simpler);
        let (probe, found) = simpler.unwrap_or_else(|| (probe.clone(), found));
        let of = scan.len();
        let (scan, (violation, setups)) =
            smallest(scan.clone(), found, |scan| breaks(&probe, scan));
        Broken::new(Case {
            setups: Some(setups),
            scan: Some((scan, of)),
            named: bench.declared.looked_at.clone(),
            ..self.case(promise, violation.told)
        })
    }

    /// Runs some scans again, now that time has passed.
    fn look_again(
        &self,
        bench: &Bench,
        first: &[(MadeScan, Ran)],
    ) -> std::result::Result<(), Broken> {
        for (scan, plain) in first {
            let Ok(answer) = &plain.answer else { continue };
            let again = bench.run(scan, &Setup::PLAIN).answer;
            let told = match &again {
                Ok(again) => {
                    answer.difference(again, &Sameness::Everything, &bench.declared.looked_at)
                }
                Err((_, told)) => Some(format!("the second fails: {told}")),
            };
            if let Some(told) = told {
                return Err(Broken::new(Case {
                    setups: Some([Setup::PLAIN, Setup::PLAIN]),
                    scan: Some((scan.clone(), scan.len())),
                    named: bench.declared.looked_at.clone(),
                    ..self.case(Promise::Time, told)
                }));
            }
        }
        Ok(())
    }

    /// Measures the memory that the stage works with on many points, if the program counts it.
    fn measure(&self, bench: &Bench, conduct: &mut Conduct) -> std::result::Result<(), Broken> {
        if !counts() {
            return Ok(());
        }
        let asked = &bench.declared.looked_at;
        let scan = MadeScan::of(Arrangement::Planes, MANY, asked, self.seed)
            .map_err(|error| self.broken(Promise::Answers, error.to_string()))?;
        let plain = bench.run(&scan, &Setup::PLAIN);
        let probe = Probe { promise: Promise::Memory, kind: ProbeKind::Alone(Setup::PLAIN) };
        if plain.answer.is_ok() {
            conduct.memory = Some(plain.memory);
        }
        self.ask(bench, &probe, &scan, &plain, conduct)
    }

    fn case(&self, promise: Promise, told: String) -> Case {
        Case {
            stage: self.chain.proven.kind.clone(),
            promise,
            told,
            setups: None,
            scan: None,
            named: Vec::new(),
            seed: self.seed,
        }
    }

    fn broken(&self, promise: Promise, told: String) -> Broken {
        Broken::new(self.case(promise, told))
    }
}

/// The seed of one of a check's scans.
fn seed_of(seed: u64, run: usize) -> u64 {
    (Random::new(seed, run as u64).unit() * 2f64.powi(53)) as u64
}
