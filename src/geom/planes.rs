//! How far points are from the planes of their nearest others, several planes of each, eight points
//! side by side.
//!
//! The planes of the nearest five, eight and twelve share their sums: those of the nearest five are
//! summed first, and each further point goes on from there. Offsets are from the point that asks,
//! which makes the bits a function of the positions alone, and sums go from the nearest on.

use super::plane::{Symmetric, dot, smallest, smallest_vector};
use super::simd::{EIGHT, Kernel, Lanes, Real, Simd};
use crate::point::{Position, distance2};

/// How many of the nearest each plane is through.
const PLANES: [usize; 3] = [5, 8, 12];
/// How many nearest others are looked at.
pub const NEAREST: usize = PLANES[2];
/// With fewer others than these there is no plane, but the distance to the nearest.
pub const FEWEST: usize = PLANES[0];

/// Squared distances to planes, of eight points at a time.
#[derive(Debug)]
pub struct PlaneErrors {
    simd: Simd,
    points: Box<EightPoints>,
    used: usize,
}

/// EightPoints points.
#[derive(Debug, Default)]
struct EightPoints {
    /// The number that each was given.
    number: [u32; EIGHT],
    /// Offsets of the nearest others by axis; 0 where there are no more.
    offsets: [[[f64; EIGHT]; 3]; NEAREST],
    /// How many others there are.
    count: [f64; EIGHT],
    /// What comes out.
    error2: [f64; EIGHT],
}

impl PlaneErrors {
    /// None yet, to be computed by the given instruction set; all give the same bits.
    pub fn new(simd: Simd) -> PlaneErrors {
        PlaneErrors { simd, points: Box::default(), used: 0 }
    }

    /// Takes point `number` with the offsets of its nearest others in lattice steps, the nearest
    /// first, at least one and as many as [`NEAREST`] at most. Calls `done` with the numbers of
    /// points and, in steps², the mean of the squared distances to the planes of their nearest 5, 8
    /// and 12, or of as many as there are; with fewer than 5, the squared distance to the nearest.
    pub fn push(
        &mut self,
        number: u32,
        offsets: impl Iterator<Item = [f64; 3]>,
        done: impl FnMut(u32, f64),
    ) {
        let (points, lane) = (&mut *self.points, self.used);
        let mut count = 0;
        for (place, offset) in points.offsets.iter_mut().zip(offsets) {
            (0..3).for_each(|axis| place[axis][lane] = offset[axis]);
            count += 1;
        }
        points.offsets[count..].iter_mut().flatten().for_each(|axis| axis[lane] = 0.0);
        points.count[lane] = count as f64;
        points.number[lane] = number;
        self.used += 1;
        if self.used == EIGHT {
            self.flush(done);
        }
    }

    /// Calls `done` for all that it was not called for yet.
    pub fn flush(&mut self, mut done: impl FnMut(u32, f64)) {
        self.simd.run(EightKernel(&mut self.points));
        let each = self.points.number.iter().zip(&self.points.error2).take(self.used);
        each.for_each(|(number, error2)| done(*number, *error2));
        self.used = 0;
    }
}

/// Computes the errors of eight points.
struct EightKernel<'a>(&'a mut EightPoints);

impl Kernel for EightKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let points = self.0;
        let count = lanes.load_eight(&points.count);
        let number = |v: f64| count.of(v);
        let zero = number(0.0);
        let (mut sum, mut products) = ([zero; 3], [zero; 6]);
        let (mut from, mut error2) = (0, zero);
        for k in PLANES {
            for offset in &points.offsets[from..k] {
                let o = [
                    lanes.load_eight(&offset[0]),
                    lanes.load_eight(&offset[1]),
                    lanes.load_eight(&offset[2]),
                ];
                add(&mut sum, &mut products, o);
            }
            from = k;
            let n = L::F64::choose(count.below(number(k as f64)), count, number(k as f64));
            error2 = error2 + squared_distance(sum, products, n);
        }
        let [x, y, z] = &points.offsets[0];
        let first = [lanes.load_eight(x), lanes.load_eight(y), lanes.load_eight(z)];
        let few = count.below(number(FEWEST as f64));
        let mean = error2 / number(PLANES.len() as f64);
        points.error2 = lanes.store_eight(L::F64::choose(few, dot(first, first), mean));
    }
}

