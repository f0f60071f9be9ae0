//! What a dimension of a record is given.

use std::ops::Range;

use super::bind::{Names, NumberNode, TruthNode, number, truth, type_of};
use super::eval;
use super::fault::ExpressionFault;
use super::lanes::{LANES, LoadedField};
use super::parser::parse_assignment;
use super::text::{FromText, is_its_text};
use super::tree::{ExpressionTree, TreeNode};
use crate::point::{Dimension, PointBatch, names};
use crate::quantity::Figure;
use crate::{Error, Result};

/// `NAME = EXPRESSION`, as it was written: see the [module](super). A condition gives 1 where it
/// holds, else 0.
#[derive(Debug, Clone)]
pub struct Assignment {
    text: String,
    target: (String, Range<usize>),
    tree: ExpressionTree,
}

is_its_text!(Assignment);

enum BoundValue {
    Number(NumberNode),
    Truth(TruthNode),
}

impl FromText for Assignment {
    const NAME: &'static str = "Assignment";
    const EXPECTED: &'static str = "an assignment in quotes, such as \"Classification = 7\"";

    fn read(text: &str) -> Result<Assignment, ExpressionFault> {
        let (name, span, tree) = parse_assignment(text)?;
        if names::XYZ.contains(&name.as_str()) {
            let told = format!("{name} is a coordinate, and coordinates are not assigned");
            return Err(ExpressionFault::new(span, told).help("a stage `transform` moves points"));
        }
        Ok(Assignment { text: text.to_owned(), target: (name, span), tree })
    }
}

impl Assignment {
    /// Reads an assignment.
    ///
    /// # Errors
    ///
    /// What is no assignment, with its place in the text.
    pub fn parse(text: &str) -> Result<Assignment> {
        Assignment::read(text).map_err(|fault| fault.error(text))
    }

    /// As it was written.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The dimension that is given a value.
    pub fn target(&self) -> &str {
        &self.target.0
    }

    /// The names that its value is made of, each once.
    pub fn names(&self) -> Vec<&str> {
        self.tree.names()
    }

    /// Refuses names that are not there, and a target that is no dimension of the records.
    /// A number that the dimension can hold for no point is refused, too.
    pub(crate) fn check(&self, names: Names<'_>) -> Result<(), ExpressionFault> {
        let (field, _) = self.bind(names)?;
        let TreeNode::Number(number) = self.tree.node else { return Ok(()) };
        let target = LoadedField::of_record(&field, names.schema);
        let stride = names.schema.stride;
        if target.store(&[number], &mut vec![0; stride], stride).is_ok() {
            return Ok(());
        }
        let told = format!("{} ({}) cannot hold it", self.target.0, type_of(&field));
        Err(ExpressionFault::new(self.tree.span.clone(), told))
    }

    fn bind(&self, names: Names<'_>) -> Result<(Dimension, BoundValue), ExpressionFault> {
        let (name, span) = &self.target;
        let of_records = Names { columns: &[], ..names };
        let Some(field) = names.schema.find(name) else {
            return Err(of_records.unknown(name, span));
        };
        let value = match self.tree.is_condition() {
            Some(true) => BoundValue::Truth(truth(&self.tree, names)?),
            _ => BoundValue::Number(number(&self.tree, names)?),
        };
        Ok((field.clone(), value))
    }

    /// Gives the dimension its value in every record of `batch`.
    ///
    /// # Errors
    ///
    /// Names that are not there, and a value that the dimension cannot hold.
    pub(crate) fn apply(&self, batch: &mut PointBatch) -> Result<()> {
        let names = Names { schema: batch.schema(), columns: &batch.columns.kinds() };
        let bound = self.bind(names).map_err(|fault| fault.error(&self.text))?;
        let (field, mut numbers) = (bound.0, Vec::new());
        match bound.1 {
            BoundValue::Number(number) => eval::numbers(&number, batch, &mut numbers),
            BoundValue::Truth(truth) => {
                let mut held = Vec::new();
                eval::holds(&truth, batch, &mut held);
                numbers.extend(held.into_iter().map(|held| f64::from(u8::from(held))));
            }
        }
        let schema = batch.schema().clone();
        let target = LoadedField::of_record(&field, &schema);
        let blocks = batch.records_mut().chunks_mut(LANES * schema.stride);
        blocks.zip(numbers.chunks(LANES)).try_for_each(|(records, numbers)| {
            let stored = target.store(numbers, records, schema.stride);
            stored.map_err(|number| self.too_much(&field, number))
        })
    }

    fn too_much(&self, field: &Dimension, number: f64) -> Error {
        let Assignment { text, target: (name, _), .. } = self;
        let told = match number.is_nan() {
            true => format!("`{text}` is not a number for a point"),
            false => format!("`{text}` is {} for a point", Figure(number)),
        };
        let (holds, help) = (type_of(field), "limit it by `where`, `min` or `max`");
        Error::pipeline(format!("{told}, which {name} ({holds}) cannot hold")).help(help)
    }
}
