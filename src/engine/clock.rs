//! Times the phases of a run, tells the watcher of them, and holds the run to their order.
//!
//! Phases follow each other, each ends where the next begins, so that their times add up to that of
//! the run and nothing that a run does is in none of them.

use std::time::Instant;
use std::vec::IntoIter;

use super::Watch;
use super::phase::RunPhase;
use crate::host::process::cpu_seconds;
use crate::report::Phase;
use crate::{Error, Result};

/// Wall-clock times of phases, one after the other.
pub(crate) struct Clock<'a> {
    watch: &'a dyn Watch,
    /// Those that are still to come.
    later: IntoIter<RunPhase>,
    start: Instant,
    cpu_before: f64,
    open: Option<(&'static str, Instant)>,
    phases: Vec<Phase>,
    /// The phase that runs, told or not, and the CPU seconds of the process when it began.
    at_work: Option<(&'static str, f64)>,
    cpu_by_phase: Vec<(&'static str, f64)>,
}

impl<'a> Clock<'a> {
    /// Of a run of these phases.
    pub fn new(watch: &'a dyn Watch, phases: Vec<RunPhase>) -> Self {
        Clock {
            watch,
            later: phases.into_iter(),
            start: Instant::now(),
            cpu_before: cpu_seconds(),
            open: None,
            phases: Vec::new(),
            at_work: None,
            cpu_by_phase: Vec::new(),
        }
    }

    /// Ends the phase that runs and begins `phase`, which has `total` points to do.
    ///
    /// # Errors
    ///
    /// If another one is next.
    pub fn begin(&mut self, phase: RunPhase, total: Option<u64>) -> Result<()> {
        let next = self.later.next();
        if next != Some(phase) {
            return Err(Error::internal(format!("the next phase is {next:?}, not {phase:?}")));
        }
        self.count();
        self.at_work = Some((phase.name_in_predictions(), cpu_seconds()));
        if let Some(name) = phase.name() {
            self.end();
            self.open = Some((name, Instant::now()));
            self.watch.phase(name, total);
        }
        Ok(())
    }

    fn end(&mut self) {
        if let Some((name, since)) = self.open.take() {
            let seconds = since.elapsed().as_secs_f64();
            self.phases.push(Phase { name: name.to_owned(), seconds });
        }
    }

    /// Enters what the phase that ends took of the processors.
    fn count(&mut self) {
        let Some((name, before)) = self.at_work.take() else { return };
        self.cpu_by_phase.push((name, cpu_seconds() - before));
    }

    /// CPU seconds of each phase, those that are not told included; what follows is in none.
    pub fn cpu_by_phase(&mut self) -> Vec<(&'static str, f64)> {
        self.count();
        std::mem::take(&mut self.cpu_by_phase)
    }

    /// Wall-clock seconds in all, CPU seconds in all, and wall-clock seconds by phase.
    pub fn finish(mut self) -> (f64, f64, Vec<Phase>) {
        self.end();
        (self.start.elapsed().as_secs_f64(), cpu_seconds() - self.cpu_before, self.phases)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Quiet;

    #[test]
    fn a_phase_out_of_its_turn_is_refused() {
        let all = || vec![RunPhase::Decode, RunPhase::Look(0), RunPhase::Mill(0)];
        let mut clock = Clock::new(&Quiet, all());
        all().into_iter().for_each(|phase| clock.begin(phase, None).unwrap());
        assert!(clock.begin(RunPhase::Publish, None).is_err(), "there is none left");
        let told: Vec<_> = clock.finish().2.into_iter().map(|phase| phase.name).collect();
        assert_eq!(told, ["decode", "mill"]);
        for (before, phase) in
            [(0, RunPhase::Merge), (1, RunPhase::Mill(0)), (2, RunPhase::Mill(1))]
        {
            let mut clock = Clock::new(&Quiet, all());
            all().into_iter().take(before).for_each(|phase| clock.begin(phase, None).unwrap());
            assert!(clock.begin(phase, None).unwrap_err().to_string().contains("the next phase"));
        }
    }
}
