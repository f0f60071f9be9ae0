//! Normals are turned to agree with those of their neighbours (Hoppe et al., Surface reconstruction
//! from unorganized points, 1992, section 3.3).
//!
//! Signs go along a minimum spanning forest, and no tree of it is ever built: edges come by
//! ascending weight, and sets of positions that are joined by one keep, for each position, whether
//! its sign is that of its set's root. So a walk along the tree is not needed, and equal weights,
//! which come in the order of their positions, leave nothing to chance.

use super::sign::turn;
use crate::geom::angle::is_known;
use crate::geom::nearest::Nearest;
use crate::geom::plane::dot;
use crate::ops::whole::Rows;
use crate::point::{NORMAL, Position, names};
use crate::report::Tally;
use crate::stage::{Gathered, Needs, ScanOp, TileOp};
use crate::tile::Tile;
use crate::{Error, Result};

/// Bytes that an edge takes: its weight and its ends.
const EDGE_BYTES: usize = size_of::<Edge>();
/// Bytes of a position besides: what was gathered, its neighbours, its set, its sign.
const HELD_BYTES: usize =
    Rows::<[f32; 3]>::BYTES + Nearest::BYTES_PER_POINT + 2 * size_of::<u32>() + size_of::<u64>();

/// Two neighbours: one minus the cosine of the angle of their normals without signs, and which.
type Edge = (f32, u32, u32);

/// `orient` by propagation.
#[derive(Debug)]
pub(super) struct Propagation {
    neighbors: usize,
    /// For each position with a normal whether it is to be turned.
    found: Option<Rows<u8>>,
}

impl Propagation {
    pub fn new(neighbors: usize) -> Self {
        Propagation { neighbors, found: None }
    }
}

impl TileOp for Propagation {
    fn needs(&self) -> Needs {
        Needs::none().looks_at(names::XYZ).reads(&NORMAL).writes(&NORMAL)
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let unfound = || Error::internal("the stage orient ran before signs were known");
        let found = self.found.as_ref().ok_or_else(unfound)?;
        turn(tile, tally, |tile, i, _| Some(found.value(tile.positions[i]).is_some_and(|t| t != 0)))
    }
}

impl ScanOp for Propagation {
    type Summary = Rows<[f32; 3]>;

    fn gather_needs(&self) -> Needs {
        let needs = Needs::none().looks_at(names::XYZ).reads(&NORMAL);
        let held = HELD_BYTES + self.neighbors * EDGE_BYTES;
        needs.bytes_per_point(2 * Rows::<[f32; 3]>::BYTES).holds(held)
    }

    fn gather(&self, tile: &mut Tile, _: &mut Tally) -> Result<Rows<[f32; 3]>> {
        let normals = tile.columns.get(&NORMAL)?;
        Ok(Rows::of_core_where(tile, |i| is_known(normals[i]), |i| normals[i]))
    }

    fn conclude(&mut self, gathered: &dyn Gathered<Rows<[f32; 3]>>) -> Result<Option<String>> {
        let rows = Rows::of_scan(gathered)?;
        let edges = edges(&rows.positions, &rows.values, self.neighbors);
        let turns = turns(&rows.positions, &rows.values, &edges, || gathered.go_on())?;
        drop(edges);
        self.found = Some(rows.with(turns));
        Ok(None)
    }
}

/// The edges between neighbours, each once, by ascending weight.
fn edges(positions: &[Position], normals: &[[f32; 3]], k: usize) -> Vec<Edge> {
    let mut edges: Vec<Edge> = Vec::with_capacity(positions.len() * k);
    let mut nearest = Nearest::new();
    nearest.build(positions);
    nearest.search(
        positions,
        k,
        |_| true,
        |i, neighbors, _| {
            for &j in neighbors {
                let cosine = cosine(normals[i], normals[j as usize]);
                let (a, b) = (j.min(i as u32), j.max(i as u32));
                edges.push(((1.0 - cosine.abs()) as f32, a, b));
            }
        },
    );
    drop(nearest);
    edges.sort_unstable_by(|one, two| {
        one.0.total_cmp(&two.0).then((one.1, one.2).cmp(&(two.1, two.2)))
    });
    edges.dedup();
    edges
}

fn cosine(a: [f32; 3], b: [f32; 3]) -> f64 {
    dot(a.map(f64::from), b.map(f64::from))
}

