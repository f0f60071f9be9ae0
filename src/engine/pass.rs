//! Passes over the scan: which tile stages run on each tile in turn, what they see, and what is
//! stored.
//!
//! Stages that follow each other run on a tile while it is in memory, so that nothing is stored
//! between them. That ends where a stage removes or marks records, as those behind it must not see
//! them in the rim either, and where a stage decides by figures of the whole scan, which are known
//! when all tiles were seen. A pass says whose outcome it goes on from, which makes chains and
//! branches one case.

use std::sync::Arc;

use super::row::RowLayout;
use crate::expression::{Choice, Condition, Weight};
use crate::graph::{Limits, Written};
use crate::point::{ColumnKind, ComputedDimension, Mark, NORMAL, PointBatch, Schema, names};
use crate::report::Tally;
use crate::stage::{AnyScanOp, Needs, RoundOp, TileOp, Transform};
use crate::tile::{Loader, NeighborNeeds, ReadDimensions, Sieve, Tile};
use crate::{Error, Result};

/// A tile stage and where it stands.
pub(crate) struct StageOp {
    pub kind: String,
    /// How it is written in its pipeline.
    pub written: Arc<dyn Written>,
    pub op: Op,
    pub limits: Limits,
    /// The columns that stages above it compute.
    pub above: Vec<ColumnKind>,
    /// The bits of the records that it is limited to; 0 for all.
    pub selection: u8,
    /// The selections of the conditions by which it weighs positions.
    pub weighed: Vec<u8>,
    /// What streams behind it and moves the records as it said, if it moves any.
    pub mover: Option<usize>,
}

impl StageOp {
    /// The columns by which its records are chosen; none if the records alone say which they are.
    pub fn chosen_by(&self) -> Vec<ColumnKind> {
        let condition = self.limits.choice.condition.as_ref();
        let names = condition.map_or(Vec::new(), Condition::names);
        named_columns(&names, &self.above)
    }
}

/// The columns among `all` that have a number with one of these names.
pub(crate) fn named_columns(names: &[&str], all: &[ColumnKind]) -> Vec<ColumnKind> {
    let is_named = |kind: &&ColumnKind| names.iter().any(|name| kind.part(name).is_some());
    all.iter().filter(is_named).copied().collect()
}

/// The role of a tile stage.
pub(crate) enum Op {
    Tile(Box<dyn TileOp>),
    Scan(Box<dyn AnyScanOp>),
    Round(Box<dyn RoundOp>),
}

impl Op {
    pub fn tile(&self) -> &dyn TileOp {
        match self {
            Op::Tile(op) => &**op,
            Op::Scan(op) => &**op,
            Op::Round(op) => &**op,
        }
    }

    /// What positions weigh, where it asks for that.
    pub fn weight(&self) -> Option<(&'static str, &Weight)> {
        match self {
            Op::Round(op) => op.weight(),
            Op::Tile(_) | Op::Scan(_) => None,
        }
    }

    pub fn tile_mut(&mut self) -> &mut dyn TileOp {
        match self {
            Op::Tile(op) => &mut **op,
            Op::Scan(op) => &mut **op,
            Op::Round(op) => &mut **op,
        }
    }
}

/// A stage that streams and where it stands: in the decode, or behind stages that work on tiles or
/// on one of several branches. There, what it removes is entered in a pass of its own, and what it
/// changes is changed as records are written.
pub(crate) struct StreamOp {
    pub kind: String,
    /// Its name or, where it has none, its kind, with a number if several are of it.
    pub label: Arc<str>,
    /// How it is written in its pipeline.
    pub written: Arc<dyn Written>,
    pub transform: Box<dyn Transform>,
    pub choice: Choice,
    /// The columns that stages above it compute.
    pub above: Vec<ColumnKind>,
    /// True if it is a part of a stage that works on tiles: see [`Moved`](super::moved::Moved).
    pub of_tiles: bool,
}

impl StreamOp {
    /// The columns that it looks at, by its expressions and what it is limited to among others.
    pub fn reads(&self) -> Vec<ColumnKind> {
        let expressions = self.transform.expressions();
        let own = expressions.iter().flat_map(|(_, expression)| expression.names());
        let condition = self.choice.condition.as_ref();
        let names: Vec<&str> =
            own.chain(condition.into_iter().flat_map(Condition::names)).collect();
        let mut reads = named_columns(&names, &self.above);
        reads.extend(self.transform.needs().reads);
        reads
    }

