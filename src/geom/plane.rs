//! Planes through neighbourhoods: exact moments of integer offsets, and eigenvectors of symmetric
//! 3 × 3 matrices in closed form. Knows no tiles, no stages.
//!
//! Every function gives the same bits on every platform: integers, and f64 with additions,
//! multiplications, divisions and square roots alone.

use std::ops::{Mul, Sub};

use super::simd::Real;

/// A symmetric 3 × 3 matrix, its upper triangle row by row: xx, xy, xz, yy, yz, zz.
pub type Symmetric = [f64; 6];

/// Bits that scatter entries keep: two of them multiply within i128 with room for a difference.
const ENTRY_BITS: u32 = 62;
/// 2·cos(acos(r)/3) for r in [0, 1] to 1e-4: from there two Newton steps reach 1e-16.
const ROOT_START: [f64; 4] = [1.732_132_66, 0.330_660_7, -0.081_382_39, 0.018_639_37];
const ROOT_STEPS: usize = 2;
const TWO_64: f64 = 18_446_744_073_709_551_616.0;

/// The covariance of a position and its neighbours, from exact integer moments.
///
/// Exact as long as n²·d² < 2^62 for n positions and a largest offset d; beyond, entries are
/// rounded once to 62 bits. Offsets themselves are rounded (to multiples of a power of two) only
/// where n·d ≥ 2^62.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Covariance {
    /// n·Σxy − Σx·Σy, divided by 2^`exponent`.
    scatter: [i64; 6],
    exponent: u32,
    count: u64,
}

impl Covariance {
    /// The covariance of the neighbours at `offsets` (steps from p) and of p itself, at offset 0.
    pub fn of(offsets: &[[i64; 3]]) -> Covariance {
        let count = offsets.len() as u64 + 1;
        let mut widest = 0;
        for o in offsets {
            widest |= o[0].unsigned_abs() | o[1].unsigned_abs() | o[2].unsigned_abs();
        }
        if 2 * (bits(widest) + bits(count)) <= ENTRY_BITS {
            return Covariance { scatter: scatter_small(offsets), exponent: 0, count };
        }
        let excess = (bits(widest) + bits(count)).saturating_sub(ENTRY_BITS);
        let scatter = if excess == 0 {
            scatter(offsets.iter().copied())
        } else {
            let rounded = |o: &[i64; 3]| o.map(|v| shift_rounded(i128::from(v), excess));
            scatter(offsets.iter().map(rounded))
        };
        // No entry exceeds the largest on the diagonal.
        let largest = scatter[0].max(scatter[3]).max(scatter[5]);
        let shift = (128 - largest.leading_zeros()).saturating_sub(ENTRY_BITS);
        let scatter = if shift == 0 {
            scatter.map(|v| v as i64)
        } else {
            scatter.map(|v| shift_rounded(v, shift))
        };
        Covariance { scatter, exponent: 2 * excess + shift, count }
    }

    /// The covariance of `count` positions, p included, from n·Σxy − Σx·Σy, each below 2^62.
    pub fn of_scatter(scatter: [i64; 6], count: usize) -> Covariance {
        Covariance { scatter, exponent: 0, count: count as u64 }
    }

    /// True if all positions lie on one line; exact where the covariance is.
    pub fn is_of_a_line(&self) -> bool {
        let [xx, _, _, yy, _, zz] = self.adjugate();
        xx == 0.0 && yy == 0.0 && zz == 0.0
    }

    /// The covariance (of the population) in steps².
    pub fn matrix(&self) -> Symmetric {
        let n = self.count as f64;
        let unit = power_of_two(self.exponent) / (n * n);
        self.scatter.map(|v| v as f64 * unit)
    }

    /// The adjugate, up to a positive factor: what turns a first estimate of the normal into that
    /// of the least-squares height function over it. Each entry is exact but for its rounding.
    pub fn adjugate(&self) -> Symmetric {
        // No entry exceeds the largest on the diagonal.
        let [xx, _, _, yy, _, zz] = self.scatter;
        if (xx | yy | zz) < 1 << 31 {
            adjugate(self.scatter).map(|v| v as f64)
        } else {
            adjugate(self.scatter.map(i128::from)).map(to_f64)
        }
    }
}