/// For each position 1 if its normal is to be turned; asks now and then whether to go on.
fn turns(
    positions: &[Position],
    normals: &[[f32; 3]],
    edges: &[Edge],
    go_on: impl Fn() -> Result<()>,
) -> Result<Vec<u8>> {
    let mut sets = SignedSets::of(positions.len());
    for edges in edges.chunks(1 << 16) {
        go_on()?;
        for &(_, a, b) in edges {
            let differ = cosine(normals[a as usize], normals[b as usize]) < 0.0;
            sets.join(a, b, differ);
        }
    }
    // The highest of each set; of equally high ones the first, as positions are in order.
    let mut highest = vec![u32::MAX; positions.len()];
    for i in 0..positions.len() as u32 {
        let (root, _) = sets.find(i);
        let best = &mut highest[root as usize];
        if *best == u32::MAX || positions[i as usize][2] > positions[*best as usize][2] {
            *best = i;
        }
    }
    let turn = |i: u32| {
        let (root, differs) = sets.find(i);
        let top = highest[root as usize];
        let (_, top_differs) = sets.find(top);
        let looks_down = normals[top as usize][2] < 0.0;
        u8::from(differs ^ top_differs ^ looks_down)
    };
    Ok((0..positions.len() as u32).map(turn).collect())
}

/// Sets of positions that are joined, each position with its sign beside that of another of its
/// set, the way to the root.
struct SignedSets {
    /// Twice the position on the way to the root, and 1 more if the sign differs from its.
    parents: Vec<u64>,
    sizes: Vec<u32>,
}

impl SignedSets {
    fn of(count: usize) -> Self {
        SignedSets { parents: (0..count as u64).map(|i| 2 * i).collect(), sizes: vec![1; count] }
    }

    /// The root of a position, and whether their signs differ. Sets are joined by size, so the way
    /// has few steps.
    fn find(&self, mut i: u32) -> (u32, bool) {
        let mut differs = false;
        loop {
            let parent = self.parents[i as usize];
            if parent / 2 == u64::from(i) {
                return (i, differs);
            }
            differs ^= parent % 2 == 1;
            i = (parent / 2) as u32;
        }
    }

    /// Joins the sets of two positions whose signs differ or not; nothing if they are one.
    fn join(&mut self, a: u32, b: u32, differ: bool) {
        let ((a, a_differs), (b, b_differs)) = (self.find(a), self.find(b));
        if a == b {
            return;
        }
        let differs = u64::from(differ ^ a_differs ^ b_differs);
        let is_smaller = self.sizes[a as usize] < self.sizes[b as usize];
        let (below, root) = if is_smaller { (a, b) } else { (b, a) };
        self.parents[below as usize] = 2 * u64::from(root) + differs;
        self.sizes[root as usize] += self.sizes[below as usize];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::hash::of_position;
    use crate::geom::morton::morton_cmp;

    /// A ball of positions whose normals have signs by chance.
    fn ball(count: usize) -> (Vec<Position>, Vec<[f32; 3]>) {
        let place = |n: usize| {
            let (turn, z) = (2.399_963 * n as f64, 1.0 - (2.0 * n as f64 + 1.0) / count as f64);
            let across = (1.0 - z * z).sqrt();
            [across * turn.cos(), across * turn.sin(), z]
        };
        let mut all: Vec<(Position, [f32; 3])> = (0..count)
            .map(|n| {
                let p = place(n).map(|v| (v * 1e6) as i64);
                let sign = if of_position(1, p).is_multiple_of(2) { 1.0 } else { -1.0 };
                (p, place(n).map(|v| (v * sign) as f32))
            })
            .collect();
        all.sort_by(|a, b| morton_cmp(&a.0, &b.0));
        all.into_iter().unzip()
    }

    #[test]
    fn all_normals_of_a_ball_look_outwards() {
        let (positions, normals) = ball(2000);
        let edges = edges(&positions, &normals, 8);
        let turns = turns(&positions, &normals, &edges, || Ok(())).unwrap();
        for ((p, n), turn) in positions.iter().zip(&normals).zip(&turns) {
            let sign = if *turn == 1 { -1.0 } else { 1.0 };
            let outwards = dot(p.map(|v| v as f64), n.map(|v| f64::from(v) * sign));
            assert!(outwards > 0.0, "{p:?} looks inwards");
        }
        assert!(turns.contains(&0) && turns.contains(&1));
    }

    #[test]
    fn what_does_not_hang_together_looks_up_by_itself() {
        let positions: Vec<Position> = vec![[0, 0, 0], [1, 0, 0], [1 << 40, 0, 9], [1 << 40, 1, 9]];
        let down = [0.0, 0.0, -1.0];
        let normals = [down, [0.0, 0.0, 1.0], down, down];
        let edges = edges(&positions, &normals, 1);
        let turns = turns(&positions, &normals, &edges, || Ok(())).unwrap();
        assert_eq!(turns, [1, 0, 1, 1]);
    }
}
