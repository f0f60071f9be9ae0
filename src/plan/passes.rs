//! The tile stages of a pipeline as passes over the scan: a pass ends where points are removed, or
//! where a stage must have seen all tiles before it decides.

use super::sorted::{Sorted, StageWork};
use crate::engine::pass::{Branch, Call, Op, Pass, PassFilter, StageOp, decides, needs};
use crate::graph::{Limits, Sees};
use crate::point::{Schema, names};
use crate::store::SELECTIONS;
use crate::{Error, Result};

/// Refuses stages that are limited by a class or a flag that records of `schema` do not have.
pub(crate) fn check_limits(ops: &[StageOp], schema: &Schema) -> Result<()> {
    for StageOp { kind, written, limits, .. } in ops {
        if let Some(name) = limits.selection.missing(schema) {
            let key = if name == names::CLASSIFICATION { "classes" } else { "with" };
            let told =
                format!("`{kind}.{key}` selects points by {name}, which the input does not have");
            return Err(written.wrong_key(key, told).help(format!("leave `{kind}.{key}` out")));
        }
    }
    Ok(())
}

/// Gives stages that are limited to some records a bit each, equal limits the same.
pub(crate) fn number_selections(ops: &mut [StageOp]) -> Result<Vec<crate::point::Selection>> {
    let mut selections = Vec::new();
    for op in ops.iter_mut().filter(|op| !op.limits.selection.is_all()) {
        let same = selections.iter().position(|known| *known == op.limits.selection);
        let number = same.unwrap_or_else(|| {
            selections.push(op.limits.selection.clone());
            selections.len() - 1
        });
        if number >= SELECTIONS as usize {
            let told = format!("stages are limited in more than {SELECTIONS} different ways");
            return Err(op
                .written
                .wrong(told)
                .help("let some of them have equal classes and flags"));
        }
        op.selection = 1 << number;
    }
    Ok(selections)
}

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
}

/// Lays the stages out as passes.
///
/// Fails if a stage reads what nothing before it gives, or what a pass cannot carry.
pub(super) fn unroll(sorted: &Sorted, schema: &Schema) -> Result<Passes> {
    let sinks = sorted.sinks.len();
    let out = Passes {
        changed_by: vec![Vec::new(); sinks],
        branch_of: vec![0; sinks],
        ..Passes::default()
    };
    let mut layout =
        PassLayout { sorted, ops: &sorted.ops, schema, out, at: BranchCursor::default() };
    layout.branch(sorted.root)?;
    Ok(layout.out)
}

struct PassLayout<'a> {
    sorted: &'a Sorted,
    ops: &'a [StageOp],
    schema: &'a Schema,
    out: Passes,
    at: BranchCursor,
}

