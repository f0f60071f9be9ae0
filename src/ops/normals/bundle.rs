//! Neighbourhoods estimated side by side: every lane does what
//! [`Estimator::estimate`](super::Estimator::estimate) does, to
//! the last bit.

use super::fan::Fan;
use super::{Estimate, Fallback, Method, Outcome, alone, settled};
use crate::geom::plane::{self, Covariance};
use crate::geom::simd::{EIGHT, Kernel, Lanes, Mask, Real, Simd};
use crate::geom::star::Star;
use crate::tile::Neighborhood;

/// Most neighbours of a neighbourhood that is not estimated alone.
pub(super) const MOST: usize = 64;
/// Binary logarithm of positions times offset up to which all sums of products are exact in f64:
/// their squares.
const EXACT_BITS: u32 = 26;

/// How many zeros at the end all offsets share, if their moments are exact in f64 without them, or
/// with them already, which is 0; none if they are not. `farthest2` is the largest of their squared
/// lengths.
///
/// On decimal lattices offsets are short; differences of neighbouring f32 on a lattice with 30
/// binary places end in zeros. A power of two changes no normal.
pub(super) fn shift(offsets: &[[i64; 3]], farthest2: u128) -> Option<u32> {
    let bits = |v: u128| u128::BITS - v.leading_zeros();
    let needed = bits(farthest2).div_ceil(2) + bits(offsets.len() as u128 + 1);
    let Some(excess @ 1..) = needed.checked_sub(EXACT_BITS) else { return Some(0) };
    let shared = offsets.iter().fold(0, |all, o| all | o[0] | o[1] | o[2]).trailing_zeros();
    (shared >= excess).then_some(shared)
}

/// One number of each neighbourhood.
pub(super) type Row = [f64; EIGHT];

/// Up to eight neighbourhoods of equally many neighbours, nearest first.
#[derive(Debug, Default)]
pub(super) struct Bundle {
    /// What each neighbourhood belongs to.
    owners: Vec<usize>,
    neighbors: usize,
    /// The offsets, a row for each neighbour and axis.
    at: Vec<[Row; 3]>,
    /// For each neighbour what grows in Morton order, neighbourhood after neighbourhood.
    ranks: Vec<u32>,
    fan: Fan,
}

impl Bundle {
    /// Takes the neighbourhood of `owner`, unless it has too few or too many neighbours, not as many
    /// as the others, or needs more than f64 for exact moments.
    pub fn take(&mut self, owner: usize, neighborhood: &Neighborhood<'_>) -> bool {
        let count = neighborhood.ranks().len();
        if self.owners.is_empty() {
            self.neighbors = count;
            self.at.resize(count, [[0.0; EIGHT]; 3]);
        }
        if count != self.neighbors || !(3..=MOST).contains(&count) {
            return false;
        }
        let offsets = neighborhood.offsets();
        let Some(shift) = shift(offsets, neighborhood.farthest2()) else { return false };
        let lane = self.owners.len() & (EIGHT - 1);
        for (at, &offset) in self.at.iter_mut().zip(offsets) {
            for axis in 0..3 {
                at[axis][lane] = (offset[axis] >> shift) as f64;
            }
        }
        self.ranks.extend_from_slice(neighborhood.ranks());
        self.owners.push(owner);
        true
    }

    /// True if there is no room for another one.
    pub fn is_full(&self) -> bool {
        self.owners.len() == EIGHT
    }

