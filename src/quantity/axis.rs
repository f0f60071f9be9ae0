//! One of the axes of space.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The axis that one looks along: what is seen lies across it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Along x: y and z lie across it.
    X,
    /// Along y: z and x lie across it.
    Y,
    /// Along z: x and y lie across it.
    #[default]
    Z,
}
