//! Height functions of degree 2 and 3 over a first estimate of the normal, by least squares.
//!
//! The frame has its origin in the point and the first estimate as z axis, so that what the surface
//! does at the point is in two coefficients: its slopes along x and y. Lengths are divided by a
//! power of two about the size of the neighbourhood, and each power of x and y by its own length
//! over all positions: what is left of a column of the system beside those before it is then the
//! sine of an angle, and says how well the coefficient is determined.

use nalgebra::{Cholesky, SMatrix, SVector};

use crate::geom::plane::{across, dot, unit};
use crate::geom::simd::Real;

/// A coefficient is not determined where its column of the system is within this angle, in radians,
/// of those before it. Noise of the heights is multiplied by up to the inverse; what two roundings
/// of f64 leave of it stays far below f32.
const SMALLEST_ANGLE: f64 = 1e-4;

/// A surface fitted to a neighbourhood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FittedHeight {
    /// Its unit normal at the point.
    pub normal: [f64; 3],
    /// Root mean square of what the heights are off, in steps.
    pub residual: f64,
}

/// 1, x, y, x², xy, y².
pub(super) fn quadric(x: f64, y: f64) -> [f64; 6] {
    [1.0, x, y, x * x, x * y, y * y]
}

/// 1, x, y, x², xy, y², x³, x²y, xy², y³.
pub(super) fn cubic(x: f64, y: f64) -> [f64; 10] {
    let (xx, yy) = (x * x, y * y);
    [1.0, x, y, xx, x * y, yy, xx * x, xx * y, x * yy, yy * y]
}

