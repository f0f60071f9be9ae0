//! The first phase of `cells` with `keep`: every division that could be made, and of which range.

use super::division::Division;
use super::entry;
use super::keys::Cells;
use super::limit::Limit;
use super::threshold::Threshold;
use crate::geom::angle::{MaxAngle, is_known};
use crate::report::Tally;
use crate::stage::{Gathered, Needs, ScanOp, TileOp};
use crate::tile::{Partition, Tile};
use crate::{Error, Result};

/// Bytes a position: what is found, 16 for every division and 32 for every initial cell that is
/// divided, and the order of the initial cells.
const BYTES: usize = 16 + 16 + 12;

/// Every division of a range of angles that can be told from none.
const ALL: Limit = Limit { max_angle: MaxAngle::NONE, ties: None };

impl ScanOp for Cells {
    fn gather_needs(&self) -> Needs {
        let needs = self.needs();
        Needs { bytes_per_point: needs.bytes_per_point + BYTES, ..needs }
    }

    fn gather(&self, tile: &mut Tile, found: &mut Vec<[u64; 2]>, _: &mut Tally) -> Result<()> {
        // What crosses a face is counted by the second phase.
        let (mut cells, _) = self.initial_cells(tile)?;
        let mut division = Division::new(self.rule(ALL)?, tile);
        let without_normal =
            tile.core.clone().filter(|&i| tile.is_chosen(i) && !is_known(tile.normals[i])).count();
        let initial = owned_in_order(&division, &mut cells);
        // m positions of a cell have at most m − 1 divisions.
        found.reserve_exact(cells.members.len() + initial.len() + 1);
        let mut parts = 0;
        for (first, start, end) in initial {
            cells.ends.clear();
            let (mut divisions, mut more) = (0, 0);
            division.run(start as usize..end as usize, &mut cells, |range, parts| {
                if divisions == 0 {
                    found.extend(entry::cell(tile.positions[first as usize]));
                }
                found.push(entry::division(range, parts));
                divisions += 1;
                more += parts;
            });
            parts += cells.ends.len() as u64 - more;
        }
        found.push(entry::kept(parts + without_normal as u64));
        // The members are in the order of a division that is not to be.
        cells.clear();
        tile.cells = cells;
        Ok(())
    }

    fn conclude(&mut self, found: &dyn Gathered) -> Result<Option<String>> {
        let keep = self.keep.ok_or_else(|| Error::internal("there is no target to reach"))?;
        let auto = self.settled()?.target;
        let threshold = Threshold::find(found, keep, auto)?;
        let warning = if auto.is_none() { threshold.warning(keep) } else { None };
        self.threshold = Some(threshold);
        Ok(warning)
    }
}

/// The initial cells whose Morton-first member is in the tile's core, in the order of those: the
/// first member, and the range of members.
fn owned_in_order(division: &Division, cells: &mut Partition) -> Vec<(u32, u32, u32)> {
    let mut start = 0;
    let mut owned = Vec::with_capacity(cells.ends.len());
    for end in std::mem::take(&mut cells.ends) {
        if division.owns(cells, start as usize) {
            owned.push((cells.members[start as usize], start, end));
        }
        start = end;
    }
    owned.sort_unstable();
    owned
}
