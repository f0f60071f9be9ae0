//! The classes and flags that stages are limited to: that records have them, and a bit for each way
//! of being limited.

use crate::Result;
use crate::engine::pass::StageOp;
use crate::graph::{Limits, Sees};
use crate::point::{Schema, Selection, names};
use crate::store::SELECTIONS;

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
pub(crate) fn number_selections(ops: &mut [StageOp]) -> Result<Vec<Selection>> {
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

/// The records that a stage sees as neighbours, by the selections that they are in.
pub(super) fn seen_by(stage: &StageOp) -> u8 {
    let Limits { sees, .. } = stage.limits;
    if sees == Sees::Selected { stage.selection } else { 0 }
}
