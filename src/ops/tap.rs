//! The stage `tap`: how many points come by.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::point::PointBatch;
use crate::report::Tally;
use crate::stage::{Needs, Role, RoleName, StageKind, StagePlace, Transform};

/// Counts the points that come by and changes nothing: how many there are between two stages.
///
/// The count stands in the closing table and in the report, in `result.stats` under the `name` of
/// the stage (`tap` if it has none). With `where` it counts those of some kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tap {}

impl StageKind for Tap {
    const KIND: &'static str = "tap";
    const ROLE: RoleName = RoleName::Transform;
    const ABOUT: &'static str = "Counts the points that come by, and changes nothing.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::Transform(Box::new(self)))
    }
}

impl Transform for Tap {
    fn needs(&self) -> Needs {
        Needs::none()
    }

    fn apply(&self, batch: &mut PointBatch, tally: &mut Tally) -> Result<()> {
        tally.own_stats().points += batch.len() as u64;
        Ok(())
    }
}
