//! By what records of two scans are the same, whatever their formats.

use std::sync::Arc;

use crate::geom::hash::Hash;
use crate::point::{Dimension, Endian, Schema};
use crate::{Error, ErrorKind, Result};

/// Coordinates that are steps of a scale in one of the scans are rounded to so many parts of the
/// finest step before they are compared: two scales that hold the same place give numbers that
/// differ in their last bits.
const PARTS: f64 = 1024.0;

/// By what the records of two scans are compared: equal records have equal keys.
#[derive(Debug)]
pub struct ComparedSchemas {
    /// For each scan what its records are known by.
    pub sides: [Arc<SideKeys>; 2],
    /// For each scan the dimensions that it alone has, which are not compared.
    pub left_out: [Vec<String>; 2],
    /// True if records are compared byte for byte.
    pub by_bytes: bool,
}

/// What the records of one scan are known by.
#[derive(Debug)]
pub struct SideKeys {
    endian: Endian,
    /// Bytes of a record.
    pub stride: usize,
    /// The first bytes that are compared, where bytes are.
    bytes: Option<usize>,
    /// The dimensions that both have, in the order of those of the other side.
    shared: Vec<SharedDimension>,
    axes: [SharedDimension; 3],
}

/// A dimension that both scans have, as one of them stores it.
#[derive(Debug, Clone)]
struct SharedDimension {
    dimension: Dimension,
    /// What values are rounded to; 0 where they are compared as they are.
    quantum: f64,
}

impl SharedDimension {
    /// Equal for equal values. Adding 0 makes a −0 a 0.
    #[inline]
    fn value(&self, record: &[u8], endian: Endian) -> u64 {
        let value = self.dimension.world(record, endian);
        if value.is_nan() {
            return f64::NAN.to_bits();
        }
        let value = match self.quantum > 0.0 {
            true => (value / self.quantum).round_ties_even(),
            false => value,
        };
        (value + 0.0).to_bits()
    }
}

impl ComparedSchemas {
    /// The strictest that the records of two scans allow.
    pub fn of(schemas: [&Arc<Schema>; 2]) -> Result<ComparedSchemas> {
        let [a, b] = schemas;
        let only = |one: &Schema, other: &Schema| {
            let names = one.dimensions.iter().map(|d| d.name.clone());
            names.filter(|name| other.find(name).is_none()).collect::<Vec<String>>()
        };
        let by_bytes = are_alike(a, b);
        let bytes = by_bytes.then(|| a.stride.min(b.stride));
        let pairs = a.dimensions.iter().filter_map(|d| Some((d, b.find(&d.name)?)));
        let mut shared = [Vec::new(), Vec::new()];
        for (of_a, of_b) in pairs {
            let quantum = quantum(of_a, of_b);
            shared[0].push(SharedDimension { dimension: of_a.clone(), quantum });
            shared[1].push(SharedDimension { dimension: of_b.clone(), quantum });
        }
        let [of_a, of_b] = shared;
        Ok(ComparedSchemas {
            sides: [SideKeys::new(a, bytes, of_a)?.into(), SideKeys::new(b, bytes, of_b)?.into()],
            left_out: [only(a, b), only(b, a)],
            by_bytes,
        })
    }

    /// The names of the dimensions that both have.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.sides[0].shared.iter().map(|shared| shared.dimension.name.as_str())
    }

    /// Enters in `differ` which of the dimensions that both have differ between two records; true
    /// if one does.
    pub fn difference(&self, [a, b]: [&[u8]; 2], mut differ: impl FnMut(usize)) -> bool {
        let [of_a, of_b] = &self.sides;
        let mut any = false;
        for (n, (x, y)) in of_a.shared.iter().zip(&of_b.shared).enumerate() {
            if x.value(a, of_a.endian) != y.value(b, of_b.endian) {
                differ(n);
                any = true;
            }
        }
        any
    }
}

/// 128 bits of some words. Each word is multiplied into two halves, whose upper and lower bits are
/// folded onto each other: a few cycles a word, where the finisher of a better generator would take
/// as long as the decoder. What comes out goes through such a finisher once.
#[inline]
fn hashed(words: impl Iterator<Item = u64>) -> u128 {
    const BY: [u64; 2] = [0x9e37_79b9_7f4a_7c15, 0xd1b5_4a32_d192_ed03];
    let fold = |a: u64, b: u64| {
        let product = u128::from(a) * u128::from(b);
        product as u64 ^ (product >> 64) as u64
    };
    let mut halves = [0x243f_6a88_85a3_08d3u64, 0x1319_8a2e_0370_7344];
    for word in words {
        halves[0] = fold(halves[0] ^ word, BY[0]);
        halves[1] = fold(halves[1].wrapping_add(word).rotate_left(23), BY[1]);
    }
    let [low, high] = halves.map(|half| Hash::of(half).value());
    u128::from(high) << 64 | u128::from(low)
}

/// True if the bytes of equal records are equal, as far as the shorter of them goes.
fn are_alike(a: &Schema, b: &Schema) -> bool {
    let (short, long) = if a.stride <= b.stride { (a, b) } else { (b, a) };
    let same = |one: &Dimension| long.find(&one.name) == Some(one);
    short.endian == long.endian
        && short.layout.steps == long.layout.steps
        && short.layout.family == long.layout.family
        && short.dimensions.iter().all(same)
}