/// The adjugate of a symmetric matrix; the caller sees to products of two entries having room for
/// a difference.
fn adjugate<T>([xx, xy, xz, yy, yz, zz]: [T; 6]) -> [T; 6]
where
    T: Copy + Mul<Output = T> + Sub<Output = T>,
{
    [
        yy * zz - yz * yz,
        xz * yz - xy * zz,
        xy * yz - xz * yy,
        xx * zz - xz * xz,
        xy * xz - xx * yz,
        xx * yy - xy * xy,
    ]
}

/// 2^`exponent`, below 2^1023.
fn power_of_two(exponent: u32) -> f64 {
    f64::from_bits(u64::from(1023 + exponent) << 52)
}

/// n·Σxy − Σx·Σy of the offsets and 0; the caller sees to n·d < 2^62.
fn scatter(offsets: impl Iterator<Item = [i64; 3]>) -> [i128; 6] {
    let mut count = 1i128;
    let mut sum = [0i64; 3];
    let mut product = [0i128; 6];
    for o in offsets {
        count += 1;
        let products = products(o.map(i128::from));
        for (total, v) in sum.iter_mut().zip(o) {
            *total += v;
        }
        for (total, v) in product.iter_mut().zip(products) {
            *total += v;
        }
    }
    let means = products(sum.map(i128::from));
    std::array::from_fn(|i| count * product[i] - means[i])
}

/// The same in i64; the caller sees to n²·d² < 2^62.
fn scatter_small(offsets: &[[i64; 3]]) -> [i64; 6] {
    let mut sum = [0i64; 3];
    let mut product = [0i64; 6];
    for &o in offsets {
        let products = products(o);
        for axis in 0..3 {
            sum[axis] += o[axis];
        }
        for i in 0..6 {
            product[i] += products[i];
        }
    }
    let count = offsets.len() as i64 + 1;
    let means = products(sum);
    std::array::from_fn(|i| count * product[i] - means[i])
}

/// xx, xy, xz, yy, yz, zz.
#[inline(always)]
pub fn products<T: Copy + Mul<Output = T>>([x, y, z]: [T; 3]) -> [T; 6] {
    [x * x, x * y, x * z, y * y, y * z, z * z]
}

/// How many bits `v` takes.
fn bits(v: u64) -> u32 {
    u64::BITS - v.leading_zeros()
}

/// v / 2^shift, rounded to nearest, halves upwards; `shift` is at least 1 and the result fits.
fn shift_rounded(v: i128, shift: u32) -> i64 {
    (((v >> (shift - 1)) + 1) >> 1) as i64
}

/// The nearest f64 within i64, and within two roundings of it beyond.
pub(super) fn to_f64(v: i128) -> f64 {
    match i64::try_from(v) {
        Ok(v) => v as f64,
        Err(_) => (v >> 64) as i64 as f64 * TWO_64 + v as u64 as f64,
    }
}

/// True if 0 and all offsets lie on one line; exact.
pub fn collinear(offsets: &[[i64; 3]]) -> bool {
    let Some(first) = offsets.iter().find(|o| **o != [0; 3]) else { return true };
    let d = first.map(i128::from);
    offsets.iter().all(|o| {
        // Most differ on the first two axes already. Products of two i64 fit; their difference
        // need not.
        let [x, y] = [i128::from(o[0]), i128::from(o[1])];
        let z = i128::from(o[2]);
        d[0] * y == d[1] * x && d[0] * z == d[2] * x && d[1] * z == d[2] * y
    })
}