#[inline(always)]
fn add<T: Real>(sum: &mut [T; 3], products: &mut [T; 6], [x, y, z]: [T; 3]) {
    *sum = [sum[0] + x, sum[1] + y, sum[2] + z];
    let [xx, xy, xz, yy, yz, zz] = *products;
    *products = [xx + x * x, xy + x * y, xz + x * z, yy + y * y, yz + y * z, zz + z * z];
}

/// The squared distance of the origin to the least-squares plane of `n` points; 0 where it is a
/// matter of choice, as of points on a line.
#[inline(always)]
fn squared_distance<T: Real>(sum: [T; 3], products: [T; 6], n: T) -> T {
    let mean = [sum[0] / n, sum[1] / n, sum[2] / n];
    let normal = smallest_vector(scatter(sum, products, mean));
    let distance = dot(mean, normal);
    let squared = distance * distance;
    // Only a number equals itself.
    T::choose(squared.equals(squared), squared, squared.of(0.0))
}

/// The scatter of points about their mean, from their sums.
#[inline(always)]
fn scatter<T: Real>(sum: [T; 3], products: [T; 6], mean: [T; 3]) -> [T; 6] {
    let [xx, xy, xz, yy, yz, zz] = products;
    [
        xx - sum[0] * mean[0],
        xy - sum[0] * mean[1],
        xz - sum[0] * mean[2],
        yy - sum[1] * mean[1],
        yz - sum[1] * mean[2],
        zz - sum[2] * mean[2],
    ]
}

/// How many of the nearest the plane is through that stands for the surface; those that are as near
/// as the last are among them.
pub const SURFACE: usize = 8;
/// Points are almost on a line, or in a ball, where the middle eigenvalue of their scatter is no
/// more than this part of the largest above the smallest.
const FLAT: f64 = 1e-4;

/// The distance in steps of `p` to the surface that `positions` say: to the least-squares plane of
/// its nearest [`SURFACE`], and all that are as near as the last of them. Where fewer than
/// [`FEWEST`] are there, or they are almost on a line, the distance to the nearest. `nearest` has
/// the indices of the nearest, the nearest first; at least one.
pub fn surface_distance(p: Position, nearest: &[u32], positions: &[Position]) -> f64 {
    let at = |j: u32| positions[j as usize];
    let offset = |j: u32| -> [f64; 3] {
        std::array::from_fn(|axis| at(j)[axis].saturating_sub(p[axis]) as f64)
    };
    let to_nearest = offset(nearest[0]);
    let to_nearest = dot(to_nearest, to_nearest).sqrt();
    if nearest.len() < FEWEST {
        return to_nearest;
    }
    let last = nearest.get(SURFACE - 1).map(|&j| distance2(at(j), p));
    let is_in = |(n, j): &(usize, &u32)| {
        *n < SURFACE || last.is_some_and(|last| distance2(at(**j), p) == last)
    };
    let (mut sum, mut products, mut count) = ([0.0; 3], [0.0; 6], 0.0);
    for (_, &j) in nearest.iter().enumerate().take_while(is_in) {
        add(&mut sum, &mut products, offset(j));
        count += 1.0;
    }
    let mean = sum.map(|v| v / count);
    let matrix: Symmetric = scatter(sum, products, mean);
    let (least, normal) = smallest(matrix);
    let minus = smallest(matrix.map(|v| -v)).0;
    let (most, trace) = (-minus, matrix[0] + matrix[3] + matrix[5]);
    let middle = trace - least - most;
    match middle - least < FLAT * most || most.is_nan() {
        true => to_nearest,
        false => dot(mean, normal).abs(),
    }
}
