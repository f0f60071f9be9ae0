//! One of the axes of space.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The axis that one looks along.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Along x: the image has y and z.
    X,
    /// Along y: the image has z and x.
    Y,
    /// Along z: the image has x and y.
    #[default]
    Z,
}
