//! What the store keeps beside each record, and the sizes of what it keeps for each position.
//!
//! What passes decide is kept beside records, in a byte each, and never in them: a record that is
//! kept is written with the bytes that it was read with, and passes and branches can hold different
//! opinions of it at the same time.

use crate::point::Edit;

/// Selections that a record can be in, a bit each; the highest bit is [`ASIDE`].
pub const SELECTIONS: u32 = 7;
/// Set in the selections of a record that takes no part in any pass and is written as it is.
pub const ASIDE: u8 = 1 << SELECTIONS;
/// Asks, among selections that a record must be in, that it was chosen by what a pass before
/// computed: the tag of a record is written before any pass, its state is not.
pub const CHOSEN: u8 = 1 << SELECTIONS;

/// What accompanies a record from the decode on: the selections that it is in, a bit each, its
/// class where a stage reads it, and the number of its input.
///
/// From the lowest bit: 16 bits of the input's number, 8 bits of the class or, in runs that need no
/// classes, more of the input's number, and 8 bits of selections.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Tag(pub u32);

/// Inputs that a tag can tell apart.
pub const TAGGED_INPUTS: u32 = 1 << 24;
/// Inputs that a tag can tell apart if it holds a class too.
pub const CLASSED_INPUTS: u32 = 1 << 16;

impl Tag {
    /// A tag of selections and the number of an input.
    pub fn new(selections: u8, input: u32) -> Tag {
        Tag(u32::from(selections) << 24 | input & (TAGGED_INPUTS - 1))
    }

    /// The selections, a bit each.
    pub fn selections(self) -> u8 {
        (self.0 >> 24) as u8
    }

    /// The same tag with the class of the record; the number of its input is below
    /// [`CLASSED_INPUTS`].
    #[must_use]
    pub fn of_class(self, class: u8) -> Tag {
        Tag(self.0 & !(0xff << 16) | u32::from(class) << 16)
    }

    /// The class of the record, in runs that need classes.
    pub fn class(self) -> u8 {
        (self.0 >> 16) as u8
    }

    /// The number of the input, one of so many.
    pub fn input(self, inputs: usize) -> u32 {
        let short = inputs <= CLASSED_INPUTS as usize;
        self.0 & (if short { CLASSED_INPUTS } else { TAGGED_INPUTS } - 1)
    }
}

/// The state of a record between passes, as it is stored: a byte. From the lowest bit: two bits for
/// what became of it, five for its edits, and one that says that it was not chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RecordState(pub u8);

impl RecordState {
    /// In the scan.
    pub const ALIVE: RecordState = RecordState(0);
    /// Removed.
    pub const REMOVED: RecordState = RecordState(1);
    /// Written, but no longer looked at.
    pub const ASIDE: RecordState = RecordState(2);

    /// The same state with an edit of the record more.
    #[must_use]
    pub fn edited(self, edit: Edit) -> RecordState {
        RecordState(self.0 & !EDITS | edit.added_to(self.edits()) << 2)
    }

    /// The same state of a record that is chosen, or not.
    #[must_use]
    pub fn chosen(self, is_chosen: bool) -> RecordState {
        RecordState(self.0 & !UNCHOSEN | if is_chosen { 0 } else { UNCHOSEN })
    }

    /// True unless a choice left the record out.
    pub fn is_chosen(self) -> bool {
        self.0 & UNCHOSEN == 0
    }

    /// Set aside, with the edits that it has.
    #[must_use]
    pub fn aside(self) -> RecordState {
        RecordState(self.0 & !3 | RecordState::ASIDE.0)
    }

    /// True if later passes look at the record.
    pub fn is_alive(self) -> bool {
        self.0 & 3 == 0
    }

    /// True if the record is in the output.
    pub fn is_written(self) -> bool {
        self.0 & 3 != 1
    }

    /// True if the record is in the output and no mark says that it would be removed.
    pub fn is_kept(self) -> bool {
        self.is_alive() || self.chosen(true) == RecordState::ASIDE
    }

    /// The set of edits that the record is written with: see [`Edit::of`].
    pub fn edits(self) -> u8 {
        (self.0 & EDITS) >> 2
    }
}

/// The bits of a state that are edits, and the one that is set where a record was not chosen.
const EDITS: u8 = 0b0111_1100;
const UNCHOSEN: u8 = 0b1000_0000;

/// Bytes of a record's entry in the canonical order: its number in the store and, if records have
/// them, its tag.
pub const fn ref_bytes(tagged: bool) -> usize {
    size_of::<u64>() + if tagged { size_of::<Tag>() } else { 0 }
}

/// Bytes of a stored fate; see the survey.
pub const FATE_BYTES: usize = size_of::<f32>();

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_choice_changes_nothing_else_and_is_taken_back() {
        let edited = RecordState::ALIVE.edited(Edit::HighNoise).edited(Edit::SetKeyPoint);
        for state in [RecordState::ALIVE, RecordState::REMOVED, RecordState::ASIDE, edited] {
            let left_out = state.chosen(false);
            assert!(!left_out.is_chosen() && state.is_chosen());
            assert_eq!(left_out.edits(), state.edits());
            assert_eq!(left_out.is_alive(), state.is_alive());
            assert_eq!(left_out.is_kept(), state.is_kept());
            assert_eq!(left_out.chosen(true), state);
            assert_eq!(left_out.edited(Edit::LowNoise).chosen(true), state.edited(Edit::LowNoise));
        }
    }
}
