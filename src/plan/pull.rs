//! A plan whose results are pulled: it runs on a thread beside the program's, as fast as the
//! program takes what comes out.

use std::thread;
use std::thread::JoinHandle;

use super::fitted::Plan;
use crate::engine::{Done, Watch};
use crate::memory::Received;
use crate::point::PointBatch;
use crate::{Error, Result};

impl Plan {
    /// Runs the plan on a thread of its own and gives what one of its sinks sends, the one that
    /// `received` is the other end of. The run waits while its channel is full, and is stopped when
    /// what this returns is dropped.
    pub fn pull(self, received: Received, watch: impl Watch + Send + 'static) -> Pulled {
        let run = thread::spawn(move || self.run(&watch));
        Pulled { received: Some(received), run: Some(run), done: None }
    }
}

/// The batches that a run sends, as they are pulled: an error of the run is the last item.
pub struct Pulled {
    received: Option<Received>,
    run: Option<JoinHandle<Result<Done>>>,
    done: Option<Done>,
}

impl Pulled {
    /// Lets the run go on to its end, throwing away what it still sends; what it says of itself.
    ///
    /// # Errors
    ///
    /// Those of the run, unless they were an item before.
    pub fn finish(mut self) -> Result<Done> {
        self.received.iter_mut().for_each(|received| received.for_each(drop));
        self.join()?;
        let gone = || Error::pipeline("the run failed before, and its error was given then");
        self.done.take().ok_or_else(gone)
    }

    /// Waits for the end of the run.
    fn join(&mut self) -> Result<()> {
        let Some(run) = self.run.take() else { return Ok(()) };
        let panicked = |_| Err(Error::internal("the thread of a run panicked"));
        self.done = Some(run.join().unwrap_or_else(panicked)?);
        Ok(())
    }
}

impl Iterator for Pulled {
    type Item = Result<PointBatch>;

    fn next(&mut self) -> Option<Result<PointBatch>> {
        if let Some(batch) = self.received.as_mut()?.next() {
            return Some(Ok(batch));
        }
        self.received = None;
        self.join().err().map(Err)
    }
}

impl Drop for Pulled {
    fn drop(&mut self) {
        // The run ends when it finds nobody who takes what it sends.
        self.received = None;
        let _ = self.join();
    }
}