/// The smallest eigenvalue of a symmetric matrix and its unit eigenvector.
///
/// The eigenvector errs by a few roundings times the matrix's norm over the gap to the next
/// eigenvalue; where two are equal it is a vector of their common eigenspace. The value errs by a
/// few roundings of the norm and may so be slightly negative for a singular matrix. A matrix that
/// is a multiple of the identity, or not finite, has the z axis.
///
/// The root of the characteristic cubic that is farthest from the other two is well conditioned and
/// comes first; what remains is a 2 × 2 problem in the plane across its eigenvector.
pub fn smallest(matrix: Symmetric) -> (f64, [f64; 3]) {
    const ANY: [f64; 3] = [0.0, 0.0, 1.0];
    if !matrix.iter().all(|v| v.is_finite()) {
        return (f64::NAN, ANY);
    }
    if matrix.iter().all(|v| v.abs() < f64::MIN_POSITIVE) {
        return (0.0, ANY);
    }
    let Traceless { mean, radius, unit, matrix } = Traceless::of(matrix);
    if radius == 0.0 {
        return (mean * unit, ANY);
    }
    let (root, far) = isolated(&matrix);
    let far = if is_nan(far) { ANY } else { far };
    if root < 0.0 {
        return ((mean + radius * root) * unit, far);
    }
    let (root, vector) = smallest_across(&matrix, far);
    let vector = if is_nan(vector) { across(far).0 } else { vector };
    ((mean + radius * root) * unit, vector)
}

/// The eigenvector of [`smallest`], or NaN where it is a matter of choice, of a matrix that is
/// finite and not 0. Without a branch: for several matrices at once.
#[inline(always)]
pub fn smallest_vector<T: Real>(matrix: [T; 6]) -> [T; 3] {
    let Traceless { matrix, .. } = Traceless::of(matrix);
    let (root, far) = isolated(&matrix);
    let (_, vector) = smallest_across(&matrix, far);
    choose(root.below(root.of(0.0)), far, vector)
}

/// A symmetric matrix as (mean·I + radius·M)·unit, with M of trace 0 and squared norm 6: its
/// eigenvalues are the roots of t³ − 3t − det M.
struct Traceless<T> {
    mean: T,
    radius: T,
    unit: T,
    matrix: [T; 6],
}

impl<T: Real> Traceless<T> {
    #[inline(always)]
    fn of(matrix: [T; 6]) -> Traceless<T> {
        let mut size = matrix[0].of(0.0);
        for v in matrix {
            size = T::choose(size.below(v.size()), v.size(), size);
        }
        // Scaling by a power of two is exact.
        let unit = size.power();
        let [xx, xy, xz, yy, yz, zz] = scaled(matrix, unit.of(1.0) / unit);
        let mean = (xx + yy + zz) / xx.of(3.0);
        let (dx, dy, dz) = (xx - mean, yy - mean, zz - mean);
        let squares = dx * dx + dy * dy + dz * dz + xy.of(2.0) * (xy * xy + xz * xz + yz * yz);
        let radius = (squares / xx.of(6.0)).root();
        let matrix = scaled([dx, xy, xz, dy, yz, dz], radius.of(1.0) / radius);
        Traceless { mean, radius, unit, matrix }
    }
}

#[inline(always)]
fn scaled<T: Real>([xx, xy, xz, yy, yz, zz]: [T; 6], by: T) -> [T; 6] {
    [xx * by, xy * by, xz * by, yy * by, yz * by, zz * by]
}

fn is_nan(v: [f64; 3]) -> bool {
    v[0].is_nan()
}

/// One of two finished vectors: no branch.
#[inline(always)]
pub fn choose<T: Real>(mask: T::Mask, a: [T; 3], b: [T; 3]) -> [T; 3] {
    [T::choose(mask, a[0], b[0]), T::choose(mask, a[1], b[1]), T::choose(mask, a[2], b[2])]
}

/// The eigenvalue farthest from the two others, and its unit eigenvector (NaN if rounding leaves
/// none), of a matrix with trace 0 and squared norm 6.
#[inline(always)]
fn isolated<T: Real>(m: &[T; 6]) -> (T, [T; 3]) {
    let [xx, xy, xz, yy, yz, zz] = *m;
    let number = |v: f64| xx.of(v);
    let determinant =
        xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
    let d = determinant.size();
    let d = T::choose(d.below(number(2.0)), d, number(2.0));
    let r = number(0.5) * d;
    let [c0, c1, c2, c3] = ROOT_START;
    let mut t = number(c0) + r * (number(c1) + r * (number(c2) + r * number(c3)));
    for _ in 0..ROOT_STEPS {
        let square = t * t;
        t = t - (t * (square - number(3.0)) - d) / (number(3.0) * square - number(3.0));
    }
    // Adding 0 makes −0 a 0.
    let root = t.signed(determinant + number(0.0));
    let (xx, yy, zz) = (xx - root, yy - root, zz - root);
    // Columns of the adjugate are multiples of the eigenvector; the longest has the largest
    // diagonal entry.
    let (ax, ay, az) = (yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy);
    let (axy, axz, ayz) = (xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz);
    let z_leads = ay.below(az);
    let column = choose(z_leads, [axz, ayz, az], [axy, ay, ayz]);
    let x_leads = !ax.below(T::choose(z_leads, az, ay));
    (root, unit_or_nan(choose(x_leads, [ax, axy, axz], column)))
}

