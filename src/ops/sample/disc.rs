//! Poisson disc samples that no cut into tiles changes: no two positions that stay are too near to
//! each other, and none goes that could stay.
//!
//! Positions are visited in some order, and one stays if none that stayed before is nearer than
//! the distance. In random order over the whole scan ("dart throwing", Cook 1986) whether one stays
//! could depend on any other. So the order is by cubes whose side is the distance, rounded up to
//! whole steps, and which are anchored at world 0: a cube's colour is the parities of its three
//! indices, one colour is visited after the other, and within a cube positions come by a hash of
//! theirs.
//!
//! Two cubes of one colour have another between them, so nothing of the one is too near to anything
//! of the other, and it does not matter which is visited first. A position depends on others of its
//! cube and on those of adjacent cubes whose colours come before, and these on theirs in turn.
//! Along such a chain of cubes an index changes by one at most at a time, and with it its parity.
//! The order of colours changes one parity at a time, that of x three times in all, those of y and
//! of z twice. A chain meets some of these colours in their order, so that no parity, and no index,
//! changes more often along it. No chain therefore leads farther than three cubes along an axis,
//! and what becomes of a position depends on nothing that is four sides away or more: so far a tile
//! is loaded beyond its cube. The order that counts up to seven would change x seven times.

use serde_json::Value;

use super::super::lengths::Square;
use super::super::removal::{keep_once, remove};
use super::cell_table::CellTable;
use crate::geom::hash::of_position;
use crate::point::{Position, Units, distance2, names};
use crate::quantity::Length;
use crate::report::Tally;
use crate::stage::{Needs, ScanFacts, TileOp};
use crate::tile::Tile;
use crate::{Error, Result};

/// The order of colours: the parities of x, y and z are the bits from the lowest on.
const COLORS: [usize; 8] = [0b000, 0b010, 0b011, 0b111, 0b110, 0b100, 0b101, 0b001];
/// Sides from a position to what its fate does not depend on.
const REACHED_CELLS: i64 = 4;
/// No two positions are farther apart along an axis than cubes of this side.
const LARGEST_SIDE: i64 = 1 << 62;
/// Bytes a position: the table, what stays, and those of a cube that may still stay.
const BYTES: usize = CellTable::BYTES + size_of::<bool>() + size_of::<(u64, u32)>();

/// `sample` by `distance`.
#[derive(Debug)]
pub(super) struct PoissonDisc {
    distance: Length,
    seed: u64,
    settled: Option<SettledDisc>,
}

/// The distance once the lattice is known.
#[derive(Debug, Clone, Copy)]
struct SettledDisc {
    /// Side of the cubes in steps.
    side: i64,
    /// The smallest squared distance in steps that is far enough.
    apart: u128,
    /// World units.
    distance: f64,
}

impl SettledDisc {
    /// Of a distance of `steps`, which need not be whole.
    fn of(steps: f64, distance: f64) -> Self {
        let square = Square::of(steps);
        let side = (steps.ceil() as i64).clamp(1, LARGEST_SIDE);
        SettledDisc { side, apart: square.at_least(), distance }
    }
}

impl PoissonDisc {
    pub fn new(distance: Length, seed: u64) -> Self {
        PoissonDisc { distance, seed, settled: None }
    }

    /// Whether each position of the tile stays, right for those of its core.
    fn sample(&self, tile: &Tile, disc: SettledDisc) -> Vec<bool> {
        let positions = &tile.positions;
        let mut table = CellTable::of(tile, disc.side);
        let mut stays = vec![false; positions.len()];
        let (mut near, mut left) = (Vec::new(), Vec::new());
        for (rank, &color) in COLORS.iter().enumerate() {
            let before = adjacent(color, &COLORS[..rank]);
            for cube in 0..table.len() {
                let at = table.at(cube);
                if color_of(at) != color {
                    continue;
                }
                near.clear();
                for by in &before {
                    let kept = table.kept(std::array::from_fn(|axis| at[axis] + by[axis]));
                    near.extend(kept.iter().map(|&i| positions[i as usize]));
                }
                let is_free = |p: Position| near.iter().all(|&q| distance2(p, q) >= disc.apart);
                left.clear();
                left.extend(
                    table
                        .members(cube)
                        .iter()
                        .map(|&i| (i, positions[i as usize]))
                        .filter(|(_, p)| is_free(*p))
                        .map(|(i, p)| (self.visited(p), i)),
                );
                while let Some(&(_, next)) = left.iter().min() {
                    table.keep(cube, next);
                    stays[next as usize] = true;
                    let p = positions[next as usize];
                    left.retain(|&(_, i)| distance2(p, positions[i as usize]) >= disc.apart);
                }
            }
        }
        stays
    }

    /// When a position is visited among those of its cube; of equal ones the Morton-first is.
    fn visited(&self, p: Position) -> u64 {
        of_position(self.seed, p)
    }
}

fn color_of(place: [i64; 3]) -> usize {
    let [x, y, z] = place.map(|index| (index & 1) as usize);
    x | y << 1 | z << 2
}

/// The steps from a cube of `color` to the adjacent ones that have one of the colours `before` it.
fn adjacent(color: usize, before: &[usize]) -> Vec<[i64; 3]> {
    let by = |n: i64| [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1];
    let is_before = |by: &[i64; 3]| before.contains(&(color ^ color_of(*by)));
    (0..27).map(by).filter(is_before).collect()
}

impl TileOp for PoissonDisc {
    fn needs(&self) -> Needs {
        let reach = self.settled.map_or(0, |disc| disc.side.saturating_mul(REACHED_CELLS));
        let looks = Needs::none().looks_at(names::XYZ);
        looks.cells(reach, false).bytes_per_point(BYTES).removes(None)
    }

    fn convert(&mut self, units: &Units) -> Result<()> {
        self.distance = self.distance.in_scan(units, "sample.distance")?;
        Ok(())
    }

    fn lengths(&self) -> Vec<(&'static str, Length)> {
        vec![("sample.distance", self.distance)]
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        let distance = self.distance.value();
        self.settled = Some(SettledDisc::of(distance / scan.lattice.step, distance));
        Ok(())
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let disc = self.settled.ok_or_else(|| {
            Error::internal("the stage sample ran before its distance was settled")
        })?;
        if u32::try_from(tile.positions.len()).is_err() {
            return Err(Error::internal("a tile has more than 2^32 positions"));
        }
        let stays = self.sample(tile, disc);
        let (mut coincident, mut near) = (0, 0);
        for i in tile.core.clone() {
            match (tile.is_chosen(i), stays[i]) {
                (false, _) => {}
                (true, true) => coincident += keep_once(tile, i),
                (true, false) => near += remove(tile, i),
            }
        }
        tally.remove("sample", "coincident", coincident);
        tally.remove("sample", "too near", near);
        Ok(())
    }

    fn decisions(&self) -> Vec<(String, Value)> {
        self.settled.map_or(Vec::new(), |disc| vec![("distance".into(), disc.distance.into())])
    }
}

#[cfg(test)]
mod tests;
