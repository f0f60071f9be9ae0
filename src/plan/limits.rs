//! What stages are limited to and what their expressions name: that the records and the columns
//! above have it, and a bit for each way of being limited.

use crate::engine::pass::{StageOp, StreamOp};
use crate::expression::{Choice, Condition, KeyExpression, Names};
use crate::graph::{LimitKeys, Limits, Sees, Written};
use crate::point::{ColumnKind, Schema, Selection, names};
use crate::store::{CHOSEN, SELECTIONS};
use crate::{Error, Result};

use super::sorted::Sorted;

/// What is wrong with stages that are limited by what neither records of `schema` nor the stages
/// above have, and with expressions that name it.
pub(super) fn check_limits(sorted: &Sorted, schema: &Schema) -> Vec<Error> {
    let mut wrong = Vec::new();
    let own = sorted.filters.iter().filter(|stage| !stage.of_tiles);
    for stage in sorted.transforms.iter().chain(own) {
        let StreamOp { kind, written, transform, choice, above, .. } = stage;
        let names = Names { schema, columns: above };
        for (key, expression) in transform.expressions() {
            wrong.extend(check(&**written, key, expression, names).err());
        }
        wrong.extend(check_choice(kind, &**written, choice, names).err());
    }
    for StageOp { kind, written, limits, above, op, .. } in &sorted.ops {
        if let Some((key, weight)) = op.weight() {
            // Records are weighed as they are decoded, and have no columns then.
            let names = Names { schema, columns: &[] };
            wrong.extend(check(&**written, key, KeyExpression::Weight(weight), names).err());
        }
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
    for op in ops {
        if !op.chosen_by().is_empty() {
            op.selection = CHOSEN;
        } else if !op.limits.choice.is_all() {
            op.selection = number_of(&op.limits.choice, &mut choices, &*op.written)?;
        }
        let choice = |condition: &Condition| Choice {
            selection: Selection::default(),
            condition: Some(condition.clone()),
        };
        let weight = op.op.weight();
        let conditions = weight.iter().flat_map(|(_, weight)| weight.conditions());
        let weighed: Vec<Choice> = conditions.map(choice).collect();
        let numbers = weighed.iter().map(|one| number_of(one, &mut choices, &*op.written));
        op.weighed = numbers.collect::<Result<_>>()?;
    }
    Ok(choices)
}

/// The bit of a way to be limited.
fn number_of(choice: &Choice, choices: &mut Vec<Choice>, written: &dyn Written) -> Result<u8> {
    let same = choices.iter().position(|known| known == choice);
    let number = same.unwrap_or_else(|| {
        choices.push(choice.clone());
        choices.len() - 1
    });
    if number >= SELECTIONS as usize {
        let told =
            format!("stages are limited or weigh points in more than {SELECTIONS} different ways");
        let help = "let some of them have equal `where`, classes and flags, or fewer weights";
        return Err(written.wrong(told).help(help));
    }
    Ok(1 << number)
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