    /// The dimensions of the records that it changes.
    pub fn changes(&self) -> Vec<String> {
        self.transform.needs().changes
    }

    /// True if it changes coordinates.
    pub fn moves(&self) -> bool {
        self.changes().iter().any(|name| names::XYZ.contains(&name.as_str()))
    }

    /// True if it reads the numbers that records have in the input.
    pub fn reads_record_numbers(&self) -> bool {
        self.transform.needs().record_numbers
    }

    /// Lets it work on those records of `batch` that it is limited to.
    pub fn apply(&self, batch: &mut PointBatch, tally: &mut Tally) -> Result<()> {
        let before = batch.len();
        tally.stage = self.label.clone();
        if self.choice.is_all() {
            self.transform.apply(batch, tally)?;
        } else {
            let mut chosen = Vec::with_capacity(before);
            self.choice.holds(batch, &mut chosen)?;
            batch.change_some(&chosen, |some| self.transform.apply(some, tally))?;
        }
        tally.stage = Arc::default();
        match batch.len() > before {
            true => Err(Error::internal(format!("the stage {} made points up", self.kind))),
            false => Ok(()),
        }
    }
}

/// A path through the graph, from the source to the last stage that works.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Branch {
    /// The pass that ends it.
    pub pass: usize,
    /// A sink of what its last stage leaves.
    pub last_sink: usize,
    /// The tile stages on it.
    pub ops: Vec<usize>,
    /// Its stages as reports and outputs name them: as if it were the only one.
    pub stages: serde_json::Value,
}

/// One of a pass's stages, in one of its phases.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Call {
    /// Which of the tile stages.
    pub op: usize,
    /// True for the first phase of a scan stage.
    pub gathers: bool,
}

/// Stages that run on each tile in turn.
#[derive(Debug, Clone, Default)]
pub(crate) struct Pass {
    /// The pass whose outcome it goes on from; None for the scan as it was decoded.
    pub behind: Option<usize>,
    /// Stages that stream and are applied to what the calls leave.
    pub filters: Vec<usize>,
    /// Stages that stream above these and change what they may look at.
    pub changed_by: Vec<usize>,
    /// The tile stage whose records are chosen by what this pass finds, for the pass behind it.
    pub chooses: Option<usize>,
    /// Columns that stages which stream look at, here or as records are written.
    pub streamed: Vec<ColumnKind>,
    pub calls: Vec<Call>,
    /// Those of its stages that choose in rounds before it.
    pub by_rounds: Vec<usize>,
    /// How often the stages were applied before, where they are repeated.
    pub round: usize,
    /// True if one is that reduces, and is repeated.
    pub is_repeated: bool,
    /// True if a stage reads the class of positions.
    pub reads_classes: bool,
    /// Selections of the records that are seen as neighbours, and of those that are decided about.
    pub seen: u8,
    pub decided: u8,
    pub removes: bool,
    pub mark: Option<Mark>,
    /// Columns that its stages compute, those that it stores for later passes, and those that an
    /// earlier pass stored and this one reads.
    pub writes: Vec<ColumnKind>,
    pub stores: Vec<ColumnKind>,
    pub loads: Vec<ColumnKind>,
    /// Columns that are dimensions of the records.
    pub dimensions: Vec<ColumnKind>,
    /// Sinks of what is there before the pass removes anything, and of what it leaves.
    pub before: Vec<usize>,
    pub after: Vec<usize>,
    pub makes_cells: bool,
    pub looks: bool,
}

/// Bytes that columns take for each position.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ColumnBytes {
    /// In a tile.
    pub tile: usize,
    /// As they are stored for later passes.
    pub stored: usize,
    /// In an entry for outputs that write them.
    pub row: usize,
    /// True if some are dimensions of the records.
    pub of_records: bool,
}

impl ColumnBytes {
    /// What does for both.
    pub fn larger(self, other: ColumnBytes) -> ColumnBytes {
        ColumnBytes {
            tile: self.tile.max(other.tile),
            stored: self.stored.max(other.stored),
            row: self.row.max(other.row),
            of_records: self.of_records || other.of_records,
        }
    }
}

/// Lets the stage of a call work on `tile`: on the records that it is limited to, and with the
/// neighbours and columns of theirs that it says it looks at.
pub(crate) fn put_to_work(tile: &mut Tile, ops: &[StageOp], call: Call) {
    tile.limits = ops[call.op].selection;
    let needs = needs(ops, call);
    tile.looks = Some(NeighborNeeds { count: needs.neighbors, columns: needs.of_neighbors.into() });
}