    /// Estimates all normals, calls `settle` with their owners, and is empty again. Where p is
    /// not clearly inside of its neighbours' polygon, a neighbourhood is estimated alone.
    pub fn estimate(
        &mut self,
        method: Method,
        simd: Simd,
        star: &mut Star,
        settle: &mut impl FnMut(usize, Outcome),
    ) {
        if self.owners.is_empty() {
            return;
        }
        let Bundle { at, fan, owners, ranks, neighbors } = self;
        let normals = simd.run(Together { at, ranks, fan, method });
        for (lane, owner) in owners.drain(..).enumerate() {
            let outcome = normals.outcome(lane).unwrap_or_else(|| {
                let offsets = at.iter().map(|at| [at[0][lane], at[1][lane], at[2][lane]]);
                let offsets = offsets.map(|offset| offset.map(|v| v as i64));
                let ranks = &ranks[lane * *neighbors..][..*neighbors];
                alone(method, star, &in_morton_order(offsets, ranks))
            });
            settle(owner, outcome);
        }
        ranks.clear();
    }
}

/// Offsets sorted by their ranks.
pub(super) fn in_morton_order(
    offsets: impl Iterator<Item = [i64; 3]>,
    ranks: &[u32],
) -> Vec<[i64; 3]> {
    let mut sorted: Vec<(u32, [i64; 3])> = ranks.iter().copied().zip(offsets).collect();
    sorted.sort_unstable_by_key(|neighbor| neighbor.0);
    sorted.into_iter().map(|neighbor| neighbor.1).collect()
}

/// The estimate of each lane.
struct Estimates {
    normal: [Row; 3],
    /// The lanes to be estimated alone.
    alone: u32,
    /// The lanes whose positions all lie on one line.
    lines: u32,
    /// The lanes whose first estimate lies in the plane that it should be normal to: they have the
    /// normal of the plane of regression.
    perpendicular: u32,
}

impl Estimates {
    /// None if the lane is to be estimated alone.
    fn outcome(&self, lane: usize) -> Option<Outcome> {
        let is_in = |mask: u32| mask >> lane & 1 == 1;
        if is_in(self.alone) {
            return None;
        }
        if is_in(self.lines) {
            return Some((Estimate::None, None));
        }
        let normal = settled([self.normal[0][lane], self.normal[1][lane], self.normal[2][lane]]);
        Some((normal, is_in(self.perpendicular).then_some(Fallback::Perpendicular)))
    }
}

/// All lanes of a bundle; those that no neighbourhood is in have a result that nobody reads.
struct Together<'a> {
    at: &'a [[Row; 3]],
    /// Neighbourhood after neighbourhood.
    ranks: &'a [u32],
    fan: &'a mut Fan,
    method: Method,
}

impl Kernel for Together<'_> {
    type Output = Estimates;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Estimates {
        let Together { at, ranks, fan, method } = self;
        let scatter = scatter(lanes, at);
        let flat = flat(lanes, &scatter, at.len() + 1);
        let mut alone = !flat[0].equals(flat[0]).bits();
        let (mut normal, mut perpendicular, mut lines) = (flat, 0, 0);
        if method == Method::Pca {
            if spread(lanes, &scatter) != (1 << EIGHT) - 1 {
                lines = adjugate(&scatter, at.len() + 1).1;
            }
        } else {
            let (adjugate, of_lines) = adjugate(&scatter, at.len() + 1);
            lines = of_lines;
            let (first, clear) = fan.mean_normals(lanes, at, ranks, flat);
            alone |= !(clear & first[0].equals(first[0]).bits());
            let fitted = fitted(lanes, &adjugate, first);
            let is_fitted = fitted[0].equals(fitted[0]);
            normal = plane::choose(is_fitted, fitted, flat);
            perpendicular = !is_fitted.bits();
        }
        let normal = [
            lanes.store_eight(normal[0]),
            lanes.store_eight(normal[1]),
            lanes.store_eight(normal[2]),
        ];
        Estimates { normal, alone, lines, perpendicular }
    }
}

/// Three rows.
#[inline(always)]
pub(super) fn load<L: Lanes>(lanes: L, rows: &[Row; 3]) -> [L::F64; 3] {
    [lanes.load_eight(&rows[0]), lanes.load_eight(&rows[1]), lanes.load_eight(&rows[2])]
}

