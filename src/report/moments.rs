//! Exact moments of positions and the plane that fits them best. Knows no tiles, no files.

use serde::{Deserialize, Serialize};

use crate::point::{Bounds, Position};

/// Bits that a coordinate relative to the origin may have, its sign apart.
const COORDINATE_BITS: u32 = 43;
/// The pairs of axes of the second moments.
const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Number, sums and products of positions, each counted with its copies, in exact integers: merged
/// in any order and by any split they are the same.
///
/// Coordinates are relative to the middle of a box that holds all positions. Where the box is 2^44
/// steps or longer they are rounded to 2^`shift` steps first, so that they stay below 2^43. Exact
/// for up to 2^40 records.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Moments {
    origin: Position,
    shift: u32,
    count: u64,
    sum: [i128; 3],
    products: [i128; 6],
}

impl Moments {
    /// Moments of no positions yet; those to come are in `bounds`.
    pub fn for_bounds(bounds: &Bounds) -> Self {
        let (mut origin, mut shift) = ([0; 3], 0);
        if !bounds.is_empty() {
            let extent = bounds.extent();
            origin = std::array::from_fn(|a| bounds.lo[a].wrapping_add((extent[a] / 2) as i64));
            let bits = extent.iter().max().and_then(|e| e.checked_ilog2()).map_or(0, |b| b + 1);
            shift = bits.saturating_sub(COORDINATE_BITS + 1);
        }
        Moments { origin, shift, count: 0, sum: [0; 3], products: [0; 6] }
    }

    /// Adds `copies` records at `position`.
    pub fn add(&mut self, position: Position, copies: u32) {
        if copies == 0 {
            return;
        }
        let at = self.relative(position);
        self.count += u64::from(copies);
        // One copy, the usual case, is kept apart: its products take one multiplication each.
        if copies == 1 {
            self.plus(|v| v, at);
        } else {
            let weight = i128::from(copies);
            self.plus(|v| v.wrapping_mul(weight), at);
        }
    }

    /// Adds `copies` records, those of its index, at each position.
    ///
    /// What lies close together and is exact is summed about its first position, in words.
    pub fn add_all(&mut self, positions: &[Position], copies: impl Fn(usize) -> u32) {
        for (n, near) in positions.chunks(NEAR).enumerate() {
            let copies = |i: usize| copies(n * NEAR + i);
            match near_moments(near, copies).filter(|_| self.is_exact()) {
                Some(part) => self.absorb(&part),
                None => near.iter().enumerate().for_each(|(i, &p)| self.add(p, copies(i))),
            }
        }
    }

    /// Adds the first and second moments of `at`, each as `weighed`.
    #[inline(always)]
    fn plus(&mut self, weighed: impl Fn(i128) -> i128, at: [i64; 3]) {
        let [x, y, z] = at;
        let first = [x, y, z].map(|v| weighed(v.into()));
        let second = [(x, x), (x, y), (x, z), (y, y), (y, z), (z, z)]
            .map(|(a, b)| weighed(i128::from(a) * i128::from(b)));
        for (sum, term) in self.sum.iter_mut().zip(first) {
            *sum = sum.wrapping_add(term);
        }
        for (product, term) in self.products.iter_mut().zip(second) {
            *product = product.wrapping_add(term);
        }
    }

    /// The position relative to the origin, in 2^shift steps, rounded half up.
    fn relative(&self, position: Position) -> [i64; 3] {
        if self.shift == 0 {
            return std::array::from_fn(|a| position[a].wrapping_sub(self.origin[a]));
        }
        let half = 1i128 << (self.shift - 1);
        std::array::from_fn(|a| {
            let steps = i128::from(position[a]) - i128::from(self.origin[a]);
            ((steps + half) >> self.shift) as i64
        })
    }

