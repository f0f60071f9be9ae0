//! Looks at every record once, as it is decoded: the selections that it is in, whether it is
//! withheld, and its class.

use super::settings::Withheld;
use crate::point::{
    Chooser, Dimension, Endian, Flag, PointBatch, Scalar, Schema, Selection, Value, names,
};
use crate::report::{ClassCounts, Tally};
use crate::tile::{ASIDE, State, Tag};

/// Tells records apart as stages and settings ask.
#[derive(Debug, Clone)]
pub(super) struct Tagger {
    selections: Vec<Chooser>,
    withheld: Option<Chooser>,
    treatment: Withheld,
    /// For each input the number that tags carry; empty if they carry none.
    inputs: Vec<u32>,
}

impl Tagger {
    /// A tagger for records of `schema`; `inputs` are the numbers that tags carry for the inputs, if
    /// they are to. A selection by what these do not have selects nothing.
    pub fn new(
        schema: &Schema,
        selections: &[Selection],
        treatment: Withheld,
        inputs: Vec<u32>,
    ) -> Self {
        let withheld = Selection { with: vec![Flag::Withheld], ..Selection::default() };
        let has_flag = schema.find(names::WITHHELD).is_some() && treatment != Withheld::Keep;
        Tagger {
            selections: selections.iter().map(|selection| selection.of(schema)).collect(),
            withheld: has_flag.then(|| withheld.of(schema)),
            treatment,
            inputs,
        }
    }

    /// True if records need tags.
    pub fn tags(&self) -> bool {
        !self.inputs.is_empty()
            || !self.selections.is_empty()
            || self.withheld.is_some() && self.treatment == Withheld::Ignore
    }

    /// The tag of `record` from input `input`; None if it is withheld and to be removed.
    pub fn look(&self, record: &[u8], input: u32) -> Option<Tag> {
        let is_withheld = self.withheld.as_ref().is_some_and(|flag| flag.holds(record));
        if is_withheld && self.treatment == Withheld::Drop {
            return None;
        }
        let in_which =
            self.selections.iter().enumerate().map(|(n, s)| u8::from(s.holds(record)) << n);
        let selections = in_which.sum::<u8>() | if is_withheld { ASIDE } else { 0 };
        Some(Tag::new(selections, self.inputs.get(input as usize).copied().unwrap_or(0)))
    }
}

/// Where the class of a record is, to count records by it.
pub(super) struct ClassOf {
    field: Option<Dimension>,
    endian: Endian,
}

impl ClassOf {
    /// The class of records of `schema`.
    pub fn new(schema: &Schema) -> Self {
        ClassOf { field: schema.find(names::CLASSIFICATION).cloned(), endian: schema.endian }
    }

    /// Counts the records of `batch` as read.
    pub fn read(&self, batch: &PointBatch, tally: &mut Tally) {
        self.each(batch, tally, |counts, _, class| counts.read(class));
    }

    /// Counts the records of `batch` as kept.
    pub fn keep(&self, batch: &PointBatch, tally: &mut Tally) {
        self.each(batch, tally, |counts, _, class| counts.keep(class));
    }

    /// Counts as kept those records of `batch` whose state is so.
    pub fn keep_by_state(&self, batch: &PointBatch, states: &[State], tally: &mut Tally) {
        self.each(batch, tally, |counts, i, class| {
            if states[i].is_kept() {
                counts.keep(class);
            }
        });
    }

    fn each(
        &self,
        batch: &PointBatch,
        tally: &mut Tally,
        mut count: impl FnMut(&mut ClassCounts, usize, u8),
    ) {
        let Some(field) = &self.field else { return };
        let counts = tally.classes.get_or_insert_default();
        if field.scalar == Scalar::U8 {
            let (shift, width) = field.bits.map_or((0, 8), |bits| (bits.shift, bits.width));
            let mask = ((1u16 << width) - 1) as u8;
            for (i, record) in batch.iter().enumerate() {
                count(counts, i, record[field.offset] >> shift & mask);
            }
            return;
        }
        for (i, record) in batch.iter().enumerate() {
            // A PLY property of that name may hold what is no class.
            let class = match field.get(record, self.endian) {
                Value::Unsigned(class) => u8::try_from(class).ok(),
                other => Some(other.as_f64() as u8),
            };
            count(counts, i, class.unwrap_or_default());
        }
    }
}
