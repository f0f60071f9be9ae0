//! Colours of 16 bits, as LAS records have them, as the 8 bits that readers of PLY, PCD and texts
//! expect.
//!
//! Nothing is lost by 8 bits where 16 of them hold no more: where each colour is a multiple of 257
//! or of 256, or all are below 256, as three kinds of writers leave them. Whether they are only all
//! points together say, long after the first are written; so rows are written with 8 bits until
//! a colour needs more, and the file is written anew when one does. Where it was needed for no more
//! than telling multiples of 257 from those of 256, it is written with 8 bits again in the end. So
//! the type in a finished file depends on the colours alone.

use super::schema::{ALPHA, PACKED, RowShape};
use super::{Encoding, RowForm, number};
use crate::point::names::{BLUE, GREEN, RED};
use crate::point::{Dimension, Endian, Scalar, Schema, Value};
use crate::stage::Colors;
use crate::{Error, Result};

/// What the 16-bit colours of some points are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Depth {
    /// Nothing but 0, which all the others have too.
    #[default]
    Black,
    /// 8 bits times 257, so that 255 is 65535, as the specification wants it (LAS 1.4 R15, table
    /// 9).
    Times257,
    /// 8 bits times 256.
    Times256,
    /// Some of the one and some of the other.
    Mixed,
    /// 8 bits as they are: their writer did not scale them.
    Unscaled,
    /// 16 bits.
    Full,
}

/// What a chunk is written with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct WrittenColors {
    pub depth: Depth,
    /// True if its colours have 16 bits.
    pub wide: bool,
}

impl WrittenColors {
    const WIDE: u8 = 8;

    /// As a number that an encoded chunk carries, and back.
    pub fn code(self) -> u8 {
        self.depth as u8 | if self.wide { Self::WIDE } else { 0 }
    }

    pub fn from_code(code: u8) -> WrittenColors {
        let depth = Depth::ALL.get(usize::from(code & !Self::WIDE)).copied();
        WrittenColors { depth: depth.unwrap_or(Depth::Full), wide: code & Self::WIDE != 0 }
    }
}

impl Depth {
    const ALL: [Depth; 6] = [
        Depth::Black,
        Depth::Times257,
        Depth::Times256,
        Depth::Mixed,
        Depth::Unscaled,
        Depth::Full,
    ];

    /// That of the colours at the byte offsets `fields` of little-endian records.
    pub fn of(records: &[u8], stride: usize, fields: &[usize]) -> Depth {
        // 0 if all are multiples of 257, all multiples of 256, all one or the other, all below 256.
        let ([mut uneven, mut low, mut high], mut neither) = ([0; 3], 0);
        for record in records.chunks_exact(stride.max(1)) {
            for &field in fields {
                if let Some(&[lower, upper]) = record.get(field..).and_then(<[u8]>::first_chunk) {
                    uneven |= lower ^ upper;
                    low |= lower;
                    high |= upper;
                    neither |= u16::from(lower) * u16::from(lower ^ upper);
                }
            }
        }
        match (uneven, low, neither, high) {
            (0, 0, ..) => Depth::Black,
            (0, ..) => Depth::Times257,
            (_, 0, ..) => Depth::Times256,
            (_, _, 0, _) => Depth::Mixed,
            (.., 0) => Depth::Unscaled,
            _ => Depth::Full,
        }
    }

    /// That of the points of both.
    pub fn join(self, other: Depth) -> Depth {
        let scaled = |depth| matches!(depth, Depth::Times257 | Depth::Times256 | Depth::Mixed);
        match (self, other) {
            (Depth::Black, depth) | (depth, Depth::Black) => depth,
            (one, two) if one == two => one,
            (one, two) if scaled(one) && scaled(two) => Depth::Mixed,
            _ => Depth::Full,
        }
    }

    /// True if 8 bits are enough to know the 16.
    pub fn is_narrow(self) -> bool {
        !matches!(self, Depth::Mixed | Depth::Full)
    }

