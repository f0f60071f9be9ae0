//! Extra-bytes descriptors (LAS 1.4 R15, table 24): what the bytes behind a record's standard
//! fields mean.

use super::text::{field, split_at_room, text};
use crate::point::{ComputedDimension, Dimension, Scalar, Value};

/// Bytes of one descriptor.
pub const DESCRIPTOR_BYTES: usize = 192;

/// Bytes of the longest name in a descriptor.
pub const LONGEST_NAME: usize = 32;

mod at {
    pub const KIND: usize = 2;
    pub const OPTIONS: usize = 3;
    pub const NAME: usize = 4;
    pub const NO_DATA: usize = 40;
    pub const MIN: usize = 64;
    pub const SCALE: usize = 112;
    pub const OFFSET: usize = 136;
    pub const DESCRIPTION: usize = 160;
}

/// Options: the descriptor's value for no data counts.
const HAS_NO_DATA: u8 = 0b0_0001;
/// Options: the descriptor's minimum and maximum count.
const HAS_RANGE: u8 = 0b0_0110;
const HAS_SCALE: u8 = 0b0_1000;
const HAS_OFFSET: u8 = 0b1_0000;

const SCALARS: [Scalar; 10] = [
    Scalar::U8,
    Scalar::I8,
    Scalar::U16,
    Scalar::I16,
    Scalar::U32,
    Scalar::I32,
    Scalar::U64,
    Scalar::I64,
    Scalar::F32,
    Scalar::F64,
];

/// One descriptor, as its bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Descriptor(pub [u8; DESCRIPTOR_BYTES]);

impl Descriptor {
    /// All descriptors of a record; bytes behind the last whole one are none.
    pub fn all(payload: &[u8]) -> Vec<Self> {
        payload.as_chunks().0.iter().map(|bytes| Descriptor(*bytes)).collect()
    }

    /// A number without scale, offset or range. Names beyond 32 bytes are cut at a character and
    /// continue in the description.
    pub fn plain(name: &str, scalar: Scalar) -> Self {
        let mut bytes = [0; DESCRIPTOR_BYTES];
        let kind = SCALARS.iter().position(|s| *s == scalar).map_or(1, |i| i as u8 + 1);
        bytes[at::KIND] = kind;
        let (head, tail) = split_at_room(name, LONGEST_NAME);
        bytes[at::NAME..at::NAME + LONGEST_NAME].copy_from_slice(&field::<LONGEST_NAME>(head));
        bytes[at::DESCRIPTION..at::DESCRIPTION + 32].copy_from_slice(&field::<32>(tail));
        Descriptor(bytes)
    }

    /// A number like `dimension`, its scale and origin included.
    pub fn of(dimension: &Dimension) -> Self {
        let mut descriptor = Self::plain(&dimension.name, dimension.scalar);
        if dimension.scale != 1.0 || dimension.origin != 0.0 {
            descriptor.0[at::OPTIONS] = HAS_SCALE | HAS_OFFSET;
            descriptor.put(at::SCALE, dimension.scale);
            descriptor.put(at::OFFSET, dimension.origin);
        }
        descriptor
    }

    /// The same under another name, of at most 32 bytes.
    pub fn named(&self, name: &str) -> Self {
        let mut named = self.clone();
        named.0[at::NAME..at::NAME + LONGEST_NAME].copy_from_slice(&field::<LONGEST_NAME>(name));
        named
    }

    /// Bytes without a meaning, to reach the described ones behind them.
    pub fn unknown(bytes: u8) -> Self {
        let mut descriptor = Self::plain("ExtraBytes", Scalar::U8);
        descriptor.0[at::KIND] = 0;
        descriptor.0[at::OPTIONS] = bytes;
        descriptor
    }

    /// The bytes.
    pub fn bytes(&self) -> &[u8; DESCRIPTOR_BYTES] {
        &self.0
    }

    /// Name as written, without trailing zeros.
    pub fn name(&self) -> String {
        text(&self.0[at::NAME..at::NAME + LONGEST_NAME])
    }

    /// Bytes of a record that it describes.
    pub fn size(&self) -> usize {
        match self.number() {
            Some((scalar, count)) => scalar.size() * count,
            None => usize::from(self.0[at::OPTIONS]),
        }
    }

    /// The type and how many of it (the deprecated types 11 to 30 are pairs and triples); None for
    /// undocumented bytes and unknown types.
    fn number(&self) -> Option<(Scalar, usize)> {
        let kind = usize::from(self.0[at::KIND]).checked_sub(1)?;
        (kind < 30).then(|| (SCALARS[kind % 10], kind / 10 + 1))
    }

    /// The dimensions it names, the first at byte `start` of the record.
    pub fn dimensions(&self, start: usize) -> Vec<Dimension> {
        let (scalar, count) = self.number().unwrap_or((Scalar::U8, self.size()));
        let written = self.name();
        let name = if written.is_empty() { "ExtraBytes" } else { &written };
        (0..count)
            .map(|i| {
                let name = if count == 1 { name.to_owned() } else { format!("{name}[{i}]") };
                let (scale, origin) = self.scaling(i);
                Dimension::new(name, scalar, start + i * scalar.size()).scaled(scale, origin)
            })
            .collect()
    }

