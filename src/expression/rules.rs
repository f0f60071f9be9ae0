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

pub(super) fn number(tree: &ExpressionTree) -> Result<(), ExpressionFault> {
    match tree.is_condition() {
        Some(true) => {
            let told = "this is true or false, and a number belongs here";
            Err(ExpressionFault::new(tree.span.clone(), told))
        }
        _ => Ok(()),
    }
}

/// Refuses a number where something that is true or false belongs.
pub(super) fn condition(tree: &ExpressionTree) -> Result<(), ExpressionFault> {
    match tree.is_condition() {
        Some(false) => {
            let told = "this is a number, and something true or false belongs here";
            let help = "compare it, as in `Intensity > 40`";
            Err(ExpressionFault::new(tree.span.clone(), told).help(help))
        }
        _ => Ok(()),
    }
}
