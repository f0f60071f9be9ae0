//! Distances to the planes of kept points, eight positions side by side.
//!
//! A check that computed as the stages do would repeat their mistakes, so the planes of `verify`
//! are its own: where stages have eigenvectors in closed form, here Jacobi rotations make them,
//! which are slower and hard to get wrong (Golub and Van Loan, Matrix Computations, section 8.5).
//! Five times around the three off-diagonal entries leave none of them larger than rounding, since
//! each time about squares what is left. Nothing branches, so that eight go side by side.

use crate::geom::simd::{EIGHT, Kernel, Lanes, Real, Simd};
use crate::point::Position;

/// Fewer points than these are no plane: the nearest is the surface.
const FEWEST: usize = 5;
/// Points are almost on a line, or in a ball, where the middle eigenvalue of their scatter is no
/// more than this part of the largest above the smallest: the nearest is the surface.
const FLAT: f64 = 1e-4;
/// How often every off-diagonal entry is made 0.
const SWEEPS: usize = 5;
/// Sums of offsets and of their products: x, y, z, xx, yy, zz, xy, xz, yz.
const SUMS: usize = 9;

/// A removed position, and how far it is from the nearest kept point in steps.
pub(super) type RemovedPoint = (Position, f64);

/// Distances to planes, eight at a time.
#[derive(Debug)]
pub(super) struct SurfacePlanes {
    simd: Simd,
    asked: [RemovedPoint; EIGHT],
    planes: Box<EightPlanes>,
    used: usize,
}

/// Eight sets of points.
#[derive(Debug, Default)]
struct EightPlanes {
    sums: [[f64; EIGHT]; SUMS],
    count: [f64; EIGHT],
    /// How far the origin is from the plane of each: negative where there is none.
    distance: [f64; EIGHT],
}

impl SurfacePlanes {
    /// None yet, to be computed by the given instruction set; all give the same bits.
    pub fn with(simd: Simd) -> SurfacePlanes {
        let asked = [([0; 3], 0.0); EIGHT];
        SurfacePlanes { simd, asked, planes: Box::default(), used: 0 }
    }

    /// Takes a position with the kept points whose plane is the surface there. Calls `done` for
    /// positions that are measured, with their distance to the surface in steps.
    pub fn push(
        &mut self,
        asked: RemovedPoint,
        points: impl ExactSizeIterator<Item = Position>,
        mut done: impl FnMut(RemovedPoint, f64),
    ) {
        let count = points.len();
        if count < FEWEST {
            done(asked, asked.1);
            return;
        }
        let mut sums = [0.0; SUMS];
        for q in points {
            let offset = |axis: usize| q[axis].saturating_sub(asked.0[axis]) as f64;
            let (x, y, z) = (offset(0), offset(1), offset(2));
            let more = [x, y, z, x * x, y * y, z * z, x * y, x * z, y * z];
            for i in 0..SUMS {
                sums[i] += more[i];
            }
        }
        let lane = self.used;
        self.planes.sums.iter_mut().zip(sums).for_each(|(all, sum)| all[lane] = sum);
        self.planes.count[lane] = count as f64;
        self.asked[lane] = asked;
        self.used += 1;
        if self.used == EIGHT {
            self.flush(done);
        }
    }

    /// Calls `done` for all that it was not called for yet.
    pub fn flush(&mut self, mut done: impl FnMut(RemovedPoint, f64)) {
        self.simd.run(MeasureEight(&mut self.planes));
        for (&asked, &distance) in self.asked.iter().zip(&self.planes.distance).take(self.used) {
            done(asked, if distance < 0.0 { asked.1 } else { distance });
        }
        self.used = 0;
    }
}

/// Computes the distances of eight.
struct MeasureEight<'a>(&'a mut EightPlanes);

impl Kernel for MeasureEight<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let planes = self.0;
        let [x, y, z, xx, yy, zz, xy, xz, yz] = &planes.sums;
        let n = lanes.load_eight(&planes.count);
        let sum = [lanes.load_eight(x), lanes.load_eight(y), lanes.load_eight(z)];
        let mean = [sum[0] / n, sum[1] / n, sum[2] / n];
        let mut diagonal = [
            lanes.load_eight(xx) - sum[0] * mean[0],
            lanes.load_eight(yy) - sum[1] * mean[1],
            lanes.load_eight(zz) - sum[2] * mean[2],
        ];
        // Each beside the axis that it does not belong to.
        let mut off = [
            lanes.load_eight(yz) - sum[1] * mean[2],
            lanes.load_eight(xz) - sum[0] * mean[2],
            lanes.load_eight(xy) - sum[0] * mean[1],
        ];
        // The mean in the frame of the rotated axes, which become the eigenvectors.
        let mut along = mean;
        for _ in 0..SWEEPS {
            rotate::<_, 0, 1, 2>(&mut diagonal, &mut off, &mut along);
            rotate::<_, 0, 2, 1>(&mut diagonal, &mut off, &mut along);
            rotate::<_, 1, 2, 0>(&mut diagonal, &mut off, &mut along);
        }
        let [a, b, c] = diagonal;
        let (low, of_low) = (L::F64::choose(b.below(a), b, a), b.below(a));
        let high = L::F64::choose(b.below(a), a, b);
        let least = L::F64::choose(c.below(low), c, low);
        let most = L::F64::choose(high.below(c), c, high);
        let rest = L::F64::choose(c.below(high), c, high);
        let middle = L::F64::choose(rest.below(low), low, rest);
        let of_low = L::F64::choose(of_low, along[1], along[0]);
        let distance = L::F64::choose(c.below(low), along[2], of_low).size();
        let is_flat = (middle - least).below(n.of(FLAT) * most);
        planes.distance = lanes.store_eight(L::F64::choose(is_flat, n.of(-1.0), distance));
    }
}

