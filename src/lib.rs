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
//! The rooms of the house from the bottom up; each uses those before it:
//!
//! - [`Error`] is the one error type: what went wrong, at which file and byte, and what would be
//!   right. Its [`ErrorKind`] decides the exit code.
//! - [`host`]: what differs from system to system: memory and its limits, disks, threads.
//! - [`point`]: points side by side. A [`PointBatch`](point::PointBatch) holds records as their
//!   file's own bytes; a [`Schema`](point::Schema) says where in them a dimension is.
//! - [`quantity`]: counts, angles and lengths as people write them.
//! - [`budget`]: the one place that counts bytes. Whoever allocates by the size of the input takes
//!   a [`Lease`](budget::Lease) first.
//! - [`geom`]: geometry on plain slices. The [`lattice`](geom::lattice) makes coordinates integers,
//!   so that every decision is exact; [`nearest`](geom::nearest) finds neighbours,
//!   [`star`](geom::star), [`plane`](geom::plane) and [`angle`](geom::angle) make normals of them
//!   and compare these.
//! - [`store`]: scans larger than memory. A [`TileStore`](store::TileStore) takes records in any
//!   order, [`seal`](store::seal) merges them into one canonical sequence.
//! - [`tile`]: a [`Tile`](tile::Tile) is the points of a cube with neighbourhoods that are exact
//!   beyond its faces.
//! - [`report`]: what a run counts and measures, merged so that no order and no cut changes a byte.
//! - [`stage`]: the roles that a stage can play and what it tells the plan. Implement one to add a
//!   stage of your own.
//! - [`io`]: LAS, LAZ and PLY, conversion between their records, and the stages `read` and `write`.
//! - [`synth`]: synthetic scans, and the stage `synth`.
//! - [`ops`]: the stages that compute or select: `filter`, `outliers`, `normals`, `cells`, `median`
//!   and `grid`.
//! - [`picture`]: scans drawn from above or from a side, side by side.
//! - [`graph`]: what a pipeline is, whoever wrote it: a [`Graph`] of stages.
//! - [`engine`]: from a plan to a report, in phases over the store, on threads.
//! - [`plan`]: from a graph, headers and memory to a [`Plan`].
//! - [`language`]: from a text to a graph, and the [`Registry`] of kinds that a text may name.
//! - [`cli`]: the command line. A program of yours with stages of its own calls [`cli::main`] with
//!   its registry and has the same commands.
//!
//! The programs in `examples/` go on from here, and `docs/architecture.md` tells why it is so.

pub mod budget;
#[cfg(feature = "cli")]
pub mod cli;
pub mod engine;
mod error;
pub mod geom;
pub mod graph;
pub mod host;
pub mod io;
pub mod language;
pub mod ops;
pub mod picture;
pub mod plan;
pub mod point;
pub mod quantity;
pub mod report;
pub mod stage;
pub mod store;
pub mod synth;
pub mod tile;

pub use engine::{Done, Quiet, Watch};
pub use error::{Error, ErrorKind, Result};
pub use graph::{Graph, Overrides};
pub use language::{Registry, Set};
pub use plan::{Outline, Plan};
