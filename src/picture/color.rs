//! What a point's colour says.

use super::look::Look;
use super::settings::ColorBy;

/// Red, green and blue.
pub(super) type Shade = [u8; 3];

/// Colours of heights from the lowest to the highest.
const HEIGHTS: [Shade; 6] =
    [[38, 52, 118], [28, 118, 150], [74, 166, 110], [188, 196, 84], [234, 158, 62], [178, 52, 46]];
/// Colours of intensities, likewise.
const GREYS: [Shade; 2] = [[16, 16, 16], [226, 226, 226]];
/// Colours of the classes that LAS names (LAS 1.4 R15, table 17), from 0 on.
const CLASSES: [Shade; 19] = [
    [150, 150, 150],
    [176, 176, 176],
    [150, 108, 66],
    [150, 200, 110],
    [90, 170, 80],
    [34, 120, 50],
    [206, 66, 52],
    [232, 40, 200],
    [120, 90, 160],
    [52, 120, 210],
    [96, 84, 74],
    [110, 110, 120],
    [200, 200, 140],
    [240, 200, 40],
    [240, 160, 40],
    [90, 90, 110],
    [200, 140, 90],
    [180, 150, 130],
    [255, 0, 160],
];

impl ColorBy {
    /// True if colours are a range of figures.
    pub(super) fn is_range(self) -> bool {
        matches!(self, ColorBy::Height | ColorBy::Intensity)
    }

    /// True if what points of this look are coloured by is 0 everywhere: a scan whose records have
    /// room for it and whose scanner did not measure it.
    pub(super) fn is_black(self, look: &Look) -> bool {
        matches!(self, ColorBy::Color | ColorBy::Intensity) && look.values == [0.0; 2]
    }

    /// What the first and the last colour stand for: the range of the middle 98 of 100 points, so
    /// that a few far ones do not take all colours; for colours 0 and what full brightness is
    /// stored as.
    pub(super) fn range(self, looks: &[Look]) -> [f64; 2] {
        let of = |pick: fn(&Look) -> [f64; 2]| {
            let wider = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
            looks.iter().map(pick).fold([f64::INFINITY, f64::NEG_INFINITY], wider)
        };
        match self {
            ColorBy::Height | ColorBy::Intensity => of(|look| look.middle_values()),
            ColorBy::Class => [0.0, 255.0],
            // Colours of 8 bits stand in fields of 16 in many files.
            ColorBy::Color if of(|look| look.values)[1] > 255.0 => [0.0, 65_535.0],
            ColorBy::Color => [0.0, 255.0],
        }
    }

    /// The colour of a point with these `values` of its dimensions.
    pub(super) fn color(self, values: &[f64], [low, high]: [f64; 2]) -> Shade {
        let share = |value: f64| match high > low {
            true => ((value - low) / (high - low)).clamp(0.0, 1.0),
            false => 0.5,
        };
        match (self, values) {
            (ColorBy::Color, [r, g, b]) => [r, g, b].map(|v| (share(*v) * 255.0).round() as u8),
            (ColorBy::Class, [class, ..]) => match CLASSES.get(*class as usize) {
                Some(color) => *color,
                None => other_class(*class as u8),
            },
            (ColorBy::Intensity, [value, ..]) => mixed(&GREYS, share(*value)),
            (_, [value, ..]) => mixed(&HEIGHTS, share(*value)),
            (_, []) => [0; 3],
        }
    }
}

/// A colour between those of `stops`, at `share` of the way.
pub(crate) fn mixed(stops: &[Shade], share: f64) -> Shade {
    let at = share * (stops.len() - 1) as f64;
    let below = (at as usize).min(stops.len() - 2);
    let part = at - below as f64;
    std::array::from_fn(|i| {
        let (a, b) = (f64::from(stops[below][i]), f64::from(stops[below + 1][i]));
        (a + (b - a) * part).round() as u8
    })
}

/// A colour for a class that LAS does not name: neighbours in number differ.
fn other_class(class: u8) -> Shade {
    let hue = u32::from(class).wrapping_mul(0x9e37_79b9);
    [24, 16, 8].map(|shift| 60 + ((hue >> shift) as u8) / 2)
}
