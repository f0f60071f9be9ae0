//! The tile stages of a pipeline as passes over the scan: a pass ends where points are removed, or
//! where a stage must have seen all tiles before it decides.

use super::columns::{NewestColumns, lacks, missing, replaced};
use super::limits::seen_by;
use super::sorted::{Sorted, StageWork};
use crate::engine::pass::{Branch, Call, Op, Pass, StageOp, decides, needs};
use crate::error::listed;
use crate::point::{ColumnKind, ComputedDimension, SHIFT, Scalar, Schema, names};
use crate::stage::Needs;
use crate::tile::Partition;
use crate::{Error, Result};

/// The passes of a graph.
#[derive(Debug, Default)]
pub(super) struct Passes {
    /// In an order in which each is behind the one that it goes on from.
    pub passes: Vec<Pass>,
    pub branches: Vec<Branch>,
    /// For each sink the stages that stream above it, behind the decode.
    pub changed_by: Vec<Vec<usize>>,
    /// For each sink the first branch that it is on.
    pub branch_of: Vec<usize>,
    /// For each sink the computed dimensions that it writes.
    pub computed: Vec<Vec<ComputedDimension>>,
}

/// Lays the stages out as passes.
///
/// Adds to `wrong` what a stage reads that nothing before it gives, or that a pass cannot carry.
pub(super) fn unroll(sorted: &Sorted, schema: &Schema, wrong: &mut Vec<Error>) -> Result<Passes> {
    let sinks = sorted.sinks.len();
    let out = Passes {
        changed_by: vec![Vec::new(); sinks],
        branch_of: vec![0; sinks],
        computed: vec![Vec::new(); sinks],
        ..Passes::default()
    };
    let at = BranchCursor::default();
    let mut layout = PassLayout { sorted, ops: &sorted.ops, schema, out, at, wrong: Vec::new() };
    layout.branch(sorted.root)?;
    wrong.append(&mut layout.wrong);
    Ok(layout.out)
}

pub(super) struct PassLayout<'a> {
    pub sorted: &'a Sorted,
    pub ops: &'a [StageOp],
    schema: &'a Schema,
    pub out: Passes,
    pub at: BranchCursor,
    /// What stages lack; they are laid out all the same, so that all of it is told.
    pub wrong: Vec<Error>,
}

/// How far a branch is laid out.
#[derive(Debug, Clone, Default)]
pub(super) struct BranchCursor {
    /// The pass that the next stage may join; None if it begins one.
    pass: Option<usize>,
    /// The pass that one which begins goes on from.
    behind: Option<usize>,
    /// False once the pass removes or gathers.
    pub is_open: bool,
    /// The newest values of each column that a stage computed.
    columns: NewestColumns,
    /// Stages of the graph so far, the decode's left out.
    path: Vec<usize>,
    /// The tile stages among them.
    ops: Vec<usize>,
    /// The stages that stream among them.
    pub filters: Vec<usize>,
    /// True if the last stage takes records away.
    pub decides: bool,
    /// The tile stage that made the partition which nothing has taken yet.
    untaken: Option<usize>,
}

