//! What the items of a phase come to, and what a thread sums up of all that it did: small, and able
//! to be written down. Knows no phase.
//!
//! What is large stays where an item stored it. What is left crosses from an item to the run in one
//! value, and nothing else does. That each is a value which text can hold is demanded here, where
//! every phase passes through: a list of what is done can then be kept, or sent, whatever phases
//! there will be. Nobody does so yet.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// What an item or a thread of a phase comes to. Read again from where it was written, it is the
/// same.
pub trait ItemTally: Serialize + DeserializeOwned + PartialEq + Send {}

impl<T: Serialize + DeserializeOwned + PartialEq + Send> ItemTally for T {}

/// The tally as it is: the unit tests write every one down, and go on with what they read.
pub(super) fn handed_over<T: ItemTally>(tally: T) -> T {
    #[cfg(test)]
    let tally = written::and_read(tally);
    tally
}

#[cfg(test)]
pub(crate) mod written {
    //! Tallies as texts.

    use std::any::type_name;
    use std::collections::BTreeMap;
    use std::sync::{Mutex, PoisonError};

    use super::ItemTally;

    static LONGEST: Mutex<BTreeMap<&str, usize>> = Mutex::new(BTreeMap::new());

    /// What comes back of a tally; a panic if it is another.
    pub fn and_read<T: ItemTally>(tally: T) -> T {
        let (name, text) = (type_name::<T>(), serde_json::to_string(&tally).unwrap());
        let read: T = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{name}: {e}: {text}"));
        assert!(read == tally, "{name} comes back as another: {text}");
        let mut longest = LONGEST.lock().unwrap_or_else(PoisonError::into_inner);
        let longest = longest.entry(name).or_default();
        *longest = text.len().max(*longest);
        read
    }

    /// Bytes of the longest text of each type that went through.
    pub fn longest() -> BTreeMap<&'static str, usize> {
        LONGEST.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}
