//! pointmill reduces laser scans that do not fit in memory to the points that matter, and proves
//! what it did.
//!
//! A run is a pipeline: a source, stages that work on its points, sinks. It is written as a text,
//! planned (do the stages fit each other, the inputs and the memory?) and run; what comes back is a
//! report.
//!
//! ```
//! use pointmill::{Graph, Overrides, Quiet, Registry};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let folder = tempfile::tempdir()?;
//! let reduced = folder.path().join("reduced.laz");
//! let text = format!(
//!     r#"
//!     [run]
//!     memory = "128MiB"           # bounds the peak memory of the process, at any number of points
//!     threads = 2
//!
//!     [[stage]]
//!     kind = "synth"              # or "read", with a path
//!     scene = "part"
//!     points = 20_000
//!
//!     [[stage]]
//!     kind = "normals"
//!
//!     [[stage]]
//!     kind = "cells"
//!     max_angle = "6deg"
//!
//!     [[stage]]
//!     kind = "median"
//!
//!     [[stage]]
//!     kind = "write"
//!     path = '{}'
//!     "#,
//!     reduced.display()
//! );
//! let registry = Registry::builtin();
//! let graph = Graph::parse(&text, "tour.toml", &registry)?;
//! let report = graph.plan(&Overrides::default())?.run(&Quiet)?.report;
//!
//! // Every record is accounted for, and the file holds those that were kept.
//! let ledger = &report.result.ledger;
//! assert_eq!(ledger.read, 20_000);
//! assert_eq!(ledger.read, ledger.kept + ledger.removed_records());
//! assert_eq!(report.run.outputs[0].points, ledger.kept);
//! assert_eq!(pointmill::io::describe(&reduced, registry.formats())?["points"], ledger.kept);
//!
//! // How far what was removed lies from the surface of what was kept, in the scan's unit.
//! let totals = report.result.totals.ok_or("tiles were milled")?;
//! let deviation = totals.deviation.ok_or("points were removed")?;
//! assert_eq!(deviation.points, ledger.read - ledger.kept);
//! assert!(deviation.p50 <= deviation.p95 && deviation.p95 <= deviation.max);
//!
//! // The budget was kept.
//! assert!(report.run.leased_bytes <= report.run.memory_bytes);
//! # Ok(())
//! # }
//! ```
//!
//! What is public, from the bottom up:
//!
//! - [`Error`] is the one error type: what went wrong, at which file and byte, and what would be
//!   right. Its [`ErrorKind`] decides the exit code.
//! - [`point`]: points side by side. A [`PointBatch`](point::PointBatch) holds records as their
//!   file's own bytes; a [`Schema`](point::Schema) says where in them a dimension is.
//! - [`quantity`]: counts, angles and lengths as people write them, the types of stages' keys.
//! - [`expression`]: conditions and values over dimensions and columns, as pipelines write them.
//! - [`tile`]: a [`Tile`](tile::Tile) is the points of a cube with neighbourhoods that are exact
//!   beyond its faces.
//! - [`report`]: what a run counts and measures, merged so that no order and no cut changes a byte.
//! - [`stage`]: the roles that a stage can play and what it tells the plan. Implement one to add a
//!   stage of your own, or [`Format`](stage::Format) to add a format.
//! - [`io`]: formats, conversion between their records, and the stages `read`, `write`,
//!   `mesh` and `discard`.
//! - [`memory`]: points from and into a program's own memory; [`Plan::pull`] gives results as an
//!   iterator.
//! - [`synth`]: synthetic scans, and the stage `synth`.
//! - [`ops`]: the stages that compute, select, move or look: `filter`, `drop`, `crop`, `sample`,
//!   `assign`, `transform`, `stats`, `tap`, `merge`, `outliers`, `smooth`, `normals`, `orient`,
//!   `cells`, `gaussian-image`, `median`, `graded`, `cut`, `grid`, `scanline`,
//!   `triangles`, `wavelet` and `fourier`.
//! - [`picture`]: scans drawn from above or from a side, side by side.
//! - [`graph`]: what a pipeline is, whoever wrote it: a [`Graph`] of stages.
//! - [`PipelineText`]: a pipeline as it is written, in TOML, JSON or one line, with [`Parameter`]s.
//! - [`Registry`]: the kinds and formats that a text may name; [`Set`]: what is put in the place of
//!   a text's values.
//! - [`Plan`]: a graph that is fitted to headers and memory. It runs, and tells a [`Watch`] how it
//!   goes; [`Done`] has the report.
//! - [`report::AcceptTable`]: rules that a result is held to; [`Done::accepted`] says if it does.
//! - [`compare`]: [`verify`](compare::verify) says whether a scan is a reduction of another, and
//!   how true it is; [`depth_errors`](compare::depth_errors), what two scans differ by as depth
//!   images; [`reproduce`](compare::reproduce), whether the run that made an output gives it again.
//! - [`cli`]: the command line. A program of yours with stages of its own calls [`cli::main`] with
//!   its registry and has the same commands.
//!
//! Enums and structs that will grow are `#[non_exhaustive]`; those of them that a stage or a format
//! makes have a constructor. Settings are written `Settings { key, ..Settings::default() }`, which
//! holds when keys are added.
//!
//! The programs in `examples/` go on from here, and `docs/architecture.md` tells why it is so and
//! has the rooms behind this surface, among them the store, geometry, plan and engine.

#[allow(clippy::missing_errors_doc, reason = "no program calls it: see `internals`")]
mod budget;
#[cfg(feature = "cli")]
pub mod cli;
pub mod compare;
mod engine;
mod error;
pub mod expression;
mod geom;
pub mod graph;
mod host;
#[doc(hidden)]
pub mod internals;
pub mod io;
mod language;
pub mod memory;
pub mod ops;
mod page;
pub mod picture;
mod plan;
pub mod point;
pub mod quantity;
pub mod report;
pub mod stage;
#[allow(clippy::missing_errors_doc, reason = "no program calls it: see `internals`")]
mod store;
pub mod synth;
#[cfg(feature = "testing")]
pub mod testing;
pub mod tile;

pub use engine::{Done, Quiet, Watch};
pub use error::{Error, ErrorKind, Result};
pub use graph::{Graph, Overrides};
pub use language::{
    Explained, GraphBuilder, KeyDescription, Parameter, ParameterType, PipelineText, Registry, Set,
    TableDescription, WordDescription,
};
pub use plan::{
    FittedSize, Outline, Plan, PredictedOutput, PredictedPhase, Prediction, Preview, Pulled, Trial,
    TrialPoints,
};