/// How far a branch is laid out.
#[derive(Debug, Clone, Default)]
struct BranchCursor {
    /// The pass that the next stage may join; None if it begins one.
    pass: Option<usize>,
    /// The pass that one which begins goes on from.
    behind: Option<usize>,
    /// False once the pass removes or gathers.
    is_open: bool,
    /// The pass whose normals are the newest.
    normals_from: Option<usize>,
    /// True once a stage or a sink has read them.
    normals_read: bool,
    /// Stages of the graph so far, the decode's left out.
    path: Vec<usize>,
    /// The tile stages among them.
    ops: Vec<usize>,
    /// The stages that stream among them.
    filters: Vec<usize>,
    /// True if the last stage takes records away.
    decides: bool,
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
        let is_idle = shared.calls.is_empty() && shared.filters.is_empty();
        let behind = if is_idle { shared.behind } else { Some(pass) };
        let of = |n: usize| match is_idle && n == 0 {
            true => self.at.clone(),
            false => BranchCursor { pass: None, behind, ..self.at.clone() },
        };
        (0..branches).map(of).collect()
    }

    /// The pass that the branch is at; begins one if it is at none.
    fn pass(&mut self) -> usize {
        match self.at.pass {
            Some(pass) => pass,
            None => self.begin(),
        }
    }

    /// Begins a pass behind the one that the branch is at.
    fn begin(&mut self) -> usize {
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
        if needs.passes > 1 {
            let repeated = self.repeated(op, &above)?;
            for round in 2..=needs.passes {
                repeated.iter().try_for_each(|&op| self.add(op, round))?;
            }
        }
        self.at.decides = decides(&needs);
        Ok(())
    }

    /// What streams behind tiles has a pass of its own, unless nothing but such stages is in the
    /// last.
    fn filter(&mut self, filter: usize) -> Result<()> {
        let at = self.pass();
        let pass = &self.out.passes[at];
        let at = match !pass.calls.is_empty() || !pass.after.is_empty() {
            true => self.begin(),
            false => at,
        };
        self.out.passes[at].filters.push(filter);
        self.at.filters.push(filter);
        (self.at.is_open, self.at.decides) = (false, true);
        Ok(())
    }

    /// Refuses a tile stage that reads what a stage above, which streams, changes only in what is
    /// written.
    fn check_unchanged(&self, op: usize) -> Result<()> {
        let StageOp { kind, written, op, .. } = &self.ops[op];
        let reads = op.tile().needs().reads;
        let is_read = |name: &String| names::XYZ.contains(&name.as_str()) || reads.contains(name);
        for filter in &self.at.filters {
            let PassFilter { kind: above, transform } = &self.sorted.filters[*filter];
            if let Some(name) = transform.needs().writes.iter().find(|name| is_read(name)) {
                let told =
                    format!("`{kind}` works by {name} as it is read, and `{above}` changes it");
                let help = format!(
                    "put `{above}` above all stages that work on tiles, or behind `{kind}`"
                );
                return Err(written.wrong(told).help(help));
            }
        }
        Ok(())
    }

    /// The stages that are repeated with `op`, from the last above that computes normals on.
    fn repeated(&self, op: usize, above: &[usize]) -> Result<Vec<usize>> {
        let written = &self.ops[op].written;
        let writes = |at: &usize| {
            self.ops[*at].op.tile().needs().writes.iter().any(|column| column == "Normal")
        };
        let first = above.iter().rposition(writes).ok_or_else(|| {
            written.wrong(
                "`median.passes` repeats the stages from `normals` on, and there is none".into(),
            )
        })?;
        let repeated: Vec<usize> = above[first..].iter().copied().chain([op]).collect();
        let scan = repeated.iter().find(|&&at| matches!(self.ops[at].op, Op::Scan(_)));
        if let Some(&at) = scan {
            let told =
                format!("`{}` looks at the whole scan and cannot be repeated", self.ops[at].kind);
            let help = "leave `median.passes` out, or run the pipeline twice";
            return Err(written.wrong(told).help(help));
        }
        Ok(repeated)
    }

    fn add(&mut self, op: usize, round: usize) -> Result<()> {
        if let Op::Scan(_) = &self.ops[op].op {
            self.call(Call { op, gathers: true }, round)?;
            self.at.is_open = false;
        }
        self.call(Call { op, gathers: false }, round)
    }

    fn call(&mut self, call: Call, round: usize) -> Result<()> {
        let stage = &self.ops[call.op];
        let needs = needs(self.ops, call);
        let reads = |column: &str| needs.reads.iter().any(|name| name == column);
        let Limits { sees, .. } = stage.limits;
        let seen = if sees == Sees::Selected { stage.selection } else { 0 };
        let on_columns = reads("Normal") || reads("Cell");
        let writes = |column: &str| needs.writes.iter().any(|name| name == column);
        if writes("Normal") && self.at.normals_from.is_some() && !self.at.normals_read {
            let told = "this `normals` would replace normals that nothing has read".to_owned();
            return Err(stage.written.wrong(told).help("leave one of the two out"));
        }
        let at = self.pass();
        let last = &self.out.passes[at];
        let rewrites = writes("Normal") && last.writes_normals;
        let other_neighbors = needs.neighbors > 0 && last.looks && last.seen != seen;
        let other_records = !on_columns && last.decided != stage.selection;
        let begun = !last.calls.is_empty() || !last.filters.is_empty();
        let at = match begun && (!self.at.is_open || rewrites || other_neighbors || other_records) {
            true => self.begin(),
            false => at,
        };
        for name in &needs.reads {
            self.provide(at, name, stage)?;
        }
        let pass = &mut self.out.passes[at];
        pass.round = round;
        pass.calls.push(call);
        pass.decided |= stage.selection;
        if needs.neighbors > 0 {
            (pass.seen, pass.looks) = (seen, true);
        }
        pass.writes_cells |= writes("Cell");
        pass.stores_figures |= writes("Figure");
        if decides(&needs) {
            (pass.removes, pass.mark) = (true, needs.mark);
            self.at.is_open = false;
        }
        if writes("Normal") {
            (pass.writes_normals, pass.loads_normals) = (true, false);
            (self.at.normals_from, self.at.normals_read) = (Some(at), false);
        }
        Ok(())
    }

    /// Sees to it that `name` is there for a stage of pass `at`.
    fn provide(&mut self, at: usize, name: &str, stage: &StageOp) -> Result<()> {
        let kind = &stage.kind;
        let missing = |help: &str| {
            let told = format!("`{kind}` needs {name}, which nothing before it gives");
            Err(stage.written.wrong(told).help(help.to_owned()))
        };
        match name {
            "Normal" => match self.bring_normals(at) {
                true => {}
                false => return missing("put a `normals` stage before it"),
            },
            "Cell" if self.out.passes[at].writes_cells => {}
            "Cell" if self.out.passes.iter().any(|pass| pass.writes_cells) => {
                return missing(
                    "cells last until points are removed: put a `cells` stage right before it",
                );
            }
            "Cell" => return missing("put a `cells` stage before it"),
            "Figure" => match self.out.passes[at].behind {
                Some(before) if self.out.passes[before].stores_figures => {
                    self.out.passes[at].loads_figures = true;
                }
                _ => return missing("only the second phase of a stage reads it"),
            },
            _ if self.schema.find(name).is_none() => {
                return missing("the input has no such dimension");
            }
            names::CLASSIFICATION => self.out.passes[at].reads_classes = true,
            // What a tile has of its records are their positions and classes.
            _ if !names::XYZ.contains(&name) => {
                let told =
                    format!("`{kind}` needs {name}, which stages that work on tiles cannot read");
                return Err(stage
                    .written
                    .wrong(told)
                    .help("they read X, Y, Z, Classification, and what stages above computed"));
            }
            _ => {}
        }
        Ok(())
    }

    /// Brings the newest normals to pass `at`; false if there are none.
    fn bring_normals(&mut self, at: usize) -> bool {
        let Some(from) = self.at.normals_from else { return false };
        self.at.normals_read = true;
        if from != at {
            self.out.passes[from].stores_normals = true;
            self.out.passes[at].loads_normals = true;
        }
        true
    }

    /// Attaches sinks to the pass that the branch is at: they take what is there before it, if its
    /// last stage takes nothing away, else what it leaves.
    fn tap(&mut self, sinks: &[usize]) -> Result<()> {
        for &sink in sinks {
            let at = self.pass();
            if self.sorted.sinks[sink].wants_normals() && !self.bring_normals(at) {
                let told = "the output wants normals, which no stage computes";
                let help = "put a `normals` stage before it, or leave `write.dimensions` out";
                return Err(Error::pipeline(told).help(help));
            }
            let pass = &mut self.out.passes[at];
            if self.at.decides {
                pass.after.push(sink)
            } else {
                pass.before.push(sink)
            }
            self.out.changed_by[sink] = self.at.filters.clone();
            self.out.branch_of[sink] = self.out.branches.len();
        }
        Ok(())
    }
}
