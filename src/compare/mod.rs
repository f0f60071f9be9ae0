//! Two scans against each other: is one a reduction of the other, and how true is it? What do they
//! differ by as depth images? And an output against what the run that made it gives when it is made
//! again.
//!
//! A check of what a run did must not believe the run. So it is made from the two files alone, by
//! code that shares nothing with the stages that reduce but the search of nearest neighbours: every
//! record that was kept is looked for among those of the original, and of every other position of
//! the original it is measured how far it is from the surface that the kept points say.

#[cfg(feature = "cli")]
mod current;
mod depth;
mod meet;
mod planes;
mod records;
mod reduced;
mod reproduce;
mod surface;
mod told;
mod verdict;
mod verify;

#[cfg(feature = "cli")]
pub(crate) use current::is_current;
pub use depth::{DepthCounts, DepthErrors, DepthSettings, MOST_PIXELS, depth_errors};
pub use reproduce::{FoundInput, ReproduceSettings, Reproduction, reproduce};
pub use verdict::{DistanceFigures, ForeignRecord, Verification};
pub use verify::{VerifySettings, verify};
