//! What may stand where in an expression, as far as it can be told without what names mean.

use std::ops::Range;

use super::fault::ExpressionFault;
use super::lexer::TokenKind;
use super::tree::{ExpressionTree, Relation, TreeNode};

/// Parts inside parts that an expression has at most, so that no text exhausts the stack.
pub(super) const DEEPEST: usize = 64;

pub(super) fn too_deep(span: Range<usize>) -> ExpressionFault {
    let told = format!("more than {DEEPEST} parts stand in each other, or numbers in a row");
    ExpressionFault::new(span, told)
}

/// Parts inside parts.
pub(super) fn depth(tree: &ExpressionTree) -> usize {
    1 + tree.parts().into_iter().map(depth).max().unwrap_or(0)
}

pub(super) fn not(part: ExpressionTree, start: usize) -> ExpressionTree {
    let span = start..part.span.end;
    ExpressionTree { node: TreeNode::Not(Box::new(part)), span }
}

pub(super) fn relation(token: &TokenKind) -> Option<Relation> {
    let TokenKind::Sign(sign) = token else { return None };
    Some(match *sign {
        "==" => Relation::Equal,
        "!=" => Relation::Unequal,
        "<" => Relation::Less,
        "<=" => Relation::AtMost,
        ">" => Relation::Greater,
        ">=" => Relation::AtLeast,
        _ => return None,
    })
}

/// 1 for what ascends, -1 for what descends, else 0.
pub(super) fn direction(relation: Relation) -> i8 {
    match relation {
        Relation::Less | Relation::AtMost => 1,
        Relation::Greater | Relation::AtLeast => -1,
        Relation::Equal | Relation::Unequal => 0,
    }
}

/// Refuses something that is true or false where a number belongs.
pub(super) fn number(tree: &ExpressionTree) -> Result<(), ExpressionFault> {
    if tree.is_condition() == Some(true) { Err(no_number(tree)) } else { Ok(()) }
}

/// Refuses a number where something that is true or false belongs.
pub(super) fn condition(tree: &ExpressionTree) -> Result<(), ExpressionFault> {
    if tree.is_condition() == Some(false) { Err(no_condition(tree)) } else { Ok(()) }
}

/// The fault of what is true or false and should be a number.
pub(super) fn no_number(tree: &ExpressionTree) -> ExpressionFault {
    let told = "this is true or false, and a number belongs here";
    ExpressionFault::new(tree.span.clone(), told)
}

/// The fault of what is a number and should be true or false.
pub(super) fn no_condition(tree: &ExpressionTree) -> ExpressionFault {
    let told = "this is a number, and something true or false belongs here";
    ExpressionFault::new(tree.span.clone(), told).help("compare it, as in `Intensity > 40`")
}