/// Fits a height function, a sum of `powers` of which the first three are 1, x and y, over the unit
/// vector `first` to a point and its neighbours at `offsets`, in steps. None where the positions do
/// not determine it.
pub(super) fn fitted<const N: usize>(
    powers: fn(f64, f64) -> [f64; N],
    offsets: &[[i64; 3]],
    first: [f64; 3],
) -> Option<FittedHeight> {
    if offsets.len() + 1 < N {
        return None;
    }
    let (u, v) = across(first);
    let local = |o: &[i64; 3]| {
        let o = o.map(|c| c as f64);
        [dot(o, u), dot(o, v), dot(o, first)]
    };
    let widest = |widest: f64, [x, y, _]: [f64; 3]| widest.max(x.abs()).max(y.abs());
    let size = offsets.iter().map(local).fold(0.0, widest);
    if size == 0.0 {
        return None;
    }
    let scale = size.power();
    let rows = || {
        let neighbors = offsets.iter().map(local).map(|p| p.map(|c| c / scale));
        [[0.0; 3]].into_iter().chain(neighbors)
    };
    let (mut gram, mut heights) = (SMatrix::<f64, N, N>::zeros(), SVector::<f64, N>::zeros());
    for [x, y, z] in rows() {
        let row = powers(x, y);
        for i in 0..N {
            heights[i] += row[i] * z;
            for j in 0..=i {
                gram[(i, j)] += row[i] * row[j];
            }
        }
    }
    let lengths = SVector::<f64, N>::from_fn(|i, _| gram[(i, i)].sqrt());
    if lengths.iter().any(|length| *length == 0.0) {
        return None;
    }
    for i in 0..N {
        heights[i] /= lengths[i];
        for j in 0..=i {
            gram[(i, j)] /= lengths[i] * lengths[j];
        }
    }
    let factor = Cholesky::new(gram)?;
    let left = factor.l_dirty().diagonal();
    if left.iter().any(|sine| sine.is_nan() || *sine <= SMALLEST_ANGLE) {
        return None;
    }
    let mut found = factor.solve(&heights);
    found.component_div_assign(&lengths);
    let off = |[x, y, z]: [f64; 3]| {
        let row = powers(x, y);
        (0..N).fold(z, |z, i| z - found[i] * row[i])
    };
    let squares: f64 = rows().map(|p| off(p).powi(2)).sum();
    let slopes = [found[1], found[2]];
    let normal = [0, 1, 2].map(|axis| first[axis] - slopes[0] * u[axis] - slopes[1] * v[axis]);
    let residual = (squares / (offsets.len() + 1) as f64).sqrt() * scale;
    Some(FittedHeight { normal: unit(normal)?, residual })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::hash::of_position;

    /// A unit vector that is none of the axes.
    fn tilted() -> [f64; 3] {
        unit([0.3, -0.5, 0.9]).unwrap()
    }

    /// Positions of the surface z = f(x, y) in the frame of [`tilted`], rounded to whole steps.
    fn surface(count: usize, f: impl Fn(f64, f64) -> f64) -> Vec<[i64; 3]> {
        let (u, v) = across(tilted());
        let one = |i: usize, axis: i64| {
            let hash = of_position(5, [i as i64, axis, 0]);
            (hash % 20_001) as f64 / 10_000.0 - 1.0
        };
        let world = |i: usize| {
            let (x, y) = (one(i, 0), one(i, 1));
            let at = |axis: usize| x * u[axis] + y * v[axis] + f(x, y) * tilted()[axis];
            [0, 1, 2].map(|axis| (at(axis) * 1e9).round() as i64)
        };
        (0..count).map(world).collect()
    }

    /// The angle between a fitted normal and that of slopes a and b in the frame.
    fn off(fitted: FittedHeight, a: f64, b: f64) -> f64 {
        let (u, v) = across(tilted());
        let true_normal = unit([0, 1, 2].map(|i| tilted()[i] - a * u[i] - b * v[i])).unwrap();
        let sine = crate::geom::star::cross(fitted.normal, true_normal);
        dot(sine, sine).sqrt()
    }

    #[test]
    fn surfaces_of_their_degree_are_found_from_as_few_positions_as_determine_them() {
        let second = |x: f64, y: f64| 0.2 * x - 0.1 * y + 0.5 * x * x - 0.7 * x * y + 0.3 * y * y;
        let third = |x: f64, y: f64| second(x, y) + 0.4 * x * x * x - 0.6 * x * y * y;
        for count in [9, 14, 40] {
            let found = fitted(quadric, &surface(count, second), tilted()).unwrap();
            assert!(off(found, 0.2, -0.1) < 1e-7, "{count}: {}", off(found, 0.2, -0.1));
            assert!(found.residual < 2.0, "steps of the rounding, of a billion");
            let found = fitted(cubic, &surface(count + 4, third), tilted()).unwrap();
            assert!(off(found, 0.2, -0.1) < 1e-6, "{count}: {}", off(found, 0.2, -0.1));
        }
        // A plane is a bad guess at a surface that bends, and a quadric at one of degree three.
        let offsets = surface(30, third);
        let (by_two, by_three) = (
            fitted(quadric, &offsets, tilted()).unwrap(),
            fitted(cubic, &offsets, tilted()).unwrap(),
        );
        assert!(by_two.residual > 1e6 && by_three.residual < 2.0);
    }

    #[test]
    fn positions_that_do_not_determine_a_surface_fit_none() {
        let flat = |x: f64, y: f64| 0.1 * x + 0.2 * y;
        assert_eq!(fitted(quadric, &surface(4, flat), tilted()), None, "too few");
        assert_eq!(fitted(cubic, &surface(8, flat), tilted()), None, "too few");
        assert!(fitted(quadric, &surface(9, flat), tilted()).is_some());
        // On one circle around the point, x² + y² is a constant, but for the point itself; on two
        // lines through it xy is 0; straight above it nothing is known.
        let up = [0.0, 0.0, 1.0];
        let lines: Vec<[i64; 3]> = (1..8).flat_map(|i| [[i, 0, i], [0, i, 1]]).collect();
        assert_eq!(fitted(quadric, &lines, up), None);
        let above: Vec<[i64; 3]> = (1..12).map(|i| [0, 0, i]).collect();
        assert_eq!(fitted(quadric, &above, up), None);
        assert_eq!(fitted(cubic, &above, up), None);
    }
}