impl PassLayout<'_> {
    /// Lays out what is behind stage `number` of the graph.
    fn branch(&mut self, number: usize) -> Result<()> {
        let (working, sinks) = self.sorted.behind(number);
        self.tap(&sinks)?;
        if let (true, Some(&last_sink)) = (working.is_empty(), sinks.first()) {
            let stages = self.sorted.named(&self.at.path);
            let branch = Branch { pass: self.pass(), last_sink, ops: self.at.ops.clone(), stages };
            self.out.branches.push(branch);
            return Ok(());
        }
        let begins: Vec<BranchCursor> = self.fork(working.len());
        for (stage, begin) in working.iter().zip(begins) {
            self.at = begin;
            self.at.path.push(*stage);
            match self.sorted.works[*stage] {
                StageWork::Op(op) => self.op(op)?,
                StageWork::Filter(filter) => self.filter(filter)?,
                StageWork::Sink(_) | StageWork::Decode => {
                    return Err(Error::internal("a stage does not work and is to be laid out"));
                }
            }
            self.branch(*stage)?;
        }
        Ok(())
    }

    /// Where each of several branches begins: behind the pass that they have in common; the first
    /// may join that one where nothing is done in it.
    fn fork(&self, branches: usize) -> Vec<BranchCursor> {
        let Some(pass) = self.at.pass.filter(|_| branches > 1) else {
            return vec![self.at.clone(); branches];
        };
        let shared = &self.out.passes[pass];
        let is_idle = shared.calls.is_empty() && !shared.streams();
        let behind = if is_idle { shared.behind } else { Some(pass) };
        let of = |n: usize| match is_idle && n == 0 {
            true => self.at.clone(),
            false => BranchCursor { pass: None, behind, ..self.at.clone() },
        };
        (0..branches).map(of).collect()
    }

    /// The pass that the branch is at; begins one if it is at none.
    pub(super) fn pass(&mut self) -> usize {
        match self.at.pass {
            Some(pass) => pass,
            None => self.begin(),
        }
    }

    /// Begins a pass behind the one that the branch is at.
    pub(super) fn begin(&mut self) -> usize {
        let behind = self.at.pass.or(self.at.behind);
        self.out.passes.push(Pass { behind, ..Pass::default() });
        (self.at.pass, self.at.is_open) = (Some(self.out.passes.len() - 1), true);
        self.out.passes.len() - 1
    }

    fn op(&mut self, op: usize) -> Result<()> {
        let needs = self.ops[op].op.tile().needs();
        self.check_unchanged(op)?;
        let above = self.at.ops.clone();
        self.at.ops.push(op);
        self.add(op, 1)?;
        if let Some((column, times)) = needs.repeats.filter(|(_, times)| *times > 1) {
            let repeated = self.repeated(op, column, &above)?;
            for round in 2..=times {
                repeated.iter().try_for_each(|&op| self.add(op, round))?;
            }
        }
        self.at.decides = decides(&needs);
        if let Some(mover) = self.ops[op].mover {
            self.at.filters.push(mover);
            self.keep_shifts();
        }
        Ok(())
    }

    /// Keeps how far points are moved until the branch is measured.
    fn keep_shifts(&mut self) {
        if let Some(from) = self.at.columns.read(SHIFT.kind()) {
            let stores = &mut self.out.passes[from].stores;
            if !stores.contains(&SHIFT.kind()) {
                stores.push(SHIFT.kind());
            }
        }
    }

    /// The stages that are repeated with `op`, from the last above that computes `column` on.
    fn repeated(&self, op: usize, column: ColumnKind, above: &[usize]) -> Result<Vec<usize>> {
        let StageOp { kind, written, .. } = &self.ops[op];
        let writes = |at: &usize| self.ops[*at].op.tile().needs().writes.contains(&column);
        let first = above.iter().rposition(writes).ok_or_else(|| {
            let name = column.name();
            written.wrong(format!(
                "`{kind}.passes` repeats the stages from the one that computes {name} on, and \
                 there is none"
            ))
        })?;
        let repeated: Vec<usize> = above[first..].iter().copied().chain([op]).collect();
        let scan = repeated.iter().find(|&&at| !matches!(self.ops[at].op, Op::Tile(_)));
        if let Some(&at) = scan {
            let told =
                format!("`{}` looks at the whole scan and cannot be repeated", self.ops[at].kind);
            let help = format!("leave `{kind}.passes` out, or run the pipeline twice");
            return Err(written.wrong(told).help(help));
        }
        Ok(repeated)
    }

    fn add(&mut self, op: usize, round: usize) -> Result<()> {
        self.choose(op);
        if let Op::Scan(_) = &self.ops[op].op {
            self.call(Call { op, gathers: true }, round)?;
            self.at.is_open = false;
        }
        self.call(Call { op, gathers: false }, round)
    }

    fn call(&mut self, call: Call, round: usize) -> Result<()> {
        let stage = &self.ops[call.op];
        let needs = needs(self.ops, call);
        let at = self.place(stage, &needs)?;
        self.look(at, stage, &needs)?;
        if needs.takes_cells && !self.out.passes[at].makes_cells {
            let told = self.no_cells(stage);
            self.wrong.push(told);
        }
        self.check_partition(call.op, &needs);
        let mut lacking = Vec::new();
        for column in &needs.reads {
            lacking.extend(self.provide(at, *column, stage)?);
        }
        self.wrong.extend(lacks(stage, &lacking));
        let pass = &mut self.out.passes[at];
        pass.round = round;
        pass.is_repeated |= needs.repeats.is_some_and(|(_, times)| times > 1);
        if let Op::Round(_) = &stage.op {
            pass.by_rounds.push(call.op);
        }
        pass.calls.push(call);
        pass.decided |= stage.selection;
        if needs.neighbors > 0 {
            (pass.seen, pass.looks) = (seen_by(stage), true);
        }
        pass.makes_cells |= needs.makes_cells;
        for column in needs.writes.iter().copied() {
            pass.loads.retain(|loaded| *loaded != column || needs.reads.contains(loaded));
            pass.writes.push(column);
            self.at.columns.write(column, at);
        }
        if decides(&needs) {
            (pass.removes, pass.mark) = (true, needs.mark);
            self.at.is_open = false;
        }
        Ok(())
    }

    /// Tells of a partition that another replaces before anything takes it.
    fn check_partition(&mut self, op: usize, needs: &Needs) {
        if needs.takes_cells {
            self.at.untaken = None;
        }
        if !needs.makes_cells {
            return;
        }
        if let Some(before) = self.at.untaken.replace(op).filter(|before| *before != op) {
            self.wrong.push(replaced(&self.ops[before], &self.ops[op]));
        }
    }

    /// The pass of a stage that needs this: the one that the branch is at, or one that begins.
    fn place(&mut self, stage: &StageOp, needs: &Needs) -> Result<usize> {
        self.wrong.extend(self.at.columns.check_written(stage, needs).err());
        let at = self.pass();
        let last = &self.out.passes[at];
        let is_new = |column: &ColumnKind| last.writes.contains(column);
        // A column is there for the whole rim once all tiles have computed theirs.
        let rewrites = needs.writes.iter().chain(&needs.of_neighbors).any(is_new);
        let other_neighbors = needs.neighbors > 0 && last.looks && last.seen != seen_by(stage);
        let is_computed = |column: &ColumnKind| self.at.columns.have(column);
        let on_columns = needs.takes_cells || needs.reads.iter().any(is_computed);
        let other_records = !on_columns && last.decided != stage.selection;
        let begun = !last.calls.is_empty() || last.streams();
        match begun && (!self.at.is_open || rewrites || other_neighbors || other_records) {
            true => Ok(self.begin()),
            false => Ok(at),
        }
    }

    /// Lets a stage of pass `at` look at the dimensions that it needs.
    fn look(&mut self, at: usize, stage: &StageOp, needs: &Needs) -> Result<()> {
        for name in &needs.dimensions {
            if self.schema.find(name).is_none() {
                self.wrong.push(missing(stage, name, "the input has no such dimension"));
                continue;
            }
            match name.as_str() {
                names::CLASSIFICATION => self.out.passes[at].reads_classes = true,
                // What a tile has of its records are their positions and classes.
                name if !names::XYZ.contains(&name) => {
                    let kind = &stage.kind;
                    let told = format!(
                        "`{kind}` needs {name}, which stages that work on tiles cannot read"
                    );
                    return Err(stage.written.wrong(told).help(
                        "they read X, Y, Z, Classification, and what they declare as columns",
                    ));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Sees to it that `column` is there for a stage of pass `at`: as a stage above computed it, or
    /// as the records have it. Returns its name where nothing has it.
    fn provide(
        &mut self,
        at: usize,
        column: ColumnKind,
        stage: &StageOp,
    ) -> Result<Option<&'static str>> {
        if self.bring(at, column) {
            return Ok(None);
        }
        let name = column.name();
        if self.at.columns.have_named(name) {
            let told = format!("`{}` reads {name} as another type than it has", stage.kind);
            return Err(Error::internal(told));
        }
        if self.schema.find(name).is_none() {
            // It is one mistake, however many stages below need the column, too.
            self.at.columns.write(column, at);
            self.at.columns.read(column);
            let Some(by) = column.computed_by() else { return Ok(Some(name)) };
            self.wrong.push(missing(stage, name, &format!("put a `{by}` stage before it")));
            return Ok(None);
        }
        if column.scalar() != Scalar::F64 || column.parts().len() > 1 {
            let told = format!("`{}` reads {name} as another type than f64", stage.kind);
            return Err(Error::internal(told));
        }
        let dimensions = &mut self.out.passes[at].dimensions;
        if !dimensions.contains(&column) {
            dimensions.push(column);
        }
        Ok(None)
    }

    /// Brings the newest values of a column to pass `at`; false if no stage computed any.
    pub(super) fn bring(&mut self, at: usize, column: ColumnKind) -> bool {
        let Some(from) = self.at.columns.read(column) else { return false };
        if from != at {
            let add = |columns: &mut Vec<ColumnKind>| {
                if !columns.contains(&column) {
                    columns.push(column);
                }
            };
            add(&mut self.out.passes[from].stores);
            add(&mut self.out.passes[at].loads);
        }
        true
    }

    fn no_cells(&self, stage: &StageOp) -> Error {
        let by = Partition::MADE_BY;
        let help = match self.out.passes.iter().any(|pass| pass.makes_cells) {
            true => {
                format!("cells last until points are removed: put a `{by}` stage right before it")
            }
            false => format!("put a `{by}` stage before it"),
        };
        missing(stage, "Cell", &help)
    }

    /// Attaches sinks to the pass that the branch is at: they take what is there before it, if its
    /// last stage takes nothing away, else what it leaves.
    fn tap(&mut self, sinks: &[usize]) -> Result<()> {
        for &sink in sinks {
            let at = self.pass();
            self.out.computed[sink] = self.computed(sink, at)?;
            let filters = self.at.filters.clone();
            let reads = filters.iter().flat_map(|&filter| self.sorted.filters[filter].reads());
            self.stream(at, reads.collect());
            let pass = &mut self.out.passes[at];
            if self.at.decides {
                pass.after.push(sink)
            } else {
                pass.before.push(sink)
            }
            self.out.changed_by[sink] = filters;
            self.out.branch_of[sink] = self.out.branches.len();
        }
        Ok(())
    }

    /// The computed dimensions that a sink of what pass `at` finds or leaves writes.
    fn computed(&mut self, sink: usize, at: usize) -> Result<Vec<ComputedDimension>> {
        let (mut computed, mut unknown) = (Vec::new(), Vec::new());
        for name in self.sorted.sinks[sink].computed() {
            match self.at.columns.dimension(name) {
                Some(dimension) => {
                    self.bring(at, dimension.column);
                    computed.push(dimension);
                }
                None => unknown.push(name.as_str()),
            }
        }
        if !unknown.is_empty() {
            let told =
                format!("the output wants {}, which no stage computes", listed(&unknown, "and"));
            let error = self.sorted.endings[sink].wrong_key("dimensions", told);
            self.wrong.push(error.help(self.at.columns.remedy(&unknown)));
        }
        Ok(computed)
    }
}
