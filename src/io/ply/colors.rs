//! Colours of LAS records, which have 16 bits, as the 8 bits that readers of PLY expect.
//!
//! Nothing is lost by 8 bits where 16 of them hold no more: where all colours are multiples of 257, of
//! 256, or below 256, as three kinds of writers leave them. Whether they are only all points together
//! say, long after the first are written; so vertices are written with 8 bits until a colour needs
//! more, and what is written until then is widened once. The type in a finished file depends on the
//! colours alone.

use serde::{Deserialize, Serialize};

use super::header::Encoding;
use super::text;
use crate::point::names::{BLUE, GREEN, RED};
use crate::point::{Dimension, Endian, Layout, Scalar, Schema, Value};
use crate::{Error, Result};

/// How many bits the colours of LAS records have in a PLY file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Colors {
    /// 8 where that loses nothing, else 16.
    #[default]
    #[serde(rename = "auto")]
    Auto,
    /// The upper 8 bits, as `uchar`.
    #[serde(rename = "8bit")]
    Eight,
    /// All 16 bits, as `ushort`.
    #[serde(rename = "16bit")]
    Sixteen,
}

/// What the 16-bit colours of some points are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Depth {
    /// Nothing but 0, which all the others have too.
    #[default]
    Black,
    /// 8 bits times 257, so that 255 is 65535, as the specification wants it (LAS 1.4 R15, table 9).
    Times257,
    /// 8 bits times 256.
    Times256,
    /// 8 bits as they are: their writer did not scale them.
    Unscaled,
    /// 16 bits.
    Full,
}

impl Depth {
    const ALL: [Depth; 5] =
        [Depth::Black, Depth::Times257, Depth::Times256, Depth::Unscaled, Depth::Full];

    /// That of the colours at the byte offsets `fields` of little-endian records.
    pub fn of(records: &[u8], stride: usize, fields: &[usize]) -> Depth {
        // Bits that would be 0 if all were multiples of 257, multiples of 256, below 256.
        let [mut uneven, mut low, mut high] = [0; 3];
        for record in records.chunks_exact(stride.max(1)) {
            for &field in fields {
                if let Some(&[lower, upper]) = record.get(field..).and_then(<[u8]>::first_chunk) {
                    uneven |= lower ^ upper;
                    low |= lower;
                    high |= upper;
                }
            }
        }
        match (uneven, low, high) {
            (0, 0, 0) => Depth::Black,
            (0, ..) => Depth::Times257,
            (_, 0, _) => Depth::Times256,
            (.., 0) => Depth::Unscaled,
            _ => Depth::Full,
        }
    }

    /// That of the points of both.
    pub fn join(self, other: Depth) -> Depth {
        match (self, other) {
            (Depth::Black, depth) | (depth, Depth::Black) => depth,
            (one, two) if one == two => one,
            _ => Depth::Full,
        }
    }

    /// As a number that an encoded chunk carries, and back.
    pub fn code(self) -> u8 {
        self as u8
    }

    pub fn from_code(code: u8) -> Depth {
        Depth::ALL.get(usize::from(code)).copied().unwrap_or(Depth::Full)
    }

    /// What 8 bits stand for.
    fn widened(self, bits: u8) -> u16 {
        match self {
            Depth::Times256 => u16::from(bits) * 256,
            Depth::Unscaled => u16::from(bits),
            Depth::Black | Depth::Times257 | Depth::Full => u16::from(bits) * 257,
        }
    }
}

/// True for a dimension that has 16 bits in LAS records and may have 8 in a vertex.
fn is_color(dimension: &Dimension) -> bool {
    [RED, GREEN, BLUE].contains(&dimension.name.as_str()) && dimension.scalar == Scalar::U16
}

/// Byte offsets of the colours of LAS records of `schema`, but for those of `drop`; none in others.
pub(super) fn fields(schema: &Schema, drop: &[String]) -> Vec<usize> {
    let las = matches!(schema.layout, Layout::Las { .. }) && schema.endian == Endian::Little;
    let held = schema.dimensions.iter().filter(|d| las && is_color(d) && !drop.contains(&d.name));
    held.map(|d| d.offset).collect()
}

