//! A machined part: a box with sharp edges, four through holes and a dome, seen evenly from all
//! sides in random order.

use std::f64::consts::PI;

use super::random::{Random, key};
use super::record::{STRIDE, SceneRecord, stored};
use super::truth::Truth;

/// World units of a stored step.
pub const SCALE: f64 = 1e-5;
const PER_UNIT: f64 = 1e5;

/// Half the length and half the width of the box, and its height: 120 × 80 × 30, standing on z = 0
/// around the z axis.
const HALF: [f64; 2] = [60.0, 40.0];
const HEIGHT: f64 = 30.0;
/// Axes and radius of the holes through the box from top to bottom.
const HOLES: [[f64; 2]; 4] = [[-45.0, -25.0], [45.0, -25.0], [-45.0, 25.0], [45.0, 25.0]];
const HOLE_RADIUS: f64 = 6.0;
/// The dome is the cap of a sphere around the z axis: 24 wide from the axis and 16 high, so that it
/// meets the top at a sharp angle.
const DOME_FOOT: f64 = 24.0;
const DOME_HEIGHT: f64 = 16.0;
const DOME_RADIUS: f64 = 26.0;
const DOME_CENTER: f64 = HEIGHT + DOME_HEIGHT - DOME_RADIUS;

/// A face of the part; its place in [`FACES`] is the `UserData` of its points.
#[derive(Debug, Clone, Copy, PartialEq)]
enum PartFace {
    Bottom,
    Top,
    /// Perpendicular to an axis (0 or 1), on its negative or positive side.
    Side(usize, f64),
    Dome,
    Hole(usize),
}

const FACES: [PartFace; 11] = [
    PartFace::Bottom,
    PartFace::Top,
    PartFace::Side(0, -1.0),
    PartFace::Side(0, 1.0),
    PartFace::Side(1, -1.0),
    PartFace::Side(1, 1.0),
    PartFace::Dome,
    PartFace::Hole(0),
    PartFace::Hole(1),
    PartFace::Hole(2),
    PartFace::Hole(3),
];

pub struct PartScene {
    key: u64,
    noise: f64,
    /// Share of the surface up to and with each face.
    shares: [f64; FACES.len()],
}

impl PartScene {
    pub fn new(seed: u64, noise: f64) -> Self {
        let mut sum = 0.0;
        let shares = FACES.map(|face| {
            sum += face.area();
            sum
        });
        PartScene { key: key(seed, 0x71), noise, shares: shares.map(|s| s / sum) }
    }

    /// Makes the points from number `first` on; the noise is the same in every direction, so edges
    /// blur as in a scan.
    pub fn fill(&self, first: u64, records: &mut [u8]) {
        for (bytes, index) in records.chunks_exact_mut(STRIDE).zip(first..) {
            let mut random = Random::new(self.key, index);
            let share = random.unit();
            let number = self.shares.iter().position(|&s| share < s).unwrap_or(FACES.len() - 1);
            let on = FACES[number].sample(&mut random);
            let ([a, b], [c, _]) = (random.gaussians(), random.gaussians());
            let off = [a, b, c];
            let position = std::array::from_fn(|axis| on[axis] + self.noise * off[axis]);
            SceneRecord {
                intensity: 1000,
                user_data: number as u8,
                ..SceneRecord::single(stored(position, PER_UNIT), index as f64 * 1e-6)
            }
            .store(bytes);
        }
    }
}

impl PartFace {
    fn area(self) -> f64 {
        let plan = 4.0 * HALF[0] * HALF[1] - 4.0 * PI * HOLE_RADIUS * HOLE_RADIUS;
        match self {
            PartFace::Bottom => plan,
            PartFace::Top => plan - PI * DOME_FOOT * DOME_FOOT,
            PartFace::Side(axis, _) => 2.0 * HALF[1 - axis] * HEIGHT,
            PartFace::Dome => 2.0 * PI * DOME_RADIUS * DOME_HEIGHT,
            PartFace::Hole(_) => 2.0 * PI * HOLE_RADIUS * HEIGHT,
        }
    }

