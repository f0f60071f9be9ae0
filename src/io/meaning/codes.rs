//! The EPSG codes of a system that is described without them, and how its heights become those of
//! another.

use super::{Across, DEGREE, DatumName, NEAR, SystemMeaning, near};
use crate::io::epsg;

impl SystemMeaning {
    /// True if x and y are angles in degrees.
    pub fn is_in_degrees(&self) -> bool {
        matches!(self.across, Across::Angles(unit) if near(unit, DEGREE, NEAR))
    }

    /// The EPSG codes of systems of x and y that mean the same, heights aside, from the least on.
    pub fn horizontal_codes(&self) -> Vec<u32> {
        let DatumName::Code(datum) = self.datum else { return Vec::new() };
        let flat = SystemMeaning { up: None, ..self.clone() };
        let means = |code: &u32| {
            SystemMeaning::by_code(&format!("EPSG:{code}")).is_some_and(|system| system.is(&flat))
        };
        epsg::systems_on(datum).into_iter().filter(means).collect()
    }

    /// The least EPSG code of the system of its heights; None where it names none, and none inside
    /// where no code is known for them.
    pub fn height_code(&self) -> Option<Option<u32>> {
        let up = self.up.as_ref()?;
        let Some(DatumName::Code(datum)) = &up.datum else { return Some(None) };
        let means =
            |code: &u32| SystemMeaning::of_heights(*code).is_some_and(|system| system.up_is(self));
        Some(epsg::heights_on(*datum).into_iter().find(means))
    }

    /// What a height of the system `from` is multiplied by to be one of the system `to`, both EPSG
    /// codes; None where they differ by more than unit and sign.
    pub fn height_factor(from: u32, to: u32) -> Option<f64> {
        let [from, to] = [from, to].map(|code| SystemMeaning::of_heights(code)?.up);
        let (from, to) = (from?, to?);
        let is_one = from.datum.is_some() && from.datum == to.datum;
        let sign = if from.is_depth == to.is_depth { 1.0 } else { -1.0 };
        is_one.then(|| sign * from.metres / to.metres)
    }

    /// Some system that has the heights `code`.
    fn of_heights(code: u32) -> Option<SystemMeaning> {
        SystemMeaning::by_code(&format!("EPSG:4326+{code}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_without_codes_has_that_of_the_system_that_it_means() {
        let plain = |code: u32, up: Option<u32>| {
            let text = epsg::wkt(code, up).unwrap();
            let mut pieces = text.split(",AUTHORITY[").map(str::to_owned);
            let mut without = pieces.next().unwrap();
            for piece in pieces {
                without += piece.split_once(']').unwrap().1;
            }
            assert!(!without.contains("EPSG"), "{without}");
            SystemMeaning::said(&without).unwrap()
        };
        // 3044 is 25832 with its axes named in the other order.
        let utm = plain(25832, Some(7837));
        assert_eq!(
            (utm.horizontal_codes(), utm.height_code()),
            (vec![3044, 25832], Some(Some(7837)))
        );
        let texas = plain(2277, Some(6360));
        assert_eq!((texas.horizontal_codes(), texas.height_code()), (vec![2277], Some(Some(6360))));
        let degrees = plain(4326, None);
        assert_eq!((degrees.horizontal_codes(), degrees.height_code()), (vec![4326], None));
        assert!(degrees.is_in_degrees() && !utm.is_in_degrees());
    }

    #[test]
    fn heights_of_one_datum_differ_by_unit_and_sign() {
        let factor = SystemMeaning::height_factor;
        assert_eq!(factor(5703, 5703), Some(1.0));
        let feet = factor(6360, 5703).unwrap();
        assert!((feet - 1200.0 / 3937.0).abs() < 1e-15, "{feet}");
        assert!(factor(5703, 6358).unwrap() < 0.0, "depth in feet");
        assert_eq!((factor(5703, 7837), factor(5703, 25832)), (None, None));
    }
}
