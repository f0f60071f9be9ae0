//! Tiles: the points of one cube with neighbourhoods that are exact beyond its faces, as a pass
//! sees them. Knows no stage that works on them.
//!
//! A stage sees plain slices in memory and none of how a scan is stored. What it computes for the
//! core of a tile is what it would compute of the whole scan, since neighbourhoods are proven to be
//! complete or searched for until they are. So a stage is written once, and no cut into tiles shows
//! in a result.

mod around;
pub(crate) mod load;
mod numbered;
mod only;
mod remote;
pub(crate) mod sieve;
mod values;

pub use around::Neighborhood;
pub(crate) use around::{Around, LoadedBox};
pub(crate) use load::{Core, Loader};
pub(crate) use numbered::{NumberedPositions, NumberedReader};
pub(crate) use only::{Cover, Only};
pub(crate) use remote::Remote;
pub(crate) use sieve::{ReadDimensions, RecordRun, Sieve};

use std::ops::Range;
use std::sync::Arc;

use crate::error::Undeclared;
use crate::geom::simd::Simd;
use crate::point::{Bounds, Column, ColumnKind, ColumnValue, Columns, Position};
use crate::{Error, Result};

/// The points of one cube, then a rim of its neighbours' points.
///
/// Positions are distinct and in Morton order, so those of the cube itself, the core, are one
/// range. Columns have one entry a position.
#[derive(Debug)]
pub struct Tile {
    /// The cube whose points this tile decides.
    pub cube: Bounds,
    /// The cube grown by what the stages look at together: columns must be right for all positions
    /// in it. Every position of it is loaded.
    pub zone: Bounds,
    /// All positions loaded.
    pub positions: Vec<Position>,
    /// How many records of each position are decided about: 0 for one that is only seen.
    pub copies: Vec<u32>,
    /// Those of `cube`.
    pub core: Range<usize>,
    /// Columns that the pass computes or reads.
    pub columns: Columns,
    /// True if the signs of normals mean something: a stage turned them to a side.
    pub oriented: bool,
    /// For each position the class of the first of its records that are decided about, in canonical
    /// order (of those that are seen, where none is decided about); empty unless a stage of the
    /// pass reads "Classification".
    pub classes: Vec<u8>,
    /// The partition into cells, once a stage made one.
    pub cells: Partition,
    /// What becomes of each position (meaningful in the core). Kept unless a stage says otherwise.
    pub fates: Vec<Fate>,
    /// Where neighbours are found.
    pub(crate) around: Around,
    /// For each position, the selections that one of its records is in, a bit each; empty if no
    /// stage is limited to some records.
    pub(crate) selections: Vec<u8>,
    /// The selections that the stage at work is limited to.
    pub(crate) limits: u8,
    /// How far the stage at work says that it looks; None where nobody says.
    pub(crate) looks: Option<NeighborNeeds>,
}

/// What a stage says that it needs of the neighbours of each position.
#[derive(Debug, Clone)]
pub(crate) struct NeighborNeeds {
    /// How many it looks at, at most.
    pub count: usize,
    /// The columns that it reads of them.
    pub columns: Arc<[ColumnKind]>,
}

impl Tile {
    /// An empty tile with memory for `capacity` positions.
    pub fn with_capacity(capacity: usize) -> Self {
        Tile {
            cube: Bounds::EMPTY,
            zone: Bounds::EMPTY,
            positions: Vec::with_capacity(capacity),
            copies: Vec::with_capacity(capacity),
            core: 0..0,
            columns: Columns::default(),
            oriented: false,
            classes: Vec::new(),
            cells: Partition::default(),
            fates: Vec::with_capacity(capacity),
            around: Around::default(),
            selections: Vec::new(),
            limits: 0,
            looks: None,
        }
    }

