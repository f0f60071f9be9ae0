//! The stage `stats`: what the numbers of dimensions come to, for the report.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::expression::{KeyExpression, NamedField};
use crate::point::{PointBatch, Schema, names};
use crate::report::{StatsTally, StoredNumbers, Tally};
use crate::stage::{Needs, Role, RoleName, StageKind, StagePlace, Transform};
use crate::{Error, Result};

/// Tells what the numbers of dimensions come to: smallest, largest, mean, standard deviation and a
/// histogram, of all points that come by or of those of each class. It changes no point.
///
/// The figures stand in the report, in `result.stats` under the `name` of the stage (`stats` if it
/// has none), and are the same to the last bit however the points come. A histogram has up to 256
/// bins, as wide as the smallest power of two that does; of whole numbers that few values have, it
/// is the count of each value. Columns that stages above compute are dimensions, too.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Stats {
    /// The dimensions, such as ["Z", "Intensity"]; none: all that the records have.
    pub dimensions: Vec<String>,
    /// True for the figures of each class besides those of all points.
    pub by_class: bool,
}

impl StageKind for Stats {
    const KIND: &'static str = "stats";
    const ROLE: RoleName = RoleName::Transform;
    const ABOUT: &'static str = "Tells what the numbers of dimensions come to, for the report.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        let twice = |(n, name): &(usize, &String)| self.dimensions[..*n].contains(name);
        if let Some((_, name)) = self.dimensions.iter().enumerate().find(twice) {
            let error = Error::pipeline(format!("{name} stands twice in the list"));
            return Err(at.blame("dimensions", error));
        }
        Ok(Role::Transform(Box::new(self)))
    }
}

impl Stats {
    fn names(&self, schema: &Schema) -> Vec<String> {
        match self.dimensions.is_empty() {
            true => schema.dimensions.iter().map(|dimension| dimension.name.clone()).collect(),
            false => self.dimensions.clone(),
        }
    }
}

impl Transform for Stats {
    fn needs(&self) -> Needs {
        Needs::none().looks_at(self.by_class.then_some(names::CLASSIFICATION))
    }

    fn expressions(&self) -> Vec<(&'static str, KeyExpression<'_>)> {
        self.dimensions.iter().map(|name| ("dimensions", KeyExpression::Name(name))).collect()
    }

    fn apply(&self, batch: &mut PointBatch, tally: &mut Tally) -> Result<()> {
        let classes = if self.by_class { classes(batch)? } else { Vec::new() };
        let stats = tally.own_stats();
        let count = |stats: &mut StatsTally, points: usize| stats.points += points as u64;
        count(stats, batch.len());
        for class in &classes {
            count(stats.classes.entry(*class).or_default(), 1);
        }
        for (number, name) in self.names(batch.schema()).iter().enumerate() {
            let field = NamedField::find(name, batch)?;
            let mut place = 0;
            field.each(batch, |stored| {
                stats.dimension(number, name).add(numbers(&field, stored));
                for (class, stored) in by_class(&classes, place, stored) {
                    let stats = stats.classes.entry(class).or_default();
                    stats.dimension(number, name).add(numbers(&field, &stored));
                }
                place += stored.len();
            });
        }
        Ok(())
    }
}

fn numbers<'a>(field: &NamedField, stored: &'a [f64]) -> StoredNumbers<'a> {
    let [scale, origin] = field.units();
    StoredNumbers { stored, scale, origin, whole: field.is_whole() }
}

/// The class of each record, as the report counts them: what is no class is class 0.
fn classes(batch: &PointBatch) -> Result<Vec<u8>> {
    let mut classes = Vec::with_capacity(batch.len());
    let field = NamedField::find(names::CLASSIFICATION, batch)?;
    field.each(batch, |stored| classes.extend(stored.iter().map(|class| *class as u8)));
    Ok(classes)
}

/// StoredNumbers by class, those of the records from `place` on.
fn by_class(classes: &[u8], place: usize, stored: &[f64]) -> BTreeMap<u8, Vec<f64>> {
    let mut all: BTreeMap<u8, Vec<f64>> = BTreeMap::new();
    if !classes.is_empty() {
        let classes = &classes[place..place + stored.len()];
        classes.iter().zip(stored).for_each(|(class, v)| all.entry(*class).or_default().push(*v));
    }
    all
}
