//! A tilted plane, seen evenly in random order.

use super::random::{Random, key};
use super::record::{STRIDE, SceneRecord, stored};
use super::truth::Truth;

/// World units of a stored step.
pub const SCALE: f64 = 1e-4;
const PER_UNIT: f64 = 1e4;
/// Points per square unit of the plan.
const DENSITY: f64 = 400.0;
/// Rise along x and along y.
const SLOPE: [f64; 2] = [0.25, 0.125];

/// z = x / 4 + y / 8 over a square from the origin, as large as the points fill.
pub struct PlaneScene {
    key: u64,
    side: f64,
    noise: f64,
}

impl PlaneScene {
    pub fn new(points: u64, seed: u64, noise: f64) -> Self {
        PlaneScene { key: key(seed, 0x70), side: (points as f64 / DENSITY).sqrt(), noise }
    }

    /// Makes the points from number `first` on; the noise is their distance from the plane.
    pub fn fill(&self, first: u64, records: &mut [u8]) {
        let normal = normal();
        for (bytes, index) in records.chunks_exact_mut(STRIDE).zip(first..) {
            let mut random = Random::new(self.key, index);
            let [x, y] = [self.side * random.unit(), self.side * random.unit()];
            let off = self.noise * random.gaussians()[0];
            let on = [x, y, SLOPE[0] * x + SLOPE[1] * y];
            let position = std::array::from_fn(|axis| on[axis] + off * normal[axis]);
            SceneRecord {
                intensity: 1000,
                ..SceneRecord::single(stored(position, PER_UNIT), index as f64 * 1e-6)
            }
            .store(bytes);
        }
    }
}

fn normal() -> [f64; 3] {
    let length = (SLOPE[0] * SLOPE[0] + SLOPE[1] * SLOPE[1] + 1.0).sqrt();
    [-SLOPE[0] / length, -SLOPE[1] / length, 1.0 / length]
}

/// The distance of `p` to the plane and its upward normal.
pub fn truth(p: [f64; 3]) -> Truth {
    let normal = normal();
    let height: f64 = (0..3).map(|axis| p[axis] * normal[axis]).sum();
    Truth { distance: height.abs(), normal }
}
