//! Reach for this when a run is long: what it does is shown while it does it, and it stops when it
//! is told to, leaving nothing behind.
//!
//! `cargo run --example 03_progress`

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use pointmill::ops::{Grid, Pick};
use pointmill::quantity::Length;
use pointmill::synth::{Scene, Synthetic};
use pointmill::{ErrorKind, Graph, GraphBuilder, Overrides, Watch};

/// Prints the phases as they begin, and asks for a stop after so many points.
struct Progress {
    stop_after: u64,
    points: AtomicU64,
    phases: Mutex<Vec<&'static str>>,
}

impl Watch for Progress {
    fn phase(&self, name: &'static str, total: Option<u64>) {
        println!("{name}, {} points", total.map_or("so many".into(), |total| total.to_string()));
        self.phases.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(name);
    }

    // Called from all threads that work, often: it should take no time.
    fn advance(&self, points: u64) {
        self.points.fetch_add(points, Ordering::Relaxed);
    }

    fn warn(&self, message: &str) {
        println!("warning: {message}");
    }

    fn cancelled(&self) -> bool {
        self.points.load(Ordering::Relaxed) > self.stop_after
    }
}

fn progress(stop_after: u64) -> Progress {
    Progress { stop_after, points: AtomicU64::new(0), phases: Mutex::default() }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let side = Length::of(0.01).ok_or("a length above 0")?;
    let thinned = |name: &str| -> GraphBuilder {
        Graph::builder()
            .source(Synthetic {
                scene: Scene::Part,
                points: 300_000,
                seed: 0,
                noise: None,
                ..Synthetic::default()
            })
            .stage(Grid::new(side, Pick::Center))
            .write(folder.path().join(name))
    };
    let watch = progress(u64::MAX);
    thinned("all.laz").build()?.plan(&Overrides::default())?.run(&watch)?;
    let phases = watch.phases.into_inner().map_err(|_| "a thread panicked")?;
    assert!(phases.contains(&"decode") && phases.contains(&"mill"), "{phases:?}");

    let plan = thinned("some.laz").build()?.plan(&Overrides::default())?;
    let stopped = plan.run(&progress(100_000)).err().ok_or("it was stopped")?;
    assert_eq!(stopped.kind(), ErrorKind::Interrupted);
    assert!(!folder.path().join("some.laz").exists(), "a run that was stopped leaves nothing");
    println!("the second run: {stopped}");
    Ok(())
}
