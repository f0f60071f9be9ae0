//! What z is multiplied by so that distances mean something, from the units of a scan and the
//! `[run]` settings.

use crate::graph::{MixedUnits, RunSettings, ZScale};
use crate::point::{Mismatch, Units};
use crate::quantity::Figure;
use crate::{Error, ErrorKind, Result};

/// What z is multiplied by on a scan's lattice, and why that may be wrong.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    /// The factor.
    pub factor: f64,
    /// What the user is to be warned of.
    pub doubt: Option<String>,
}

impl RunSettings {
    /// What z is multiplied by on the lattice of a scan in `units`.
    ///
    /// # Errors
    ///
    /// Units that do not match and that neither a factor nor an override answers, and `auto` where
    /// no factor makes them match or not both units are known.
    pub(crate) fn stretch(&self, units: Units) -> crate::Result<Stretch> {
        let certain = |factor| Ok(Stretch { factor, doubt: None });
        let mismatch = match (self.z_scale, self.units) {
            (Some(ZScale::Factor(factor)), _) => return certain(factor),
            (None, MixedUnits::Ignore) => return certain(1.0),
            _ => units.mismatch(),
        };
        let auto = self.z_scale == Some(ZScale::Auto);
        match mismatch {
            None if auto => known(units).and_then(|()| certain(1.0)),
            None => {
                let doubt = units.doubt().map(|doubt| {
                    format!(
                        "{doubt}; z is measured in the unit of x and y: give `run.z_scale = 1` if \
                         that is right, or the factor that brings z there"
                    )
                });
                Ok(Stretch { factor: 1.0, doubt })
            }
            Some(Mismatch { z_scale: Some(factor), .. }) if auto => certain(factor),
            Some(Mismatch { message, z_scale: Some(factor) }) => {
                Err(Error::new(ErrorKind::Data, message).help(format!(
                    "give `run.z_scale = \"auto\"`, which measures with z times {}, or \
                     `run.z_scale = 1` if the reference system is wrong; records keep their z",
                    Figure(factor)
                )))
            }
            Some(Mismatch { message, z_scale: None }) => Err(Error::new(ErrorKind::Data, message)
                .help(
                    "project the scan to metres first, or give `run.z_scale` a factor (1 if the \
                     reference system is wrong)",
                )),
        }
    }
}

/// Refuses to find a factor by units that are not both known.
fn known(units: Units) -> Result<()> {
    if units.horizontal.is_some() && units.vertical.is_some() {
        return Ok(());
    }
    let told = format!(
        "`run.z_scale = \"auto\"` needs to know the units; those of the scan: {}",
        units.words()
    );
    Err(Error::new(ErrorKind::Data, told).help(
        "give `run.z_scale = 1` if z is in the unit of x and y, else the factor that brings it \
         there, such as 0.3048 for feet above metres",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point::Horizontal;

    #[test]
    fn units_that_differ_need_a_factor_or_an_override() {
        let metres = Some(Horizontal::Metres(1.0));
        let feet = Units { horizontal: metres, vertical: Some(0.3048), ..Units::default() };
        let degrees = Units { horizontal: Some(Horizontal::Degrees), ..Units::default() };
        let with = |z_scale, units| RunSettings { z_scale, units, ..RunSettings::default() };
        let factor = |settings: RunSettings, units| settings.stretch(units).unwrap().factor;
        let (refuse, ignore) = (MixedUnits::Refuse, MixedUnits::Ignore);
        let none = with(None, refuse);
        let told = none.stretch(feet).unwrap_err();
        assert!(told.remedy().unwrap().contains("times 0.3048"), "{told:?}");
        assert!(none.stretch(degrees).unwrap_err().remedy().unwrap().contains("project"));
        let auto = with(Some(ZScale::Auto), refuse);
        assert_eq!(factor(auto.clone(), feet), 0.3048);
        assert!(auto.stretch(degrees).is_err());
        for units in [feet, degrees] {
            assert_eq!(factor(with(None, ignore), units), 1.0);
            assert_eq!(factor(with(Some(ZScale::Factor(2.0)), refuse), units), 2.0);
        }
    }

    #[test]
    fn units_that_are_not_known_are_doubted_and_auto_refuses_them() {
        let of = |horizontal| Units { horizontal, ..Units::default() };
        let foot = of(Some(Horizontal::Metres(0.3048)));
        let metre = of(Some(Horizontal::Metres(1.0)));
        let with = |z_scale| RunSettings { z_scale, ..RunSettings::default() };
        for (units, doubted) in [(Units::default(), false), (metre, false), (foot, true)] {
            let Stretch { factor, doubt } = with(None).stretch(units).unwrap();
            assert_eq!((factor, doubt.is_some()), (1.0, doubted), "{doubt:?}");
            let told = with(Some(ZScale::Auto)).stretch(units).unwrap_err();
            assert!(told.to_string().ends_with("not known"), "{told}");
            let given = with(Some(ZScale::Factor(1.0))).stretch(units).unwrap();
            assert_eq!(given, Stretch { factor: 1.0, doubt: None });
        }
        let both = Units { vertical: Some(1.0), ..metre };
        assert_eq!(with(Some(ZScale::Auto)).stretch(both).unwrap().factor, 1.0);
    }
}