/// The smallest eigenvalue, and its unit eigenvector (NaN if both are equal), of `m` in the plane
/// across `axis`.
#[inline(always)]
fn smallest_across<T: Real>(m: &[T; 6], axis: [T; 3]) -> (T, [T; 3]) {
    let (u, v) = across(axis);
    let (mu, mv) = (product(m, u), product(m, v));
    let (a, b, d) = (dot(u, mu), dot(u, mv), dot(v, mv));
    let (zero, half) = (a.of(0.0), a.of(0.5));
    let apart = half * (a - d);
    let radius = (apart * apart + b * b).root();
    let negative = apart.below(zero);
    let x = T::choose(negative, radius - apart, zero - b);
    let y = T::choose(negative, zero - b, apart + radius);
    let vector = [x * u[0] + y * v[0], x * u[1] + y * v[1], x * u[2] + y * v[2]];
    (half * (a + d) - radius, unit_or_nan(vector))
}

/// The vector at length 1; NaN if it is 0.
#[inline(always)]
pub fn unit_or_nan<T: Real>(v: [T; 3]) -> [T; 3] {
    let length = dot(v, v).root();
    [v[0] / length, v[1] / length, v[2] / length]
}

/// Two unit vectors that make a right-handed frame with the unit vector `axis` as third; no root,
/// no case but the sign of z (Duff et al., Building an Orthonormal Basis, Revisited, JCGT 6, 2017).
/// Axes of the coordinate system give axes.
#[inline(always)]
pub fn across<T: Real>([x, y, z]: [T; 3]) -> ([T; 3], [T; 3]) {
    let (zero, one) = (z.of(0.0), z.of(1.0));
    let sign = one.signed(z);
    let a = z.of(-1.0) / (sign + z);
    let b = x * y * a;
    ([one + sign * x * x * a, sign * b, zero - sign * x], [b, sign + y * y * a, zero - y])
}

/// `matrix` times `v`.
#[inline(always)]
pub fn product<T: Real>(matrix: &[T; 6], v: [T; 3]) -> [T; 3] {
    let [xx, xy, xz, yy, yz, zz] = *matrix;
    [
        xx * v[0] + xy * v[1] + xz * v[2],
        xy * v[0] + yy * v[1] + yz * v[2],
        xz * v[0] + yz * v[1] + zz * v[2],
    ]
}

/// The scalar product.
#[inline(always)]
pub fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The vector at length 1; none if it is 0 or not finite. Lengths from 1e-150 to 1e150 are told
/// from 0.
pub fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let length = dot(v, v).sqrt();
    (length > 0.0 && length.is_finite()).then(|| v.map(|c| c / length))
}

/// The one of `v` and −v whose component of largest magnitude (the first of equal ones) is
/// positive; zeros lose their sign.
pub fn canonical<T>(v: [T; 3]) -> [T; 3]
where
    T: Copy + PartialOrd + std::ops::Neg<Output = T> + Default + std::ops::Add<Output = T>,
{
    use std::hint::select_unpredictable;

    let zero = T::default();
    let size = |c: T| select_unpredictable(c < zero, -c, c);
    let mut largest = v[0];
    for &c in &v[1..] {
        largest = select_unpredictable(size(c) > size(largest), c, largest);
    }
    let turned = largest < zero;
    // −0 + 0 = 0
    v.map(|c| select_unpredictable(turned, -c, c) + zero)
}
