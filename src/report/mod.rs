//! What a run says it did: the ledger, the errors of tiles and scan, and how they are merged.

mod baseline;
mod classes;
mod deviations;
mod digits;
mod document;
mod figures;
mod ledger;
mod lot;
mod machine;
mod moments;
mod sums;
mod survey;
mod table;
mod tally;

pub use baseline::Baseline;
pub use classes::ClassCounts;
pub use classes::class_name;
pub use deviations::{Deviations, Histogram};
pub use digits::{Coordinate, Grouped, Short};
pub use document::{
    Decision, FileFigures, LatticeFigures, Outcome, Phase, Report, RunFigures, result_bytes,
};
pub use figures::{
    BaselineFigures, ClassFigures, DeviationFigures, DeviationTotals, Pair, PassFigures,
    PlaneFigures, TileFigures, Totals,
};
pub use ledger::{Ledger, Removed, check_written};
pub use lot::Lot;
pub use machine::Machine;
pub use moments::{Moments, Plane};
pub use sums::{Distances, FixedSum};
pub use survey::{
    FittedScan, FittedTile, PlaneDistances, ScanSurvey, TileSurvey, report_tile_level,
};
pub use table::Table;
pub use tally::{Apart, KEY_POINTS, Tally};
