//! Keys of `graded` that are choices.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How much is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Effort {
    /// Three rounds: a third of the time, and errors that are up to a third larger.
    Low,
    /// Four coarser distances with two rounds each, then eight rounds.
    #[default]
    Normal,
    /// Six coarser distances with three rounds each, then sixteen rounds: some 1 to 3 % less error
    /// for twice the time.
    High,
}