    /// Adds moments that were made for the same box.
    pub fn merge(&mut self, other: &Moments) {
        debug_assert_eq!((self.origin, self.shift), (other.origin, other.shift), "one box");
        self.count += other.count;
        for (mine, theirs) in self.sum.iter_mut().zip(other.sum) {
            *mine = mine.wrapping_add(theirs);
        }
        for (mine, theirs) in self.products.iter_mut().zip(other.products) {
            *mine = mine.wrapping_add(theirs);
        }
    }

    /// True if no coordinate is rounded.
    pub fn is_exact(&self) -> bool {
        self.shift == 0
    }

    /// Adds moments of a part of the box, both exact, as if their positions were added here.
    pub fn absorb(&mut self, part: &Moments) {
        debug_assert!(self.is_exact() && part.is_exact(), "exact moments");
        let n = i128::from(part.count);
        let by: [i128; 3] =
            std::array::from_fn(|a| i128::from(part.origin[a]) - i128::from(self.origin[a]));
        self.count += part.count;
        for (product, (theirs, (a, b))) in
            self.products.iter_mut().zip(part.products.into_iter().zip(PAIRS))
        {
            // Σ(x + s)(y + t) = Σxy + tΣx + sΣy + nst; terms may wrap, the sum cannot.
            let moved = theirs
                .wrapping_add(by[b].wrapping_mul(part.sum[a]))
                .wrapping_add(by[a].wrapping_mul(part.sum[b]))
                .wrapping_add(n.wrapping_mul(by[a]).wrapping_mul(by[b]));
            *product = product.wrapping_add(moved);
        }
        for ((sum, theirs), by) in self.sum.iter_mut().zip(part.sum).zip(by) {
            *sum = sum.wrapping_add(theirs).wrapping_add(n.wrapping_mul(by));
        }
    }

    /// Records.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Centre of mass: the nearest position, and what is left to it in lattice steps.
    fn center(&self) -> (Position, [f64; 3]) {
        let unit = (1i128 << self.shift) as f64;
        let (whole, rest) = self.mean();
        let position =
            std::array::from_fn(|a| (i128::from(self.origin[a]) + (whole[a] << self.shift)) as i64);
        (position, rest.map(|r| r as f64 / self.count as f64 * unit))
    }

    /// Mean of the relative coordinates, rounded, and the remainders Σx − n·mean (at most n/2).
    fn mean(&self) -> ([i128; 3], [i128; 3]) {
        let n = i128::from(self.count).max(1);
        let whole = self.sum.map(|sum| (2 * sum + n).div_euclid(2 * n));
        (whole, std::array::from_fn(|a| self.sum[a] - n * whole[a]))
    }

    /// Σ (a − mean a)(b − mean b) for all pairs of axes, in (2^shift steps)².
    ///
    /// Taken about the rounded mean in integers first: what is lost by rounding to f64 is then
    /// relative to the spread of the positions and not to their distance from the origin.
    fn scatter(&self) -> [[f64; 3]; 3] {
        let n = i128::from(self.count).max(1);
        let (mean, rest) = self.mean();
        let mut scatter = [[0.0; 3]; 3];
        for (product, (a, b)) in self.products.iter().zip(PAIRS) {
            // Terms may wrap, their sum cannot: it is at most the product's own bound.
            let about = product
                .wrapping_sub(mean[a].wrapping_mul(self.sum[b]))
                .wrapping_sub(mean[b].wrapping_mul(self.sum[a]))
                .wrapping_add(n.wrapping_mul(mean[a]).wrapping_mul(mean[b]));
            let value = about as f64 - rest[a] as f64 * rest[b] as f64 / n as f64;
            scatter[a][b] = value;
            scatter[b][a] = value;
        }
        scatter
    }
}

/// Positions that are summed together.
const NEAR: usize = 256;
/// Bits of their distances from the first, and of their number with copies, with which no sum of
/// products overflows.
const NEAR_BITS: u32 = 22;
const NEAR_RECORDS: u64 = 1 << (62 - 2 * NEAR_BITS);

