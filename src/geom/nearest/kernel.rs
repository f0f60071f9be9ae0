//! The arithmetic of the search, 16 lanes at a time.
//!
//! Squared distances are ((dx·dx) + dy·dy) + dz·dz everywhere, boxes included: rounding is
//! monotonic, so no point of a box gets a smaller float than its box does.

use super::batch::{Batch, NONE, distance_of, rank_of};
use super::refine::Leaf;
use super::tree::BoxNode;
use crate::geom::simd::{Kernel, LANES, Lanes, Row, joined, smaller};

/// Points of one set meet a leaf of another: a new search among that begins with all of it.
pub(super) struct Guests<'a> {
    pub batch: &'a mut Batch,
    /// The points, in the frame of their own node.
    pub points: &'a [[f32; LANES]; 3],
    /// From that frame to the leaf's.
    pub shift: [f32; 3],
    pub leaf: &'a Leaf,
    /// The lanes that search.
    pub wanted: u32,
    /// How many candidates they keep.
    pub kept: usize,
}

impl Kernel for Guests<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Guests { batch, points, shift, leaf, wanted, kept } = self;
        batch.kept = kept;
        let mut rows = [[NONE; LANES]; LANES];
        let at = load(lanes, points);
        let at = [
            lanes.add(at[0], lanes.splat(shift[0])),
            lanes.add(at[1], lanes.splat(shift[1])),
            lanes.add(at[2], lanes.splat(shift[2])),
        ];
        for (other, row) in rows.iter_mut().enumerate() {
            let distances = lanes.store(squared(lanes, at, leaf.point(other)));
            *row = keys(&distances, leaf.rank[other]);
        }
        begin(lanes, batch, &mut rows, wanted);
    }
}

/// The points of a leaf meet each other: a new search begins with the nearest of them.
pub(super) struct Home<'a> {
    pub batch: &'a mut Batch,
    pub leaf: &'a Leaf,
    /// The lanes that search.
    pub wanted: u32,
    /// How many candidates they keep.
    pub kept: usize,
}

impl Kernel for Home<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Home { batch, leaf, wanted, kept } = self;
        batch.kept = kept;
        let mut rows = [[NONE; LANES]; LANES];
        let at = load(lanes, &leaf.at);
        for (other, row) in rows.iter_mut().enumerate() {
            let distances = lanes.store(squared(lanes, at, leaf.point(other)));
            *row = keys(&distances, leaf.rank[other]);
            row[other] = NONE;
        }
        begin(lanes, batch, &mut rows, wanted);
    }
}

/// Fills the lists of a batch with its first candidates, a row each in any order.
#[inline(always)]
fn begin<L: Lanes>(lanes: L, batch: &mut Batch, rows: &mut [Row; LANES], wanted: u32) {
    lanes.sort(rows);
    let shape = batch.shape;
    if shape.across {
        batch.best.copy_from_slice(rows.as_flattened());
    } else {
        batch.best.fill(NONE);
        for (i, row) in rows.iter().enumerate().take(shape.width()) {
            let places = batch.best[shape.place(i)..].iter_mut().step_by(shape.width());
            places.zip(row).for_each(|(place, key)| *place = *key);
        }
    }
    for lane in 0..LANES {
        batch.bind(lane);
        if wanted >> lane & 1 == 0 {
            batch.bound[lane] = -1.0;
        }
    }
    batch.farthest = lanes.largest(lanes.load(&batch.bound));
}

/// The keys of one point as a candidate of others; one that is infinitely far is none.
#[inline(always)]
fn keys(distances: &[f32; LANES], rank: u32) -> Row {
    let mut keys = [0.0; LANES];
    for lane in 0..LANES {
        keys[lane] = smaller(joined(distances[lane], rank), NONE);
    }
    keys
}

/// The points of a leaf meet the leaves of a run, nearest first.
pub(super) struct Visit<'a> {
    pub batch: &'a mut Batch,
    pub node: &'a BoxNode,
    /// The children of the node.
    pub leaves: &'a [Leaf],
    /// Those to be met, a bit each.
    pub left: u32,
    /// The points, and a box around them, in the frame of their own node.
    pub points: &'a [[f32; LANES]; 3],
    pub lo: [f32; 3],
    pub hi: [f32; 3],
    /// From that frame to the node's.
    pub shift: [f32; 3],
}

