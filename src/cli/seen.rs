//! How pictures are asked for: the words for where scans are seen from and what colours them.

use clap::ValueEnum;
use clap::builder::PossibleValue;

use crate::picture::{ColorBy, View};

impl ValueEnum for View {
    fn value_variants<'a>() -> &'a [Self] {
        &[View::Above, View::South, View::North, View::East, View::West]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(match self {
            View::Above => "above",
            View::South => "south",
            View::North => "north",
            View::East => "east",
            View::West => "west",
        }))
    }
}

impl ValueEnum for ColorBy {
    fn value_variants<'a>() -> &'a [Self] {
        &[ColorBy::Height, ColorBy::Class, ColorBy::Color, ColorBy::Intensity]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(match self {
            ColorBy::Height => PossibleValue::new("height"),
            ColorBy::Class => PossibleValue::new("class"),
            ColorBy::Color => PossibleValue::new("color").alias("colour"),
            ColorBy::Intensity => PossibleValue::new("intensity"),
        })
    }
}