    /// A tile that is all of a small scan: `positions` distinct and in Morton order, one record
    /// each; without columns.
    pub fn of(positions: Vec<Position>) -> Self {
        let bounds = Bounds::of(positions.iter().copied());
        let n = positions.len();
        Tile {
            cube: bounds,
            zone: bounds,
            positions,
            copies: vec![1; n],
            core: 0..n,
            columns: Columns::default(),
            oriented: false,
            classes: Vec::new(),
            cells: Partition::default(),
            fates: vec![Fate::Kept; n],
            around: Around::default(),
            selections: Vec::new(),
            limits: 0,
            looks: None,
        }
    }

    fn clear(&mut self, cube: Bounds, zone: Bounds) {
        (self.cube, self.zone) = (cube, zone);
        self.core = 0..0;
        self.positions.clear();
        self.copies.clear();
        self.columns.clear_values();
        self.oriented = false;
        self.classes.clear();
        self.cells.clear();
        self.fates.clear();
        self.selections.clear();
        self.limits = 0;
    }

    /// True if the stage at work decides about position `i`: one of its records is of the classes
    /// and flags that the stage is limited to.
    pub fn is_chosen(&self, i: usize) -> bool {
        self.copies[i] > 0 && chosen(&self.selections, self.limits, i)
    }

    /// Sets the instruction set that the tile's neighbours are searched by, and that its stages are
    /// to compute by: that of the processor's best if nothing else is set. Drops what was reserved.
    pub(crate) fn compute_by(&mut self, simd: Simd) {
        self.around.compute_by(simd);
    }

    /// The instruction set that stages are to compute by.
    pub(crate) fn simd(&self) -> Simd {
        self.around.simd()
    }

