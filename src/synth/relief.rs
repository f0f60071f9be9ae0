//! The front of a test object as a projector sees it: a plane, an edge behind which a second plane
//! falls off, and a dome that meets the first plane at an angle. Nothing of it is hidden from the
//! front, so every place of the plan has one height.

use super::truth::Truth;

/// Width (along x) and length (along y) from world 0, in millimetres.
pub const WIDTH: f64 = 120.0;
pub const LENGTH: f64 = 160.0;
/// The edge runs along y here; left of it the height is 0.
const EDGE: f64 = 80.0;
/// Fall of the second plane per millimetre of x: about 7°, more than the angle that a cell may
/// span.
const FALL: f64 = 0.125;
/// Axis of the dome, radius of its foot, its height, and the radius and the centre of its sphere
/// (30² + 72² = 78²): it meets the plane at about 23°.
const DOME: [f64; 2] = [40.0, 80.0];
const FOOT: f64 = 30.0;
const RADIUS: f64 = 78.0;
const CENTER: [f64; 3] = [DOME[0], DOME[1], -72.0];

/// A face of the relief; its number is the `UserData` of its points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Face {
    Plane = 0,
    Slope = 1,
    Dome = 2,
}

/// The face at this place of the plan and its height there.
pub fn height(plan: [f64; 2]) -> (Face, f64) {
    let square = from_dome(plan);
    if square < FOOT * FOOT {
        (Face::Dome, CENTER[2] + (RADIUS * RADIUS - square).sqrt())
    } else if plan[0] > EDGE {
        (Face::Slope, -FALL * (plan[0] - EDGE))
    } else {
        (Face::Plane, 0.0)
    }
}

/// The distance of `p` to the relief and the normal of the face nearest to it, towards the front.
/// None for coordinates that are no numbers.
pub fn truth(p: [f64; 3]) -> Option<Truth> {
    let faces = [plane(p), Some(slope(p)), Some(dome(p))];
    let least = faces.into_iter().flatten().min_by(|a, b| a.distance.total_cmp(&b.distance));
    least.filter(|truth| truth.distance.is_finite())
}

/// None over the dome: its foot, which is nearest then, is the dome's too.
fn plane(p: [f64; 3]) -> Option<Truth> {
    let foot = [p[0].clamp(0.0, EDGE), p[1].clamp(0.0, LENGTH), 0.0];
    let there = from_dome([foot[0], foot[1]]) >= FOOT * FOOT;
    there.then(|| Truth { distance: distance(p, foot), normal: [0.0, 0.0, 1.0] })
}

fn slope(p: [f64; 3]) -> Truth {
    let normal = slope_normal();
    // Along the fall from the edge: (1, 0, -FALL), as long as 1 / normal[2].
    let down = ((p[0] - EDGE) - FALL * p[2]) * normal[2] * normal[2];
    let down = down.clamp(0.0, WIDTH - EDGE);
    let foot = [EDGE + down, p[1].clamp(0.0, LENGTH), -FALL * down];
    Truth { distance: distance(p, foot), normal }
}

fn slope_normal() -> [f64; 3] {
    let length = (FALL * FALL + 1.0).sqrt();
    [FALL / length, 0.0, 1.0 / length]
}

fn dome(p: [f64; 3]) -> Truth {
    let from = distance(p, CENTER);
    let up = p[2] - CENTER[2];
    if up > 0.0 && up * RADIUS >= -CENTER[2] * from {
        let normal = std::array::from_fn(|axis| (p[axis] - CENTER[axis]) / from);
        return Truth { distance: (from - RADIUS).abs(), normal };
    }
    let out = from_dome([p[0], p[1]]).sqrt();
    let toward =
        if out > 0.0 { [(p[0] - DOME[0]) / out, (p[1] - DOME[1]) / out] } else { [1.0, 0.0] };
    let rim = [DOME[0] + FOOT * toward[0], DOME[1] + FOOT * toward[1], 0.0];
    let normal = [FOOT * toward[0], FOOT * toward[1], -CENTER[2]].map(|v| v / RADIUS);
    Truth { distance: distance(p, rim), normal }
}

/// Squared distance from the axis of the dome.
fn from_dome(plan: [f64; 2]) -> f64 {
    let [x, y] = [plan[0] - DOME[0], plan[1] - DOME[1]];
    x * x + y * y
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]) * (a[axis] - b[axis])).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_surface_is_where_its_heights_are() {
        let mut faces = [0; 3];
        for x in 0..=240 {
            for y in 0..=320 {
                let plan = [f64::from(x) / 2.0, f64::from(y) / 2.0];
                let (face, z) = height(plan);
                faces[face as usize] += 1;
                let truth = truth([plan[0], plan[1], z]).unwrap();
                assert!(truth.distance < 1e-9, "{plan:?}: {truth:?}");
            }
        }
        assert!(faces.iter().all(|&n| n > 5000), "{faces:?}");
    }

    #[test]
    fn distances_and_normals_are_those_of_the_nearest_face() {
        let near = |p, distance: f64, normal: [f64; 3]| {
            let truth = truth(p).unwrap();
            assert!((truth.distance - distance).abs() < 1e-9, "{p:?}: {truth:?}");
            let apart = (0..3).map(|axis| (truth.normal[axis] - normal[axis]).abs()).sum::<f64>();
            assert!(apart < 1e-9, "{p:?}: {truth:?}");
        };
        near([5.0, 20.0, 0.5], 0.5, [0.0, 0.0, 1.0]);
        near([-3.0, 164.0, 0.0], 5.0, [0.0, 0.0, 1.0]);
        near([40.0, 80.0, 6.25], 0.25, [0.0, 0.0, 1.0]);
        let fall = slope_normal();
        near([100.0 + fall[0], 50.0, -2.5 + fall[2]], 1.0, fall);
        // A step out of the dome along its normal.
        let normal = [0.28, 0.0, 0.96];
        near([40.0 + 79.0 * 0.28, 80.0, -72.0 + 79.0 * 0.96], 1.0, normal);
        assert_eq!(truth([f64::NAN, 0.0, 0.0]), None);
    }

    #[test]
    fn neighbouring_places_differ_little_in_height() {
        for step in 0..12_000 {
            let at = |x| height([f64::from(x) / 100.0, 80.0]).1;
            assert!((at(step) - at(step + 1)).abs() < 0.006, "a gap at {step}");
        }
    }
}
