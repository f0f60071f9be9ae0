//! The stage that makes one scan of several sources: a name for all of them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::stage::{Role, RoleName, StageKind, StagePlace};

/// Takes from several sources, which it names in `from`, and does nothing else: stages behind it
/// need not name them all. A stage whose own `from` is a list merges just the same. The records of
/// all come in the order in which the sources stand in the pipeline, whatever the order of `from`.
/// Sources that read files are merged if they read them in one way: all keys of `read` but `path`
/// and `format` are the same.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Merge {}

impl StageKind for Merge {
    const KIND: &'static str = "merge";
    const ROLE: RoleName = RoleName::Merge;
    const ABOUT: &'static str = "Makes one scan of several sources.";
    const IS_LIMITED: bool = false;

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::Merge)
    }
}
