//! A sphere, seen evenly from all sides in random order: the surface whose normals are known best.

use super::random::{Random, key};
use super::record::{STRIDE, SceneRecord, stored};
use super::truth::Truth;

/// World units of a stored step.
pub const SCALE: f64 = 1e-5;
const PER_UNIT: f64 = 1e5;
/// The sphere is around world 0.
const RADIUS: f64 = 50.0;

pub struct SphereScene {
    key: u64,
    noise: f64,
}

impl SphereScene {
    pub fn new(seed: u64, noise: f64) -> Self {
        SphereScene { key: key(seed, 0x73), noise }
    }

    /// Makes the points from number `first` on; the noise is along the normal.
    pub fn fill(&self, first: u64, records: &mut [u8]) {
        for (bytes, index) in records.chunks_exact_mut(STRIDE).zip(first..) {
            let mut random = Random::new(self.key, index);
            let normal = normal(&mut random);
            let out = RADIUS + self.noise * random.gaussians()[0];
            let octant = (0..3).map(|axis| u8::from(normal[axis] < 0.0) << axis).sum();
            SceneRecord {
                intensity: 1000,
                user_data: octant,
                ..SceneRecord::single(
                    stored(normal.map(|v| v * out), PER_UNIT),
                    index as f64 * 1e-6,
                )
            }
            .store(bytes);
        }
    }
}

/// A direction uniform on the sphere: equal heights have equal areas (Archimedes).
fn normal(random: &mut Random) -> [f64; 3] {
    let up = random.between(-1.0, 1.0);
    let out = (1.0 - up * up).sqrt();
    let [cos, sin] = random.direction();
    [out * cos, out * sin, up]
}

/// The distance of `p` to the sphere and the outward normal there; in the centre the normal is +z.
pub fn truth(p: [f64; 3]) -> Truth {
    let out = p.iter().map(|v| v * v).sum::<f64>().sqrt();
    let normal = if out > 0.0 { p.map(|v| v / out) } else { [0.0, 0.0, 1.0] };
    Truth { distance: (out - RADIUS).abs(), normal }
}