impl Kernel for Visit<'_> {
    /// How many leaves were met.
    type Output = u64;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> u64 {
        let Visit { batch, node, leaves, mut left, points, lo, hi, shift } = self;
        // The same sums as the points' own, and monotonic: a box around the points as stored.
        let boxes = box_distances(lanes, node, moved(lo, shift), moved(hi, shift));
        left &= lanes.at_most(boxes, lanes.splat(batch.farthest));
        if left == 0 {
            return 0;
        }
        let queries = load(lanes, points);
        let queries = [
            lanes.add(queries[0], lanes.splat(shift[0])),
            lanes.add(queries[1], lanes.splat(shift[1])),
            lanes.add(queries[2], lanes.splat(shift[2])),
        ];
        let at = [lanes.store(queries[0]), lanes.store(queries[1]), lanes.store(queries[2])];
        let order = order(&lanes.store(boxes));
        let mut met = 0;
        while left != 0 {
            let child = lanes.first(&order, left);
            left &= !(1 << child);
            met += 1;
            let near = lanes_near(lanes, batch, queries, node, child);
            let sunk = match batch.shape.across {
                true => near != 0 && meet_together(lanes, batch, &leaves[child], queries),
                false => meet(lanes, batch, &leaves[child], near, &at),
            };
            if sunk {
                batch.farthest = lanes.largest(lanes.load(&batch.bound));
                left &= lanes.at_most(boxes, lanes.splat(batch.farthest));
            }
        }
        met
    }
}

/// Numbers that sort like distances, to 20 bits of them, and tell their lanes.
#[inline(always)]
fn order(distances: &[f32; LANES]) -> [u32; LANES] {
    let mut keys = [0; LANES];
    for lane in 0..LANES {
        keys[lane] = distances[lane].to_bits() & !(LANES as u32 - 1) | lane as u32;
    }
    keys
}

/// The lanes for which a leaf can hold a better candidate.
#[inline(always)]
fn lanes_near<L: Lanes>(
    lanes: L,
    batch: &Batch,
    at: [L::F32; 3],
    node: &BoxNode,
    child: usize,
) -> u32 {
    let x =
        gap(lanes, lanes.splat(node.lo[0][child]), lanes.splat(node.hi[0][child]), at[0], at[0]);
    let y =
        gap(lanes, lanes.splat(node.lo[1][child]), lanes.splat(node.hi[1][child]), at[1], at[1]);
    let z =
        gap(lanes, lanes.splat(node.lo[2][child]), lanes.splat(node.hi[2][child]), at[2], at[2]);
    let distances = norm(lanes, x, y, z);
    lanes.before(distances, lanes.load(&batch.bound), node.first[child], &batch.bound_rank)
}

/// The points of the lanes in `near` meet a leaf. True if a bound may have sunk.
#[inline(always)]
fn meet<L: Lanes>(
    lanes: L,
    batch: &mut Batch,
    leaf: &Leaf,
    mut near: u32,
    at: &[[f32; LANES]; 3],
) -> bool {
    let mut found = false;
    let width = batch.shape.width();
    let others = load(lanes, &leaf.at);
    while near != 0 {
        let lane = near.trailing_zeros() as usize & (LANES - 1);
        near &= near - 1;
        let distances = squared(lanes, others, [at[0][lane], at[1][lane], at[2][lane]]);
        let hits = lanes.at_most(distances, lanes.splat(batch.bound[lane]));
        if hits != 0 {
            let list = &mut batch.best[lane * width..(lane + 1) * width];
            insert(lanes, list, &lanes.store(distances), &leaf.rank, hits);
            batch.bind(lane);
            found = true;
        }
    }
    found
}

/// All points meet a leaf. True, as a bound may have sunk.
#[inline(always)]
fn meet_together<L: Lanes>(lanes: L, batch: &mut Batch, leaf: &Leaf, at: [L::F32; 3]) -> bool {
    let mut rows = [[NONE; LANES]; LANES];
    for (other, row) in rows.iter_mut().enumerate() {
        let distances = lanes.store(squared(lanes, at, leaf.point(other)));
        *row = keys(&distances, leaf.rank[other]);
    }
    let (best, _) = batch.best.as_chunks_mut::<LANES>();
    let Some(best) = best.first_chunk_mut::<LANES>() else { return false };
    lanes.merge(best, &mut rows);
    let last = best[batch.kept - 1];
    for (lane, &key) in last.iter().enumerate() {
        // Those that do not search stay so.
        if batch.bound[lane] >= 0.0 {
            batch.bound[lane] = distance_of(key);
            batch.bound_rank[lane] = rank_of(key);
        }
    }
    true
}

