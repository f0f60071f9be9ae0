//! What a voxel grid would have left that keeps as many positions as a stage does that chooses in
//! rounds: measured behind the last one, in nodes of the octree, which are the items.
//!
//! A node is looked at block after block, twice: for the points of the grid in it and around it,
//! and for the positions that ask them. So what a thread holds follows from the number of cubes
//! around a node, however many positions these have, and is less than what an arena of the mill
//! has, in whose place it is.

use super::tile::{POSITION_BYTES, RoundScan};
use crate::Result;
use crate::engine::demands::FEWEST;
use crate::engine::job::Job;
use crate::geom::lattice::Lattice;
use crate::point::Position;
use crate::report::deviations::{Histogram, MeasuredDeviations};
use crate::report::{BaselineFigures, VoxelCounts, VoxelNode, VoxelSample, grid_figures};
use crate::stage::GridBeside;
use crate::store::{BLOCK, Levels, Reader, TileKey};
use crate::tile::{Loader, Tile};

/// The arena of a thread has more than it takes to look at nodes, and what they come to.
const _: () = assert!(
    VoxelNode::BYTES + 2 * Histogram::BYTES as usize <= FEWEST * POSITION_BYTES,
    "no memory is planned for looking at nodes"
);

/// Blocks of the scan that an item lists the nodes of.
const BLOCKS: usize = 256;

/// A grid beside a stage, and what became of the positions that it does not keep.
pub(in crate::engine) struct MeasuredGrid {
    /// The side of its cubes in steps.
    side: i64,
    /// Records that the stage removes.
    pub removes: u64,
    deviations: MeasuredDeviations,
}

impl MeasuredGrid {
    /// The figures of the grid in world units; none if nothing was measured.
    pub fn figures(&self, lattice: &Lattice) -> Option<BaselineFigures> {
        grid_figures(&self.deviations, self.side, lattice)
    }
}

/// Measures a grid beside what a stage keeps of so many `records`, whose positions occupy these
/// `levels`; none if it removes nothing.
pub(super) fn measure_beside(
    job: &Job<'_>,
    scan: &RoundScan<'_>,
    (levels, records): (&Levels, u64),
    GridBeside { keeps, side }: GridBeside,
) -> Result<Option<MeasuredGrid>> {
    let sample = VoxelSample::of(side, levels);
    let about = (side.round() as i64).max(1);
    let nodes = nodes(job, scan, &sample)?;
    let side = counts(job, scan, &nodes, about)?.side(about, keeps, levels);
    if side < 2 {
        return Ok(None);
    }
    let deviations = deviations(job, scan, &nodes, side, &sample)?;
    Ok(Some(MeasuredGrid { side, removes: records.saturating_sub(keeps), deviations }))
}

/// The nodes of the sample that hold a position of the scan.
fn nodes(job: &Job<'_>, scan: &RoundScan<'_>, sample: &VoxelSample) -> Result<Vec<TileKey>> {
    let (tiles, level) = (&scan.field.tiles, sample.level);
    let mut all: Vec<TileKey> = Vec::new();
    job.items(tiles.blocks().div_ceil(BLOCKS)).run(
        Reader::default,
        |reader, index| {
            job.advance(0)?;
            let mut corners: Vec<Position> = Vec::new();
            let mut enter = |p: Position| {
                let node = TileKey::around(p, level);
                if corners.last() != Some(&node.corner) && sample.takes(&node) {
                    corners.push(node.corner);
                }
            };
            for b in index * BLOCKS..tiles.blocks().min((index + 1) * BLOCKS) {
                let bounds = tiles.block(b).bounds;
                match TileKey::around(bounds.lo, level) == TileKey::around(bounds.hi, level) {
                    true => enter(bounds.lo),
                    false => tiles.read(b, reader)?.0.iter().for_each(|p| enter(*p)),
                }
            }
            Ok(corners)
        },
        |corners: Vec<Position>| {
            all.extend(corners.into_iter().map(|corner| TileKey { corner, level }));
        },
        |_| Ok(()),
    )?;
    // Those of a node follow one another in Morton order.
    all.dedup();
    Ok(all)
}

/// What a thread looks at nodes with.
struct NodeWorker {
    loader: Loader,
    /// The records that the stage is limited to.
    limits: u8,
    node: VoxelNode,
}

impl NodeWorker {
    fn new(job: &Job<'_>, scan: &RoundScan<'_>) -> NodeWorker {
        let loader = Loader::new(&scan.field.tiles, scan.sieve, BLOCK);
        let limits = job.ops[scan.op].selection;
        NodeWorker { loader, limits, node: VoxelNode::default() }
    }

    /// Finds the points of a grid of `side` steps, as far around a node as counting its cubes or
    /// measuring needs. How many are in the node.
    fn find(&mut self, key: &TileKey, side: i64, measures: bool) -> Result<u64> {
        let NodeWorker { loader, limits, node } = self;
        let around = node.begin(key, side, measures);
        loader.each_block(&around, |tile| {
            chosen(tile, *limits, |p, _| node.take(p));
        })?;
        Ok(node.end())
    }
}

/// Calls `visit` for the positions of a tile that a stage decides about, and how many records each
/// has.
fn chosen(tile: &mut Tile, limits: u8, mut visit: impl FnMut(Position, u32)) {
    tile.limits = limits;
    let all = (0..tile.positions.len()).filter(|i| tile.is_chosen(*i));
    all.for_each(|i| visit(tile.positions[i], tile.copies[i]));
}

/// How many cubes are occupied in the nodes, for the side `about`.
fn counts(
    job: &Job<'_>,
    scan: &RoundScan<'_>,
    nodes: &[TileKey],
    about: i64,
) -> Result<VoxelCounts> {
    let mut sum = VoxelCounts::default();
    job.items(nodes.len()).run(
        || NodeWorker::new(job, scan),
        |worker, index| {
            job.advance(0)?;
            let grid = worker.find(&nodes[index], about, false)?;
            let mut counts = VoxelCounts::of_grid(grid);
            let (limits, mut last) = (worker.limits, None);
            worker.loader.each_block(&nodes[index].cube(), |tile| {
                chosen(tile, limits, |p, _| counts.take(about, last.replace(p), p));
            })?;
            Ok(counts)
        },
        |counts| sum.add(counts),
        |_| Ok(()),
    )?;
    Ok(sum)
}

/// How far what a grid of `side` steps removes in the nodes is from its surface.
fn deviations(
    job: &Job<'_>,
    scan: &RoundScan<'_>,
    nodes: &[TileKey],
    side: i64,
    sample: &VoxelSample,
) -> Result<MeasuredDeviations> {
    let simd = job.task.simd;
    let of_threads = job.items(nodes.len()).run(
        || (NodeWorker::new(job, scan), MeasuredDeviations::default()),
        |(worker, sum), index| {
            job.advance(0)?;
            worker.find(&nodes[index], side, true)?;
            let NodeWorker { loader, limits, node } = worker;
            loader.each_block(&nodes[index].cube(), |tile| {
                chosen(tile, *limits, |p, copies| node.ask(sample, (p, copies), simd, sum));
            })?;
            node.flush(simd, sum);
            Ok(())
        },
        |()| {},
        |(_, sum)| Ok(sum),
    )?;
    let mut sum = MeasuredDeviations::default();
    of_threads.iter().for_each(|of_thread| sum.merge(of_thread));
    Ok(sum)
}
