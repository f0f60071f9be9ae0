//! What a record holds: typed fields at byte offsets, bit fields included.

/// Type of a stored number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the names are the types")]
pub enum Scalar {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

impl Scalar {
    /// Bytes of one number.
    pub fn size(self) -> usize {
        match self {
            Scalar::U8 | Scalar::I8 => 1,
            Scalar::U16 | Scalar::I16 => 2,
            Scalar::U32 | Scalar::I32 | Scalar::F32 => 4,
            Scalar::U64 | Scalar::I64 | Scalar::F64 => 8,
        }
    }

    /// True for the two floating-point types.
    pub fn is_float(self) -> bool {
        matches!(self, Scalar::F32 | Scalar::F64)
    }
}

/// Byte order of the numbers in a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the names say it")]
pub enum Endian {
    Little,
    Big,
}

/// A number as stored: before scale and origin.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the names say it")]
pub enum Value {
    Unsigned(u64),
    Signed(i64),
    Single(f32),
    Double(f64),
}

impl Value {
    /// The number as f64; exact for all but integers above 2^53.
    pub fn as_f64(self) -> f64 {
        match self {
            Value::Unsigned(v) => v as f64,
            Value::Signed(v) => v as f64,
            Value::Single(v) => f64::from(v),
            Value::Double(v) => v,
        }
    }

    /// The whole number that it is, if it is one that a field of integers may hold.
    fn whole(self) -> Option<i128> {
        match self {
            Value::Unsigned(v) => Some(i128::from(v)),
            Value::Signed(v) => Some(i128::from(v)),
            Value::Single(_) | Value::Double(_) => {
                let v = self.as_f64();
                // NaN and infinities have a NaN fraction.
                (v.fract() == 0.0 && v.abs() < 1.8446744073709552e19).then_some(v as i128)
            }
        }
    }
}

/// Some bits of a stored unsigned number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Bits {
    /// Place of the lowest bit.
    pub shift: u8,
    /// How many bits.
    pub width: u8,
}

/// One field of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Dimension {
    /// Shared name (see [`super::names`]) or the file's own.
    pub name: String,
    /// Type as stored.
    pub scalar: Scalar,
    /// Byte offset in the record.
    pub offset: usize,
    /// Which bits of the stored number, where it is not all of them.
    pub bits: Option<Bits>,
    /// World value = stored · scale + origin.
    pub scale: f64,
    /// World value = stored · scale + origin.
    pub origin: f64,
}

impl Dimension {
    /// A plain field: no bits, scale 1, origin 0.
    pub fn new(name: impl Into<String>, scalar: Scalar, offset: usize) -> Self {
        Dimension { name: name.into(), scalar, offset, bits: None, scale: 1.0, origin: 0.0 }
    }

    /// The same field narrowed to some bits of the stored number.
    pub fn bits(mut self, shift: u8, width: u8) -> Self {
        self.bits = Some(Bits { shift, width });
        self
    }

    /// The same field with scale and origin.
    pub fn scaled(mut self, scale: f64, origin: f64) -> Self {
        (self.scale, self.origin) = (scale, origin);
        self
    }

    /// The stored number.
    pub fn get(&self, record: &[u8], endian: Endian) -> Value {
        macro_rules! read {
            ($t:ty) => {{
                const N: usize = size_of::<$t>();
                let mut bytes = [0u8; N];
                bytes.copy_from_slice(&record[self.offset..self.offset + N]);
                match endian {
                    Endian::Little => <$t>::from_le_bytes(bytes),
                    Endian::Big => <$t>::from_be_bytes(bytes),
                }
            }};
        }
        let narrow = |v: u64| match self.bits {
            Some(b) => (v >> b.shift) & ((1 << b.width) - 1),
            None => v,
        };
        match self.scalar {
            Scalar::U8 => Value::Unsigned(narrow(u64::from(record[self.offset]))),
            Scalar::U16 => Value::Unsigned(narrow(u64::from(read!(u16)))),
            Scalar::U32 => Value::Unsigned(narrow(u64::from(read!(u32)))),
            Scalar::U64 => Value::Unsigned(narrow(read!(u64))),
            Scalar::I8 => Value::Signed(i64::from(read!(i8))),
            Scalar::I16 => Value::Signed(i64::from(read!(i16))),
            Scalar::I32 => Value::Signed(i64::from(read!(i32))),
            Scalar::I64 => Value::Signed(read!(i64)),
            Scalar::F32 => Value::Single(read!(f32)),
            Scalar::F64 => Value::Double(read!(f64)),
        }
    }

    /// The world value: stored · scale + origin, as multiplication and addition (never fused).
    pub fn world(&self, record: &[u8], endian: Endian) -> f64 {
        self.get(record, endian).as_f64() * self.scale + self.origin
    }

