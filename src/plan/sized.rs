//! A run whose outputs are to take so many bytes: how many that are is known when they are there,
//! and before they get their names.

use std::ops::RangeInclusive;
use std::sync::OnceLock;

use super::fitted::Plan;
use crate::Result;
use crate::engine::task::WantedSize;
use crate::engine::{Done, Watch};

/// What a run came to whose outputs were to take so many bytes.
#[derive(Debug)]
pub enum FittedSize {
    /// They do.
    Done(Box<Done>),
    /// They do not, and nothing was left behind.
    Unfit {
        /// Records of the outputs.
        points: u64,
        /// Bytes of all their files.
        bytes: u64,
    },
}

impl Plan {
    /// Runs the plan as [`run`](Plan::run) does, and gives the outputs their names only if all of
    /// their files take so many bytes together. Packed records differ in size, so that only a run
    /// tells how many points a size allows: a next one, with as many more or fewer, comes near.
    ///
    /// # Errors
    ///
    /// As [`run`](Plan::run).
    pub fn run_to_size(
        mut self,
        bytes: RangeInclusive<u64>,
        watch: &dyn Watch,
    ) -> Result<FittedSize> {
        self.task.wanted = Some(WantedSize { bytes, unfit: OnceLock::new() });
        let done = self.task.run(self.ops, watch);
        let unfit = self.task.wanted.as_ref().and_then(|wanted| wanted.unfit.get());
        match (done, unfit) {
            (Err(_), Some(&(points, bytes))) => Ok(FittedSize::Unfit { points, bytes }),
            (done, _) => done.map(|done| FittedSize::Done(Box::new(done))),
        }
    }

    /// Bytes that a record takes in an output that packs nothing; None where it packs, or where
    /// there are several outputs.
    ///
    /// # Errors
    ///
    /// Those of the output, of a schema that it cannot hold.
    #[cfg(feature = "cli")]
    pub(crate) fn plain_bytes(&self) -> Result<Option<u64>> {
        let [sink] = &self.task.sinks[..] else { return Ok(None) };
        let [bytes, _] = sink.disk_bytes(self.task.schema(), &self.task.metadata(0, None))?;
        Ok((bytes > 0).then_some(bytes))
    }
}
