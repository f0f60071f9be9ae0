//! Proof for stages of your own: a check that a test calls. Behind the feature `testing`.
//!
//! A run gives the same whatever its tiles, threads, memory and files are, because every stage keeps
//! the [promises](Promise) that the engine relies on, and says in its
//! [needs](crate::stage::Needs) what it looks at. Nothing but a test can hold a stage to that. A
//! [`Conformance`] makes small scans (points in a box, clusters, planes, copies by the hundred, one
//! point, none, far from the origin, at the ends of what integers hold), runs the stage on each in
//! about 20 ways that must not matter, and compares what comes out: records, columns and report.
//!
//! ```
//! use pointmill::Result;
//! use pointmill::ops::removal;
//! use pointmill::report::Tally;
//! use pointmill::stage::{Needs, Role, RoleName, StageKind, StagePlace, TileOp};
//! use pointmill::testing::{Conformance, CountingAllocator, Promise};
//! use pointmill::tile::Tile;
//! use schemars::JsonSchema;
//! use serde::{Deserialize, Serialize};
//!
//! // So that the check can say how much memory the stage works with.
//! #[global_allocator]
//! static COUNTING: CountingAllocator = CountingAllocator;
//!
//! /// Removes what has no other position within some lattice steps.
//! #[derive(Serialize, Deserialize, JsonSchema)]
//! struct Lonely {
//!     steps: u32,
//! }
//!
//! impl StageKind for Lonely {
//!     const KIND: &'static str = "lonely";
//!     const ROLE: RoleName = RoleName::OnTiles;
//!     const ABOUT: &'static str = "Removes what has no other position near.";
//!
//!     fn build(self, _: &StagePlace) -> Result<Role> {
//!         Ok(Role::TileOp(Box::new(self)))
//!     }
//! }
//!
//! impl TileOp for Lonely {
//!     fn needs(&self) -> Needs {
//!         Needs::none().neighbors(1).bytes_per_point(size_of::<usize>()).removes(None)
//!     }
//!
//!     fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
//!         let mut lonely = Vec::with_capacity(tile.positions.len());
//!         let (core, steps) = (tile.core.clone(), u128::from(self.steps));
//!         tile.each_neighborhood(1, |i, nearest| {
//!             if core.contains(&i) && nearest.farthest2() > steps * steps {
//!                 lonely.push(i);
//!             }
//!         })?;
//!         let removed = lonely.into_iter().map(|i| removal::remove(tile, i)).sum();
//!         tally.remove("lonely", "alone", removed);
//!         Ok(())
//!     }
//! }
//!
//! let conduct = Conformance::of(Lonely { steps: 100 }).runs(10).check()?;
//! assert!(conduct.answers[&Promise::Reach] > 0);
//! assert!(conduct.memory.is_some(), "measured");
//! # Ok::<(), pointmill::testing::Broken>(())
//! ```
//!
//! A stage that reads what others compute stands [behind](Conformance::after) them; one whose work
//! shows only in what others do with it stands [before](Conformance::before) one of these. What it
//! gives back is a [`Conduct`], or the first promise that was [`Broken`]: as a text that names it,
//! the two runs that differ, the first record that they differ in, and the smallest scan on which
//! they do. To try more, give other seeds.
//!
//! What it finds is by trying: a stage that depends on what no scan has here (a dimension of values
//! beyond the common, thousands of points in a cell) passes. It sees no memory that a stage takes on
//! threads of its own, and nothing that a stage writes elsewhere.

mod allocator;
mod answer;
mod bench;
mod broken;
mod chain;
mod check;
mod hidden;
mod made;
mod probes;
mod promise;
mod setup;
mod shrink;
mod split;
mod tile_state;
mod watched;
mod witness;

pub use allocator::CountingAllocator;
pub use broken::{Broken, Conduct};
pub use check::Conformance;
pub use promise::Promise;
pub use witness::MemoryTaken;
