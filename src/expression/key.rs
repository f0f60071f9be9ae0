//! The expressions of a stage, whatever they are, for those that look their names up.

use super::assignment::Assignment;
use super::bind::Names;
use super::condition::Condition;
use super::fault::ExpressionFault;
use super::weight::Weight;

/// A condition or an assignment that is the value of a stage's key, or one of its values.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum KeyExpression<'a> {
    /// Something that is true or false.
    Condition(&'a Condition),
    /// What a dimension is given.
    Assignment(&'a Assignment),
    /// The name of a dimension, or of a number of a column.
    Name(&'a str),
    /// What a record counts.
    Weight(&'a Weight),
}

impl<'a> KeyExpression<'a> {
    /// As it was written.
    pub fn text(self) -> &'a str {
        match self {
            KeyExpression::Condition(condition) => condition.text(),
            KeyExpression::Assignment(assignment) => assignment.text(),
            KeyExpression::Name(name) => name,
            KeyExpression::Weight(weight) => weight.text(),
        }
    }

    /// The names that it reads, each once.
    pub fn names(self) -> Vec<&'a str> {
        match self {
            KeyExpression::Condition(condition) => condition.names(),
            KeyExpression::Assignment(assignment) => assignment.names(),
            KeyExpression::Name(name) => vec![name],
            KeyExpression::Weight(weight) => weight.names(),
        }
    }

    /// Refuses names that are not there, and what does not fit where it stands.
    pub(crate) fn check(self, names: Names<'_>) -> Result<(), ExpressionFault> {
        match self {
            KeyExpression::Condition(condition) => condition.bind_names(names).map(drop),
            KeyExpression::Assignment(assignment) => assignment.check(names),
            KeyExpression::Name(name) => names.field(name, &(0..name.len())).map(drop),
            KeyExpression::Weight(weight) => weight.check(names),
        }
    }
}
