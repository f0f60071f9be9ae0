//! Neighbourhoods estimated side by side: every lane does what
//! [`Estimator::estimate`](super::Estimator::estimate) does, to the last bit.

use super::estimate::{Estimate, EstimateOutcome, Fallback, Method, alone, over_first, settled};
use super::fan::{Fan, LaneRow, MOST, load};
use crate::geom::plane::{self, Covariance};
use crate::geom::simd::{EIGHT, Kernel, Lanes, Mask, Real, Simd};
use crate::geom::star::Star;
use crate::tile::Neighborhood;

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

/// Up to eight neighbourhoods of equally many neighbours, nearest first.
#[derive(Debug, Default)]
pub(super) struct Bundle {
    /// What each neighbourhood belongs to.
    owners: Vec<usize>,
    neighbors: usize,
    /// The offsets, a row for each neighbour and axis.
    at: Vec<[LaneRow; 3]>,
    /// For each neighbour what grows in Morton order, neighbourhood after neighbourhood.
    ranks: Vec<u32>,
    fan: Fan,
}

impl Bundle {
    /// Takes the neighbourhood of `owner`, unless it has too few or too many neighbours, not as
    /// many as the others, or needs more than f64 for exact moments.
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

    /// Estimates all normals, calls `settle` with their owners, and is empty again. Where the fan
    /// of triangles is in doubt, its normal is that of `star`.
    pub fn estimate(
        &mut self,
        method: Method,
        simd: Simd,
        star: &mut Star,
        settle: &mut impl FnMut(usize, EstimateOutcome),
    ) {
        if self.owners.is_empty() {
            return;
        }
        let Bundle { at, fan, owners, ranks, neighbors } = self;
        let estimates = simd.run(Together { at, ranks, fan, method });
        for (lane, owner) in owners.drain(..).enumerate() {
            let offsets = || {
                let offsets = at.iter().map(|at| [at[0][lane], at[1][lane], at[2][lane]]);
                in_morton_order(offsets, &ranks[lane * *neighbors..][..*neighbors])
            };
            let outcome = match estimates.of(lane) {
                LaneResult::Outcome(outcome) => outcome,
                LaneResult::NoFan { flat, adjugate } => {
                    let first = star.normal_of_short(&offsets(), flat);
                    let (normal, fallback) = over_first(method, &adjugate, flat, first);
                    (settled(normal), fallback)
                }
                LaneResult::Nothing => {
                    let whole = |offset: [f64; 3]| offset.map(|v| v as i64);
                    alone(method, star, &offsets().into_iter().map(whole).collect::<Vec<_>>()).0
                }
            };
            settle(owner, outcome);
        }
        ranks.clear();
    }
}

/// Offsets sorted by their ranks.
pub(super) fn in_morton_order<T>(
    offsets: impl Iterator<Item = [T; 3]>,
    ranks: &[u32],
) -> Vec<[T; 3]> {
    let mut sorted: Vec<(u32, [T; 3])> = ranks.iter().copied().zip(offsets).collect();
    sorted.sort_unstable_by_key(|neighbor| neighbor.0);
    sorted.into_iter().map(|neighbor| neighbor.1).collect()
}

/// The estimate of each lane.
struct Estimates {
    normal: [LaneRow; 3],
    /// The normals of the planes of regression.
    flat: [LaneRow; 3],
    adjugate: [LaneRow; 6],
    /// The lanes to be estimated alone: they have no single plane of regression.
    alone: u32,
    /// The lanes where the fan of triangles is in doubt.
    doubtful: u32,
    /// The lanes whose positions all lie on one line.
    lines: u32,
    /// The lanes whose first estimate lies in the plane that it should be normal to: they have the
    /// normal of the plane of regression.
    perpendicular: u32,
}

/// What came of a lane.
enum LaneResult {
    Outcome(EstimateOutcome),
    /// All but the fan of triangles.
    NoFan {
        flat: [f64; 3],
        adjugate: [f64; 6],
    },
    Nothing,
}

impl Estimates {
    fn of(&self, lane: usize) -> LaneResult {
        let is_in = |mask: u32| mask >> lane & 1 == 1;
        if is_in(self.alone) {
            return LaneResult::Nothing;
        }
        if is_in(self.lines) {
            return LaneResult::Outcome((Estimate::None, None));
        }
        if is_in(self.doubtful) {
            let (flat, adjugate) = (self.flat.map(|v| v[lane]), self.adjugate.map(|v| v[lane]));
            return LaneResult::NoFan { flat, adjugate };
        }
        let normal = settled(self.normal.map(|v| v[lane]));
        LaneResult::Outcome((normal, is_in(self.perpendicular).then_some(Fallback::Perpendicular)))
    }
}

/// All lanes of a bundle; those that no neighbourhood is in have a result that nobody reads.
struct Together<'a> {
    at: &'a [[LaneRow; 3]],
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
        let alone = !flat[0].equals(flat[0]).bits();
        let (mut normal, mut perpendicular, mut lines, mut doubtful) = (flat, 0, 0, 0);
        let mut adjugates = [[0.0; EIGHT]; 6];
        if method == Method::Pca {
            if spread(lanes, &scatter) != (1 << EIGHT) - 1 {
                lines = adjugate(&scatter, at.len() + 1).1;
            }
        } else {
            (adjugates, lines) = adjugate(&scatter, at.len() + 1);
            let (first, clear) = fan.mean_normals(lanes, at, ranks, flat);
            doubtful = !(clear & first[0].equals(first[0]).bits());
            if method == Method::Delaunay {
                normal = first;
            } else {
                let fitted = fitted(lanes, &adjugates, first);
                let is_fitted = fitted[0].equals(fitted[0]);
                normal = plane::choose(is_fitted, fitted, flat);
                perpendicular = !is_fitted.bits();
            }
        }
        Estimates {
            normal: store(lanes, normal),
            flat: store(lanes, flat),
            adjugate: adjugates,
            alone,
            doubtful,
            lines,
            perpendicular,
        }
    }
}

#[inline(always)]
fn store<L: Lanes>(lanes: L, rows: [L::F64; 3]) -> [LaneRow; 3] {
    [lanes.store_eight(rows[0]), lanes.store_eight(rows[1]), lanes.store_eight(rows[2])]
}

/// n·Σxy − Σx·Σy as in [`Covariance`].
#[inline(always)]
fn scatter<L: Lanes>(lanes: L, at: &[[LaneRow; 3]]) -> [LaneRow; 6] {
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
fn flat<L: Lanes>(lanes: L, scatter: &[LaneRow; 6], count: usize) -> [L::F64; 3] {
    let unit = 1.0 / (count * count) as f64;
    let mut matrix = [lanes.load_eight(&[0.0; EIGHT]); 6];
    for entry in 0..6 {
        let scatter = lanes.load_eight(&scatter[entry]);
        matrix[entry] = scatter * scatter.of(unit);
    }
    plane::smallest_vector(matrix)
}

/// The lanes where the positions are certainly not on one line: two of the axes have variances
/// whose product exceeds the square of their covariance, whatever rounding did.
#[inline(always)]
fn spread<L: Lanes>(lanes: L, scatter: &[LaneRow; 6]) -> u32 {
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
fn adjugate(scatter: &[LaneRow; 6], count: usize) -> ([LaneRow; 6], u32) {
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
fn fitted<L: Lanes>(lanes: L, adjugate: &[LaneRow; 6], first: [L::F64; 3]) -> [L::F64; 3] {
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