/// Moments of positions about the first of them; None if they might overflow.
fn near_moments(positions: &[Position], copies: impl Fn(usize) -> u32) -> Option<Moments> {
    let origin = *positions.first()?;
    let (mut count, mut span, mut sum, mut products) = (0, 0, [0i64; 3], [0i64; 6]);
    for (i, position) in positions.iter().enumerate() {
        let copies = copies(i);
        if copies == 0 {
            continue;
        }
        count += u64::from(copies);
        let [x, y, z]: [i64; 3] = std::array::from_fn(|a| position[a].wrapping_sub(origin[a]));
        span |= (x ^ x >> 63) | (y ^ y >> 63) | (z ^ z >> 63);
        let weighed = [x, y, z].map(|v| v.wrapping_mul(i64::from(copies)));
        for (sum, term) in sum.iter_mut().zip(weighed) {
            *sum = sum.wrapping_add(term);
        }
        for (product, (a, b)) in products.iter_mut().zip(PAIRS) {
            *product = product.wrapping_add(weighed[a].wrapping_mul([x, y, z][b]));
        }
    }
    (span >> NEAR_BITS == 0 && count <= NEAR_RECORDS).then(|| Moments {
        origin,
        shift: 0,
        count,
        sum: sum.map(i128::from),
        products: products.map(i128::from),
    })
}

/// A plane in lattice space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    normal: [f64; 3],
    anchor: Position,
    /// Distance of the plane from the anchor, along the normal.
    offset: f64,
}

impl Plane {
    /// The plane of least squared distances (algorithm.md, section 4): through the centre of mass,
    /// across the direction of least spread. Positions on a line or in one place get one of the
    /// planes through them. None without positions.
    pub fn fit(moments: &Moments) -> Option<Plane> {
        if moments.count == 0 {
            return None;
        }
        let normal = least_axis(moments.scatter());
        let (anchor, rest) = moments.center();
        Some(Plane { normal, anchor, offset: dot(normal, rest) })
    }

    /// Unit normal; its sign means nothing.
    pub fn normal(&self) -> [f64; 3] {
        self.normal
    }

    /// Signed distance of a position in lattice steps.
    pub fn distance(&self, position: Position) -> f64 {
        let from = std::array::from_fn(|a| position[a].wrapping_sub(self.anchor[a]) as f64);
        dot(self.normal, from) - self.offset
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Sweeps after which the rotations of a 3 × 3 matrix are below the rounding: six to eight reach
/// it.
const SWEEPS: usize = 10;

/// Unit eigenvector of the smallest eigenvalue of a symmetric matrix, by cyclic Jacobi rotations
/// (Golub & Van Loan, Matrix Computations, section 8.5). Of equal eigenvalues the last axis wins.
fn least_axis(mut m: [[f64; 3]; 3]) -> [f64; 3] {
    let largest = m.iter().flatten().fold(0.0f64, |most, v| most.max(v.abs()));
    if largest == 0.0 {
        return [0.0, 0.0, 1.0];
    }
    m.iter_mut().flatten().for_each(|v| *v /= largest);
    let mut axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            rotate(&mut m, &mut axes, p, q);
        }
    }
    let least = (0..3).fold(0, |least, a| if m[a][a] <= m[least][least] { a } else { least });
    let axis = axes.map(|row| row[least]);
    let length = dot(axis, axis).sqrt();
    axis.map(|v| v / length)
}

