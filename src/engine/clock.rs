//! Times the phases of a run and tells the watcher of them.
//!
//! Phases follow each other, each ends where the next begins, so that their times add up to that of
//! the run and nothing that a run does is in none of them.

use std::time::Instant;

use super::Watch;
use crate::host::process::cpu_seconds;
use crate::report::Phase;

/// Wall-clock times of phases, one after the other.
pub(crate) struct Clock<'a> {
    watch: &'a dyn Watch,
    start: Instant,
    cpu_before: Option<f64>,
    open: Option<(&'static str, Instant)>,
    phases: Vec<Phase>,
}

impl<'a> Clock<'a> {
    pub fn new(watch: &'a dyn Watch) -> Self {
        Clock {
            watch,
            start: Instant::now(),
            cpu_before: cpu_seconds(),
            open: None,
            phases: Vec::new(),
        }
    }

    /// Ends the phase that runs and begins `name`, which has `total` points to do.
    pub fn phase(&mut self, name: &'static str, total: Option<u64>) {
        self.end();
        self.open = Some((name, Instant::now()));
        self.watch.phase(name, total);
    }

    fn end(&mut self) {
        if let Some((name, since)) = self.open.take() {
            let seconds = since.elapsed().as_secs_f64();
            self.phases.push(Phase { name: name.to_owned(), seconds });
        }
    }

    /// Wall-clock seconds in all, CPU seconds in all, and wall-clock seconds by phase.
    pub fn finish(mut self) -> (f64, Option<f64>, Vec<Phase>) {
        self.end();
        let cpu = self.cpu_before.and_then(|before| Some(cpu_seconds()? - before));
        (self.start.elapsed().as_secs_f64(), cpu, self.phases)
    }
}