/// The same records, their colours being the byte at `place` of each: 0 for the lower, 1 for the upper
/// one.
pub(super) fn bytes_of(schema: &Schema, place: usize) -> Schema {
    let mut narrow = schema.clone();
    for dimension in narrow.dimensions.iter_mut().filter(|d| is_color(d)) {
        dimension.scalar = Scalar::U8;
        dimension.offset += place;
    }
    narrow
}

/// Makes vertices with colours of 16 bits of those with 8.
pub(super) struct Widening<'a> {
    pub encoding: Encoding,
    pub from: &'a Schema,
    pub to: &'a Schema,
    pub depth: Depth,
}

impl Widening<'_> {
    /// Appends to `out` what the whole vertices that `written` begins with become; returns how many
    /// bytes of it they are.
    pub fn append(&self, written: &[u8], out: &mut Vec<u8>) -> Result<usize> {
        match self.encoding {
            Encoding::Ascii => self.append_lines(written, out),
            _ => Ok(self.append_binary(written, out)),
        }
    }

    fn append_binary(&self, written: &[u8], out: &mut Vec<u8>) -> usize {
        let vertices = written.chunks_exact(self.from.stride.max(1));
        let taken = written.len() - vertices.remainder().len();
        for vertex in vertices {
            for (from, to) in self.from.dimensions.iter().zip(&self.to.dimensions) {
                let field = &vertex[from.offset..from.offset + from.scalar.size()];
                match (field, from.scalar == to.scalar) {
                    (&[bits], false) => {
                        let wide = self.depth.widened(bits);
                        out.extend(match self.encoding.endian() {
                            Endian::Little => wide.to_le_bytes(),
                            Endian::Big => wide.to_be_bytes(),
                        });
                    }
                    _ => out.extend_from_slice(field),
                }
            }
        }
        taken
    }

    fn append_lines(&self, written: &[u8], out: &mut Vec<u8>) -> Result<usize> {
        let own = || Error::internal("a text that was just written does not read back");
        let taken = written.iter().rposition(|&b| b == b'\n').map_or(0, |end| end + 1);
        for line in written[..taken].split_inclusive(|&b| b == b'\n') {
            let words = line.trim_ascii_end().split(|&b| b == b' ');
            for ((word, from), to) in words.zip(&self.from.dimensions).zip(&self.to.dimensions) {
                if from.scalar == to.scalar {
                    out.extend_from_slice(word);
                } else {
                    let mut bits = [0];
                    if !text::parse(word, from.scalar, &mut bits) {
                        return Err(own());
                    }
                    text::print(Value::Unsigned(self.depth.widened(bits[0]).into()), out);
                }
                out.push(b' ');
            }
            out.pop();
            out.push(b'\n');
        }
        Ok(taken)
    }
}

/// What to tell of colours in a finished file; `full` if they have 16 bits there.
pub(super) fn note(asked: Colors, depth: Depth, full: bool) -> Option<String> {
    let told = match (asked, depth) {
        (Colors::Auto, Depth::Full) if full => {
            "colours have 16 bits here, which many viewers of PLY do not read: \
             `write.colors = \"8bit\"` writes their upper 8"
        }
        (Colors::Auto, Depth::Unscaled) => {
            "colours are 0 to 255 in the input, though LAS means 0 to 65535: they are taken for 8 \
             bits that its writer did not scale"
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
        for mixed in [&[257, 256][..], &[255, 256], &[255, 257], &[258], &[40_000]] {
            assert_eq!(depth(mixed), Depth::Full, "{mixed:?}");
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
        assert!(Depth::ALL.iter().all(|&d| Depth::from_code(d.code()) == d));
    }

    #[test]
    fn eight_bits_widen_to_what_they_were() {
        for color in 0..=65_535u16 {
            let depth = depth(&[color]);
            if depth != Depth::Full {
                let bits = if depth == Depth::Unscaled { color as u8 } else { (color >> 8) as u8 };
                assert_eq!(depth.widened(bits), color);
            }
        }
    }
}