    /// What 8 bits stand for.
    fn widened(self, bits: u8) -> u16 {
        match self {
            Depth::Times256 => u16::from(bits) * 256,
            Depth::Unscaled => u16::from(bits),
            _ => u16::from(bits) * 257,
        }
    }
}

/// True for the name of a colour.
pub(super) fn is_color_name(name: &str) -> bool {
    [RED, GREEN, BLUE].contains(&name)
}

/// True for a dimension that has 16 bits in LAS records and may have 8 in a vertex.
fn is_color(dimension: &Dimension) -> bool {
    is_color_name(&dimension.name) && dimension.scalar == Scalar::U16
}

/// Byte offsets of the colours of 16 bits in records of `schema`, but for those of `drop`; none in
/// those of the format itself.
pub(super) fn fields(schema: &Schema, form: &RowForm, drop: &[String]) -> Vec<usize> {
    let others = schema.layout.family != form.layout.family && schema.endian == Endian::Little;
    let held =
        schema.dimensions.iter().filter(|d| others && is_color(d) && !drop.contains(&d.name));
    held.map(|d| d.offset).collect()
}

/// The same records, their colours being the byte at `place` of each: 0 for the lower, 1 for the
/// upper one.
pub(super) fn bytes_of(schema: &Schema, place: usize) -> Schema {
    let mut narrow = schema.clone();
    for dimension in narrow.dimensions.iter_mut().filter(|d| is_color(d)) {
        dimension.scalar = Scalar::U8;
        dimension.offset += place;
    }
    narrow
}

/// Makes rows with colours of 16 bits of those with 8, or the other way round.
pub(crate) struct Recoloring<'a> {
    pub encoding: Encoding,
    pub separator: u8,
    pub from: &'a RowShape,
    pub to: &'a RowShape,
    pub depth: Depth,
}

impl Recoloring<'_> {
    /// Appends to `out` what the whole rows that `written` begins with become; returns how many
    /// bytes of it they are.
    pub fn append(&self, written: &[u8], out: &mut Vec<u8>) -> Result<usize> {
        match self.encoding {
            Encoding::Ascii => self.append_lines(written, out),
            _ => Ok(self.append_binary(written, out)),
        }
    }

    /// The other number of bits of the same colour.
    fn other(&self, color: u64, from: Scalar) -> u64 {
        match from {
            Scalar::U8 => u64::from(self.depth.widened(color as u8)),
            _ => color >> 8,
        }
    }

    fn append_binary(&self, written: &[u8], out: &mut Vec<u8>) -> usize {
        let (from, to) = (&self.from.row, &self.to.row);
        let rows = written.chunks_exact(from.stride.max(1));
        let taken = written.len() - rows.remainder().len();
        for row in rows {
            let start = out.len();
            out.resize(start + to.stride, 0);
            let target = &mut out[start..];
            for (one, two) in from.dimensions.iter().zip(&to.dimensions) {
                let size = one.scalar.size();
                if one.scalar == two.scalar {
                    let field = &row[one.offset..one.offset + size];
                    target[two.offset..two.offset + size].copy_from_slice(field);
                } else if let Value::Unsigned(color) = one.get(row, from.endian) {
                    let color = Value::Unsigned(self.other(color, one.scalar));
                    let held = two.put(target, to.endian, color);
                    debug_assert!(held, "8 bits of 16, or 16");
                }
            }
        }
        taken
    }

    /// As [`append_binary`](Self::append_binary), through the values of each line: colours that
    /// share a number are three in the other rows.
    fn append_lines(&self, written: &[u8], out: &mut Vec<u8>) -> Result<usize> {
        let own = || Error::internal("a text that was just written does not read back");
        let taken = written.iter().rposition(|&b| b == b'\n').map_or(0, |end| end + 1);
        let is_color =
            |column: &Dimension| PACKED.iter().chain(&COLORS).any(|name| column.name == *name);
        let (mut row, mut recolored) = (vec![0; self.from.row.stride], Vec::new());
        for line in written[..taken].split_inclusive(|&b| b == b'\n') {
            let mut others = Vec::new();
            for (word, column) in
                line.trim_ascii_end().split(|&b| b == self.separator).zip(&self.from.columns)
            {
                if !is_color(column) {
                    others.push(word);
                } else if !number::parse(word, column.scalar, &mut row[column.offset..]) {
                    return Err(own());
                }
            }
            let mut others = others.into_iter();
            recolored.clear();
            self.append_binary(&row, &mut recolored);
            for column in &self.to.columns {
                match is_color(column) {
                    true => number::print(column.get(&recolored, Endian::Little), out),
                    false => out.extend_from_slice(others.next().ok_or_else(own)?),
                }
                out.push(self.separator);
            }
            out.pop();
            out.push(b'\n');
        }
        Ok(taken)
    }
}

