//! What is true or false for a record.

use super::bind::{Names, TruthNode, truth};
use super::eval;
use super::fault::ExpressionFault;
use super::parser::parse;
use super::rules::condition;
use super::text::{FromText, is_its_text};
use super::tree::ExpressionTree;
use crate::Result;
use crate::point::{PointBatch, Schema};

/// Something that is true or false for a record, as it was written: see the [module](super).
#[derive(Debug, Clone)]
pub struct Condition {
    text: String,
    tree: ExpressionTree,
}

is_its_text!(Condition);

impl FromText for Condition {
    const NAME: &'static str = "Condition";
    const EXPECTED: &'static str = "a condition in quotes, such as \"Classification == 2\"";

    fn read(text: &str) -> Result<Condition, ExpressionFault> {
        let tree = parse(text)?;
        condition(&tree)?;
        Ok(Condition { text: text.to_owned(), tree })
    }
}

impl Condition {
    /// Reads a condition.
    ///
    /// # Errors
    ///
    /// What is no condition, with its place in the text. Whether there are dimensions of these
    /// names is found when it is [bound](Condition::bind).
    pub fn parse(text: &str) -> Result<Condition> {
        Condition::read(text).map_err(|fault| fault.error(text))
    }

    /// As it was written.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The names of dimensions and columns in it, each once, in the order of the text.
    pub fn names(&self) -> Vec<&str> {
        self.tree.names()
    }

    /// The condition for records of `schema`.
    ///
    /// # Errors
    ///
    /// A name that is no dimension of theirs, and a number where something true or false belongs.
    pub fn bind(&self, schema: &Schema) -> Result<BoundCondition> {
        let bound = self.bind_names(Names { schema, columns: &[] });
        bound.map_err(|fault| fault.error(&self.text))
    }

    /// The condition for records and columns of these names.
    pub(crate) fn bind_names(&self, names: Names<'_>) -> Result<BoundCondition, ExpressionFault> {
        Ok(BoundCondition(truth(&self.tree, names)?))
    }

    /// Appends to `held` for each record of `batch` whether it holds, by records and columns of the
    /// batch.
    pub(crate) fn holds(&self, batch: &PointBatch, held: &mut Vec<bool>) -> Result<()> {
        let names = Names { schema: batch.schema(), columns: &batch.columns.kinds() };
        let bound = self.bind_names(names).map_err(|fault| fault.error(&self.text))?;
        bound.holds(batch, held);
        Ok(())
    }
}

/// A [`Condition`] for records of one schema.
#[derive(Debug, Clone)]
pub struct BoundCondition(TruthNode);

impl BoundCondition {
    /// Appends to `held` for each record of `batch`, which are of the schema that it was bound to,
    /// whether it holds.
    pub fn holds(&self, batch: &PointBatch, held: &mut Vec<bool>) {
        eval::holds(&self.0, batch, held);
    }
}