    /// Calls `visit` for every chosen position of the zone with its index in the tile and the `k`
    /// nearest *other* positions of the whole scan: nearest by exact squared distance, ties by
    /// Morton order. Fewer only if the scan has fewer.
    ///
    /// ```
    /// use pointmill::tile::Tile;
    ///
    /// let mut tile = Tile::of(vec![[0, 0, 0], [1, 0, 0], [5, 0, 0], [7, 0, 0]]);
    /// let mut nearest = Vec::new();
    /// tile.each_neighborhood(2, |i, found| nearest.push((i, found.offsets().to_vec())))?;
    /// // In lattice steps from the position, the nearest first.
    /// assert_eq!(nearest[2], (2, vec![[2, 0, 0], [-4, 0, 0]]));
    /// # Ok::<(), pointmill::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// More neighbours than the stage [declares](crate::stage::Needs::neighbors), and those of
    /// reading the store, where neighbours are not in the tile.
    pub fn each_neighborhood(
        &mut self,
        k: usize,
        visit: impl FnMut(usize, &Neighborhood<'_>),
    ) -> Result<()> {
        self.refuse_undeclared(k)?;
        let Tile { positions, zone, around, selections, limits, .. } = self;
        let is_asked = |i: usize| zone.contains(positions[i]) && chosen(selections, *limits, i);
        around.each_neighborhood(positions, k, is_asked, visit)
    }

    /// Refuses to look for more neighbours than the stage at work says: the rim of the tile is as
    /// wide as these need it, and each one more would be searched for in the whole scan.
    fn refuse_undeclared(&self, k: usize) -> Result<()> {
        match &self.looks {
            Some(NeighborNeeds { count, .. }) if k > *count => Err(Error::undeclared(
                Undeclared::Neighbors,
                format!("a stage looks for {k} neighbours and declares {count}"),
            )),
            _ => Ok(()),
        }
    }

    /// Does what [`each_neighborhood`](Tile::each_neighborhood) does, and calls `visit` with the
    /// neighbours' values of `column` besides, in their order. The column is one that the stage
    /// declared to read [of its neighbours](crate::stage::Needs::reads_of_neighbors).
    ///
    /// ```
    /// use pointmill::point::Column;
    /// use pointmill::tile::Tile;
    ///
    /// const ROUGHNESS: Column<f32> = Column::new("Roughness", &[]);
    /// let mut tile = Tile::of(vec![[0, 0, 0], [1, 0, 0], [3, 0, 0]]);
    /// tile.columns.set(&ROUGHNESS, &[1.0, 2.0, 4.0]);
    /// let mut nearest = [0.0; 3];
    /// tile.each_neighborhood_with(1, &ROUGHNESS, |i, _, values| nearest[i] = values[0])?;
    /// assert_eq!(nearest, [2.0, 1.0, 2.0]);
    /// # Ok::<(), pointmill::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// More neighbours than were declared, a column that was not, and what reading the scan fails
    /// with.
    pub fn each_neighborhood_with<T: ColumnValue>(
        &mut self,
        k: usize,
        column: &Column<T>,
        mut visit: impl FnMut(usize, &Neighborhood<'_>, &[T]),
    ) -> Result<()> {
        self.refuse_undeclared(k)?;
        if self.looks.as_ref().is_some_and(|looks| !looks.columns.contains(&column.kind())) {
            let name = column.kind().name();
            let told = format!("a stage reads {name} of its neighbours and does not declare it");
            return Err(Error::undeclared(Undeclared::Column, told));
        }
        let Tile { positions, zone, around, selections, limits, columns, .. } = self;
        let is_asked = |i: usize| zone.contains(positions[i]) && chosen(selections, *limits, i);
        let (loaded, mut beyond) = (columns.get(column)?, around.values_beyond(column.kind()));
        let (mut values, mut outcome) = (Vec::with_capacity(k), Ok(()));
        around.each_neighborhood(positions, k, is_asked, |i, neighborhood| {
            values.clear();
            match neighborhood.found() {
                None => values.extend(neighborhood.ranks().iter().map(|&j| loaded[j as usize])),
                Some(found) if outcome.is_ok() => outcome = beyond.read(found, &mut values),
                Some(_) => {}
            }
            if outcome.is_ok() {
                visit(i, neighborhood, &values);
            }
        })?;
        outcome
    }

    /// True if columns must be right for position `i`.
    pub fn in_zone(&self, i: usize) -> bool {
        self.zone.contains(self.positions[i])
    }
}

/// See [`Tile::is_chosen`].
fn chosen(selections: &[u8], limits: u8, i: usize) -> bool {
    limits == 0 || selections.get(i).is_none_or(|of| of & limits == limits)
}

/// What becomes of the records of a position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fate {
    /// All are kept.
    Kept,
    /// The canonical first is kept, the other copies are removed as coincident.
    KeptOnce,
    /// All are removed, and nothing stands for them.
    Removed,
    /// All are removed; a kept point stands for them.
    Represented {
        /// Distance to the plane through the point that stands for them, along its normal, in
        /// lattice steps.
        deviation: f32,
    },
}

/// Groups of positions that are decided together.
///
/// Group `g` is `members[ends[g - 1]..ends[g]]`, in Morton order; positions without a normal are in
/// none.
#[derive(Debug, Default)]
pub struct Partition {
    /// Indices into the tile's positions, group after group.
    pub members: Vec<u32>,
    /// For each member, its normal's sign in the group: true if the normal is to be turned.
    pub turned: Vec<bool>,
    /// End of each group in `members`.
    pub ends: Vec<u32>,
    /// Reference direction N of the partition, to which θ is the angle; none if each group has its
    /// own: the dominant axis of its normals.
    pub reference: Option<[f64; 3]>,
}

impl Partition {
    /// The stage that is told to make one where a stage needs it and none does.
    pub(crate) const MADE_BY: &'static str = "cells";

    /// Forgets all groups, keeps the memory.
    pub fn clear(&mut self) {
        self.members.clear();
        self.turned.clear();
        self.ends.clear();
    }

    /// The ranges of `members`, one a group.
    pub fn groups(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        (0..self.ends.len()).map(|g| {
            let start = if g == 0 { 0 } else { self.ends[g - 1] as usize };
            start..self.ends[g] as usize
        })
    }
}
