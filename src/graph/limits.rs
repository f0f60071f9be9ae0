//! The keys that every stage takes which works on points: which records it is limited to.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::expression::{Choice, Condition};
use crate::point::{Flag, Selection};

/// The records that a stage works on. What is not selected passes through untouched.
///
/// Stages between a source and a sink take these keys besides their own, but for `merge`,
/// `transform`, `filter` and `drop`; `sees` is for stages that work on tiles.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LimitKeys {
    /// A condition that holds for the records, over their dimensions and the columns that stages
    /// above computed: "Intensity > 40 and NormalZ > 0.9".
    #[serde(rename = "where", skip_serializing_if = "Option::is_none")]
    pub condition: Option<Condition>,
    /// Classes of the records, as their number (2 is ground); none: whatever their class.
    pub classes: Vec<u8>,
    /// Flags that a record must have.
    pub with: Vec<Flag>,
    /// Flags that a record must not have.
    pub without: Vec<Flag>,
    /// Which records are seen as neighbours.
    pub sees: Sees,
}

/// Which records a stage that is limited to some sees as neighbours.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Sees {
    /// Those that it is limited to.
    #[default]
    Selected,
    /// All.
    All,
}

impl LimitKeys {
    /// The names of the keys.
    pub const KEYS: [&'static str; 5] = [Self::WHERE, "classes", "with", "without", Self::SEES];
    /// That of them which is an expression.
    pub const WHERE: &'static str = "where";
    /// That of them which is for stages that work on tiles alone.
    pub const SEES: &'static str = "sees";
}

impl Limits {
    /// What the keys say.
    pub fn of(keys: LimitKeys) -> Limits {
        let LimitKeys { condition, mut classes, mut with, mut without, sees } = keys;
        classes.sort_unstable();
        with.sort_unstable();
        without.sort_unstable();
        let selection = Selection { classes, with, without, ..Selection::default() };
        Limits { choice: Choice { selection, condition }, sees }
    }
}

/// The records that a stage decides about, and those that it sees.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Limits {
    /// Those that it decides about.
    pub choice: Choice,
    /// Those that it sees as neighbours.
    pub sees: Sees,
}
