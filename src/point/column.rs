//! What a computed column is: a name, and values of one type for every position.
//!
//! A stage declares a column as a constant and hands it out with what it needs; whoever knows the
//! constant reads the values as what they are. The engine, which carries columns between passes,
//! to disk and to outputs, knows them by their [`ColumnKind`] alone. So a column is added where the
//! stage is that computes it, and nowhere else.

use std::marker::PhantomData;

use bytemuck::Pod;

use super::names;
use super::schema::Scalar;

/// A value of a column: numbers of one type, one or several.
pub trait ColumnValue: Pod + Send + Sync {
    /// The type of the numbers.
    const SCALAR: Scalar;
    /// How many numbers a value is.
    const PARTS: usize;
}

macro_rules! numbers {
    ($($number:ty => $scalar:ident),*) => {$(
        impl ColumnValue for $number {
            const SCALAR: Scalar = Scalar::$scalar;
            const PARTS: usize = 1;
        }

        impl ColumnValue for [$number; 3] {
            const SCALAR: Scalar = Scalar::$scalar;
            const PARTS: usize = 3;
        }
    )*};
}

numbers!(u8 => U8, i8 => I8, u16 => U16, i16 => I16, u32 => U32, i32 => I32, u64 => U64);
numbers!(i64 => I64, f32 => F32, f64 => F64);

/// A column whose values are of type `T`, by its name.
///
/// ```
/// use pointmill::point::Column;
///
/// const ROUGHNESS: Column<f32> = Column::new("Roughness", &[]);
/// const DRIFT: Column<[f32; 3]> = Column::new("Drift", &["DriftX", "DriftY", "DriftZ"]);
/// assert_eq!(ROUGHNESS.kind().parts(), ["Roughness"]);
/// assert_eq!(DRIFT.kind().bytes(), 12);
/// ```
#[derive(Debug)]
pub struct Column<T> {
    kind: ColumnKind,
    of: PhantomData<fn() -> T>,
}

impl<T: ColumnValue> Column<T> {
    /// The column called `name`. Outputs know each number of a value by its name in `parts`; none
    /// is given where a value is one number, which then has the column's name.
    ///
    /// A column that is called as a dimension of the records, with `f64` as its type, is that
    /// dimension's world value for stages that work on tiles, unless a stage computes it.
    ///
    /// # Panics
    ///
    /// Where there are not as many names as numbers; in a constant the compiler tells.
    pub const fn new(name: &'static str, parts: &'static [&'static str]) -> Self {
        assert!(if parts.is_empty() { T::PARTS == 1 } else { parts.len() == T::PARTS });
        let kind = ColumnKind { name, parts, scalar: T::SCALAR, by: None };
        Column { kind, of: PhantomData }
    }

    /// The same, to be told as computed by the stage `kind` where none computes it.
    #[must_use]
    pub const fn computed_by(self, kind: &'static str) -> Self {
        Column { kind: ColumnKind { by: Some(kind), ..self.kind }, of: PhantomData }
    }

    /// The column of this kind, which must be of a type `T`.
    pub(super) const fn of_kind(kind: ColumnKind) -> Self {
        Column { kind, of: PhantomData }
    }

    /// What it is, whatever its type.
    pub const fn kind(&self) -> ColumnKind {
        self.kind
    }
}

/// Unit surface normals; NaN where there is none.
pub const NORMAL: Column<[f32; 3]> = Column::new("Normal", &names::NORMAL).computed_by("normals");

/// How far a stage [moves](crate::stage::Needs::moves) the records of each position, in world
/// units: whole steps of the lattice. All zero where they stay.
pub const SHIFT: Column<[f64; 3]> = Column::new("Shift", &["ShiftX", "ShiftY", "ShiftZ"]);

/// What a column is, for those that do not know its type.
#[derive(Debug, Clone, Copy)]
pub struct ColumnKind {
    name: &'static str,
    parts: &'static [&'static str],
    scalar: Scalar,
    by: Option<&'static str>,
}

impl PartialEq for ColumnKind {
    fn eq(&self, other: &Self) -> bool {
        (self.name, self.parts, self.scalar) == (other.name, other.parts, other.scalar)
    }
}

impl Eq for ColumnKind {}

impl ColumnKind {
    /// Its name.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The stage that computes it, if one is told to.
    pub fn computed_by(&self) -> Option<&'static str> {
        self.by
    }

    /// The names of the numbers of a value, as outputs have them.
    pub fn parts(&self) -> &[&'static str] {
        if self.parts.is_empty() { std::slice::from_ref(&self.name) } else { self.parts }
    }

    /// The type of the numbers.
    pub fn scalar(&self) -> Scalar {
        self.scalar
    }

    /// Bytes of a value.
    pub fn bytes(&self) -> usize {
        self.scalar.size() * self.parts().len()
    }

    /// The value of a position that nothing was computed for: NaN, or 0 where numbers are whole.
    pub(crate) fn unknown(&self) -> Vec<u8> {
        let number = match self.scalar {
            Scalar::F32 => f32::NAN.to_ne_bytes().to_vec(),
            Scalar::F64 => f64::NAN.to_ne_bytes().to_vec(),
            whole => vec![0; whole.size()],
        };
        number.repeat(self.parts().len())
    }

    /// Its number called `name`, as an output has it.
    pub fn part(&self, name: &str) -> Option<ComputedDimension> {
        let at = self.parts().iter().position(|part| *part == name)?;
        Some(ComputedDimension { name: self.parts()[at], column: *self, at })
    }
}

/// A dimension of an output that is computed: one number of a column's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ComputedDimension {
    /// Its name.
    pub name: &'static str,
    /// The column.
    pub column: ColumnKind,
    at: usize,
}

impl ComputedDimension {
    /// Its type.
    pub fn scalar(&self) -> Scalar {
        self.column.scalar
    }

    /// Its bytes in the bytes of a value of the column.
    pub fn range(&self) -> std::ops::Range<usize> {
        let size = self.column.scalar.size();
        self.at * size..(self.at + 1) * size
    }
}