    /// Stores `value`, converted to the field's type. Returns false, storing nothing, if the field
    /// cannot hold it: out of range, or not a whole number for an integer field.
    #[must_use]
    pub fn put(&self, record: &mut [u8], endian: Endian, value: Value) -> bool {
        macro_rules! write {
            ($v:expr) => {{
                let v = $v;
                let bytes = match endian {
                    Endian::Little => v.to_le_bytes(),
                    Endian::Big => v.to_be_bytes(),
                };
                record[self.offset..self.offset + bytes.len()].copy_from_slice(&bytes);
                true
            }};
        }
        if self.scalar.is_float() {
            let v = value.as_f64();
            let exact = match value {
                Value::Unsigned(u) => v as u128 == u128::from(u),
                Value::Signed(i) => v as i128 == i128::from(i),
                _ => true,
            };
            return match (self.scalar, value) {
                (Scalar::F64, _) => exact && write!(v),
                (_, Value::Single(v)) => write!(v),
                _ => exact && (f64::from(v as f32) == v || v.is_nan()) && write!(v as f32),
            };
        }
        let Some(whole) = value.whole() else { return false };
        if let Some(bits) = self.bits {
            return self.put_bits(record, endian, bits, whole);
        }
        macro_rules! store {
            ($t:ty) => {
                match <$t>::try_from(whole) {
                    Ok(v) => write!(v),
                    Err(_) => false,
                }
            };
        }
        match self.scalar {
            Scalar::U8 => store!(u8),
            Scalar::I8 => store!(i8),
            Scalar::U16 => store!(u16),
            Scalar::I16 => store!(i16),
            Scalar::U32 => store!(u32),
            Scalar::I32 => store!(i32),
            Scalar::U64 => store!(u64),
            Scalar::I64 => store!(i64),
            Scalar::F32 | Scalar::F64 => false, // handled above
        }
    }

    /// Stores `whole` in some bits of the field, the others of which stay as they are.
    fn put_bits(&self, record: &mut [u8], endian: Endian, bits: Bits, whole: i128) -> bool {
        let mask = ((1u128 << bits.width) - 1) as i128;
        if whole < 0 || whole > mask {
            return false;
        }
        let field = Dimension { bits: None, ..self.clone() };
        let Value::Unsigned(old) = field.get(record, endian) else {
            return false; // bits of a signed number: no format has them
        };
        let new = (i128::from(old) & !(mask << bits.shift)) | (whole << bits.shift);
        field.put(record, endian, Value::Unsigned(new as u64))
    }
}

/// Which family of formats a record's bytes come from, and what that means for them. A sink of the
/// same family and an equal schema copies records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Layout {
    /// The family's name, such as "LAS" for LAS and LAZ.
    pub family: &'static str,
    /// Which of the family's forms of records, where it has several: the point format of LAS.
    pub form: Option<u8>,
    /// True if coordinates of whole numbers are steps of their scale from their origin, so that a
    /// lattice may have the same steps; false if they are numbers of any size.
    pub steps: bool,
    /// The class that says overlap where records have no flag that does.
    pub overlap_class: Option<u8>,
}

impl Layout {
    /// Records of a family that has one form of them and whose coordinates are numbers of any size.
    pub const fn plain(family: &'static str) -> Self {
        Layout { family, form: None, steps: false, overlap_class: None }
    }
}

/// What a record holds.
///
/// ```
/// use pointmill::point::{Dimension, Endian, Layout, Scalar, Schema, Value, names};
///
/// // Three coordinates in millimetres, then a byte that has a flag in its highest bit.
/// let axis = |(i, name)| Dimension::new(name, Scalar::I32, 4 * i).scaled(0.001, 0.0);
/// let mut dimensions: Vec<Dimension> = names::XYZ.into_iter().enumerate().map(axis).collect();
/// dimensions.push(Dimension::new("Withheld", Scalar::U8, 12).bits(7, 1));
/// let layout = Layout::plain("TOY");
/// let schema = Schema { layout, endian: Endian::Little, stride: 13, dimensions };
///
/// let mut record = [0; 13];
/// let z = schema.find("Z").expect("it is there");
/// assert!(z.put(&mut record, schema.endian, Value::Signed(1500)));
/// assert_eq!(z.world(&record, schema.endian), 1.5);
/// let withheld = schema.find("Withheld").expect("it is there");
/// assert!(withheld.put(&mut record, schema.endian, Value::Unsigned(1)));
/// assert_eq!(record[12], 0x80);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Schema {
    /// Which family of formats the bytes come from.
    pub layout: Layout,
    /// Byte order of the numbers.
    pub endian: Endian,
    /// Bytes of a record.
    pub stride: usize,
    /// The fields in record order; `X`, `Y` and `Z` are always among them.
    pub dimensions: Vec<Dimension>,
}

impl Schema {
    /// The field called `name`.
    pub fn find(&self, name: &str) -> Option<&Dimension> {
        self.dimensions.iter().find(|d| d.name == name)
    }

    /// The coordinate fields, if all three are there.
    pub fn coordinates(&self) -> Option<[&Dimension; 3]> {
        let [x, y, z] = super::names::XYZ.map(|name| self.find(name));
        Some([x?, y?, z?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_take_the_integers_that_they_hold_and_no_others() {
        let put = |scalar, value| {
            let mut record = [0; 8];
            let field = Dimension::new("v", scalar, 0);
            let held = field.put(&mut record, Endian::Big, value);
            held.then(|| field.get(&record, Endian::Big).as_f64())
        };
        let beyond = (1 << 53) + 1;
        for scalar in [Scalar::F32, Scalar::F64] {
            assert_eq!(put(scalar, Value::Unsigned(1 << 60)), Some((1u64 << 60) as f64));
            assert_eq!(put(scalar, Value::Signed(-5)), Some(-5.0));
            assert_eq!(put(scalar, Value::Unsigned(beyond)), None, "{scalar:?}");
            assert_eq!(put(scalar, Value::Signed(-(beyond as i64))), None, "{scalar:?}");
            assert_eq!(put(scalar, Value::Unsigned(u64::MAX)), None, "{scalar:?}");
        }
        assert_eq!(put(Scalar::F32, Value::Signed((1 << 24) + 1)), None);
        assert_eq!(put(Scalar::F32, Value::Double(0.1)), None);
        assert!(put(Scalar::F32, Value::Double(f64::NAN)).unwrap().is_nan());
    }
}
