//! What numbers of a text are, all together.

use super::number::{self, EXACT};
use crate::point::Scalar;

/// What is in a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ColumnFacts {
    /// True if all are whole numbers that 64 bits hold, with or without a sign.
    pub is_whole: bool,
    /// The smallest and the largest, if they are whole.
    pub least: i128,
    pub most: i128,
    /// True if none is below -1 or above 1.
    is_small: bool,
    /// True if none is below 0.
    is_positive: bool,
}

impl ColumnFacts {
    /// Of no number.
    pub const NONE: ColumnFacts = ColumnFacts {
        is_whole: true,
        least: i128::MAX,
        most: i128::MIN,
        is_small: true,
        is_positive: true,
    };

    /// True if all are whole numbers from 0 to 255.
    pub fn is_byte(&self) -> bool {
        self.is_whole && self.least >= 0 && self.most <= 255
    }

    /// True if all may be cosines.
    pub fn is_cosine(&self) -> bool {
        self.is_small
    }

    /// True if all are from 0 to 1.
    pub fn is_fraction(&self) -> bool {
        self.is_small && self.is_positive
    }

    /// Adds a number; false if it is none.
    pub fn add(&mut self, field: &[u8]) -> bool {
        if let Some(value) = number::short(field) {
            self.note(value);
            match value.fract() == 0.0 {
                true => self.add_whole(value as i128),
                false => self.is_whole = false,
            }
            return true;
        }
        let whole = std::str::from_utf8(field).ok().and_then(|text| text.parse::<i128>().ok());
        let is_held = |v: &i128| *v >= i128::from(i64::MIN) && *v <= i128::from(u64::MAX);
        if let Some(value) = whole.filter(is_held) {
            self.note(value as f64);
            self.add_whole(value);
            return true;
        }
        let mut bytes = [0; 8];
        if !number::parse(field, Scalar::F64, &mut bytes) {
            return false;
        }
        let value = f64::from_le_bytes(bytes);
        self.note(value);
        match value.fract() == 0.0 && value.abs() < EXACT {
            true => self.add_whole(value as i128),
            false => self.is_whole = false,
        }
        true
    }

    fn note(&mut self, value: f64) {
        self.is_small &= value.abs() <= 1.0;
        self.is_positive &= value >= 0.0;
    }

    fn add_whole(&mut self, value: i128) {
        self.least = self.least.min(value);
        self.most = self.most.max(value);
    }

    /// That of the numbers of both.
    pub fn join(&mut self, other: &ColumnFacts) {
        self.is_whole &= other.is_whole;
        self.is_small &= other.is_small;
        self.is_positive &= other.is_positive;
        self.least = self.least.min(other.least);
        self.most = self.most.max(other.most);
    }
}

/// A type that holds all numbers of both; None if there is none.
pub(crate) fn holding(one: Scalar, two: Scalar) -> Option<Scalar> {
    let range = |scalar: Scalar| match scalar {
        Scalar::U8 => Some([0, i128::from(u8::MAX)]),
        Scalar::I8 => Some([i128::from(i8::MIN), i128::from(i8::MAX)]),
        Scalar::U16 => Some([0, i128::from(u16::MAX)]),
        Scalar::I16 => Some([i128::from(i16::MIN), i128::from(i16::MAX)]),
        Scalar::U32 => Some([0, i128::from(u32::MAX)]),
        Scalar::I32 => Some([i128::from(i32::MIN), i128::from(i32::MAX)]),
        Scalar::U64 => Some([0, i128::from(u64::MAX)]),
        Scalar::I64 => Some([i128::from(i64::MIN), i128::from(i64::MAX)]),
        Scalar::F32 | Scalar::F64 => None,
    };
    match (range(one), range(two)) {
        _ if one == two => Some(one),
        (Some([a, b]), Some([c, d])) => whole(a.min(c), b.max(d)),
        (None, None) => Some(Scalar::F64),
        // A double holds whole numbers of 32 bits, a float those of 16.
        (of_one, _) => {
            let (whole, float) = if of_one.is_some() { (one, two) } else { (two, one) };
            match whole.size() {
                8 => None,
                4 => Some(Scalar::F64),
                _ => Some(float),
            }
        }
    }
}

/// The smallest type of whole numbers from the one to the other; None if no type holds them.
pub(crate) fn whole(least: i128, most: i128) -> Option<Scalar> {
    let all = [
        (Scalar::U8, 0, i128::from(u8::MAX)),
        (Scalar::U16, 0, i128::from(u16::MAX)),
        (Scalar::I8, i128::from(i8::MIN), i128::from(i8::MAX)),
        (Scalar::I16, i128::from(i16::MIN), i128::from(i16::MAX)),
        (Scalar::U32, 0, i128::from(u32::MAX)),
        (Scalar::I32, i128::from(i32::MIN), i128::from(i32::MAX)),
        (Scalar::U64, 0, i128::from(u64::MAX)),
        (Scalar::I64, i128::from(i64::MIN), i128::from(i64::MAX)),
    ];
    let found = all.into_iter().find(|(_, low, high)| *low <= least && most <= *high);
    found.map(|(scalar, ..)| scalar)
}