/// What is written otherwise in the other rows.
const COLORS: [&str; 4] = [RED, GREEN, BLUE, ALPHA];

/// What to tell of colours in a finished file.
pub(super) fn note(asked: Colors, depth: Depth, family: &str) -> Option<String> {
    let told = match (asked, depth) {
        (Colors::Auto, Depth::Full) => {
            let told = format!(
                "colours have 16 bits here, which many viewers of {family} do not read: \
                 `write.colors = \"8bit\"` writes their upper 8"
            );
            return Some(told);
        }
        (Colors::Auto, Depth::Mixed) => {
            "some colours are multiples of 256 and others of 257: both are taken for 8 bits"
        }
        (Colors::Auto, Depth::Unscaled) => {
            "colours are 0 to 255 in the input, though 16 bits mean 0 to 65535: they are taken for \
             8 bits that its writer did not scale"
        }
        (Colors::Eight, Depth::Full) => "colours are cut to their upper 8 bits of 16",
        (Colors::Eight, Depth::Unscaled) => {
            "no colour is above 255, so the upper 8 bits of 16 are 0: without \
             `write.colors = \"8bit\"` they are taken for 8 bits"
        }
        _ => return None,
    };
    Some(told.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn depth(colors: &[u16]) -> Depth {
        let records: Vec<u8> = colors.iter().flat_map(|c| c.to_le_bytes()).collect();
        Depth::of(&records, 2, &[0])
    }

    #[test]
    fn what_8_bits_hold_is_told_from_what_they_do_not() {
        assert_eq!(depth(&[]), Depth::Black);
        assert_eq!(depth(&[0, 0]), Depth::Black);
        assert_eq!(depth(&[0, 257, 65_535]), Depth::Times257);
        assert_eq!(depth(&[0, 256, 65_280]), Depth::Times256);
        assert_eq!(depth(&[0, 1, 255]), Depth::Unscaled);
        assert_eq!(depth(&[257, 0, 256]), Depth::Mixed);
        for full in [&[255, 256][..], &[255, 257], &[258], &[40_000], &[257, 256, 1]] {
            assert_eq!(depth(full), Depth::Full, "{full:?}");
        }
    }

    #[test]
    fn the_depth_of_all_is_that_of_any_parts() {
        let colors = [0, 1, 255, 256, 257, 514, 768, 65_535, 65_280, 1000];
        for one in colors {
            for two in colors {
                assert_eq!(depth(&[one]).join(depth(&[two])), depth(&[one, two]), "{one} {two}");
            }
        }
        for (depth, wide) in Depth::ALL.into_iter().flat_map(|d| [(d, false), (d, true)]) {
            let written = WrittenColors { depth, wide };
            assert_eq!(WrittenColors::from_code(written.code()), written);
        }
    }

    #[test]
    fn eight_bits_widen_to_what_they_were() {
        for color in 0..=65_535u16 {
            let depth = depth(&[color]);
            if depth.is_narrow() {
                let bits = if depth == Depth::Unscaled { color as u8 } else { (color >> 8) as u8 };
                assert_eq!(depth.widened(bits), color);
            }
        }
    }
}
