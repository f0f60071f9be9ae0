//! Points from and into a program's own memory: sources of records and of batches, and a sink whose
//! batches go over a bounded channel.
//!
//! A source of [`Records`] holds them all, and its parts are read side by side. A source of
//! [`Batches`] takes them from an iterator as the run asks for them: from a generator, or from the
//! receiving end of a channel that another thread fills. What comes out goes over a [`channel`]: it
//! holds a few batches and makes the run wait until they are taken, so that the memory stays
//! bounded however many points there are. [`Plan::pull`](crate::Plan::pull) runs a plan and gives
//! what comes out as an iterator.
//!
//! ```
//! use pointmill::graph::RunSettings;
//! use pointmill::memory::{Records, channel};
//! use pointmill::ops::{Grid, Pick};
//! use pointmill::quantity::Length;
//! use pointmill::stage::Role;
//! use pointmill::{Graph, Overrides, Quiet};
//!
//! let corner = |n: u32| [f64::from(n % 10) * 0.1, f64::from(n / 10) * 0.1, 0.0];
//! let points: Vec<[f64; 3]> = (0..100).map(corner).collect();
//!
//! let (sink, received) = channel(4, &[]);
//! let mut graph = Graph::new(RunSettings::default());
//! let source = graph.add("points", Role::Source(Box::new(Records::of_positions(&points))), &[]);
//! let side = Length::of(0.5).expect("a length above 0");
//! let grid = Role::TileOp(Box::new(Grid::new(side, Pick::Center)));
//! let grid = graph.add("grid", grid, &[source]);
//! graph.add("channel", Role::Sink(Box::new(sink)), &[grid]);
//!
//! let mut pulled = graph.plan(&Overrides::default())?.pull(received, Quiet);
//! let mut left = 0;
//! for batch in &mut pulled {
//!     left += batch?.len();
//! }
//! assert_eq!(left, 4);
//! assert_eq!(pulled.finish()?.report.result.ledger.kept, 4);
//! # Ok::<(), pointmill::Error>(())
//! ```

mod batches;
mod channel;
mod records;

pub use batches::Batches;
pub use channel::{ChannelSink, Received, channel};
pub use records::{Records, schema};
