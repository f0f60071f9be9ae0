//! The stage `assign`: dimensions of records get the values of expressions.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::expression::{Assignment, KeyExpression, OneOrSeveral};
use crate::point::PointBatch;
use crate::report::Tally;
use crate::stage::{Needs, Role, RoleName, StageKind, StagePlace, Transform};
use crate::{Error, Result};

/// Gives dimensions of the records the values of expressions.
///
/// `set = "Classification = 7"` gives every point the class 7; with `where = "Z > 400"`, those
/// points alone. Of a list of assignments each sees what those before it changed. Expressions are
/// made of dimensions and, behind stages that compute columns, of these: `set = "Intensity =
/// NormalZ * 65535"`.
///
/// A dimension of whole numbers gets the nearest, of two that are as near the even one. A value
/// that a dimension cannot hold ends the run. Coordinates are not assigned: a stage `transform`
/// moves points. Stages that work on tiles see classes and other dimensions as they are when the
/// points are read: an `assign` that one of them is to see stands above all of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Assign {
    /// What is assigned: "NAME = EXPRESSION", or a list of such texts.
    pub set: OneOrSeveral<Assignment>,
}

impl StageKind for Assign {
    const KIND: &'static str = "assign";
    const ROLE: RoleName = RoleName::Transform;
    const ABOUT: &'static str = "Gives dimensions of the records the values of expressions.";
    const MAIN: Option<&'static str> = Some("set");

    fn build(self, at: &StagePlace) -> Result<Role> {
        if self.set.0.is_empty() {
            let error = Error::pipeline("`set` is an empty list").help("leave the stage out");
            return Err(at.blame("set", error));
        }
        Ok(Role::Transform(Box::new(self)))
    }
}

impl Transform for Assign {
    fn needs(&self) -> Needs {
        Needs::none().changes(self.set.0.iter().map(Assignment::target))
    }

    fn expressions(&self) -> Vec<(&'static str, KeyExpression<'_>)> {
        self.set.0.iter().map(|one| ("set", KeyExpression::Assignment(one))).collect()
    }

    fn apply(&self, batch: &mut PointBatch, _tally: &mut Tally) -> Result<()> {
        self.set.0.iter().try_for_each(|assignment| assignment.apply(batch))
    }
}
