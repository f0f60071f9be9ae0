//! The lists of candidates of 16 points that search together.

use crate::geom::simd::{COLUMNS, LANES};

/// What is farther than any point: no candidate yet.
pub(super) const NONE: f64 = f64::from_bits((f32::MAX.to_bits() as u64) << 32 | u32::MAX as u64);

/// 16 points that search together.
#[derive(Debug)]
pub(super) struct Batch {
    /// Squared distance of each point's last kept candidate: what is farther is of no use. −1 in
    /// lanes that do not search.
    pub bound: [f32; LANES],
    /// Rank of that candidate: of what is equally far, only smaller ranks are of use.
    pub bound_rank: [u32; LANES],
    /// The largest bound.
    pub farthest: f32,
    /// The best keys of each point in ascending order, `shape.width()` a point.
    pub best: Vec<f64>,
    pub shape: Shape,
    /// How many candidates are kept, at most as many as there is room for.
    pub kept: usize,
}

/// How the list of a point is stored: down the first column, then the second, and so on; or lists
/// of 16 side by side, a row of all after the other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    rows: usize,
    columns: usize,
    pub across: bool,
}

impl Shape {
    /// For lists of `most` candidates: one of those that [`insert`] is made for, if there is one.
    fn of(most: usize) -> Shape {
        let rows = [1, 2, 3, 4, 5, 6, 8, 12, 18];
        match rows.into_iter().find(|rows| most <= rows * COLUMNS) {
            Some(rows) => Shape { rows, columns: COLUMNS, across: false },
            None => Shape { rows: most, columns: 1, across: false },
        }
    }

    pub fn width(self) -> usize {
        self.rows * self.columns
    }

    /// Lists side by side.
    const ACROSS: Shape = Shape { rows: LANES, columns: 1, across: true };

    /// Where the number `i` of a list is.
    pub fn place(self, i: usize) -> usize {
        i % self.rows * self.columns + i / self.rows
    }

    /// Where the number `i` of the list of `lane` is among all.
    #[inline(always)]
    fn index(self, lane: usize, i: usize) -> usize {
        if self.across { i * LANES + lane } else { lane * self.width() + self.place(i) }
    }
}

/// Squared distance of a key.
#[inline(always)]
pub(super) fn distance_of(key: f64) -> f32 {
    f32::from_bits((key.to_bits() >> 32) as u32)
}

/// Rank of a key.
#[inline(always)]
pub(super) fn rank_of(key: f64) -> u32 {
    key.to_bits() as u32
}

impl Batch {
    pub fn new() -> Batch {
        Batch {
            bound: [-1.0; LANES],
            bound_rank: [0; LANES],
            farthest: -1.0,
            best: Vec::new(),
            shape: Shape::of(0),
            kept: 0,
        }
    }

    /// Makes room for `most` candidates a point.
    pub fn fit(&mut self, most: usize) {
        self.make_room(Shape::of(most));
    }

    /// The same for points that meet whole leaves together, of which each finds most of its
    /// candidates in the same: up to 16 candidates are then kept side by side.
    pub fn fit_together(&mut self, most: usize) {
        self.make_room(if most <= LANES { Shape::ACROSS } else { Shape::of(most) });
    }

    fn make_room(&mut self, shape: Shape) {
        self.shape = shape;
        let numbers = self.shape.width() * LANES;
        self.best.clear();
        self.best.reserve_exact(numbers);
        self.best.resize(numbers, NONE);
    }

    /// Bytes of the lists for `most` candidates a point.
    pub fn bytes(most: usize) -> usize {
        Shape::of(most).width() * LANES * size_of::<f64>()
    }

    /// Fills `ranks` with those of a lane's first candidates, in ascending order of keys.
    #[inline(always)]
    pub fn ranks(&self, lane: usize, ranks: &mut [u32]) {
        let Shape { rows, columns, across } = self.shape;
        if across {
            let keys = self.best[lane..].iter().step_by(LANES);
            ranks.iter_mut().zip(keys).for_each(|(rank, key)| *rank = rank_of(*key));
            return;
        }
        let list = &self.best[lane * rows * columns..(lane + 1) * rows * columns];
        for (column, ranks) in ranks.chunks_mut(rows).enumerate() {
            for (row, rank) in ranks.iter_mut().enumerate() {
                *rank = rank_of(list[row * columns + column]);
            }
        }
    }

    /// Number `i` of a lane's list.
    #[inline(always)]
    pub fn key(&self, lane: usize, i: usize) -> f64 {
        self.best[self.shape.index(lane, i)]
    }

    /// Notes what the last kept candidate of a lane is.
    #[inline(always)]
    pub fn bind(&mut self, lane: usize) {
        let last = self.key(lane, self.kept - 1);
        self.bound[lane] = distance_of(last);
        self.bound_rank[lane] = rank_of(last);
    }
}