/// n·Σxy − Σx·Σy as in [`Covariance`].
#[inline(always)]
fn scatter<L: Lanes>(lanes: L, at: &[[Row; 3]]) -> [Row; 6] {
    let zero = lanes.load_eight(&[0.0; EIGHT]);
    let (mut sum, mut product) = ([zero; 3], [zero; 6]);
    for at in at {
        let [x, y, z] = load(lanes, at);
        sum = [sum[0] + x, sum[1] + y, sum[2] + z];
        let products = plane::products([x, y, z]);
        for entry in 0..6 {
            product[entry] = product[entry] + products[entry];
        }
    }
    let count = zero.of((at.len() + 1) as f64);
    let means = plane::products(sum);
    let mut scatter = [[0.0; EIGHT]; 6];
    for entry in 0..6 {
        scatter[entry] = lanes.store_eight(count * product[entry] - means[entry]);
    }
    scatter
}

/// The normals of the planes of regression of `count` positions each; NaN where there is no single
/// one.
#[inline(always)]
fn flat<L: Lanes>(lanes: L, scatter: &[Row; 6], count: usize) -> [L::F64; 3] {
    let unit = 1.0 / (count * count) as f64;
    let mut matrix = [lanes.load_eight(&[0.0; EIGHT]); 6];
    for entry in 0..6 {
        let scatter = lanes.load_eight(&scatter[entry]);
        matrix[entry] = scatter * scatter.of(unit);
    }
    plane::smallest_vector(matrix)
}

/// The lanes where the positions are certainly not on one line: two of the axes have variances whose
/// product exceeds the square of their covariance, whatever rounding did.
#[inline(always)]
fn spread<L: Lanes>(lanes: L, scatter: &[Row; 6]) -> u32 {
    // Two products are rounded, each by a factor within 1 ± 2^-53.
    const CERTAIN: f64 = 1.0 - 4.0 * f64::EPSILON;
    let mut entries = [lanes.load_eight(&scatter[0]); 6];
    for entry in 1..6 {
        entries[entry] = lanes.load_eight(&scatter[entry]);
    }
    let [xx, xy, xz, yy, yz, zz] = entries;
    let certain = xx.of(CERTAIN);
    let over = (xy * xy).below(xx * yy * certain)
        | (xz * xz).below(xx * zz * certain)
        | (yz * yz).below(yy * zz * certain);
    over.bits()
}

/// The adjugates of the covariances of `count` positions each, and the lanes where all are on one
/// line.
#[inline(always)]
fn adjugate(scatter: &[Row; 6], count: usize) -> ([Row; 6], u32) {
    let (mut adjugate, mut lines) = ([[0.0; EIGHT]; 6], 0);
    for lane in 0..EIGHT {
        let mut entries = [0; 6];
        for entry in 0..6 {
            entries[entry] = scatter[entry][lane] as i64;
        }
        let of_lane = Covariance::of_scatter(entries, count).adjugate();
        for entry in 0..6 {
            adjugate[entry][lane] = of_lane[entry];
        }
        let is_line = (of_lane[0] == 0.0) & (of_lane[3] == 0.0) & (of_lane[5] == 0.0);
        lines |= u32::from(is_line) << lane;
    }
    (adjugate, lines)
}

/// The height function's normal where the first estimates are `first`, at length 1; NaN if it is 0.
#[inline(always)]
fn fitted<L: Lanes>(lanes: L, adjugate: &[Row; 6], first: [L::F64; 3]) -> [L::F64; 3] {
    let mut matrix = [first[0]; 6];
    for entry in 0..6 {
        matrix[entry] = lanes.load_eight(&adjugate[entry]);
    }
    let normal = plane::product(&matrix, first);
    let length = plane::dot(normal, normal).root();
    let zero = length.of(0.0);
    let usable = zero.below(length) & length.below(zero.of(f64::INFINITY));
    let length = L::F64::choose(usable, length, zero.of(f64::NAN));
    [normal[0] / length, normal[1] / length, normal[2] / length]
}
