//! The units of a scan's coordinates, as far as its coordinate reference system tells them. Knows
//! no formats.

/// Units of x and y, and of z; none where nothing is said.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Units {
    /// Of x and y.
    pub horizontal: Option<Horizontal>,
    /// Metres in a unit of z.
    pub vertical: Option<f64>,
    /// A system for x and y is named, and not its unit in words that are known here.
    pub horizontal_unknown: bool,
    /// A system for z is named, likewise.
    pub vertical_unknown: bool,
}

/// The unit of x and y.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Horizontal {
    /// An angle, degrees nearly always: x and y are longitude and latitude.
    Degrees,
    /// So many metres.
    Metres(f64),
}

/// Why distances between points mean nothing, and the factor for z that would mend it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Mismatch {
    /// What the units are.
    pub message: String,
    /// What z is to be multiplied by to be in the unit of x and y; none where no factor does.
    pub z_scale: Option<f64>,
}

/// Relative difference of units that is none: the international and the US survey foot are 2e-6
/// apart, a millimetre in a tower of 500 m.
const ALIKE: f64 = 1e-4;

/// Relative difference of units that texts write with more or fewer digits.
const DIGITS: f64 = 1e-9;

impl Units {
    /// True if both are the same, but for the digits that they were written with.
    pub(crate) fn are(&self, other: &Units) -> bool {
        let near = |one: f64, two: f64| (one - two).abs() <= DIGITS * one.abs().max(two.abs());
        let across = match (self.horizontal, other.horizontal) {
            (Some(Horizontal::Metres(one)), Some(Horizontal::Metres(two))) => near(one, two),
            (one, two) => one == two,
        };
        let up = match (self.vertical, other.vertical) {
            (Some(one), Some(two)) => near(one, two),
            (one, two) => one == two,
        };
        let unknown = |units: &Units| (units.horizontal_unknown, units.vertical_unknown);
        across && up && unknown(self) == unknown(other)
    }

    /// Why a distance across x, y and z means nothing; None where the units agree or are not known.
    ///
    /// ```
    /// use pointmill::point::{Horizontal, Units};
    ///
    /// let horizontal = Some(Horizontal::Metres(1.0));
    /// let mixed = Units { horizontal, vertical: Some(0.3048), ..Units::default() };
    /// assert_eq!(mixed.mismatch().unwrap().z_scale, Some(0.3048));
    /// assert_eq!(Units::default().mismatch(), None);
    /// ```
    pub fn mismatch(&self) -> Option<Mismatch> {
        match (self.horizontal?, self.vertical) {
            (Horizontal::Degrees, vertical) => {
                let z = vertical
                    .map_or_else(|| "is a length".to_owned(), |z| "in ".to_owned() + &name(z));
                let message = format!("x and y are in degrees and z {z}: a distance mixes them");
                Some(Mismatch { message, z_scale: None })
            }
            (Horizontal::Metres(across), Some(up)) => {
                let z_scale = up / across;
                if (z_scale - 1.0).abs() <= ALIKE {
                    return None;
                }
                let (xy, z) = (name(across), name(up));
                let message = format!("x and y are in {xy} and z in {z}: a distance mixes them");
                Some(Mismatch { message, z_scale: Some(z_scale) })
            }
            (Horizontal::Metres(_), None) => None,
        }
    }

    /// What makes it doubtful that x, y and z have one unit, though nothing proves that they have
    /// not.
    ///
    /// There is no doubt where no reference system is named at all, and none about heights without
    /// a unit above metres, the most common scans of all. Above feet there is: both are common
    /// there.
    pub fn doubt(&self) -> Option<String> {
        match (self.horizontal, self.vertical) {
            (Some(Horizontal::Degrees), _) | (Some(_), Some(_)) => None,
            (Some(Horizontal::Metres(across)), None) => {
                let xy = name(across);
                let why = match self.vertical_unknown {
                    true => "the unit of its reference system is not known here",
                    false if xy != METRES => "nothing names it",
                    false => return None,
                };
                Some(format!("x and y are in {xy} and the unit of z is not known: {why}"))
            }
            (None, Some(up)) if self.horizontal_unknown || name(up) != METRES => {
                let z = name(up);
                Some(format!("z is in {z} and the unit of x and y is not known"))
            }
            (None, None) if self.horizontal_unknown || self.vertical_unknown => {
                Some("the units of the scan's reference system are not known here".to_owned())
            }
            (None, _) => None,
        }
    }

    /// The sign of the unit that distances are in, behind a number; none where that is not known.
    pub fn sign(&self) -> Option<&'static str> {
        match self.horizontal? {
            Horizontal::Degrees => None,
            Horizontal::Metres(metres) => match name(metres).as_str() {
                METRES => Some("m"),
                FEET => Some("ft"),
                SURVEY_FEET => Some("US survey ft"),
                _ => None,
            },
        }
    }

    /// The units in words, those that are not known included.
    pub fn words(&self) -> String {
        if self.horizontal.is_none() && self.vertical.is_none() {
            return "not known".to_owned();
        }
        let not_known = || "a unit that is not known".to_owned();
        let xy = match self.horizontal {
            Some(Horizontal::Degrees) => "degrees".to_owned(),
            Some(Horizontal::Metres(metres)) => name(metres),
            None => not_known(),
        };
        let z = self.vertical.map_or_else(not_known, name);
        format!("x and y in {xy}, z in {z}")
    }

    /// What `self` does not say as `other` says it, if both agree in what both say of x and y.
    pub fn or(self, other: Units) -> Units {
        match (self.horizontal, other.horizontal) {
            (Some(one), Some(two)) if one != two => self,
            _ => {
                let horizontal = self.horizontal.or(other.horizontal);
                let vertical = self.vertical.or(other.vertical);
                let either = |one: bool, two: bool, known: bool| (one || two) && !known;
                Units {
                    horizontal,
                    vertical,
                    horizontal_unknown: either(
                        self.horizontal_unknown,
                        other.horizontal_unknown,
                        horizontal.is_some(),
                    ),
                    vertical_unknown: either(
                        self.vertical_unknown,
                        other.vertical_unknown,
                        vertical.is_some(),
                    ),
                }
            }
        }
    }
}

