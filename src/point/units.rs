//! The units of a scan's coordinates, as far as its coordinate reference system tells them. Knows no
//! formats.

/// Units of x and y, and of z; none where nothing is said.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Units {
    /// Of x and y.
    pub horizontal: Option<Horizontal>,
    /// Metres in a unit of z.
    pub vertical: Option<f64>,
}

/// The unit of x and y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Horizontal {
    /// An angle, degrees nearly always: x and y are longitude and latitude.
    Degrees,
    /// So many metres.
    Metres(f64),
}

/// Why distances between points mean nothing, and the factor for z that would mend it.
#[derive(Debug, Clone, PartialEq)]
pub struct Mismatch {
    /// What the units are.
    pub message: String,
    /// What z is to be multiplied by to be in the unit of x and y; none where no factor does.
    pub z_scale: Option<f64>,
}

/// Relative difference of units that is none: the international and the US survey foot are 2e-6
/// apart, a millimetre in a tower of 500 m.
const ALIKE: f64 = 1e-4;

impl Units {
    /// Why a distance across x, y and z means nothing; None where the units agree or are not known.
    ///
    /// ```
    /// use pointmill::point::{Horizontal, Units};
    ///
    /// let mixed = Units { horizontal: Some(Horizontal::Metres(1.0)), vertical: Some(0.3048) };
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

    /// What `self` does not say as `other` says it, if both agree in what both say of x and y.
    pub fn or(self, other: Units) -> Units {
        match (self.horizontal, other.horizontal) {
            (Some(one), Some(two)) if one != two => self,
            _ => Units {
                horizontal: self.horizontal.or(other.horizontal),
                vertical: self.vertical.or(other.vertical),
            },
        }
    }
}

/// A unit of `metres` in words.
fn name(metres: f64) -> String {
    let close = |to: f64| ((metres - to) / to).abs() < 1e-9;
    match () {
        () if close(1.0) => "metres".to_owned(),
        () if close(0.3048) => "feet".to_owned(),
        () if close(1200.0 / 3937.0) => "US survey feet".to_owned(),
        () => format!("units of {metres} m"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOOT: f64 = 0.3048;
    const SURVEY_FOOT: f64 = 1200.0 / 3937.0;

    fn units(across: f64, up: f64) -> Units {
        Units { horizontal: Some(Horizontal::Metres(across)), vertical: Some(up) }
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
            let units = Units { horizontal: Some(Horizontal::Degrees), vertical };
            assert_eq!(units.mismatch().unwrap().z_scale, None);
        }
    }

    #[test]
    fn what_is_not_known_is_not_complained_of() {
        for horizontal in [None, Some(Horizontal::Metres(FOOT))] {
            assert_eq!(Units { horizontal, vertical: None }.mismatch(), None);
        }
        assert_eq!(Units { horizontal: None, vertical: Some(FOOT) }.mismatch(), None);
    }

    #[test]
    fn a_second_opinion_fills_gaps_unless_it_contradicts() {
        let known = Units { horizontal: Some(Horizontal::Metres(FOOT)), vertical: None };
        assert_eq!(known.or(units(FOOT, 1.0)).vertical, Some(1.0));
        assert_eq!(known.or(units(1.0, 1.0)), known);
        assert_eq!(Units::default().or(known), known);
    }
}
