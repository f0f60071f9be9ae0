//! What stages are limited to and what their expressions name: that the records and the columns
//! above have it, and a bit for each way of being limited.

use crate::engine::pass::{StageOp, StreamOp};
use crate::expression::{Choice, KeyExpression, Names};
use crate::graph::{LimitKeys, Limits, Sees, Written};
use crate::point::{ColumnKind, Schema, names};
use crate::store::{CHOSEN, SELECTIONS};
use crate::{Error, Result};

use super::sorted::Sorted;

/// What is wrong with stages that are limited by what neither records of `schema` nor the stages
/// above have, and with expressions that name it.
pub(super) fn check_limits(sorted: &Sorted, schema: &Schema) -> Vec<Error> {
    let mut wrong = Vec::new();
    for stage in sorted.transforms.iter().chain(&sorted.filters) {
        let StreamOp { kind, written, transform, choice, above, .. } = stage;
        let names = Names { schema, columns: above };
        for (key, expression) in transform.expressions() {
            wrong.extend(check(&**written, key, expression, names).err());
        }
        wrong.extend(check_choice(kind, &**written, choice, names).err());
    }
    for StageOp { kind, written, limits, above, .. } in &sorted.ops {
        let names = Names { schema, columns: above };
        wrong.extend(check_choice(kind, &**written, &limits.choice, names).err());
    }
    wrong
}

fn check_choice(
    kind: &str,
    written: &dyn Written,
    Choice { selection, condition }: &Choice,
    names: Names<'_>,
) -> Result<()> {
    if let Some(name) = selection.missing(names.schema) {
        let key = if name == names::CLASSIFICATION { "classes" } else { "with" };
        let told =
            format!("`{kind}.{key}` selects points by {name}, which the input does not have");
        return Err(written.wrong_key(key, told).help(format!("leave `{kind}.{key}` out")));
    }
    condition.iter().try_for_each(|condition| {
        check(written, LimitKeys::WHERE, KeyExpression::Condition(condition), names)
    })
}

fn check(
    written: &dyn Written,
    key: &str,
    expression: KeyExpression<'_>,
    names: Names<'_>,
) -> Result<()> {
    expression.check(names).map_err(|fault| written.wrong_expression(key, expression.text(), fault))
}

/// Gives tile stages that are limited to some records a bit each, equal limits the same, and those
/// that are limited by columns the bit of the records that were chosen for them.
pub(super) fn number_selections(ops: &mut [StageOp]) -> Result<Vec<Choice>> {
    let mut choices: Vec<Choice> = Vec::new();
    for op in ops.iter_mut().filter(|op| !op.limits.choice.is_all()) {
        if !op.chosen_by().is_empty() {
            op.selection = CHOSEN;
            continue;
        }
        let same = choices.iter().position(|known| *known == op.limits.choice);
        let number = same.unwrap_or_else(|| {
            choices.push(op.limits.choice.clone());
            choices.len() - 1
        });
        if number >= SELECTIONS as usize {
            let told = format!("stages are limited in more than {SELECTIONS} different ways");
            return Err(op
                .written
                .wrong(told)
                .help("let some of them have equal `where`, classes and flags"));
        }
        op.selection = 1 << number;
    }
    Ok(choices)
}

/// The records that a stage sees as neighbours, by the selections that they are in.
pub(super) fn seen_by(stage: &StageOp) -> u8 {
    let Limits { sees, .. } = stage.limits;
    if sees == Sees::Selected { stage.selection } else { 0 }
}

/// The first of the columns that `stream` looks at which `writes` computes anew.
pub(super) fn rewritten(stream: &StreamOp, writes: &[ColumnKind]) -> Option<ColumnKind> {
    stream.reads().into_iter().find(|read| writes.contains(read))
}
