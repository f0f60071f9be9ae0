//! The stage `cells`: cubes of points, divided until the normals of each part agree.

mod division;
mod grouping;
mod settings;

use std::num::NonZeroUsize;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::point::Position;
use crate::report::Tally;
use crate::stage::{Needs, ScanFacts, TileOp};
use crate::tile::{Cells as Partition, Tile};
use crate::{Error, Result};

use division::{Division, Rule};
use grouping::Grouping;
pub use settings::{Measure, Side, Split};

/// Direction N that angles are measured from.
const REFERENCE: [f64; 3] = [1.0, 0.0, 0.0];
/// Positions that an occupied cube holds on average, at least, where the side is chosen by itself.
const POSITIONS_PER_CUBE: u64 = 32;
/// Cubes of this side, anchored at world 0, are the octants of the lattice: no larger side differs.
const LARGEST_SIDE: i64 = 1 << 62;
/// Bytes a position: member, turned, end of a group, end of an initial cell, room to divide.
const BYTES: usize = 4 + 1 + 4 + 4 + 4;
/// Bytes a position where positions are sorted by cell.
const SORTING_BYTES: usize = 32;

/// Partitions the tile into cells of agreeing normals (the paper's second step).
///
/// The initial cells are cubes of side `side`, anchored at world 0. Normals have no meaningful sign,
/// so those of a cell are turned to the side of its dominant axis: the eigenvector of the largest
/// eigenvalue of Σnnᵀ, its largest component positive. A cell in which the angles θ to N span more
/// than `max_angle`, and which has more than `min_points` positions, is divided; then each part
/// alike, with an axis of its own: beside a roof of many points, the few normals of a wall keep
/// signs that mean nothing.
///
/// It counts distinct positions, never records: copies of a point weigh as one.
///
/// `split = "voronoi"` needs at most m − 1 divisions for m positions, but where each division
/// separates only a few their cost is quadratic. No surface does that; to bound the time of data
/// that does, parts more than 64 + 2 log₂ m divisions deep are cut in eight instead
/// (`cells_cut_deep` of the report counts the initial cells with such parts).
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Cells {
    /// Side of the initial cells: a length in world units, rounded to whole lattice steps, or "auto":
    /// the smallest 2^j steps for which occupied cubes hold 32 positions on average.
    pub side: Side,
    /// Largest θ_max − θ_min of a cell (the paper's α) in radians, 0 to π. In a pipeline file also
    /// "6deg" or "0.1rad".
    #[serde(deserialize_with = "settings::angle")]
    pub max_angle: f64,
    /// Cells of so many positions or fewer are not divided (the paper's β).
    pub min_points: NonZeroUsize,
    /// How a cell is divided.
    pub split: Split,
    /// What the range of angles of a cell is.
    pub measure: Measure,
    #[serde(skip)]
    settled: Option<Settled>,
}

/// The side once the scan is known.
#[derive(Debug, Clone, Copy)]
struct Settled {
    /// Lattice steps.
    steps: i64,
    /// World units.
    length: f64,
}

impl Settled {
    fn is_aligned(self) -> bool {
        self.steps.count_ones() == 1
    }
}

impl Default for Cells {
    fn default() -> Self {
        Cells {
            side: Side::Auto,
            max_angle: 0.1,
            min_points: NonZeroUsize::MIN,
            split: Split::Voronoi,
            measure: Measure::Axis,
            settled: None,
        }
    }
}

impl TileOp for Cells {
    fn needs(&self) -> Needs {
        let aligned = match self.settled {
            Some(settled) => settled.is_aligned(),
            None => self.side == Side::Auto,
        };
        Needs {
            reads: vec!["Normal".into()],
            writes: vec!["Cell".into()],
            cell_side: self.settled.map_or(0, |settled| settled.steps),
            cell_aligned: aligned,
            bytes_per_point: if aligned { BYTES } else { BYTES + SORTING_BYTES },
            ..Needs::default()
        }
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        let steps = match self.side {
            Side::Auto => 1 << scan.levels.smallest_side(POSITIONS_PER_CUBE),
            Side::Length(length) => scan.lattice.steps(length).min(LARGEST_SIDE),
        };
        self.settled = Some(Settled { steps, length: steps as f64 * scan.lattice.step });
        Ok(())
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let settled = self
            .settled
            .ok_or_else(|| Error::internal("the stage cells ran before its side was settled"))?;
        if u32::try_from(tile.positions.len()).is_err() {
            return Err(Error::internal("a tile has more than 2^32 positions"));
        }
        let Tile { positions, normals, core, cells, .. } = tile;
        cells.clear();
        cells.reference = REFERENCE;
        let grouping = Grouping { positions, normals, core: core.clone(), side: settled.steps };
        let crossing = grouping.run(cells);
        tally.work("crossing_cells", crossing);
        let rule = Rule::new(self, REFERENCE, settled.steps);
        self.divide(Division::new(rule, positions, normals), cells, &|i| core.contains(&i), tally);
        Ok(())
    }

    fn decisions(&self) -> Vec<(String, Value)> {
        self.settled.map_or(Vec::new(), |settled| {
            vec![
                ("side".into(), settled.length.into()),
                ("side_steps".into(), settled.steps.into()),
            ]
        })
    }
}

impl Cells {
    /// Divides the initial cells in place. What crosses a tile's face is counted by the tile whose
    /// core has its Morton-first member, so that every cut into tiles counts alike.
    fn divide(
        &self,
        mut division: Division,
        cells: &mut Partition,
        is_core: &dyn Fn(usize) -> bool,
        tally: &mut Tally,
    ) {
        let initial = std::mem::take(&mut cells.ends);
        cells.turned.resize(cells.members.len(), false);
        cells.ends.reserve_exact(cells.members.len());
        let owned = |cells: &Partition, start: usize| is_core(cells.members[start] as usize);
        let (mut cells_initial, mut cells_divided, mut cut_deep) = (0, 0, 0);
        let mut start = 0;
        for end in initial {
            let mine = u64::from(owned(cells, start));
            let groups = cells.ends.len();
            let deep = division.run(start, end as usize, cells);
            cells_initial += mine;
            cut_deep += mine * u64::from(deep);
            for group in groups..cells.ends.len() {
                cells_divided += u64::from(owned(cells, start));
                start = cells.ends[group] as usize;
            }
        }
        tally.count("cells_initial", cells_initial);
        tally.count("cells", cells_divided);
        if cut_deep > 0 {
            tally.count("cells_cut_deep", cut_deep);
        }
    }
}

/// Corner of the cell of side `side`, anchored at world 0, that holds `p`.
fn corner(p: Position, side: i64) -> Position {
    p.map(|v| v.div_euclid(side) * side)
}
