//! The stage `synth`.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, de};

use super::front::{Front, NoiseIn, SquaresProjection};
use super::scene::Scene;
use super::synthetic::Synthetic;
use crate::Result;
use crate::stage::{Role, RoleName, StageKind, StagePlace};

/// A source that needs no file: for trying, for tests, and to see what a setting does where the
/// truth is known. It streams at any size, and equal keys give equal bytes on every machine.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Synth {
    /// What is scanned.
    pub scene: Scene,
    /// How many points.
    pub points: u64,
    /// Equal seeds give equal scans.
    #[serde(default)]
    pub seed: u64,
    /// Standard deviation of the noise in world units; none: the scene's own.
    #[serde(default, deserialize_with = "some_length")]
    #[schemars(range(min = 0))]
    pub noise: Option<f64>,
    /// What squares are projected on.
    #[serde(default, skip_serializing_if = "is_default")]
    pub front: Front,
    /// Of projected squares: where their noise goes.
    #[serde(default, skip_serializing_if = "is_default")]
    pub noise_in: NoiseIn,
    /// Of projected squares: the share of points that are far from the front, 0 to 1: 10 to 60 mm
    /// above or below it. Their `UserData` is 255.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(range(min = 0, max = 1))]
    pub outliers: f64,
}

/// A plane without points: what is not said of a scan.
impl Default for Synth {
    fn default() -> Self {
        let Synthetic { scene, points, seed, noise, projection } = Synthetic::default();
        let SquaresProjection { front, noise_in, outliers } = projection;
        Synth { scene, points, seed, noise, front, noise_in, outliers }
    }
}

impl StageKind for Synth {
    const KIND: &'static str = "synth";
    const ROLE: RoleName = RoleName::Source;
    const ABOUT: &'static str = "Makes a synthetic scan: of a simple surface, a machine part, \
                                 projected squares or a landscape.";
    const MAIN: Option<&'static str> = Some("scene");

    fn build(self, _at: &StagePlace) -> Result<Role> {
        let Synth { scene, points, seed, noise, front, noise_in, outliers } = self;
        let projection = SquaresProjection { front, noise_in, outliers };
        Ok(Role::Source(Box::new(Synthetic { scene, points, seed, noise, projection })))
    }
}

/// True for what most scenes have no use for: reports name it where it is given.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

fn some_length<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    let length = f64::deserialize(from)?;
    match length.is_finite() && length >= 0.0 {
        true => Ok(Some(length)),
        false => Err(de::Error::invalid_value(de::Unexpected::Float(length), &"a number from 0")),
    }
}