/// What the values of a dimension are rounded to.
fn quantum(a: &Dimension, b: &Dimension) -> f64 {
    let is_stepped = |d: &Dimension| (d.scale != 1.0 || d.origin != 0.0) && !d.scalar.is_float();
    let is_same = a.scale == b.scale && a.origin == b.origin && is_stepped(a) == is_stepped(b);
    let steps = [a, b].into_iter().filter(|d| is_stepped(d)).map(|d| d.scale.abs());
    match steps.reduce(f64::min) {
        Some(step) if !is_same && step.is_normal() => step / PARTS,
        _ => 0.0,
    }
}

impl SideKeys {
    fn new(
        schema: &Schema,
        bytes: Option<usize>,
        shared: Vec<SharedDimension>,
    ) -> Result<SideKeys> {
        let nowhere = || Error::new(ErrorKind::Data, "records without x, y and z are no points");
        let axes = schema.coordinates().ok_or_else(nowhere)?;
        let rounded = |axis: &Dimension| {
            let found = shared.iter().find(|one| one.dimension.name == axis.name);
            found.cloned().ok_or_else(nowhere)
        };
        let axes = [rounded(axes[0])?, rounded(axes[1])?, rounded(axes[2])?];
        Ok(SideKeys { endian: schema.endian, stride: schema.stride, bytes, shared, axes })
    }

    /// 128 bits that no two different records of any scan are likely to share.
    #[inline]
    pub fn key(&self, record: &[u8]) -> u128 {
        match self.bytes {
            Some(length) => {
                let record = &record[..length];
                let (words, rest) = record.as_chunks::<8>();
                let words = words.iter().map(|word| u64::from_le_bytes(*word));
                // The last 8 bytes, of which some are in the word before: a copy of as many bytes
                // as there are takes longer.
                let last = || match record.last_chunk::<8>() {
                    Some(last) => u64::from_le_bytes(*last),
                    None => rest.iter().fold(1, |all, byte| all << 8 | u64::from(*byte)),
                };
                hashed(words.chain((!rest.is_empty()).then(last)))
            }
            None => hashed(self.shared.iter().map(|one| one.value(record, self.endian))),
        }
    }

    /// The same of its place alone.
    pub fn place_key(&self, record: &[u8]) -> u128 {
        hashed(self.axes.iter().map(|axis| axis.value(record, self.endian)))
    }

    /// World coordinates.
    pub fn world(&self, record: &[u8]) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.axes[axis].dimension.world(record, self.endian))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point::{Layout, Scalar, names};

    fn schema(scale: f64, origin: f64, more: &[&str]) -> Arc<Schema> {
        let axis = |(i, name)| Dimension::new(name, Scalar::I32, 4 * i).scaled(scale, origin);
        let mut dimensions: Vec<Dimension> = names::XYZ.into_iter().enumerate().map(axis).collect();
        let bytes = |(i, name): (usize, &&str)| Dimension::new(*name, Scalar::U8, 12 + i);
        dimensions.extend(more.iter().enumerate().map(bytes));
        let layout = Layout { steps: true, ..Layout::plain("TOY") };
        let stride = 12 + more.len();
        Arc::new(Schema { layout, endian: Endian::Little, stride, dimensions })
    }

    fn record(xyz: [i32; 3], more: &[u8]) -> Vec<u8> {
        let mut record = xyz.map(i32::to_le_bytes).as_flattened().to_vec();
        record.extend_from_slice(more);
        record
    }

    #[test]
    fn records_of_one_layout_are_compared_by_their_bytes_as_far_as_both_go() {
        let (short, long) = (schema(0.01, 0.0, &["A"]), schema(0.01, 0.0, &["A", "B"]));
        let compared = ComparedSchemas::of([&long, &short]).unwrap();
        assert!(compared.by_bytes);
        assert_eq!(compared.left_out, [vec!["B".to_owned()], vec![]]);
        let [of_long, of_short] = &compared.sides;
        assert_eq!(
            of_long.key(&record([1, 2, 3], &[7, 9])),
            of_short.key(&record([1, 2, 3], &[7]))
        );
        assert_ne!(
            of_long.key(&record([1, 2, 3], &[8, 9])),
            of_short.key(&record([1, 2, 3], &[7]))
        );
    }

    #[test]
    fn places_that_two_scales_hold_are_the_same() {
        let (fine, coarse) = (schema(0.001, 4_000_000.0, &["A"]), schema(0.01, -3.0, &["B"]));
        let compared = ComparedSchemas::of([&fine, &coarse]).unwrap();
        assert!(!compared.by_bytes);
        assert_eq!(compared.left_out, [vec!["A".to_owned()], vec!["B".to_owned()]]);
        let [of_fine, of_coarse] = &compared.sides;
        for n in 0..1000 {
            let one = record([10 * n, 0, -10 * n], &[5]);
            let other = record([n + 400_000_300, 400_000_300, 400_000_300 - n], &[6]);
            assert_eq!(of_fine.key(&one), of_coarse.key(&other), "{n}");
            assert_eq!(of_fine.place_key(&one), of_coarse.place_key(&other));
            assert!(!compared.difference([&one, &other], |_| ()));
            let beside = record([10 * n + 1, 0, -10 * n], &[5]);
            assert_ne!(of_fine.key(&beside), of_coarse.key(&other));
            let mut differ = Vec::new();
            assert!(compared.difference([&beside, &other], |n| differ.push(n)));
            assert_eq!(differ, [0]);
        }
    }
}
