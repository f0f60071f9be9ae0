//! The keys that every tile stage takes: which records it is limited to.

use serde::{Deserialize, Serialize};

use crate::point::{Flag, Selection};

/// The records that a tile stage decides about. What is not selected passes through untouched.
///
/// Any stage that works on tiles takes these keys besides its own.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LimitKeys {
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
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
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
    pub const KEYS: [&'static str; 4] = ["classes", "with", "without", "sees"];

    /// What they say.
    pub(crate) fn limits(self) -> Limits {
        let LimitKeys { mut classes, mut with, mut without, sees } = self;
        classes.sort_unstable();
        with.sort_unstable();
        without.sort_unstable();
        let selection = Selection { classes, with, without, ..Selection::default() };
        Limits { selection, sees }
    }
}

/// The records that a stage decides about, and those that it sees.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Limits {
    /// Those that it decides about.
    pub selection: Selection,
    /// Those that it sees as neighbours.
    pub sees: Sees,
}
