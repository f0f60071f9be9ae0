//! The stage `filter`: records of some classes or flags stay, all others go. Knows no neighbours.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::expression::{Condition, KeyExpression, choose};
use crate::point::{Flag, PointBatch, Schema, Selection, names};
use crate::report::Tally;
use crate::stage::{Needs, Role, RoleName, StageKind, StagePlace, Transform};
use crate::{Error, Result};

/// Keeps the records for which a condition holds, or of some classes and flags, and removes all
/// others.
///
/// A record stays if the condition `where` holds for it (where one is given), if its class is
/// among `keep_classes` (where any are given) and not among `drop_classes`, and if it has all of
/// `keep_flags` and none of `drop_flags`. A scan without classes has nothing of a class to drop,
/// which the run says; to keep some of its classes is an error. Point formats 0 to 5 have no
/// overlap flag: there the flag `overlap` is class 12.
///
/// Stages below it neither see nor count what it removes. Behind stages that compute columns, a
/// condition may name these, too: `where = "NormalZ > 0.9"`. To limit one stage to some records and
/// let the others pass, give that stage `where`, `classes`, `with` or `without` instead; to name
/// what goes instead of what stays, use `drop`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Filter {
    /// A condition that holds for the records that stay, such as "Intensity > 40".
    #[serde(rename = "where")]
    pub condition: Option<Condition>,
    /// Classes that stay, as their number (2 is ground); none: all.
    pub keep_classes: Vec<u8>,
    /// Classes that go, such as 7 and 18, which are noise.
    pub drop_classes: Vec<u8>,
    /// Flags that a record must have to stay.
    pub keep_flags: Vec<Flag>,
    /// Flags that a record must not have to stay.
    pub drop_flags: Vec<Flag>,
}

impl Filter {
    /// Refuses a filter that says nothing, or of one class or flag both; names the key.
    pub(crate) fn check(&self) -> Result<(), (&'static str, Error)> {
        let Filter { keep_classes, drop_classes, keep_flags, drop_flags, .. } = self;
        if let Some(class) = drop_classes.iter().find(|class| keep_classes.contains(class)) {
            let told = format!("class {class} is both kept and dropped");
            return Err(("drop_classes", Error::pipeline(told)));
        }
        if let Some(flag) = drop_flags.iter().find(|flag| keep_flags.contains(flag)) {
            let told = format!("records with the flag {} are both kept and dropped", flag.name());
            return Err(("drop_flags", Error::pipeline(told)));
        }
        Ok(())
    }

    /// The classes and flags of the records that stay.
    fn selection(&self) -> Selection {
        Selection {
            classes: self.keep_classes.clone(),
            not_classes: self.drop_classes.clone(),
            with: self.keep_flags.clone(),
            without: self.drop_flags.clone(),
        }
    }
}

impl StageKind for Filter {
    const KIND: &'static str = "filter";
    const ROLE: RoleName = RoleName::Transform;
    const ABOUT: &'static str =
        "Keeps the records for which a condition holds, or of some classes and flags.";
    const IS_LIMITED: bool = false;
    const MAIN: Option<&'static str> = Some("where");

    fn build(self, at: &StagePlace) -> Result<Role> {
        self.check().map_err(|(key, error)| at.blame(key, error))?;
        Ok(Role::Transform(Box::new(self)))
    }
}

impl Transform for Filter {
    fn needs(&self) -> Needs {
        Needs::none().looks_at_if_there(self.selection().names()).removes(None)
    }

    fn expressions(&self) -> Vec<(&'static str, KeyExpression<'_>)> {
        self.condition.iter().map(|c| ("where", KeyExpression::Condition(c))).collect()
    }

    fn check(&self, schema: &Schema) -> Result<()> {
        let selection = self.selection();
        let Some(missing) = selection.missing(schema) else { return Ok(()) };
        let by_class = Selection { with: Vec::new(), ..selection }.missing(schema).is_some();
        let (key, remedy) = match by_class {
            true => ("`filter.keep_classes`", "leave `filter.keep_classes` out"),
            false => ("`filter.keep_flags`", "leave the flag in `filter.keep_flags` out"),
        };
        let told = format!("{key} selects points by {missing}, which the input does not have");
        Err(Error::pipeline(told).help(remedy))
    }

    fn warnings(&self, schema: &Schema) -> Vec<String> {
        let class = (!self.drop_classes.is_empty() && schema.find(names::CLASSIFICATION).is_none())
            .then(|| {
                "the input has no classes: `filter.drop_classes` leaves no point out".to_owned()
            });
        let flag = |flag: Flag| {
            let name = flag.name();
            format!("the input has no flag {name}: `filter.drop_flags` leaves no point out by it")
        };
        class.into_iter().chain(self.selection().idle(schema).into_iter().map(flag)).collect()
    }

    fn idle(&self, schema: &Schema) -> Vec<String> {
        let condition = self.condition.iter().map(|condition| {
            format!("every point is where {condition}: `filter.where` leaves no point out")
        });
        let classes = Selection { classes: self.drop_classes.clone(), ..Selection::default() };
        let is_there = |dropped: &Selection| !dropped.is_all() && dropped.missing(schema).is_none();
        let told = |dropped: Selection, key| {
            format!("no point is {dropped}: `filter.{key}` leaves no point out")
        };
        let classes = Some(classes).filter(is_there).map(|which| told(which, "drop_classes"));
        let flag = |flag: &Flag| {
            let with = Selection { with: vec![*flag], ..Selection::default() };
            Some(with).filter(is_there).map(|which| told(which, "drop_flags"))
        };
        let flags = self.drop_flags.iter().filter_map(flag);
        condition.chain(classes).chain(flags).collect()
    }

    fn removes_by(&self) -> Vec<&'static str> {
        let keys = [
            ("filter.where", self.condition.is_none()),
            ("filter.keep_classes", self.keep_classes.is_empty()),
            ("filter.drop_classes", self.drop_classes.is_empty()),
            ("filter.keep_flags", self.keep_flags.is_empty()),
            ("filter.drop_flags", self.drop_flags.is_empty()),
        ];
        keys.into_iter().filter(|(_, is_empty)| !is_empty).map(|(key, _)| key).collect()
    }

    fn apply(&self, batch: &mut PointBatch, _tally: &mut Tally) -> Result<()> {
        let (selection, condition) = (self.selection(), self.condition.as_ref());
        if condition.is_some() || !selection.is_all() {
            let mut stays = Vec::with_capacity(batch.len());
            choose(&selection, condition, batch, &mut stays)?;
            batch.retain(|i, _| stays[i]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_class_or_flag_that_is_both_kept_and_dropped_is_refused() {
        let filter = |text: &str| toml::from_str::<Filter>(text).unwrap();
        let told = filter("keep_classes = [2, 6]\ndrop_classes = [7, 6]").check().unwrap_err();
        assert_eq!(
            (told.0, told.1.to_string().as_str()),
            ("drop_classes", "class 6 is both kept and dropped")
        );
        let told =
            filter("keep_flags = ['overlap']\ndrop_flags = ['overlap']").check().unwrap_err();
        assert_eq!(told.0, "drop_flags");
        assert!(filter("keep_classes = [2]\ndrop_flags = ['withheld']").check().is_ok());
    }
}
