//! The stage `drop`: records of some classes or flags, or for which a condition holds, go.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::expression::{Choice, Condition, KeyExpression, choose};
use crate::point::{Flag, PointBatch, Schema, Selection};
use crate::report::Tally;
use crate::stage::{Needs, Role, RoleName, StageKind, StagePlace, Transform};
use crate::{Error, Result};

/// Removes the records of some classes or flags, or for which a condition holds.
///
/// The keys are those that limit any other stage: a record goes if all that are given hold for it.
/// `classes = [7, 18]` removes what is classified as noise. What stays is what a stage `filter`
/// with the opposite condition keeps. A scan that has no such class or flag has nothing to remove,
/// which the run says.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Drop {
    /// A condition that holds for the records that go, such as "Intensity < 40".
    #[serde(rename = "where")]
    pub condition: Option<Condition>,
    /// Classes of the records that go, as their number (7 and 18 are noise); none: whatever their
    /// class.
    pub classes: Vec<u8>,
    /// Flags that the records that go have.
    pub with: Vec<Flag>,
    /// Flags that the records that go do not have.
    pub without: Vec<Flag>,
}

impl Drop {
    /// The classes and flags of the records that go.
    fn selection(&self) -> Selection {
        let Drop { classes, with, without, .. } = self;
        let (classes, with, without) = (classes.clone(), with.clone(), without.clone());
        Selection { classes, with, without, ..Selection::default() }
    }

    fn choice(&self) -> Choice {
        Choice { selection: self.selection(), condition: self.condition.clone() }
    }
}

impl StageKind for Drop {
    const KIND: &'static str = "drop";
    const ROLE: RoleName = RoleName::Transform;
    const ABOUT: &'static str =
        "Removes the records of some classes or flags, or for which a condition holds.";
    const IS_LIMITED: bool = false;
    const MAIN: Option<&'static str> = Some("where");

    fn build(self, _: &StagePlace) -> Result<Role> {
        if self.choice().is_all() {
            let told = "this `drop` would remove every point";
            return Err(
                Error::pipeline(told).help("say which: by `where`, `classes`, `with` or `without`")
            );
        }
        Ok(Role::Transform(Box::new(self)))
    }
}

impl Transform for Drop {
    fn needs(&self) -> Needs {
        Needs::none().looks_at_if_there(self.selection().names()).removes(None)
    }

    fn expressions(&self) -> Vec<(&'static str, KeyExpression<'_>)> {
        self.condition.iter().map(|c| ("where", KeyExpression::Condition(c))).collect()
    }

    fn warnings(&self, schema: &Schema) -> Vec<String> {
        let missing = self.selection().missing(schema);
        let told = |name| format!("the input has no {name}: `drop` leaves no point out by it");
        missing.map(told).into_iter().collect()
    }

    fn idle(&self, schema: &Schema) -> Vec<String> {
        let choice = self.choice();
        match choice.selection.missing(schema) {
            Some(_) => Vec::new(),
            None => vec![format!("no point is {choice}: `drop` leaves no point out")],
        }
    }

    fn removes_by(&self) -> Vec<&'static str> {
        let keys = [
            ("drop.where", self.condition.is_none()),
            ("drop.classes", self.classes.is_empty()),
            ("drop.with", self.with.is_empty()),
            ("drop.without", self.without.is_empty()),
        ];
        keys.into_iter().filter(|(_, is_empty)| !is_empty).map(|(key, _)| key).collect()
    }

    fn apply(&self, batch: &mut PointBatch, _tally: &mut Tally) -> Result<()> {
        let selection = self.selection();
        if selection.missing(batch.schema()).is_some() {
            return Ok(());
        }
        let mut goes = Vec::with_capacity(batch.len());
        choose(&selection, self.condition.as_ref(), batch, &mut goes)?;
        batch.retain(|i, _| !goes[i]);
        Ok(())
    }
}
