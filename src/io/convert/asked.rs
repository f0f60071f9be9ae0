//! What users ask of values that get another type.

use super::step::{Move, asked_step};
use crate::point::Dimension;
use crate::point::names::{BLUE, GREEN, INTENSITY, NIR, RED};
use crate::stage::{FloatIntensity, WriteKeys};

/// What coordinates are rounded to.
pub(in crate::io) const SCALE: &str = "the output's scale";
/// What other values are rounded to.
pub(in crate::io) const TYPES: &str = "their types in the output";

/// What was asked of the values of an output.
#[derive(Debug, Clone, Default)]
pub(crate) struct AskedValues {
    /// Dimensions that are left out.
    pub drop: Vec<String>,
    /// Dimensions that are rounded to the type that they have in the output, by their names there.
    pub typed: Vec<String>,
    /// True if intensities of floating-point numbers are parts of the most.
    pub unit_intensity: bool,
}

impl AskedValues {
    /// What the keys of `write` ask.
    pub fn of(keys: &WriteKeys) -> Self {
        AskedValues {
            drop: keys.drop.clone(),
            typed: keys.types.iter().map(|retyped| retyped.name.clone()).collect(),
            unit_intensity: keys.intensity == Some(FloatIntensity::Unit),
        }
    }

    /// The step that what was asked, or that colours mean the same, needs.
    pub(super) fn step(
        &self,
        families: [&str; 2],
        from: &Dimension,
        to: &Dimension,
    ) -> Option<Move> {
        let is_typed = self.typed.contains(&to.name);
        let is_color = [RED, GREEN, BLUE, NIR].contains(&to.name.as_str());
        let others = families[0] != families[1];
        let floats = from.scalar.is_float() && !to.scalar.is_float();
        let is_part = is_color && (is_typed || others && floats)
            || self.unit_intensity && to.name == INTENSITY && floats;
        (is_typed || is_part).then(|| asked_step(from, to, is_part)).flatten()
    }
}
