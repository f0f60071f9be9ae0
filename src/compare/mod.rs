//! Two scans against each other: do they have the same records, is one a reduction of the other,
//! and how true is it? How far are they from each other, what angles do their normals have, and
//! what do they differ by as depth images? And an output against what the run that made it gives
//! when it is made again.
//!
//! A check of what a run did must not believe the run. So it is made from the two files alone, by
//! code that shares nothing with the stages that reduce but the search of nearest neighbours: every
//! record that was kept is looked for among those of the original, and of every other position of
//! the original it is measured how far it is from the surface that the kept points say.

mod clouds;
#[cfg(feature = "cli")]
mod current;
mod depth;
mod figures;
mod left_out;
mod meet;
mod planes;
mod records;
mod reduced;
mod reproduce;
mod rules;
mod same;
mod scans;
mod surface;
mod told;
mod verdict;
mod verify;

pub use clouds::{CloudDirection, CloudDistances, CloudFigures, NormalAngles, NormalDirection};
#[cfg(feature = "cli")]
pub(crate) use current::is_current;
pub use depth::{DepthCounts, DepthErrors, DepthSettings, MOST_PIXELS, depth_errors};
pub use reproduce::{FoundInput, ReproduceSettings, Reproduction, reproduce};
pub use rules::{CompareRuleVerdict, CompareRules, CompareVerdict};
pub use same::{
    ChangedDimension, ChangedPlace, ChangedRecords, ComparedBy, OnlyRecords, PartOf, RecordPlace,
    RecordsComparison,
};
pub use scans::{CompareSettings, DEPTH_PIXELS, ScanComparison, compare};
pub use verdict::{DistanceFigures, ForeignRecord, Verification};
pub use verify::{VerifySettings, verify};
