//! How a run tells its progress and hears that it should stop.
//!
//! The engine prints nothing and reads no signals: a program that uses the library has its own way
//! to show progress. It is called as things happen, on the threads that work, so what it does
//! should take little time.

use crate::report::Decision;

/// Told what a run does; called from several threads. The command line draws bars from it.
///
/// ```
/// use std::sync::atomic::{AtomicU64, Ordering};
///
/// use pointmill::{ErrorKind, Graph, Overrides, Registry, Watch};
///
/// /// Stops a run after so many points.
/// struct Until(AtomicU64);
///
/// impl Watch for Until {
///     fn phase(&self, _name: &'static str, _total: Option<u64>) {}
///
///     fn advance(&self, points: u64) {
///         let less = |left: u64| Some(left.saturating_sub(points));
///         let _ = self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, less);
///     }
///
///     fn warn(&self, _message: &str) {}
///
///     fn cancelled(&self) -> bool {
///         self.0.load(Ordering::Relaxed) == 0
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let folder = tempfile::tempdir()?;
/// let text = format!(
///     "stage = [
///         {{kind = 'synth', scene = 'plane', points = 100_000}},
///         {{kind = 'write', path = '{}'}},
///     ]",
///     folder.path().join("plane.ply").display()
/// );
/// let graph = Graph::parse(&text, "plane.toml", &Registry::builtin())?;
/// let stopped = graph.plan(&Overrides::default())?.run(&Until(AtomicU64::new(20_000)));
/// assert_eq!(stopped.unwrap_err().kind(), ErrorKind::Interrupted);
/// // It left nothing behind.
/// assert_eq!(std::fs::read_dir(folder.path())?.count(), 0);
/// # Ok(())
/// # }
/// ```
pub trait Watch: Sync {
    /// A phase begins; `total` is its amount of work in points, where known.
    fn phase(&self, name: &'static str, total: Option<u64>);

    /// `points` more of the phase are done.
    fn advance(&self, points: u64);

    /// Something the user should know, once.
    fn warn(&self, message: &str);

    /// The stages chose values of keys by what they saw of the scan, before a pass that works by
    /// them.
    fn chose(&self, _values: &[Decision]) {}

    /// True if the run should stop; asked between batches and tiles.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Watches nothing.
pub struct Quiet;

impl Watch for Quiet {
    fn phase(&self, _name: &'static str, _total: Option<u64>) {}
    fn advance(&self, _points: u64) {}
    fn warn(&self, _message: &str) {}
}
