//! Neighbourhoods estimated side by side, in plain loops over lanes that compilers turn into vector
//! instructions: every lane does what [`Estimator::estimate`](super::Estimator::estimate) does, to
//! the last bit.

#![allow(clippy::needless_range_loop, reason = "one index walks several arrays of lanes")]

use super::{Estimate, Method, Outcome, alone, settled, varady};
use crate::geom::plane::{self, Covariance};
use crate::geom::star::{Inverted, Projected, Star};

/// Neighbourhoods side by side.
const LANES: usize = 16;
/// The bits of a sorting key that hold a neighbour's rank; those above hold its direction.
const RANK: u64 = 63;
/// Positions times offset up to which all sums of products are exact in f64: their squares.
const EXACT: f64 = (1 << 26) as f64;

type Row = [f64; LANES];

/// Up to 16 neighbourhoods of equally many neighbours.
#[derive(Debug, Default)]
pub(super) struct Bundle {
    /// What each neighbourhood belongs to.
    owners: Vec<usize>,
    neighbors: usize,
    /// Neighbourhood after neighbourhood.
    offsets: Vec<[i64; 3]>,
    /// The same, a row for each neighbour and axis.
    at: Vec<[Row; 3]>,
    /// The inverted projections.
    inverted: Vec<[Row; 2]>,
    /// Distances in the plane, squared.
    squares: Vec<Row>,
    /// Directions, with ranks as their last bits; sorted.
    keys: Vec<Row>,
}

impl Bundle {
    /// Takes the neighbourhood of `owner`, unless it has too few or too many neighbours or not as
    /// many as the others.
    pub fn take(&mut self, owner: usize, offsets: &[[i64; 3]]) -> bool {
        if self.owners.is_empty() {
            self.neighbors = offsets.len();
        }
        if offsets.len() != self.neighbors || !(3..=RANK as usize + 1).contains(&offsets.len()) {
            return false;
        }
        self.owners.push(owner);
        self.offsets.extend_from_slice(offsets);
        true
    }

    /// True if there is no room for another one.
    pub fn is_full(&self) -> bool {
        self.owners.len() == LANES
    }

    /// Estimates all normals, calls `settle` with their owners, and is empty again. Where exact
    /// arithmetic needs more than f64, and where p is not inside of its neighbours' polygon, a
    /// neighbourhood is estimated alone.
    pub fn estimate(
        &mut self,
        method: Method,
        star: &mut Star,
        settle: &mut impl FnMut(usize, Outcome),
    ) {
        if self.neighbors < 2 {
            // A scan of one or two positions has no surface.
            self.owners.drain(..).for_each(|owner| settle(owner, (Estimate::None, None)));
            self.offsets.clear();
            return;
        }
        let exact = self.spread();
        let scatter = self.scatter();
        let flat = flat(&scatter, self.neighbors + 1);
        let nearest = (method == Method::Varady).then(|| {
            self.project(&flat);
            self.sort();
            self.nearest()
        });
        for (lane, &owner) in self.owners.iter().enumerate() {
            let offsets = &self.offsets[lane * self.neighbors..][..self.neighbors];
            let flat = [flat[0][lane], flat[1][lane], flat[2][lane]];
            let scatter = std::array::from_fn(|entry| scatter[entry][lane] as i64);
            let covariance = Covariance::of_scatter(scatter, self.neighbors + 1);
            let outcome = if !exact[lane] || flat[0].is_nan() {
                alone(method, star, offsets)
            } else if covariance.is_of_a_line() {
                (Estimate::None, None)
            } else if let Some(nearest) = &nearest {
                match self.first_estimate(lane, nearest[lane], flat, star) {
                    Some(first) => varady(&covariance, flat, first),
                    None => alone(method, star, offsets),
                }
            } else {
                (settled(flat), None)
            };
            settle(owner, outcome);
        }
        self.owners.clear();
        self.offsets.clear();
    }

    /// Writes the offsets into rows; says which lanes are exact.
    fn spread(&mut self) -> [bool; LANES] {
        self.at.resize(self.neighbors, [[0.0; LANES]; 3]);
        for (lane, offsets) in self.offsets.chunks_exact(self.neighbors).enumerate() {
            for (at, offset) in self.at.iter_mut().zip(offsets) {
                for axis in 0..3 {
                    at[axis][lane] = offset[axis] as f64;
                }
            }
        }
        let mut widest = [0.0; LANES];
        for at in &self.at {
            for row in at {
                for i in 0..LANES {
                    let size = row[i].abs();
                    widest[i] = if size > widest[i] { size } else { widest[i] };
                }
            }
        }
        widest.map(|widest| widest * (self.neighbors + 1) as f64 <= EXACT)
    }

    /// n·Σxy − Σx·Σy as in [`Covariance`].
    fn scatter(&self) -> [Row; 6] {
        let mut sum = [[0.0; LANES]; 3];
        let mut product = [[0.0; LANES]; 6];
        for at in &self.at {
            for i in 0..LANES {
                let o = [at[0][i], at[1][i], at[2][i]];
                let products = plane::products(o);
                for axis in 0..3 {
                    sum[axis][i] += o[axis];
                }
                for entry in 0..6 {
                    product[entry][i] += products[entry];
                }
            }
        }
        let count = (self.neighbors + 1) as f64;
        for i in 0..LANES {
            let means = plane::products([sum[0][i], sum[1][i], sum[2][i]]);
            for entry in 0..6 {
                product[entry][i] = count * product[entry][i] - means[entry];
            }
        }
        product
    }

