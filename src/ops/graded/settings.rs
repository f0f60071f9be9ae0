//! Keys of `graded` that are choices.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How much is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Effort {
    /// One distance and three rounds: points are chosen in about a quarter of the time, and the
    /// 99th percentile of their surface error is 3 to 80 % larger (six scenes at 10 %; a quarter
    /// more in the middle).
    Low,
    /// Twelve coarser distances, with two rounds each from 200 points on, then one with eight
    /// rounds. More of them gain nothing that could be measured.
    #[default]
    Normal,
}