/// Turns the axes P and Q so that their entry is 0; R is the third axis. Each entry off the
/// diagonal stands at the axis that it does not belong to.
#[inline(always)]
fn rotate<T: Real, const P: usize, const Q: usize, const R: usize>(
    diagonal: &mut [T; 3],
    off: &mut [T; 3],
    along: &mut [T; 3],
) {
    let (apart, between) = (diagonal[Q] - diagonal[P], off[R]);
    let (zero, one) = (between.of(0.0), between.of(1.0));
    // The tangent of the smaller of the two angles that do.
    let twice = between + between;
    let root = (apart * apart + twice * twice).root();
    let tangent = twice / (apart.size() + root);
    let tangent = T::choose(apart.below(zero), zero - tangent, tangent);
    let tangent = T::choose(root.equals(zero), zero, tangent);
    let cosine = one / (tangent * tangent + one).root();
    let sine = tangent * cosine;
    diagonal[P] = diagonal[P] - tangent * between;
    diagonal[Q] = diagonal[Q] + tangent * between;
    off[R] = zero;
    let (of_p, of_q) = (off[Q], off[P]);
    off[Q] = cosine * of_p - sine * of_q;
    off[P] = sine * of_p + cosine * of_q;
    let (of_p, of_q) = (along[P], along[Q]);
    along[P] = cosine * of_p - sine * of_q;
    along[Q] = sine * of_p + cosine * of_q;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::hash::of_position;

    /// Distances of the origin to the planes of sets of offsets, on one instruction set.
    fn distances(simd: Simd, sets: &[Vec<Position>]) -> Vec<f64> {
        let mut planes = SurfacePlanes::with(simd);
        let mut all = vec![f64::NAN; sets.len()];
        let mut done = |asked: RemovedPoint, off: f64| all[asked.1 as usize] = off;
        for (n, set) in sets.iter().enumerate() {
            planes.push(([0; 3], n as f64), set.iter().copied(), &mut done);
        }
        planes.flush(&mut done);
        all
    }

    /// The least-squares plane by another road: no direction among many, refined, has less scatter.
    fn by_search(set: &[Position]) -> f64 {
        let n = set.len() as f64;
        let mean = [0, 1, 2].map(|axis| set.iter().map(|p| p[axis] as f64).sum::<f64>() / n);
        let along = |normal: [f64; 3], v: [f64; 3]| (0..3).map(|i| normal[i] * v[i]).sum::<f64>();
        let scatter = |normal: [f64; 3]| {
            let off = |p: &Position| [0, 1, 2].map(|axis| p[axis] as f64 - mean[axis]);
            set.iter().map(|p| along(normal, off(p)).powi(2)).sum::<f64>()
        };
        let unit = |v: [f64; 3]| v.map(|c| c / along(v, v).sqrt());
        let mut best = [0.0, 0.0, 1.0];
        let mut step = 1.0;
        while step > 1e-11 {
            let around =
                (0..27).map(|i| [i % 3, i / 3 % 3, i / 9].map(|c| f64::from(c - 1) * step));
            let turned = around.map(|by| unit([0, 1, 2].map(|axis| best[axis] + by[axis])));
            let better = turned.min_by(|a, b| scatter(*a).total_cmp(&scatter(*b)));
            match better.filter(|normal| scatter(*normal) < scatter(best)) {
                Some(normal) => best = normal,
                None => step /= 2.0,
            }
        }
        along(best, mean).abs()
    }

    fn some(n: usize, count: usize, wide: [i64; 3]) -> Vec<Position> {
        let number = |i: usize, axis: usize| {
            let hash = of_position(n as u64, [i as i64, axis as i64, 3]);
            (hash % 2001) as i64 * wide[axis] / 2000 - wide[axis] / 3
        };
        (0..count).map(|i| [0, 1, 2].map(|axis| number(i, axis))).collect()
    }

    #[test]
    fn planes_are_those_of_a_search_over_all_directions_on_every_instruction_set() {
        let shapes = [[3000, 2000, 90], [40, 5000, 1700], [900, 7, 1100], [2000, 900, 0]];
        let sets: Vec<Vec<Position>> =
            (0..200).map(|n| some(n, 5 + n % 9, shapes[n % shapes.len()])).collect();
        let all = distances(Simd::PORTABLE, &sets);
        for (n, set) in sets.iter().enumerate() {
            let expected = by_search(set);
            assert!((all[n] - expected).abs() < 0.01, "{n}: {} {expected}", all[n]);
        }
        for simd in Simd::all() {
            let bits = |all: &[f64]| all.iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
            assert_eq!(bits(&distances(simd, &sets)), bits(&all), "{simd:?}");
        }
    }

    #[test]
    fn few_points_and_points_on_a_line_or_in_a_ball_have_no_plane() {
        let line: Vec<Position> = (1..9).map(|i| [3 * i, 5 * i, -2 * i]).collect();
        let corners: Vec<Position> =
            (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2].map(|bit| 10 + 4 * bit)).collect();
        let four = corners[..4].to_vec();
        let plane: Vec<Position> = (0..9).map(|i| [i % 3, i / 3, 7]).collect();
        let sets = [line, corners, four, plane];
        for simd in Simd::all() {
            // The distance to the nearest of each is its number.
            assert_eq!(distances(simd, &sets), [0.0, 1.0, 2.0, 7.0], "{simd:?}");
        }
    }
}