    /// Projects all neighbours to the planes with the given normals.
    fn project(&mut self, normals: &[Row; 3]) {
        let Bundle { at, inverted, squares, keys, neighbors, .. } = self;
        inverted.resize(*neighbors, [[0.0; LANES]; 2]);
        squares.resize(*neighbors, [0.0; LANES]);
        keys.resize(*neighbors, [0.0; LANES]);
        let mut frame = [[0.0; LANES]; 6];
        for i in 0..LANES {
            let (u, v) = plane::across([normals[0][i], normals[1][i], normals[2][i]]);
            for axis in 0..3 {
                (frame[axis][i], frame[3 + axis][i]) = (u[axis], v[axis]);
            }
        }
        for (rank, at) in at.iter().enumerate() {
            let ([x, y], square, key) = (&mut inverted[rank], &mut squares[rank], &mut keys[rank]);
            for i in 0..LANES {
                let u = [frame[0][i], frame[1][i], frame[2][i]];
                let v = [frame[3][i], frame[4][i], frame[5][i]];
                let p = Projected::of([at[0][i], at[1][i], at[2][i]], u, v);
                (x[i], y[i], square[i]) = (p.x, p.y, p.square);
                key[i] = f64::from_bits(p.direction.to_bits() & !RANK | rank as u64);
            }
        }
    }

    /// Sorts the keys of every lane: Batcher's merge exchange, as in Knuth's Algorithm 5.2.2 M. A
    /// direction that is not a number spoils its lane, which then does not turn left.
    fn sort(&mut self) {
        let count = self.keys.len();
        let top = count.next_power_of_two() / 2;
        let mut p = top;
        while p > 0 {
            let (mut q, mut r, mut d) = (top, 0, p);
            loop {
                for i in (0..count - d).filter(|i| i & p == r) {
                    let (low, high) = self.keys.split_at_mut(i + d);
                    exchange(&mut low[i], &mut high[0]);
                }
                if q == p {
                    break;
                }
                (d, q, r) = (q - p, q / 2, p);
            }
            p /= 2;
        }
    }

    /// The rank of each lane's nearest neighbour in the plane; None if rounding cannot tell.
    fn nearest(&self) -> [Option<u32>; LANES] {
        const RIVAL: f64 = 1.0 + 1.0 / (1u64 << 36) as f64;
        let (mut least, mut rank, mut rivals) = ([f64::MAX; LANES], [0.0; LANES], [0.0; LANES]);
        for (row, this) in self.squares.iter().zip(0u32..) {
            for i in 0..LANES {
                let less = row[i] < least[i];
                least[i] = plane::select(less, row[i], least[i]);
                rank[i] = plane::select(less, f64::from(this), rank[i]);
            }
        }
        for row in &self.squares {
            for i in 0..LANES {
                rivals[i] += plane::select(row[i] <= least[i] * RIVAL, 1.0, 0.0);
            }
        }
        std::array::from_fn(|i| (rivals[i] == 1.0).then_some(rank[i] as u32))
    }

    /// The mean normal of the Delaunay triangles around a lane's p, if p is inside of them.
    fn first_estimate(
        &self,
        lane: usize,
        nearest: Option<u32>,
        flat: [f64; 3],
        star: &mut Star,
    ) -> Option<Option<[f64; 3]>> {
        let mut start = None;
        let sorted = self.keys.iter().enumerate().map(|(place, key)| {
            let rank = (key[lane].to_bits() & RANK) as u32;
            start = if nearest == Some(rank) { Some(place) } else { start };
            let [x, y] = &self.inverted[rank as usize];
            Inverted::new(x[lane], y[lane], rank)
        });
        star.place(sorted);
        star.normal_inside(start, flat, |rank| {
            let at = &self.at[rank as usize];
            [at[0][lane], at[1][lane], at[2][lane]]
        })
    }
}

/// The normals of the planes of regression of `count` positions each; NaN where there is no single
/// one.
fn flat(scatter: &[Row; 6], count: usize) -> [Row; 3] {
    let unit = 1.0 / (count * count) as f64;
    let mut flat = [[0.0; LANES]; 3];
    for i in 0..LANES {
        let matrix = std::array::from_fn(|entry| scatter[entry][i] * unit);
        let normal = plane::smallest_vector(matrix);
        for axis in 0..3 {
            flat[axis][i] = normal[axis];
        }
    }
    flat
}

/// Puts the smaller of two keys first, in every lane.
fn exchange(low: &mut Row, high: &mut Row) {
    for i in 0..LANES {
        // In this form compilers know minimum and maximum.
        let (a, b) = (low[i], high[i]);
        low[i] = if a < b { a } else { b };
        high[i] = if a > b { a } else { b };
    }
}
