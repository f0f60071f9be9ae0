//! The stage `sample`: some of the points stay, by chance, by their number, or by their distance.

mod cell_table;
mod disc;
mod every;

mod random;

use std::num::NonZeroU64;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::quantity::{Fraction, Length};
use crate::stage::{Role, RoleName, StageKind, StagePlace};
use crate::{Error, Result};

use disc::PoissonDisc;
use every::EveryNth;
use random::RandomSample;

/// Thins a scan without looking at what it shows; give exactly one of three keys.
///
/// With `fraction` each record stays with that probability. What decides is a hash of its
/// coordinates, its other bytes and `seed`, so the same records stay in whatever order, files and
/// parts they come, and records that are the same in every byte stay or go together. Another `seed`
/// chooses others; of two fractions of one seed the smaller chooses some of those of the larger.
///
/// With `every = 10` the records of the input stay whose number, from 0 over all inputs in their
/// order, is a multiple of 10. Stages above that remove points do not change these numbers. The
/// order of the inputs decides, so this stands where points still come in that order: above stages
/// that work on tiles and above branches.
///
/// With `distance` the points that stay are a Poisson disc sample: no two are nearer to each other
/// than the distance, and each that goes is nearer than that to one that stays. Positions are
/// visited by the colours of a checkerboard of cubes whose side is the distance, within a cube in
/// random order by `seed`, so that how a scan is cut into tiles changes nothing. Distances are
/// compared exactly, in lattice steps. Copies of a position weigh as one, and one record of them
/// stays.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Sample {
    /// The part of the records that stays, by chance: above 0 and at most 1, or as "10%".
    pub fraction: Option<Fraction>,
    /// Every n-th record of the input stays, the first one included.
    pub every: Option<NonZeroU64>,
    /// How near to each other no two points may stay.
    pub distance: Option<Length>,
    /// Of `fraction` and `distance`: which of all random choices is made; none: 0.
    pub seed: Option<u64>,
}

impl Sample {
    /// The stage in the role that its key has, or the key to blame and why.
    fn role(self) -> Result<Role, (&'static str, Error)> {
        let Sample { fraction, every, distance, seed } = self;
        let number = seed.unwrap_or(0);
        match (fraction, every, distance) {
            (Some(fraction), None, None) => {
                Ok(Role::Transform(Box::new(RandomSample::new(fraction, number))))
            }
            (None, Some(_), None) if seed.is_some() => {
                let told = "`sample.seed` is for random choices, and `sample.every` makes none";
                Err(("seed", Error::pipeline(told).help("leave `sample.seed` out")))
            }
            (None, Some(every), None) => Ok(Role::Transform(Box::new(EveryNth(every)))),
            (None, None, Some(distance)) => {
                Ok(Role::TileOp(Box::new(PoissonDisc::new(distance, number))))
            }
            _ => {
                let given = [
                    ("fraction", fraction.is_some()),
                    ("every", every.is_some()),
                    ("distance", distance.is_some()),
                ];
                let given: Vec<&str> =
                    given.iter().filter(|(_, is_given)| *is_given).map(|(key, _)| *key).collect();
                let told = match given.len() {
                    0 => "`sample` does not say which points stay".to_owned(),
                    _ => format!("`sample` takes one of its keys, not {}", given.join(" and ")),
                };
                let help = "give one of `sample.fraction = \"10%\"`, `sample.every = 10` and \
                            `sample.distance = 0.5`";
                Err((given.last().copied().unwrap_or("fraction"), Error::pipeline(told).help(help)))
            }
        }
    }
}

impl StageKind for Sample {
    const KIND: &'static str = "sample";
    const ABOUT: &'static str =
        "Keeps some of the points: by chance, by their number, or so far from each other.";
    const ROLE: RoleName = RoleName::OnTiles;
    const EITHER: &'static [&'static str] = &["fraction", "every", "distance"];

    fn build(self, at: &StagePlace) -> Result<Role> {
        self.role().map_err(|(key, error)| at.blame(key, error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blamed(text: &str) -> Option<&'static str> {
        toml::from_str::<Sample>(text).unwrap().role().err().map(|(key, _)| key)
    }

    #[test]
    fn exactly_one_way_to_choose_is_given() {
        for (text, key) in [
            ("fraction = '10%'", None),
            ("fraction = 0.25\nseed = 3", None),
            ("every = 10", None),
            ("distance = '5 cm'\nseed = 1", None),
            ("", Some("fraction")),
            ("seed = 1", Some("fraction")),
            ("every = 10\nseed = 1", Some("seed")),
            ("every = 10\nfraction = 1", Some("every")),
            ("every = 10\ndistance = 1", Some("distance")),
        ] {
            assert_eq!(blamed(text), key, "{text}");
        }
        for wrong in ["every = 0", "every = -1", "distance = 0", "fraction = 0", "part = 1"] {
            assert!(toml::from_str::<Sample>(wrong).is_err(), "{wrong}");
        }
    }
}
