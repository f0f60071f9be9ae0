//! Which records: by class and flags, which most pipelines ask for, and by a condition.

use std::fmt;

use super::condition::Condition;
use crate::Result;
use crate::point::{PointBatch, Selection, names};

/// Records by class, flags and a condition; by default all of them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Choice {
    /// Their classes and flags.
    pub selection: Selection,
    /// What holds for them besides.
    pub condition: Option<Condition>,
}

impl Choice {
    /// True if it leaves no record out.
    pub fn is_all(&self) -> bool {
        self.condition.is_none() && self.selection.is_all()
    }

    /// True if what it says depends on the dimension `name`.
    pub fn looks_at(&self, name: &str) -> bool {
        let Selection { classes, not_classes, with, without } = &self.selection;
        let by_class = !(classes.is_empty() && not_classes.is_empty());
        let mut flags = with.iter().chain(without).map(|flag| flag.dimension());
        by_class && name == names::CLASSIFICATION
            || flags.any(|flag| flag == name)
            || self.condition.iter().any(|condition| condition.names().contains(&name))
    }

    /// Appends to `chosen` for each record of `batch` whether it is among them.
    pub fn holds(&self, batch: &PointBatch, chosen: &mut Vec<bool>) -> Result<()> {
        choose(&self.selection, self.condition.as_ref(), batch, chosen)
    }
}

/// Appends to `chosen` for each record of `batch` whether it is of the classes and flags of
/// `selection` and the condition holds.
pub(crate) fn choose(
    selection: &Selection,
    condition: Option<&Condition>,
    batch: &PointBatch,
    chosen: &mut Vec<bool>,
) -> Result<()> {
    let begin = chosen.len();
    match condition {
        Some(condition) => condition.holds(batch, chosen)?,
        None => chosen.resize(begin + batch.len(), true),
    }
    if !selection.is_all() {
        let chooser = selection.of(batch.schema());
        let each = chosen[begin..].iter_mut().zip(batch.iter());
        each.for_each(|(is_chosen, record)| *is_chosen &= chooser.holds(record));
    }
    Ok(())
}

/// In words that complete "points": `of class 2 or 6, where Z > 3`.
impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.condition {
            None => self.selection.fmt(f),
            Some(condition) if self.selection.is_all() => write!(f, "where {condition}"),
            Some(condition) => write!(f, "{}, where {condition}", self.selection),
        }
    }
}
