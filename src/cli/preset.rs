//! Sets of values for `reduce`, by the name of what was scanned. What is given by other arguments
//! takes the place of a preset's.

use clap::ValueEnum;
use serde_json::{Value, json};

use crate::language::Set;

/// What a scan is of, or whose method it is reduced by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Preset {
    /// The published method as it is printed: 10 neighbours, angles to the x axis, 0.1 rad
    Paper,
    /// A part scanned at close range, of little noise: 20 neighbours, 0.1 rad
    Part,
    /// An airborne scan: 20 neighbours, 20 degrees
    Airborne,
    /// A scan from the ground, of walls and trees: 30 neighbours, 35 degrees
    Terrestrial,
}

impl Preset {
    /// The keys and values, in place of those of `pipelines/reduce.toml`.
    pub fn sets(self) -> Vec<Set> {
        let (neighbors, angle) = match self {
            Preset::Paper => (10, json!(0.1)),
            Preset::Part => (20, json!(0.1)),
            Preset::Airborne => (20, json!("20deg")),
            Preset::Terrestrial => (30, json!("35deg")),
        };
        let (measure, side, spacing) = match self {
            Preset::Paper => ("axis", "auto", "none"),
            _ => ("cone", "spread", "auto"),
        };
        let set = |(address, value): (&str, Value)| Set::argument("--preset", address, value);
        [
            ("normals.neighbors", json!(neighbors)),
            ("cells.max_angle", angle),
            ("cells.measure", json!(measure)),
            ("cells.side", json!(side)),
            ("cells.min_spacing", json!(spacing)),
        ]
        .map(set)
        .to_vec()
    }
}
