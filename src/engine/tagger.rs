//! Looks at every record once, as it is decoded: the selections that it is in, whether it is
//! withheld, and its class.
//!
//! Later passes ask this of a record each time that they load it, and records are stored in bytes
//! of their format, in another order than positions. A tag of four bytes beside the reference to a
//! record answers without fetching it, and is not stored where no stage asks.

use crate::Result;
use crate::expression::Choice;
use crate::graph::{RunSettings, Treatment};
use crate::point::{
    Chooser, Dimension, Endian, Flag, PointBatch, Scalar, Schema, Selection, Value, names,
};
use crate::report::{ClassCounts, Tally};
use crate::store::{ASIDE, RecordState, Tag};

/// Tells records apart as stages and settings ask.
#[derive(Debug, Clone)]
pub(crate) struct Tagger {
    choices: Vec<(Choice, Chooser)>,
    useless: Vec<Useless>,
    /// Where the class is that tags carry, if they are to.
    class: Option<ClassOf>,
    /// For each input the number that tags carry; empty if they carry none.
    inputs: Vec<u32>,
    /// Flags that selections forbid and the records do not have.
    idle: Vec<Flag>,
}

/// Records that the scan itself says are of no use.
#[derive(Debug, Clone)]
struct Useless {
    chooser: Chooser,
    /// True if they are removed, false if they are written as they are.
    is_dropped: bool,
    /// As the ledger names them.
    reason: &'static str,
}

/// The reasons for which the ledger has records that the decode leaves out, the setting that
/// decides it, and what they are.
pub(crate) const LEFT_OUT: [(&str, &str, &str); 2] = [
    ("withheld", "run.withheld", "with the withheld flag"),
    ("noise", "run.noise", "of the classes 7 and 18 (noise)"),
];
/// The reason for which it has those whose coordinates are no numbers, by `run.nonfinite`.
pub(crate) const NOT_FINITE: &str = "not finite";
const NOISE: [u8; 2] = [7, 18];

impl Tagger {
    /// A tagger for records of `schema`; `inputs` are the numbers that tags carry for the inputs,
    /// if they are to, and `classes` says if they carry the class. A selection by what these do not
    /// have selects nothing.
    pub fn new(schema: &Schema, choices: &[Choice], classes: bool, inputs: Vec<u32>) -> Self {
        let mut idle: Vec<Flag> =
            choices.iter().flat_map(|choice| choice.selection.idle(schema)).collect();
        idle.sort_unstable();
        idle.dedup();
        Tagger {
            choices: choices.iter().map(|c| (c.clone(), c.selection.of(schema))).collect(),
            useless: Vec::new(),
            class: classes.then(|| ClassOf::new(schema)),
            inputs,
            idle,
        }
    }

    /// Leaves records out, or sets them aside, as the settings say.
    pub fn treat(&mut self, schema: &Schema, settings: &RunSettings) {
        let withheld = Selection { with: vec![Flag::Withheld], ..Selection::default() };
        let noise = Selection { classes: NOISE.to_vec(), ..Selection::default() };
        let treated = [Some(settings.withheld), settings.noise];
        for ((selection, treatment), (reason, ..)) in
            [withheld, noise].iter().zip(treated).zip(LEFT_OUT)
        {
            let is_there = selection.missing(schema).is_none();
            let Some(treatment) = treatment.filter(|_| is_there) else { continue };
            if treatment != Treatment::Keep {
                let is_dropped = treatment == Treatment::Drop;
                self.useless.push(Useless { chooser: selection.of(schema), is_dropped, reason });
            }
        }
    }

    /// True if records need tags.
    pub fn tags(&self) -> bool {
        !self.inputs.is_empty()
            || self.class.is_some()
            || !self.choices.is_empty()
            || self.useless.iter().any(|useless| !useless.is_dropped)
    }

    /// Replaces `held` by a byte for each record of `batch`: the conditions of choices that hold, a
    /// bit each. Empty if no choice has a condition.
    pub fn conditions(&self, batch: &PointBatch, held: &mut Vec<u8>) -> Result<()> {
        held.clear();
        let mut holds = Vec::new();
        for (n, (choice, _)) in self.choices.iter().enumerate() {
            let Some(condition) = &choice.condition else { continue };
            holds.clear();
            condition.holds(batch, &mut holds)?;
            held.resize(batch.len(), 0);
            held.iter_mut().zip(&holds).for_each(|(held, is)| *held |= u8::from(*is) << n);
        }
        Ok(())
    }

    /// The tag of `record` from input `input`, for which the conditions `held`; if it is to be
    /// removed, why.
    pub fn look(&self, record: &[u8], input: u32, held: u8) -> Result<Tag, &'static str> {
        let mut aside = 0;
        for useless in self.useless.iter().filter(|useless| useless.chooser.holds(record)) {
            if useless.is_dropped {
                return Err(useless.reason);
            }
            aside = ASIDE;
        }
        let in_which = self.choices.iter().enumerate().map(|(n, (choice, chooser))| {
            let holds = choice.condition.is_none() || held >> n & 1 == 1;
            u8::from(holds && chooser.holds(record)) << n
        });
        let selections = in_which.sum::<u8>() | aside;
        let tag = Tag::new(selections, self.inputs.get(input as usize).copied().unwrap_or(0));
        Ok(self.class.as_ref().map_or(tag, |class| tag.of_class(class.of(record))))
    }

    /// What the user should know when all records have been looked at; `met` are the selections
    /// that one of them is in, a bit each.
    pub fn warnings(&self, met: u8) -> Vec<String> {
        let nobody = |(n, (choice, _)): (usize, &(Choice, Chooser))| {
            (met >> n & 1 == 0).then(|| {
                format!("no point is {choice}: what was asked for those points did nothing")
            })
        };
        let idle = |flag: &Flag| {
            format!("the input has no flag {}: `without` leaves no point out by it", flag.name())
        };
        let unmet = self.choices.iter().enumerate().filter_map(nobody);
        unmet.chain(self.idle.iter().map(idle)).collect()
    }
}

/// Where the class of a record is.
#[derive(Debug, Clone)]
pub(crate) struct ClassOf {
    field: Option<Dimension>,
    endian: Endian,
}

impl ClassOf {
    /// The class of records of `schema`.
    pub fn new(schema: &Schema) -> Self {
        ClassOf { field: schema.find(names::CLASSIFICATION).cloned(), endian: schema.endian }
    }

    /// The class of `record`; 0 where it has none.
    pub fn of(&self, record: &[u8]) -> u8 {
        let Some(field) = &self.field else { return 0 };
        // A PLY property of that name may hold what is no class.
        match field.get(record, self.endian) {
            Value::Unsigned(class) => u8::try_from(class).unwrap_or_default(),
            other => other.as_f64() as u8,
        }
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
    pub fn keep_by_state(&self, batch: &PointBatch, states: &[RecordState], tally: &mut Tally) {
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
            count(counts, i, self.of(record));
        }
    }
}
