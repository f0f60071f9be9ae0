//! What can be scanned, by name, and the true surfaces of it.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::truth::Truth;
use super::{part, plane, relief, sphere};
use crate::{Error, Result};

/// What is scanned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Scene {
    /// A tilted square plane, 400 points a square unit of its plan, in random order.
    Plane,
    /// A machined part, a box of 120 × 80 × 30 with four through holes and a dome, from all sides:
    /// sharp edges, even by area, in random order. `UserData` is the number of the face.
    Part,
    /// A sphere of radius 50 around world 0, even by area, in random order. `UserData` is the
    /// number of the octant: 1, 2 and 4 for negative x, y and z.
    Sphere,
    /// The paper's experiment: squares of 60 × 60 pixels at random places of a window of 1200 ×
    /// 1600, projected on the `front` of an object of 120 × 160 mm, a point for each. The objects
    /// are ours, the paper names none. `UserData` is the number of the face.
    SquaresRandom,
    /// The same with the squares on a grid, 60 pixels apart and 520 a run, each run 2 pixels
    /// further in x; after 30 runs also 2 pixels lower. `PointSourceId` is the number of the run.
    /// After 468,000 points all places are taken and come again with other noise.
    SquaresUniform,
    /// An airborne scan in metres: ground (class 2), trees (5) and gabled roofs (6) in overlapping
    /// strips, about 10 points a square metre, in the order of acquisition.
    Als,
}

impl Scene {
    /// All scenes.
    pub const ALL: [Scene; 6] = [
        Scene::Plane,
        Scene::Part,
        Scene::Sphere,
        Scene::SquaresRandom,
        Scene::SquaresUniform,
        Scene::Als,
    ];

    /// The word for it in pipelines and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Scene::Plane => "plane",
            Scene::Part => "part",
            Scene::Sphere => "sphere",
            Scene::SquaresRandom => "squares-random",
            Scene::SquaresUniform => "squares-uniform",
            Scene::Als => "als",
        }
    }

    /// Standard deviation of the noise unless told otherwise, in world units: across the surface
    /// (`plane`, `sphere`), in every direction (`part`), in depth (squares) or in height (`als`).
    pub fn default_noise(self) -> f64 {
        match self {
            Scene::Plane => 0.005,
            Scene::Part | Scene::Sphere => 0.02,
            Scene::SquaresRandom | Scene::SquaresUniform => 0.1,
            Scene::Als => 0.025,
        }
    }

    /// The true surface nearest to the world coordinates `p`, where it has a closed form (all
    /// but `als`); of projected squares that of the front `relief`.
    pub fn truth(self, p: [f64; 3]) -> Option<Truth> {
        match self {
            Scene::Plane => Some(plane::truth(p)),
            Scene::Part => part::truth(p),
            Scene::Sphere => Some(sphere::truth(p)),
            Scene::SquaresRandom | Scene::SquaresUniform => relief::truth(p),
            Scene::Als => None,
        }
    }
}

impl fmt::Display for Scene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Scene {
    type Err = Error;

    /// The scene of that name. Error: no scene has it.
    fn from_str(name: &str) -> Result<Scene> {
        Scene::ALL.into_iter().find(|scene| scene.name() == name).ok_or_else(|| {
            let names = Scene::ALL.map(Scene::name).join(", ");
            Error::pipeline(format!("there is no scene {name:?}"))
                .help(format!("the scenes are {names}"))
        })
    }
}
