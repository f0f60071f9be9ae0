//! What the squares of the paper's experiment may be projected on, and what goes wrong on the way:
//! the paper tells neither its object nor its noise, so that both can be chosen.

use std::f64::consts::TAU;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::random::Random;
use super::relief;

/// Radius of the sphere that the cap is of, and the middle of the window, in millimetres.
const RADIUS: f64 = 150.0;
const MIDDLE: [f64; 2] = [relief::WIDTH / 2.0, relief::LENGTH / 2.0];
/// Height of the step, in millimetres.
const STEP: f64 = 10.0;
/// How far outliers are from the front, at least and at most, in millimetres.
const FAR: [f64; 2] = [10.0, 60.0];
/// `UserData` of a far outlier.
pub const OUTLIER: u8 = 255;

/// What squares are projected on, 120 × 160 mm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Front {
    /// Two planes that meet in an edge at 7 degrees, and a dome of 6 mm.
    #[default]
    Relief,
    /// A tilted plane.
    Plane,
    /// A cap of a sphere of radius 150 mm.
    Cap,
    /// Two planes, one 10 mm above the other.
    Step,
    /// A free-form surface: waves of 80 and 60 mm, up to 9 mm high.
    Freeform,
}

/// Where noise goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum NoiseIn {
    /// Along z alone.
    #[default]
    Depth,
    /// Along x, y and z, of each as much.
    Space,
}

/// How squares are projected and seen.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SquaresProjection {
    /// On what.
    pub front: Front,
    /// Where noise goes.
    pub noise_in: NoiseIn,
    /// The share of points that are far from the front, 0 to 1: 10 to 60 mm above or below it.
    /// Their `UserData` is 255.
    pub outliers: f64,
}

impl Front {
    /// The number of the face at this place of the plan, and its height there.
    pub fn height(self, [x, y]: [f64; 2]) -> (u8, f64) {
        match self {
            Front::Relief => {
                let (face, height) = relief::height([x, y]);
                (face as u8, height)
            }
            Front::Plane => (0, 0.1 * x + 0.05 * y),
            Front::Cap => {
                let (u, v) = (x - MIDDLE[0], y - MIDDLE[1]);
                (0, (RADIUS * RADIUS - u * u - v * v).sqrt() - RADIUS)
            }
            Front::Step => match x < MIDDLE[0] {
                true => (0, 0.0),
                false => (1, STEP),
            },
            Front::Freeform => {
                let wave = |along: f64, length: f64| libm::sin(TAU * along / length);
                let cross = libm::cos(TAU * y / 100.0);
                (0, 6.0 * wave(x, 80.0) * cross + 3.0 * wave(x + y, 60.0))
            }
        }
    }
}

impl SquaresProjection {
    /// The face and the position of a point whose square is at this place of the plan, seen with
    /// that much noise.
    pub fn point(&self, plan: [f64; 2], noise: f64, random: &mut Random) -> (u8, [f64; 3]) {
        let (mut face, height) = self.front.height(plan);
        let [deep, right] = random.gaussians();
        let mut position = [plan[0], plan[1], height + noise * deep];
        if self.noise_in == NoiseIn::Space {
            position[0] += noise * right;
            position[1] += noise * random.gaussians()[0];
        }
        // No number is drawn where there are none: scans without outliers are as they ever were.
        if self.outliers > 0.0 && random.unit() < self.outliers {
            let side = if random.unit() < 0.5 { -1.0 } else { 1.0 };
            position[2] += side * random.between(FAR[0], FAR[1]);
            face = OUTLIER;
        }
        (face, position)
    }
}

#[cfg(test)]
mod tests {
    use super::super::random::key;
    use super::*;

    #[test]
    fn every_front_has_a_height_all_over_the_window() {
        for front in [Front::Relief, Front::Plane, Front::Cap, Front::Step, Front::Freeform] {
            let mut heights = (f64::INFINITY, f64::NEG_INFINITY);
            for x in 0..=120 {
                for y in 0..=160 {
                    let (_, z) = front.height([f64::from(x), f64::from(y)]);
                    heights = (heights.0.min(z), heights.1.max(z));
                }
            }
            let range = heights.1 - heights.0;
            assert!((5.0..50.0).contains(&range), "{front:?}: {heights:?}");
        }
    }

    #[test]
    fn noise_and_outliers_are_where_they_are_asked_for() {
        let points = |projection: SquaresProjection| {
            (0..4000)
                .map(move |n| projection.point([60.0, 80.0], 0.2, &mut Random::new(key(1, 2), n)))
        };
        let plane = SquaresProjection { front: Front::Plane, ..SquaresProjection::default() };
        assert!(points(plane).all(|(_, p)| p[..2] == [60.0, 80.0] && (p[2] - 10.0).abs() < 2.0));
        let space = SquaresProjection { noise_in: NoiseIn::Space, ..plane };
        for axis in 0..3 {
            let at = [60.0, 80.0, 10.0][axis];
            let squares: f64 = points(space).map(|(_, p)| (p[axis] - at).powi(2)).sum();
            assert!(((squares / 4000.0).sqrt() - 0.2).abs() < 0.01, "axis {axis}");
        }
        let far = SquaresProjection { outliers: 0.1, ..plane };
        let outliers = points(far).filter(|(face, _)| *face == OUTLIER);
        let count = outliers.inspect(|(_, p)| assert!((p[2] - 10.0).abs() > 9.0)).count();
        assert!((300..500).contains(&count), "{count}");
    }
}
