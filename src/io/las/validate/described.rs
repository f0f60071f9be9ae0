//! The rules of the records that describe the extra bytes of points.

use std::collections::BTreeSet;

use super::raw::RawHeader;
use super::records::FoundRecord;
use super::rules as r;
use crate::io::las::extra::{DESCRIPTOR_BYTES, Descriptor};
use crate::io::las::fields::at;
use crate::io::las::format::record_size;
use crate::point::{Dimension, Endian, Scalar};
use crate::stage::Findings;

/// User and number of the records.
const EXTRA_BYTES: (&str, u16) = ("LASF_Spec", 4);
/// The highest type, and the highest that is not deprecated.
const TYPES: [u8; 2] = [30, 10];
/// Options that mean something, and the one that says that there is a scale.
const OPTIONS: u8 = 0b1_1111;
const SCALE: u8 = 0b0_1000;
/// Where these are in a descriptor, and the scale.
const KIND_AT: usize = 2;
/// See [`KIND_AT`].
const OPTIONS_AT: usize = 3;
/// See [`KIND_AT`].
const SCALE_AT: usize = 112;

/// Options that say that there is a value for no data, a smallest and a largest.
const NO_DATA: u8 = 0b001;
const MIN: u8 = 0b010;
const MAX: u8 = 0b100;
/// Where these three are.
const NO_DATA_AT: usize = 40;
const MIN_AT: usize = 64;
const MAX_AT: usize = 88;

/// The range that the values of a dimension of extra bytes are said to have.
pub struct ExtraRange {
    dimension: Dimension,
    min: f64,
    max: f64,
    no_data: Option<f64>,
}

impl ExtraRange {
    /// Those of `descriptors` of single numbers, whose bytes begin at byte `start` of a record.
    pub fn all(descriptors: &[Descriptor], start: usize) -> Vec<ExtraRange> {
        let mut start = start;
        let range = |descriptor: &Descriptor| {
            let dimensions = descriptor.dimensions(start);
            start += descriptor.size();
            let options = descriptor.bytes()[OPTIONS_AT];
            let [dimension] = &dimensions[..] else { return None };
            let is_said = descriptor.bytes()[KIND_AT] != 0 && options & (MIN | MAX) != 0;
            let value = |option, at, none| match options & option {
                0 => none,
                _ => stored(descriptor, at, dimension.scalar),
            };
            is_said.then(|| ExtraRange {
                dimension: dimension.clone(),
                min: value(MIN, MIN_AT, f64::NEG_INFINITY),
                max: value(MAX, MAX_AT, f64::INFINITY),
                no_data: (options & NO_DATA != 0).then(|| value(NO_DATA, NO_DATA_AT, 0.0)),
            })
        };
        descriptors.iter().filter_map(range).collect()
    }

    /// Looks at the value of a record.
    pub fn look(&self, findings: &mut Findings, number: u64, byte: Option<u64>, record: &[u8]) {
        let value = self.dimension.get(record, Endian::Little).as_f64();
        if (self.min..=self.max).contains(&value) || self.no_data == Some(value) {
            return;
        }
        let at = byte.map(|byte| byte + self.dimension.offset as u64);
        findings.point(&r::EXTRA_RANGE, number, at, || {
            let ExtraRange { dimension, min, max, .. } = self;
            format!("{value} of `{}`, stored, and the range is {min} to {max}", dimension.name)
        });
    }
}

/// A number of the descriptor, which has eight bytes whatever its kind.
fn stored(descriptor: &Descriptor, at: usize, scalar: Scalar) -> f64 {
    let bytes: [u8; 8] = std::array::from_fn(|i| descriptor.bytes()[at + i]);
    match scalar {
        Scalar::F32 | Scalar::F64 => f64::from_le_bytes(bytes),
        Scalar::I8 | Scalar::I16 | Scalar::I32 | Scalar::I64 => i64::from_le_bytes(bytes) as f64,
        _ => u64::from_le_bytes(bytes) as f64,
    }
}

/// Enters what the records break.
pub fn check(raw: &RawHeader, records: &[FoundRecord], findings: &mut Findings) {
    let ours = records.iter().filter(|record| record.is(EXTRA_BYTES.0, EXTRA_BYTES.1));
    let ours: Vec<&FoundRecord> = ours.collect();
    let length = raw.short(at::RECORD_LENGTH);
    let extra = length.saturating_sub(record_size(raw.format()).unwrap_or(length));
    if let [_, second, ..] = ours[..] {
        findings.at(&r::EXTRA_RECORDS, second.at, format!("{} records", ours.len()));
    }
    let (mut described, mut names) = (0, BTreeSet::new());
    for record in ours {
        if !record.length.is_multiple_of(DESCRIPTOR_BYTES as u64) {
            let told = format!("{} bytes, no whole number of descriptors", record.length);
            findings.at(&r::EXTRA_LENGTH, record.payload_at, told);
        }
        for (n, descriptor) in Descriptor::all(&record.payload).iter().enumerate() {
            let at = record.payload_at + (n * DESCRIPTOR_BYTES) as u64;
            described += descriptor.size();
            let name = descriptor.name();
            if described > usize::from(extra) {
                let told =
                    format!("`{name}` ends at extra byte {described}, and the points have {extra}");
                findings.at(&r::EXTRA_LENGTH, at, told);
            }
            if name.is_empty() {
                findings.at(&r::EXTRA_NAME, at + 4, "none");
            } else if !names.insert(name.clone()) {
                findings.at(&r::EXTRA_NAME, at + 4, format!("`{name}` again"));
            }
            of_one(descriptor, &name, at, findings);
        }
    }
    if described < usize::from(extra) {
        let none = usize::from(extra) - described;
        let told = format!("{none} of {extra} extra bytes are described by none");
        findings.at(&r::UNDESCRIBED, at::RECORD_LENGTH as u64, told);
    }
}

fn of_one(descriptor: &Descriptor, name: &str, at: u64, findings: &mut Findings) {
    let bytes = descriptor.bytes();
    let (kind, options) = (bytes[KIND_AT], bytes[OPTIONS_AT]);
    let [highest, plain] = TYPES;
    if kind > highest {
        findings.at(&r::EXTRA_TYPE, at + KIND_AT as u64, format!("type {kind} of `{name}`"));
    } else if kind > plain {
        let told = format!("type {kind} of `{name}`, which is deprecated");
        findings.at(&r::EXTRA_DEPRECATED, at + KIND_AT as u64, told);
    }
    if kind == 0 {
        return; // the options are a count of bytes
    }
    if options & !OPTIONS != 0 {
        let told = format!("{options:#010b} of `{name}`");
        findings.at(&r::EXTRA_OPTIONS, at + OPTIONS_AT as u64, told);
    }
    let scale = f64::from_le_bytes(std::array::from_fn(|i| bytes[SCALE_AT + i]));
    if options & SCALE != 0 && (scale == 0.0 || !scale.is_finite()) {
        let told = format!("a scale of {scale} of `{name}`");
        findings.at(&r::EXTRA_OPTIONS, at + SCALE_AT as u64, told);
    }
}
