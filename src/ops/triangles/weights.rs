//! What a triangle tells: the curvature at its corners, and its interior angles.

use crate::geom::plane::dot;

/// The vector from one place to another.
pub(super) fn from_to(p: [f64; 3], q: [f64; 3]) -> [f64; 3] {
    [q[0] - p[0], q[1] - p[1], q[2] - p[2]]
}

/// The normal of a triangle that runs counter-clockwise, as long as twice its area.
pub(super) fn normal(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> [f64; 3] {
    let (u, v) = (from_to(a, b), from_to(a, c));
    [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
}

/// The root mean square of the normal curvatures of a place towards its neighbours, `normal` being
/// that of its triangles, of any length; 0 without one.
pub(super) fn curvature(
    p: [f64; 3],
    normal: [f64; 3],
    neighbors: impl Iterator<Item = [f64; 3]>,
) -> f64 {
    let length = dot(normal, normal).sqrt();
    let (mut squares, mut count) = (0.0, 0);
    for q in neighbors {
        let along = from_to(p, q);
        let curvature = 2.0 * dot(normal, along) / (length * dot(along, along));
        squares += curvature * curvature;
        count += 1;
    }
    let mean = (squares / f64::from(count)).sqrt();
    if mean.is_finite() { mean } else { 0.0 }
}

/// The smallest angle of a triangle, in radians, times its perimeter.
pub(super) fn size(corners: [[f64; 3]; 3]) -> f64 {
    let side = |n: usize| from_to(corners[n], corners[(n + 1) % 3]);
    let sides = [side(0), side(1), side(2)];
    let lengths = sides.map(|side| dot(side, side).sqrt());
    let angle = |n: usize| {
        let before = (n + 2) % 3;
        let cosine = -dot(sides[n], sides[before]) / (lengths[n] * lengths[before]);
        libm::acos(cosine.clamp(-1.0, 1.0))
    };
    let smallest = angle(0).min(angle(1)).min(angle(2));
    smallest * lengths.iter().sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curvature_is_that_of_a_sphere_and_none_on_a_plane() {
        // Neighbours on a sphere of radius 5 around the origin, seen from its top.
        let ring = |count: usize| {
            (0..count).map(move |n| {
                let (sin, cos) = (n as f64).sin_cos();
                [3.0 * cos, 3.0 * sin, 4.0]
            })
        };
        let found = curvature([0.0, 0.0, 5.0], [0.0, 0.0, 7.0], ring(8));
        assert!((found - 0.2).abs() < 1e-12, "{found}");
        let flat = ring(8).map(|[x, y, _]| [x, y, 5.0]);
        assert_eq!(curvature([0.0, 0.0, 5.0], [0.0, 0.0, 1.0], flat), 0.0);
        assert_eq!(curvature([0.0; 3], [0.0; 3], ring(3)), 0.0);
    }

    #[test]
    fn a_small_angle_makes_a_triangle_small() {
        let even = size([[0.0; 3], [1.0, 0.0, 0.0], [0.5, 0.75f64.sqrt(), 0.0]]);
        assert!((even - std::f64::consts::PI).abs() < 1e-12, "60 degrees by a perimeter of 3");
        assert!(size([[0.0; 3], [1.0, 0.0, 0.0], [0.5, 0.01, 0.0]]) < 0.05);
        assert_eq!(normal([0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]), [0.0, 0.0, 2.0]);
    }
}
