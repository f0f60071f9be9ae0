//! What a run says it did: the ledger, the errors of tiles and scan, and how they are merged.

mod accept;
mod baseline;
mod classes;
pub(crate) mod deviations;
pub(crate) mod digits;
mod document;
mod figures;
mod ledger;
pub(crate) mod lot;
mod machine;
pub(crate) mod moments;
mod rule_text;
mod stats;
pub(crate) mod sums;
pub(crate) mod survey;
mod table;
mod tally;
mod towards;
mod verdict;
mod voxels;

pub use crate::budget::{Bytes, Holder, Holders};
pub(crate) use accept::AcceptFigure;
pub(crate) use accept::RULES as ACCEPT_RULES;
pub use accept::{AcceptRules, AcceptTable};
pub(crate) use baseline::Baseline;
pub(crate) use classes::{ClassCounts, class_name};
pub(crate) use digits::{Coordinate, Grouped, Long, Short};
pub use document::{
    Decision, FileFigures, LatticeFigures, LostPoints, Outcome, Phase, Report, Reprojection,
    RunFigures, result_bytes,
};
pub use figures::{
    BaselineFigures, ClassFigures, DeviationBin, DeviationFigures, DeviationTotals, Pair,
    PassFigures, PlaneFigures, TileFigures, Totals,
};
pub(crate) use ledger::check_written;
pub use ledger::{Ledger, Removed};
pub(crate) use lot::{Lot, Walked};
pub use machine::Machine;
pub(crate) use rule_text::{RuleText, angle, length};
pub use stats::{DimensionFigures, DimensionHistogram, StatsFigures};
pub(crate) use stats::{StatsTally, StoredNumbers};
pub(crate) use survey::{FittedScan, ScanSurvey, report_tile_level};
pub use table::Table;
pub use tally::Tally;
pub(crate) use tally::{Apart, KEY_POINTS};
pub use verdict::{AcceptVerdict, RuleVerdict};
pub(crate) use voxels::{VoxelCounts, VoxelNode, VoxelSample, grid_figures};
