//! The tile stages of a pipeline as passes over the scan: a pass ends where points are removed, or
//! where a stage must have seen all tiles before it decides.

use crate::engine::pass::{Call, Op, Pass, StageOp, decides, needs};
use crate::graph::{Limits, Sees};
use crate::point::{Schema, names};
use crate::store::SELECTIONS;
use crate::{Error, Result};

/// Where a sink takes its points.
pub(crate) struct Tap {
    /// Tile stages above it.
    pub ops: usize,
    /// True if it writes normals.
    pub wants_normals: bool,
}

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

/// Lays the stages out as passes; `taps` are the sinks.
///
/// Fails if a stage reads what nothing before it gives, or what a pass cannot carry.
pub(crate) fn unroll(ops: &[StageOp], schema: &Schema, taps: &[Tap]) -> Result<Vec<Pass>> {
    let mut layout = Layout {
        ops,
        schema,
        passes: vec![Pass::default()],
        normals_from: None,
        normals_read: false,
        open: true,
    };
    let mut waiting: Vec<(usize, &Tap)> = taps.iter().enumerate().collect();
    layout.tap(&mut waiting, 0, false)?;
    for (op, stage) in ops.iter().enumerate() {
        let rounds = stage.op.tile().needs().passes.max(1);
        layout.add(op, 1)?;
        if rounds > 1 {
            let first = layout.repeated(op)?;
            for round in 2..=rounds {
                (first..=op).try_for_each(|op| layout.add(op, round))?;
            }
        }
        layout.tap(&mut waiting, op + 1, decides(&stage.op.tile().needs()))?;
    }
    Ok(layout.passes)
}

struct Layout<'a> {
    ops: &'a [StageOp],
    schema: &'a Schema,
    passes: Vec<Pass>,
    /// The pass whose normals are the newest.
    normals_from: Option<usize>,
    /// True once a stage or a sink has read them.
    normals_read: bool,
    /// False once the last pass removes or gathers.
    open: bool,
}

impl Layout<'_> {
    fn last(&mut self) -> &mut Pass {
        let end = self.passes.len() - 1;
        &mut self.passes[end]
    }

    /// The first of the stages that are repeated with `op`: the last above that computes normals.
    fn repeated(&self, op: usize) -> Result<usize> {
        let writes = |at: &usize| {
            self.ops[*at].op.tile().needs().writes.iter().any(|column| column == "Normal")
        };
        let first = (0..op).rev().find(writes).ok_or_else(|| {
            self.ops[op].written.wrong(
                "`median.passes` repeats the stages from `normals` on, and there is none".into(),
            )
        })?;
        let twice = (first..=op).find(|&at| matches!(self.ops[at].op, Op::Scan(_)));
        match twice {
            None => Ok(first),
            Some(at) => {
                let kind = &self.ops[at].kind;
                let told = format!("`{kind}` looks at the whole scan and cannot be repeated");
                Err(self.ops[op]
                    .written
                    .wrong(told)
                    .help("leave `median.passes` out, or run the pipeline twice"))
            }
        }
    }

    fn add(&mut self, op: usize, round: usize) -> Result<()> {
        if let Op::Scan(_) = &self.ops[op].op {
            self.call(Call { op, gathers: true }, round)?;
            self.open = false;
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
        if writes("Normal") && self.normals_from.is_some() && !self.normals_read {
            let told = "this `normals` would replace normals that nothing has read".to_owned();
            return Err(stage.written.wrong(told).help("leave one of the two out"));
        }
        let last = self.last();
        let rewrites = writes("Normal") && last.writes_normals;
        let other_neighbors = needs.neighbors > 0 && last.looks && last.seen != seen;
        let other_records = !on_columns && last.decided != stage.selection;
        let begun = !last.calls.is_empty();
        if begun && (!self.open || rewrites || other_neighbors || other_records) {
            self.passes.push(Pass { round, ..Pass::default() });
            self.open = true;
        }
        let at = self.passes.len() - 1;
        for name in &needs.reads {
            self.provide(at, name, stage)?;
        }
        let from = self.normals_from;
        let pass = &mut self.passes[at];
        pass.round = round;
        pass.calls.push(call);
        pass.decided |= stage.selection;
        if needs.neighbors > 0 {
            (pass.seen, pass.looks) = (seen, true);
        }
        if writes("Normal") {
            (pass.writes_normals, pass.loads_normals) = (true, false);
        }
        pass.writes_cells |= writes("Cell");
        pass.stores_figures |= writes("Figure");
        if decides(&needs) {
            (pass.removes, pass.mark) = (true, needs.mark);
            self.open = false;
        }
        if writes("Normal") {
            self.normals_read = false;
        }
        self.normals_from = if writes("Normal") { Some(at) } else { from };
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
            "Cell" if self.passes[at].writes_cells => {}
            "Cell" if self.passes.iter().any(|pass| pass.writes_cells) => {
                return missing(
                    "cells last until points are removed: put a `cells` stage right before it",
                );
            }
            "Cell" => return missing("put a `cells` stage before it"),
            "Figure" => match at.checked_sub(1) {
                Some(before) if self.passes[before].stores_figures => {
                    self.passes[at].loads_figures = true;
                }
                _ => return missing("only the second phase of a stage reads it"),
            },
            _ if self.schema.find(name).is_none() => {
                return missing("the input has no such dimension");
            }
            names::CLASSIFICATION => self.passes[at].reads_classes = true,
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
        let Some(from) = self.normals_from else { return false };
        self.normals_read = true;
        if from != at {
            self.passes[from].stores_normals = true;
            self.passes[at].loads_normals = true;
        }
        true
    }

    /// Attaches the sinks that take what the first `ops` stages leave to the last pass.
    fn tap(&mut self, waiting: &mut Vec<(usize, &Tap)>, ops: usize, removes: bool) -> Result<()> {
        let at = self.passes.len() - 1;
        let mut outcome = Ok(());
        waiting.retain(|&(sink, tap)| {
            if tap.ops != ops {
                return true;
            }
            if tap.wants_normals && !self.bring_normals(at) {
                outcome = Err(Error::pipeline("the output wants normals, which no stage computes")
                    .help("put a `normals` stage before it, or leave `write.dimensions` out"));
            }
            let pass = &mut self.passes[at];
            if removes {
                pass.after.push(sink)
            } else {
                pass.before.push(sink)
            }
            false
        });
        outcome
    }
}