    /// A point uniform on the face.
    fn sample(self, random: &mut Random) -> [f64; 3] {
        match self {
            PartFace::Bottom | PartFace::Top => loop {
                let plan = HALF.map(|half| random.between(-half, half));
                if self.has(plan) {
                    let z = if self == PartFace::Top { HEIGHT } else { 0.0 };
                    return [plan[0], plan[1], z];
                }
            },
            PartFace::Side(axis, sign) => {
                let mut p = [0.0, 0.0, random.between(0.0, HEIGHT)];
                p[axis] = sign * HALF[axis];
                p[1 - axis] = random.between(-HALF[1 - axis], HALF[1 - axis]);
                p
            }
            PartFace::Dome => {
                // Equal heights of a sphere have equal areas (Archimedes).
                let up = random.between(DOME_RADIUS - DOME_HEIGHT, DOME_RADIUS);
                let out = (DOME_RADIUS * DOME_RADIUS - up * up).sqrt();
                let [cos, sin] = random.direction();
                [out * cos, out * sin, DOME_CENTER + up]
            }
            PartFace::Hole(hole) => {
                let [cos, sin] = random.direction();
                let [x, y] = HOLES[hole];
                [x + HOLE_RADIUS * cos, y + HOLE_RADIUS * sin, random.between(0.0, HEIGHT)]
            }
        }
    }

    /// True if the flat face (top or bottom) is there at this place of the plan.
    fn has(self, plan: [f64; 2]) -> bool {
        let in_hole = HOLES.iter().any(|hole| from_axis(plan, *hole).1 < HOLE_RADIUS);
        let under_dome = self == PartFace::Top && from_axis(plan, [0.0; 2]).1 < DOME_FOOT;
        !in_hole && !under_dome
    }

    /// Distance of `p` to the face and the face's outward normal nearest to it; None where another
    /// face is surely nearer.
    fn truth(self, p: [f64; 3]) -> Option<Truth> {
        let inside = std::array::from_fn(|axis| match axis {
            2 => p[2].clamp(0.0, HEIGHT),
            _ => p[axis].clamp(-HALF[axis], HALF[axis]),
        });
        match self {
            PartFace::Bottom | PartFace::Top => {
                let up = self == PartFace::Top;
                let foot = [inside[0], inside[1], if up { HEIGHT } else { 0.0 }];
                let normal = [0.0, 0.0, if up { 1.0 } else { -1.0 }];
                // Over a hole or the dome, the rim is nearest: it belongs to them too.
                self.has([foot[0], foot[1]]).then(|| Truth { distance: length(p, foot), normal })
            }
            PartFace::Side(axis, sign) => {
                let mut foot: [f64; 3] = inside;
                foot[axis] = sign * HALF[axis];
                let mut normal = [0.0; 3];
                normal[axis] = sign;
                Some(Truth { distance: length(p, foot), normal })
            }
            PartFace::Dome => {
                let center = [0.0, 0.0, DOME_CENTER];
                let from_center = length(p, center);
                let ([cos, sin], out) = from_axis([p[0], p[1]], [0.0; 2]);
                let up = (p[2] - DOME_CENTER) / from_center;
                if up >= (HEIGHT - DOME_CENTER) / DOME_RADIUS {
                    let flat = out / from_center;
                    let normal = [flat * cos, flat * sin, up];
                    return Some(Truth { distance: (from_center - DOME_RADIUS).abs(), normal });
                }
                let rim = [DOME_FOOT * cos, DOME_FOOT * sin, HEIGHT];
                let normal = [rim[0], rim[1], HEIGHT - DOME_CENTER].map(|v| v / DOME_RADIUS);
                Some(Truth { distance: length(p, rim), normal })
            }
            PartFace::Hole(hole) => {
                let [x, y] = HOLES[hole];
                let ([cos, sin], _) = from_axis([p[0], p[1]], [x, y]);
                let foot = [x + HOLE_RADIUS * cos, y + HOLE_RADIUS * sin, inside[2]];
                Some(Truth { distance: length(p, foot), normal: [-cos, -sin, 0.0] })
            }
        }
    }
}

/// Direction (cosine and sine) and distance of `plan` from `axis`; on the axis the direction is +x.
fn from_axis(plan: [f64; 2], axis: [f64; 2]) -> ([f64; 2], f64) {
    let [x, y] = [plan[0] - axis[0], plan[1] - axis[1]];
    let distance = (x * x + y * y).sqrt();
    if distance == 0.0 { ([1.0, 0.0], 0.0) } else { ([x / distance, y / distance], distance) }
}

fn length(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]) * (a[axis] - b[axis])).sum::<f64>().sqrt()
}

/// The distance of `p` to the part's surface and the outward normal of the face nearest to it.
pub fn truth(p: [f64; 3]) -> Option<Truth> {
    let faces = FACES.iter().filter_map(|face| face.truth(p));
    faces.min_by(|a, b| a.distance.total_cmp(&b.distance))
}
