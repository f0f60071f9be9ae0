//! The units of coordinate reference systems by their EPSG codes, and the systems themselves, where
//! WKT 1 has words for them. The table of units has the kind and the unit of every code.

mod definitions;
#[cfg(feature = "proj")]
mod lists;

use crate::point::{Horizontal, Units};
pub use definitions::{datum_of, datums, heights, parts, plain, unit_text, vertical_text, wkt};
#[cfg(feature = "proj")]
pub use lists::{heights_on, systems_on};

/// A line holds a kind of system, metres in a unit of its lengths, and codes: single ones and
/// ranges.
const TABLE: &str = include_str!("epsg/units.txt");

/// Metres in an international foot.
const FOOT: f64 = 0.3048;
/// Metres in a US survey foot.
const SURVEY_FOOT: f64 = 1200.0 / 3937.0;

/// Metres in the EPSG unit of length `code`, for those of surveys.
pub fn unit(code: u16) -> Option<f64> {
    match code {
        9001 => Some(1.0),
        9002 => Some(FOOT),
        9003 => Some(SURVEY_FOOT),
        9036 => Some(1000.0),
        // Clarke's foot, yard and link.
        9005 => Some(0.304_797_265_4),
        9037 => Some(0.914_391_796_2),
        9039 => Some(0.201_166_195_164),
        // The legal metre of Germany, the Indian yard, the foot of the Gold Coast, the link.
        9031 => Some(1.000_013_596_5),
        9084 => Some(0.914_398_530_744_440_8),
        9094 => Some(0.304_799_710_181_508_8),
        9098 => Some(0.201_168),
        // British yard, foot and chain (Sears 1922), foot (1936).
        9040 => Some(0.914_398_414_616_028_7),
        9041 => Some(0.304_799_471_538_676_2),
        9042 => Some(20.116_765_121_552_632),
        9095 => Some(0.304_800_749_1),
        _ => None,
    }
}

/// The units of the system `code`, which gives x and y and perhaps z.
pub fn horizontal(code: u32) -> Units {
    let unknown = Units { horizontal_unknown: true, ..Units::default() };
    let of = |horizontal| Units { horizontal: Some(horizontal), ..Units::default() };
    find(code, |kind| kind != "vertical").map_or(unknown, |(kind, metres)| match kind {
        "geographic" => of(Horizontal::Degrees),
        "geographic3" => Units { vertical: metres, ..of(Horizontal::Degrees) },
        // Three axes in one unit.
        "geocentric" => Units { vertical: metres, ..metres.map_or(unknown, in_metres) },
        _ => metres.map_or(unknown, in_metres),
    })
}

fn in_metres(metres: f64) -> Units {
    Units { horizontal: Some(Horizontal::Metres(metres)), ..Units::default() }
}

/// Metres in a unit of the heights of the vertical system `code`.
pub fn vertical(code: u32) -> Option<f64> {
    find(code, |kind| kind == "vertical")?.1
}

/// The kind of the system `code` and metres in its unit.
fn find(code: u32, wanted: impl Fn(&str) -> bool) -> Option<(&'static str, Option<f64>)> {
    let lines = TABLE.lines().filter(|line| !line.starts_with('#'));
    for line in lines {
        let mut words = line.split(' ');
        let (kind, metres) = (words.next()?, words.next()?);
        if wanted(kind) && words.any(|codes| holds(codes, code)) {
            return Some((kind, metres.parse().ok()));
        }
    }
    None
}

/// True if `codes`, one or a range, holds `code`.
fn holds(codes: &str, code: u32) -> bool {
    let (first, last) = codes.split_once('-').unwrap_or((codes, codes));
    let number = |text: &str| text.parse::<u32>().ok();
    number(first).is_some_and(|first| first <= code)
        && number(last).is_some_and(|last| code <= last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_the_table_is_a_kind_a_unit_and_codes() {
        let mut systems = 0;
        for line in TABLE.lines().filter(|line| !line.starts_with('#')) {
            let words: Vec<&str> = line.split(' ').collect();
            let length = words[1].parse::<f64>().ok();
            match words[0] {
                "geographic" => assert_eq!(words[1], "none"),
                "projected" | "vertical" | "geographic3" | "geocentric" => {
                    assert!(length.is_some_and(|metres| metres > 0.0), "{line}");
                }
                other => panic!("{other}"),
            }
            for codes in &words[2..] {
                let (first, last) = codes.split_once('-').unwrap_or((codes, codes));
                let [first, last] = [first, last].map(|code| code.parse::<u32>().unwrap());
                assert!(first <= last, "{codes}");
                systems += last - first + 1;
            }
        }
        assert_eq!(systems, 5636 + 291 + 1161, "projected, vertical and geodetic systems");
    }

    #[test]
    fn systems_have_the_units_that_their_definitions_say() {
        let across = |code| horizontal(code).horizontal;
        for (code, metres) in [(25832, 1.0), (2154, 1.0), (2277, SURVEY_FOOT), (2222, FOOT)] {
            assert_eq!(across(code), Some(Horizontal::Metres(metres)), "{code}");
        }
        for (code, up) in [(4326, None), (4258, None), (4979, Some(1.0))] {
            assert_eq!((across(code), horizontal(code).vertical), (Some(Horizontal::Degrees), up));
        }
        assert_eq!(horizontal(4978).vertical, Some(1.0), "geocentric");
        for (code, metres) in [(5703, 1.0), (7837, 1.0), (6360, SURVEY_FOOT), (8228, FOOT)] {
            assert_eq!(vertical(code), Some(metres), "{code}");
        }
        for nothing in [0, 1, 32767, 5703, 70_000, u32::MAX] {
            assert!(horizontal(nothing).horizontal_unknown, "{nothing}");
        }
        assert_eq!((vertical(25832), vertical(5103)), (None, None));
    }

    #[test]
    fn units_are_those_of_the_systems_that_have_them() {
        let systems = [
            (25832, 9001),
            (2222, 9002),
            (2277, 9003),
            (2314, 9005),
            (29371, 9031),
            (22300, 9036),
            (5472, 9037),
            (2066, 9039),
            (27291, 9040),
            (29872, 9041),
            (29871, 9042),
            (24370, 9084),
            (2136, 9094),
            (3139, 9098),
        ];
        for (system, code) in systems {
            let metres = unit(code).map(Horizontal::Metres);
            assert_eq!(horizontal(system).horizontal, metres, "{system} {code}");
        }
        assert_eq!((vertical(5754), unit(0), unit(u16::MAX)), (unit(9095), None, None));
    }
}
