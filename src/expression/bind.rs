//! From the names of an expression to fields of records and columns: what each is, and whether it
//! fits where it stands.

use std::ops::Range;

use super::fault::ExpressionFault;
use super::lanes::LoadedField;
use super::rules::{no_condition, no_number};
use super::tree::{ExpressionTree, Function, Operator, Relation, TreeNode};
use crate::point::{ColumnKind, Dimension, NORMAL, Scalar, Schema};

/// A number for each record.
#[derive(Debug, Clone)]
pub(super) enum NumberNode {
    Literal(f64),
    Field(LoadedField),
    Negated(Box<NumberNode>),
    Arithmetic(Operator, Box<NumberNode>, Box<NumberNode>),
    Call(Function, Vec<NumberNode>),
}

/// True or false for each record.
#[derive(Debug, Clone)]
pub(super) enum TruthNode {
    Compared(Relation, NumberNode, NumberNode),
    Among(NumberNode, Vec<(NumberNode, NumberNode)>),
    IsNan(NumberNode),
    /// A field of one bit.
    Set(NumberNode),
    Not(Box<TruthNode>),
    All(Vec<TruthNode>),
    Any(Vec<TruthNode>),
}

/// What names may mean: the columns of a batch, then the dimensions of its records.
#[derive(Clone, Copy)]
pub(crate) struct Names<'a> {
    pub schema: &'a Schema,
    pub columns: &'a [ColumnKind],
}

impl Names<'_> {
    pub(super) fn field(
        &self,
        name: &str,
        span: &Range<usize>,
    ) -> Result<LoadedField, ExpressionFault> {
        let column = self.columns.iter().rev().find_map(|column| column.part(name));
        if let Some(part) = column {
            return Ok(LoadedField::of_column(&part));
        }
        match self.schema.find(name) {
            Some(dimension) => Ok(LoadedField::of_record(dimension, self.schema)),
            None => Err(self.unknown(name, span)),
        }
    }

    pub(super) fn unknown(&self, name: &str, span: &Range<usize>) -> ExpressionFault {
        if let Some(column) = self.columns.iter().find(|column| column.name() == name) {
            let help = format!("its numbers are {}", column.parts().join(", "));
            return ExpressionFault::new(span.clone(), format!("{name} is several numbers"))
                .help(help);
        }
        let told = format!("there is no dimension `{name}`");
        if let Some(by) = NORMAL.kind().part(name).and_then(|part| part.column.computed_by()) {
            let help = format!("put a `{by}` stage above it");
            return ExpressionFault::new(span.clone(), told).help(help);
        }
        ExpressionFault::word(span.clone(), told, name, "dimensions", &self.listed())
    }

    /// All names with their types, in alphabetical order.
    fn listed(&self) -> Vec<String> {
        let of_records = self.schema.dimensions.iter();
        let of_records = of_records.map(|d| format!("{} ({})", d.name, type_of(d)));
        let parts = self.columns.iter().flat_map(|column| {
            column.parts().iter().map(|part| format!("{part} ({})", words(column.scalar())))
        });
        let mut all: Vec<String> = of_records.chain(parts).collect();
        all.sort();
        all.dedup();
        all
    }
}

/// The type of a dimension in words: `whole`, `flag`, `float`.
pub(super) fn type_of(dimension: &Dimension) -> String {
    match dimension.bits {
        Some(bits) if bits.width == 1 => "flag".to_owned(),
        Some(bits) => format!("whole, 0 to {}", (1u64 << bits.width) - 1),
        None if dimension.scale != 1.0 || dimension.origin != 0.0 => "float".to_owned(),
        None => words(dimension.scalar).to_owned(),
    }
}

fn words(scalar: Scalar) -> &'static str {
    match scalar {
        Scalar::U8 => "whole, 0 to 255",
        Scalar::U16 => "whole, 0 to 65535",
        Scalar::U32 | Scalar::U64 => "whole, from 0",
        Scalar::I8 | Scalar::I16 | Scalar::I32 | Scalar::I64 => "whole",
        Scalar::F32 | Scalar::F64 => "float",
    }
}

/// The number that `tree` is.
pub(super) fn number(
    tree: &ExpressionTree,
    names: Names<'_>,
) -> Result<NumberNode, ExpressionFault> {
    let boxed = |tree: &ExpressionTree| number(tree, names).map(Box::new);
    Ok(match &tree.node {
        TreeNode::Number(value) => NumberNode::Literal(*value),
        TreeNode::Name(name) => NumberNode::Field(names.field(name, &tree.span)?),
        TreeNode::Negated(of) => NumberNode::Negated(boxed(of)?),
        TreeNode::Arithmetic(operator, a, b) => {
            NumberNode::Arithmetic(*operator, boxed(a)?, boxed(b)?)
        }
        TreeNode::Call(function, of) => {
            let numbers = of.iter().map(|part| number(part, names));
            NumberNode::Call(*function, numbers.collect::<Result<_, _>>()?)
        }
        _ => return Err(no_number(tree)),
    })
}

/// The condition that `tree` is.
pub(super) fn truth(tree: &ExpressionTree, names: Names<'_>) -> Result<TruthNode, ExpressionFault> {
    let all = |parts: &[ExpressionTree]| -> Result<Vec<TruthNode>, ExpressionFault> {
        parts.iter().map(|part| truth(part, names)).collect()
    };
    Ok(match &tree.node {
        TreeNode::Compared(relation, a, b) => {
            let (a, b) = alike(number(a, names)?, number(b, names)?);
            TruthNode::Compared(*relation, a, b)
        }
        TreeNode::Among(of, ranges) => {
            let of = number(of, names)?;
            let bound = |(lo, hi): &(ExpressionTree, ExpressionTree)| {
                let lo = alike(of.clone(), number(lo, names)?).1;
                Ok((lo, alike(of.clone(), number(hi, names)?).1))
            };
            let ranges = ranges.iter().map(bound).collect::<Result<_, ExpressionFault>>()?;
            TruthNode::Among(of, ranges)
        }
        TreeNode::IsNan(of) => TruthNode::IsNan(number(of, names)?),
        TreeNode::Not(of) => TruthNode::Not(Box::new(truth(of, names)?)),
        TreeNode::All(parts) => TruthNode::All(all(parts)?),
        TreeNode::Any(parts) => TruthNode::Any(all(parts)?),
        TreeNode::Name(name) => match names.field(name, &tree.span)? {
            field if field.is_flag() => TruthNode::Set(NumberNode::Field(field)),
            _ => {
                let told = format!("{name} is a number, and something true or false belongs here");
                let help = format!("compare it, as in `{name} > 0`");
                return Err(ExpressionFault::new(tree.span.clone(), told).help(help));
            }
        },
        _ => return Err(no_condition(tree)),
    })
}

/// Two numbers that are compared: one that is written out beside a field of `f32` is rounded as
/// that field's values were, so that `Reflectance == 0.1` holds for what was stored as 0.1.
fn alike(a: NumberNode, b: NumberNode) -> (NumberNode, NumberNode) {
    let single =
        |number: &NumberNode| matches!(number, NumberNode::Field(field) if field.is_single());
    let rounded = |number: NumberNode| match number {
        NumberNode::Literal(value) => NumberNode::Literal(f64::from(value as f32)),
        other => other,
    };
    match (single(&a), single(&b)) {
        (true, false) => (a, rounded(b)),
        (false, true) => (rounded(a), b),
        _ => (a, b),
    }
}