/// The unit that most scans have.
const METRES: &str = "metres";
const FEET: &str = "feet";
const SURVEY_FEET: &str = "US survey feet";

/// A unit of `metres` in words.
fn name(metres: f64) -> String {
    let close = |to: f64| ((metres - to) / to).abs() < 1e-9;
    match () {
        () if close(1.0) => METRES.to_owned(),
        () if close(0.3048) => FEET.to_owned(),
        () if close(1200.0 / 3937.0) => SURVEY_FEET.to_owned(),
        () => format!("units of {metres} m"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOOT: f64 = 0.3048;
    const SURVEY_FOOT: f64 = 1200.0 / 3937.0;

    fn units(across: f64, up: f64) -> Units {
        let horizontal = Some(Horizontal::Metres(across));
        Units { horizontal, vertical: Some(up), ..Units::default() }
    }

    fn above(across: f64) -> Units {
        Units { vertical: None, ..units(across, 1.0) }
    }

    #[test]
    fn feet_above_metres_and_metres_above_feet_do_not_match() {
        let one = units(1.0, SURVEY_FOOT).mismatch().unwrap();
        assert!(one.message.starts_with("x and y are in metres and z in US survey feet"));
        assert_eq!(one.z_scale, Some(SURVEY_FOOT));
        let other = units(FOOT, 1.0).mismatch().unwrap();
        assert!(other.message.starts_with("x and y are in feet and z in metres"), "{other:?}");
        assert_eq!(other.z_scale, Some(1.0 / FOOT));
    }

    #[test]
    fn two_kinds_of_feet_match() {
        assert_eq!(units(FOOT, SURVEY_FOOT).mismatch(), None);
        assert_eq!(units(1.0, 1.0).mismatch(), None);
    }

    #[test]
    fn degrees_match_no_height_and_no_factor_mends_them() {
        for vertical in [None, Some(1.0), Some(FOOT)] {
            let horizontal = Some(Horizontal::Degrees);
            let units = Units { horizontal, vertical, ..Units::default() };
            assert_eq!(units.doubt(), None, "it is certain");
            assert_eq!(units.mismatch().unwrap().z_scale, None);
        }
    }

    #[test]
    fn what_is_not_known_is_no_mismatch_and_may_be_a_doubt() {
        let none = Units::default();
        let heights = |up| Units { vertical: Some(up), ..none };
        let unknown = |units| Units { vertical_unknown: true, ..units };
        let silent = [none, above(1.0), heights(1.0), units(FOOT, FOOT)];
        let doubtful = [
            (above(SURVEY_FOOT), "the unit of z is not known: nothing names it"),
            (unknown(above(1.0)), "x and y are in metres and the unit of z is not known"),
            (heights(FOOT), "z is in feet and the unit of x and y is not known"),
            (
                Units { horizontal_unknown: true, ..heights(1.0) },
                "the unit of x and y is not known",
            ),
            (unknown(none), "the units of the scan's reference system are not known here"),
            (
                Units { horizontal_unknown: true, ..none },
                "the units of the scan's reference system are not known here",
            ),
        ];
        for units in silent {
            assert_eq!((units.mismatch(), units.doubt()), (None, None), "{units:?}");
        }
        for (units, told) in doubtful {
            assert_eq!(units.mismatch(), None);
            let doubt = units.doubt().unwrap();
            assert!(doubt.contains(told), "{doubt}");
        }
    }

    #[test]
    fn units_in_words_say_what_is_not_known() {
        assert_eq!(units(1.0, SURVEY_FOOT).words(), "x and y in metres, z in US survey feet");
        assert_eq!(above(FOOT).words(), "x and y in feet, z in a unit that is not known");
        assert_eq!(Units::default().words(), "not known");
    }

    #[test]
    fn lengths_have_the_sign_of_x_and_y() {
        let signs = [1.0, FOOT, SURVEY_FOOT, 1000.0].map(|across| above(across).sign());
        assert_eq!(signs, [Some("m"), Some("ft"), Some("US survey ft"), None]);
        assert_eq!(Units::default().sign(), None);
        let degrees = Units { horizontal: Some(Horizontal::Degrees), ..Units::default() };
        assert_eq!(degrees.sign(), None);
    }

    #[test]
    fn a_second_opinion_fills_gaps_unless_it_contradicts() {
        let known = above(FOOT);
        assert_eq!(known.or(units(FOOT, 1.0)).vertical, Some(1.0));
        assert_eq!(known.or(units(1.0, 1.0)), known);
        assert_eq!(Units::default().or(known), known);
        let unknown = Units { vertical_unknown: true, ..known };
        assert_eq!((unknown.or(units(FOOT, 1.0)), known.or(unknown)), (units(FOOT, 1.0), unknown));
    }
}