/// One rotation that makes m[p][q] zero; the columns of `axes` follow.
fn rotate(m: &mut [[f64; 3]; 3], axes: &mut [[f64; 3]; 3], p: usize, q: usize) {
    if m[p][q] == 0.0 {
        return;
    }
    let theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    let moved = t * m[p][q];
    m[p][p] -= moved;
    m[q][q] += moved;
    m[p][q] = 0.0;
    m[q][p] = 0.0;
    let r = 3 - p - q;
    let (rp, rq) = (m[r][p], m[r][q]);
    m[r][p] = c * rp - s * rq;
    m[p][r] = m[r][p];
    m[r][q] = s * rp + c * rq;
    m[q][r] = m[r][q];
    for row in axes {
        let (ap, aq) = (row[p], row[q]);
        row[p] = c * ap - s * aq;
        row[q] = s * ap + c * aq;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(positions: &[Position]) -> Moments {
        let mut moments = Moments::for_bounds(&Bounds::of(positions.iter().copied()));
        positions.iter().for_each(|&p| moments.add(p, 1));
        moments
    }

    #[test]
    fn relative_coordinates_stay_below_2_to_the_43_at_any_extent() {
        for bits in [0, 1, 43, 44, 45, 50, 61, 62] {
            let far = (1i64 << bits) - 1;
            let bounds = Bounds { lo: [-far; 3], hi: [far; 3] };
            let moments = Moments::for_bounds(&bounds);
            for corner in [bounds.lo, bounds.hi] {
                assert!(moments.relative(corner).iter().all(|v| v.abs() <= 1 << 43), "{bits}");
            }
        }
        assert_eq!(Moments::for_bounds(&Bounds { lo: [0; 3], hi: [(1 << 44) - 1; 3] }).shift, 0);
        assert_eq!(Moments::for_bounds(&Bounds { lo: [0; 3], hi: [1 << 44; 3] }).shift, 1);
        assert_eq!(Moments::for_bounds(&Bounds::EMPTY).count(), 0);
        let all = Moments::for_bounds(&Bounds { lo: [i64::MIN; 3], hi: [i64::MAX; 3] });
        assert!(all.relative([i64::MIN; 3]).iter().all(|v| v.abs() <= 1 << 43));
        assert!(all.relative([i64::MAX; 3]).iter().all(|v| v.abs() <= 1 << 43));
    }

    #[test]
    fn the_center_of_positions_far_from_world_0_is_exact() {
        let far = 1 << 61;
        let (position, rest) =
            moments(&[[far, 0, -far], [far + 1, 0, -far], [far + 1, 3, -far]]).center();
        assert_eq!(position, [far + 1, 1, -far]);
        assert_eq!(rest, [-1.0 / 3.0, 0.0, 0.0]);
    }

    #[test]
    fn the_least_axis_of_a_diagonal_matrix_is_an_axis() {
        let diagonal = |d: [f64; 3]| {
            std::array::from_fn(|a| std::array::from_fn(|b| if a == b { d[a] } else { 0.0 }))
        };
        assert_eq!(least_axis(diagonal([1.0, 2.0, 3.0])), [1.0, 0.0, 0.0]);
        assert_eq!(least_axis(diagonal([5.0, 2.0, 3.0])), [0.0, 1.0, 0.0]);
        assert_eq!(least_axis(diagonal([0.0, 0.0, 0.0])), [0.0, 0.0, 1.0]);
        assert_eq!(least_axis(diagonal([4.0, 4.0, 4.0])), [0.0, 0.0, 1.0]);
    }

    proptest::proptest! {
        #[test]
        fn the_least_axis_is_an_eigenvector_and_no_direction_is_less(
            v in proptest::array::uniform9(-1e6f64..1e6),
            w in proptest::array::uniform3(-1f64..1.0),
        ) {
            let mut m = [[0.0; 3]; 3];
            for (a, b) in PAIRS {
                let value = (0..3).map(|k| v[3 * a + k] * v[3 * b + k]).sum();
                m[a][b] = value;
                m[b][a] = value;
            }
            let size = m[0][0] + m[1][1] + m[2][2];
            let apply = |x: [f64; 3]| -> [f64; 3] { std::array::from_fn(|a| dot(m[a], x)) };
            let axis = least_axis(m);
            let least = dot(axis, apply(axis));
            for (a, value) in apply(axis).into_iter().enumerate() {
                proptest::prop_assert!((value - least * axis[a]).abs() <= 1e-12 * size);
            }
            let length2 = dot(w, w);
            proptest::prop_assert!(dot(w, apply(w)) >= (least - 1e-12 * size) * length2);
        }
    }
}