    fn scaling(&self, i: usize) -> (f64, f64) {
        if self.number().is_none() || i >= 3 {
            return (1.0, 0.0);
        }
        let has = |option| self.0[at::OPTIONS] & option != 0;
        let scale = if has(HAS_SCALE) { self.float(at::SCALE + 8 * i) } else { 1.0 };
        let origin = if has(HAS_OFFSET) { self.float(at::OFFSET + 8 * i) } else { 0.0 };
        if scale.is_finite() && scale != 0.0 && origin.is_finite() {
            (scale, origin)
        } else {
            (1.0, 0.0)
        }
    }

    /// The stored number that means that there is no data, of the dimension number `i` that it
    /// names, if it says one.
    pub fn no_data(&self, i: usize) -> Option<Value> {
        let (scalar, _) = self.number()?;
        if self.0[at::OPTIONS] & HAS_NO_DATA == 0 || i >= 3 {
            return None;
        }
        let mut bytes = [0; 8];
        bytes.copy_from_slice(&self.0[at::NO_DATA + 8 * i..at::NO_DATA + 8 * i + 8]);
        Some(match scalar {
            Scalar::F32 => Value::Single(f64::from_le_bytes(bytes) as f32),
            Scalar::F64 => Value::Double(f64::from_le_bytes(bytes)),
            Scalar::I8 | Scalar::I16 | Scalar::I32 | Scalar::I64 => {
                Value::Signed(i64::from_le_bytes(bytes))
            }
            _ => Value::Unsigned(u64::from_le_bytes(bytes)),
        })
    }

    /// The descriptor without its range, which is a statistic of one file's points.
    pub fn without_range(&self) -> Self {
        let mut plain = self.clone();
        if self.number().is_some() {
            plain.0[at::OPTIONS] &= !HAS_RANGE;
            plain.0[at::MIN..at::SCALE].fill(0);
        }
        plain
    }

    fn float(&self, at: usize) -> f64 {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(&self.0[at..at + 8]);
        f64::from_le_bytes(bytes)
    }

    fn put(&mut self, at: usize, value: f64) {
        self.0[at..at + 8].copy_from_slice(&value.to_le_bytes());
    }
}

/// The descriptors that make `from` bytes of extra bytes reach the `computed` dimensions: unknown
/// ones for bytes that `known` leave undescribed, then those of the dimensions.
pub fn with_computed(
    known: &[Descriptor],
    from: usize,
    computed: &[ComputedDimension],
) -> Vec<Descriptor> {
    let mut all = Vec::new();
    let mut described = 0;
    for descriptor in known {
        if described + descriptor.size() > from {
            break;
        }
        described += descriptor.size();
        all.push(descriptor.clone());
    }
    let mut left = from - described;
    while left > 0 {
        let bytes = u8::try_from(left).unwrap_or(u8::MAX);
        all.push(Descriptor::unknown(bytes));
        left -= usize::from(bytes);
    }
    all.extend(computed.iter().map(|d| Descriptor::plain(d.name, d.scalar())));
    all
}

/// What stands in the values of `all` that records with `own` descriptors lack, where that is not
/// 0: the value of each that means no data.
pub fn absent(own: &[Descriptor], all: &[Descriptor], start: usize) -> Vec<(Dimension, Value)> {
    let mut at = start;
    let mut absent = Vec::new();
    for descriptor in all {
        if !own.iter().any(|own| own.name() == descriptor.name()) {
            let each = descriptor.dimensions(at).into_iter().enumerate();
            absent.extend(each.filter_map(|(i, d)| Some((d, descriptor.no_data(i)?))));
        }
        at += descriptor.size();
    }
    absent
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point::{NORMAL, names};

    #[test]
    fn triples_and_scales_become_dimensions() {
        let mut triple = Descriptor::plain("Echo", Scalar::U16);
        triple.0[at::KIND] += 20;
        triple.0[at::OPTIONS] = HAS_SCALE;
        triple.put(at::SCALE + 8, 0.5);
        let dimensions = triple.dimensions(20);
        assert_eq!(triple.size(), 6);
        assert_eq!(dimensions[1].name, "Echo[1]");
        assert_eq!((dimensions[1].offset, dimensions[1].scale), (22, 0.5));
        assert_eq!(dimensions[0].scale, 1.0, "a scale of zero counts as none");
    }

    #[test]
    fn normals_come_behind_bytes_nobody_described() {
        let computed = names::NORMAL.map(|name| NORMAL.kind().part(name).unwrap());
        let all = with_computed(&[Descriptor::plain("A", Scalar::U8)], 301, &computed);
        assert_eq!(all.iter().map(Descriptor::size).sum::<usize>(), 301 + 12);
        assert_eq!(all.len(), 1 + 2 + 3);
    }

    #[test]
    fn long_names_are_cut_at_a_character() {
        let name = format!("{}é and more", "x".repeat(31));
        assert_eq!(Descriptor::plain(&name, Scalar::F64).name(), "x".repeat(31));
    }
}