/// Three axes.
#[inline(always)]
fn load<L: Lanes>(lanes: L, at: &[[f32; LANES]; 3]) -> [L::F32; 3] {
    [lanes.load(&at[0]), lanes.load(&at[1]), lanes.load(&at[2])]
}

#[inline(always)]
fn moved(v: [f32; 3], shift: [f32; 3]) -> [f32; 3] {
    [v[0] + shift[0], v[1] + shift[1], v[2] + shift[2]]
}

/// Squared distances of points to `q`.
#[inline(always)]
fn squared<L: Lanes>(lanes: L, at: [L::F32; 3], q: [f32; 3]) -> L::F32 {
    let x = lanes.sub(at[0], lanes.splat(q[0]));
    let y = lanes.sub(at[1], lanes.splat(q[1]));
    let z = lanes.sub(at[2], lanes.splat(q[2]));
    norm(lanes, x, y, z)
}

#[inline(always)]
fn norm<L: Lanes>(lanes: L, x: L::F32, y: L::F32, z: L::F32) -> L::F32 {
    lanes.add(lanes.add(lanes.mul(x, x), lanes.mul(y, y)), lanes.mul(z, z))
}

/// How far the intervals `lo..hi` and `from..to` are apart.
#[inline(always)]
fn gap<L: Lanes>(lanes: L, lo: L::F32, hi: L::F32, from: L::F32, to: L::F32) -> L::F32 {
    let gap = lanes.larger(lanes.sub(lo, to), lanes.sub(from, hi));
    lanes.larger(gap, lanes.splat(0.0))
}

/// Squared distances between the 16 boxes of a node and the box `lo..hi`.
#[inline(always)]
fn box_distances<L: Lanes>(lanes: L, node: &BoxNode, lo: [f32; 3], hi: [f32; 3]) -> L::F32 {
    let (los, his) = (load(lanes, &node.lo), load(lanes, &node.hi));
    let x = gap(lanes, los[0], his[0], lanes.splat(lo[0]), lanes.splat(hi[0]));
    let y = gap(lanes, los[1], his[1], lanes.splat(lo[1]), lanes.splat(hi[1]));
    let z = gap(lanes, los[2], his[2], lanes.splat(lo[2]), lanes.splat(hi[2]));
    norm(lanes, x, y, z)
}

/// Squared distances between the boxes of a node and the box `lo..hi`, and a bit for each that is
/// not above `bound`.
pub(super) struct Boxes<'a> {
    pub node: &'a BoxNode,
    pub lo: [f32; 3],
    pub hi: [f32; 3],
    pub bound: f32,
}

impl Kernel for Boxes<'_> {
    type Output = ([f32; LANES], u32);

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> ([f32; LANES], u32) {
        let distances = box_distances(lanes, self.node, self.lo, self.hi);
        (lanes.store(distances), lanes.at_most(distances, lanes.splat(self.bound)))
    }
}

/// Merges candidates into a list of one of the shapes that lists have.
#[inline(always)]
fn insert<L: Lanes>(
    lanes: L,
    list: &mut [f64],
    distances: &[f32; LANES],
    ranks: &[u32; LANES],
    hits: u32,
) {
    macro_rules! of_rows {
        ($($rows:literal)*) => {
            match list.as_chunks_mut().0 {
                $(rows if rows.len() == $rows => {
                    if let Some(rows) = rows.first_chunk_mut::<$rows>() {
                        lanes.insert(rows, distances, ranks, hits);
                    }
                })*
                _ => insert_any(list, distances, ranks, hits),
            }
        };
    }
    of_rows!(3 1 2 4 5 6 8 12 18)
}

/// [`Lanes::insert`] for lists of one column.
fn insert_any(best: &mut [f64], distances: &[f32; LANES], ranks: &[u32; LANES], mut hits: u32) {
    while hits != 0 {
        let lane = hits.trailing_zeros() as usize & (LANES - 1);
        hits &= hits - 1;
        let candidate = joined(distances[lane], ranks[lane]);
        let place = best.partition_point(|&kept| kept < candidate);
        if place < best.len() {
            best.copy_within(place..best.len() - 1, place + 1);
            best[place] = candidate;
        }
    }
}
