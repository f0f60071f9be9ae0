//! Which records a stage is limited to, by class and flags.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::names;
use super::{Dimension, Endian, Scalar, Schema};

/// One of the flags that LAS has for every record (LAS 1.4 R15, tables 8 and 16).
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Flag {
    /// Not to be used in processing.
    Withheld,
    /// Within the overlap of two or more swaths.
    Overlap,
    /// Made by another technique than the scan.
    Synthetic,
    /// One of the points that describe the surface and are to be kept when thinning.
    KeyPoint,
}

impl Flag {
    /// The dimension that holds it.
    pub fn dimension(self) -> &'static str {
        match self {
            Flag::Withheld => names::WITHHELD,
            Flag::Overlap => names::OVERLAP,
            Flag::Synthetic => names::SYNTHETIC,
            Flag::KeyPoint => names::KEY_POINT,
        }
    }

    /// The word that files and arguments have for it.
    pub fn name(self) -> &'static str {
        match self {
            Flag::Withheld => "withheld",
            Flag::Overlap => "overlap",
            Flag::Synthetic => "synthetic",
            Flag::KeyPoint => "key-point",
        }
    }

    /// Where records of `schema` have it: a field, or a class where their layout has one for
    /// overlap.
    fn place(self, schema: &Schema) -> Option<FlagPlace> {
        let field = schema.find(self.dimension()).map(|field| FlagPlace::Field(Field::of(field)));
        let as_class = || {
            let overlap = schema.layout.overlap_class.filter(|_| self == Flag::Overlap)?;
            let class = schema.find(names::CLASSIFICATION)?;
            Some(FlagPlace::Class(Field::of(class), overlap))
        };
        field.or_else(as_class)
    }
}

/// Records by class and flags; by default all of them.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Selection {
    /// Classes of the records; none: whatever their class.
    pub classes: Vec<u8>,
    /// Classes that records must not have.
    pub not_classes: Vec<u8>,
    /// Flags that must be set.
    pub with: Vec<Flag>,
    /// Flags that must not be set.
    pub without: Vec<Flag>,
}

impl Selection {
    /// True if it leaves no record out.
    pub fn is_all(&self) -> bool {
        *self == Selection::default()
    }

    /// The dimensions that it looks at, where records have them.
    pub fn names(&self) -> Vec<&'static str> {
        let flags = self.with.iter().chain(&self.without);
        let mut all: Vec<&str> = flags.map(|flag| flag.dimension()).collect();
        // Of records without a flag for it, a class says overlap.
        let by_class = all.contains(&names::OVERLAP);
        if by_class || !self.classes.is_empty() || !self.not_classes.is_empty() {
            all.push(names::CLASSIFICATION);
        }
        all
    }

    /// What it asks for and records of `schema` do not have, so that it would hold none of them.
    pub fn missing(&self, schema: &Schema) -> Option<&'static str> {
        let class = (!self.classes.is_empty()).then_some(names::CLASSIFICATION);
        let flags = self.with.iter().filter(|flag| flag.place(schema).is_none());
        let class = class.filter(|name| schema.find(name).is_none());
        class.into_iter().chain(flags.map(|flag| flag.dimension())).next()
    }

    /// Flags that must not be set and that records of `schema` do not have: they leave none out.
    pub fn idle(&self, schema: &Schema) -> Vec<Flag> {
        self.without.iter().copied().filter(|flag| flag.place(schema).is_none()).collect()
    }

    /// The dimensions to look at in records of `schema`. One that they do not have counts as 0.
    pub fn of(&self, schema: &Schema) -> Chooser {
        let flag = |is_set| move |flag: &Flag| (flag.place(schema), is_set);
        let flags = self.with.iter().map(flag(true)).chain(self.without.iter().map(flag(false)));
        let by_class = !(self.classes.is_empty() && self.not_classes.is_empty());
        let mut classes = [self.classes.is_empty(); 256];
        self.classes.iter().for_each(|&class| classes[usize::from(class)] = true);
        self.not_classes.iter().for_each(|&class| classes[usize::from(class)] = false);
        Chooser {
            endian: schema.endian,
            class: schema.find(names::CLASSIFICATION).filter(|_| by_class).map(Field::of),
            any_class: self.classes.is_empty(),
            classes: Box::new(classes),
            flags: flags.collect(),
        }
    }
}

/// In words that complete "points": `of class 2 or 6, with the flag overlap`.
impl fmt::Display for Selection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers = |classes: &[u8]| classes.iter().map(u8::to_string).collect::<Vec<_>>();
        let flags = |flags: &[Flag]| flags.iter().map(|flag| flag.name()).collect::<Vec<_>>();
        let parts = [
            ("of class", numbers(&self.classes).join(" or ")),
            ("not of class", numbers(&self.not_classes).join(" or ")),
            ("with the flag", flags(&self.with).join(" and ")),
            ("without the flag", flags(&self.without).join(" or ")),
        ];
        let said = parts.iter().filter(|(_, list)| !list.is_empty());
        let said: Vec<String> = said.map(|(what, list)| format!("{what} {list}")).collect();
        f.write_str(&said.join(", "))
    }
}