/// What a call needs.
pub(crate) fn needs(ops: &[StageOp], call: Call) -> Needs {
    match (&ops[call.op].op, call.gathers) {
        (Op::Scan(op), true) => op.gather_needs(),
        (op, _) => op.tile().needs(),
    }
}

impl Pass {
    /// What the pass's calls need, in order.
    pub fn needs<'a>(&'a self, ops: &'a [StageOp]) -> impl Iterator<Item = Needs> + 'a {
        self.calls.iter().map(|&call| needs(ops, call))
    }

    /// The side of the cells that it decides in by normals, if it does: it is compared with grids
    /// of such sides, whose cubes no face of a tile cuts.
    pub fn compares(&self, ops: &[StageOp]) -> Option<i64> {
        let by_normals = self.needs(ops).any(|needs| decides_by_normals(&needs));
        let side = self.needs(ops).map(|needs| needs.cell_side).max().filter(|side| *side > 0);
        side.filter(|_| by_normals)
    }

    /// The stage of this pass that gathers.
    pub fn gathers(&self) -> Option<usize> {
        self.calls.iter().find(|call| call.gathers).map(|call| call.op)
    }

    /// What the pass sees of records of `schema`, with what earlier passes stored.
    pub fn sieve(&self, stored: &Sieve, schema: &Arc<Schema>) -> Sieve {
        let Pass { seen, decided, reads_classes: classes, .. } = *self;
        let computed = self.writes.clone();
        let found = |kind: &ColumnKind| Some((*kind, schema.find(kind.name())?.clone()));
        let dimensions: Vec<_> = self.dimensions.iter().filter_map(found).collect();
        let read = ReadDimensions { schema: schema.clone(), dimensions };
        let dimensions = (!read.dimensions.is_empty()).then(|| Arc::new(read));
        let mut sieve = Sieve { classes, seen, decided, computed, dimensions, ..stored.clone() };
        sieve.columns.retain(|(kind, _)| self.loads.contains(kind));
        sieve
    }

    /// Bytes that its columns take for each position: in a tile, as they are stored, and in entries
    /// for outputs that write `computed` dimensions.
    pub fn column_bytes(&self, computed: &[Vec<ComputedDimension>]) -> ColumnBytes {
        let sum = |kinds: &[ColumnKind]| kinds.iter().map(ColumnKind::bytes).sum::<usize>();
        let of_records = !self.dimensions.is_empty();
        let numbers = if of_records { Loader::DIMENSION_BYTES_PER_POINT } else { 0 };
        ColumnBytes {
            tile: sum(&self.writes) + sum(&self.loads) + sum(&self.dimensions) + numbers,
            stored: sum(&self.stores),
            row: self.row(computed).bytes(),
            of_records,
        }
    }

    /// True if records are looked at one by one for what becomes of them.
    pub fn streams(&self) -> bool {
        !self.filters.is_empty() || self.chooses.is_some()
    }

    /// What entries have for the outputs of the pass, and for stages that stream.
    pub fn row(&self, computed: &[Vec<ComputedDimension>]) -> RowLayout {
        let sinks = self.before.iter().chain(&self.after);
        let written = sinks.filter_map(|sink| computed.get(*sink)).flatten();
        let written = written.map(|dimension| dimension.column);
        RowLayout::of(self.streamed.iter().copied().chain(written))
    }
}

/// True if a stage that needs this takes records away from the passes behind it.
pub(crate) fn decides(needs: &Needs) -> bool {
    needs.removes || needs.mark.is_some()
}

/// True if a stage that needs this decides, and reads normals.
pub(crate) fn decides_by_normals(needs: &Needs) -> bool {
    decides(needs) && needs.does_read(&NORMAL)
}

/// How many outcomes of passes are there at once at most: what a pass goes on from is dropped with
/// the last that does, and the outcome of a branch's last pass when it is measured.
pub(crate) fn standings(passes: &[Pass]) -> usize {
    let goes_on = |from: usize| move |pass: &Pass| pass.behind == Some(from);
    let is_held = |from: usize, now: usize| passes[now..].iter().any(goes_on(from));
    let held = |now: usize| (0..now).filter(|&from| is_held(from, now)).count() + 1;
    (0..passes.len()).map(held).max().unwrap_or(0).max(2)
}