/// A [`Selection`] among records of one schema.
#[derive(Debug, Clone)]
pub struct Chooser {
    endian: Endian,
    class: Option<Field>,
    /// True if a class that is no whole number up to 255 will do.
    any_class: bool,
    /// For each class whether it will do.
    classes: Box<[bool; 256]>,
    /// Places of flags, and whether they are to be set.
    flags: Vec<(Option<FlagPlace>, bool)>,
}

impl Chooser {
    /// True if the selection holds `record`.
    pub fn holds(&self, record: &[u8]) -> bool {
        self.is_of_class(record)
            && self.flags.iter().all(|(place, is_set)| {
                place.as_ref().is_some_and(|place| place.is_set(record, self.endian)) == *is_set
            })
    }

    fn is_of_class(&self, record: &[u8]) -> bool {
        match &self.class {
            None => self.classes[0],
            Some(Field::Byte(byte)) => self.classes[usize::from(byte.of(record))],
            // A PLY property of that name may hold what is no class.
            Some(Field::Other(field)) => {
                let class = field.get(record, self.endian).as_f64();
                let whole = (0.0..256.0).contains(&class) && class.fract() == 0.0;
                if whole { self.classes[class as usize] } else { self.any_class }
            }
        }
    }
}

/// A field that is looked at in every record: nearly all are a byte or bits of one.
#[derive(Debug, Clone)]
enum Field {
    Byte(Byte),
    Other(Dimension),
}

/// Bits of the byte at `offset`.
#[derive(Debug, Clone, Copy)]
struct Byte {
    offset: usize,
    shift: u8,
    mask: u8,
}

impl Byte {
    fn of(self, record: &[u8]) -> u8 {
        record[self.offset] >> self.shift & self.mask
    }
}

impl Field {
    fn of(dimension: &Dimension) -> Field {
        if dimension.scalar != Scalar::U8 {
            return Field::Other(dimension.clone());
        }
        let (shift, width) = dimension.bits.map_or((0, 8), |bits| (bits.shift, bits.width));
        let mask = ((1u16 << width) - 1) as u8;
        Field::Byte(Byte { offset: dimension.offset, shift, mask })
    }

    fn value(&self, record: &[u8], endian: Endian) -> f64 {
        match self {
            Field::Byte(byte) => f64::from(byte.of(record)),
            Field::Other(field) => field.get(record, endian).as_f64(),
        }
    }
}

/// Where a flag of a record is.
#[derive(Debug, Clone)]
enum FlagPlace {
    /// A field of its own.
    Field(Field),
    /// Point formats 0 to 5 have no overlap flag, but a class for it.
    Class(Field, u8),
}

impl FlagPlace {
    fn is_set(&self, record: &[u8], endian: Endian) -> bool {
        match self {
            FlagPlace::Field(Field::Byte(byte)) => byte.of(record) != 0,
            FlagPlace::Field(field) => field.value(record, endian) != 0.0,
            FlagPlace::Class(field, class) => field.value(record, endian) == f64::from(*class),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point::{Endian, Layout, Scalar};

    fn schema() -> Schema {
        let dimensions = vec![
            Dimension::new(names::CLASSIFICATION, Scalar::U8, 0),
            Dimension::new(names::WITHHELD, Scalar::U8, 1).bits(2, 1),
            Dimension::new(names::KEY_POINT, Scalar::U8, 1).bits(1, 1),
        ];
        Schema { layout: Layout::plain("made"), endian: Endian::Little, stride: 2, dimensions }
    }

    #[test]
    fn a_selection_holds_what_its_classes_and_flags_say() {
        let holds = |selection: &Selection, record: [u8; 2]| selection.of(&schema()).holds(&record);
        let classes = Selection { classes: vec![2, 6], ..Selection::default() };
        assert!(holds(&classes, [2, 0]) && holds(&classes, [6, 255]) && !holds(&classes, [5, 0]));
        let with = Selection { with: vec![Flag::KeyPoint], ..Selection::default() };
        assert!(holds(&with, [0, 2]) && !holds(&with, [0, 4]));
        let without = Selection { without: vec![Flag::Withheld], ..Selection::default() };
        assert!(holds(&without, [0, 2]) && !holds(&without, [0, 4]));
        // What the records do not have is not set.
        let overlap = Selection { without: vec![Flag::Overlap], ..Selection::default() };
        assert!(holds(&overlap, [0, 0]));
        assert!(Selection::default().is_all() && !overlap.is_all());
    }
}
