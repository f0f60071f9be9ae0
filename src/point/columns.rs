//! Columns of a tile or of a batch: the values of each side by side.
//!
//! Values of any type lie in words of eight bytes, so that they are aligned for all types and no
//! type has a container of its own; `bytemuck` sees to it that a view of them is sound.

use bytemuck::{cast_slice, cast_slice_mut};

use super::column::{Column, ColumnKind, ColumnValue, ComputedDimension};
use super::schema::{Dimension, Endian, Value};
use crate::error::Undeclared;
use crate::{Error, Result};

/// Columns with as many values each.
#[derive(Debug, Clone, Default)]
pub struct Columns(Vec<(ColumnKind, Aligned)>);

/// Bytes that are aligned for every number.
#[derive(Debug, Clone, Default)]
struct Aligned {
    words: Vec<u64>,
    len: usize,
}

impl Aligned {
    fn bytes(&self) -> &[u8] {
        &cast_slice(&self.words)[..self.len]
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        &mut cast_slice_mut(&mut self.words)[..self.len]
    }

    fn set_len(&mut self, len: usize) {
        self.words.resize(len.div_ceil(size_of::<u64>()), 0);
        self.len = len;
    }

    fn extend(&mut self, bytes: &[u8]) {
        let len = self.len;
        self.set_len(len + bytes.len());
        self.bytes_mut()[len..].copy_from_slice(bytes);
    }

    /// Makes it `len` bytes long; those that are new are `value`, over and over.
    fn fill(&mut self, len: usize, value: &[u8]) {
        let begin = self.len.min(len);
        self.set_len(len);
        self.bytes_mut()[begin..].chunks_exact_mut(value.len()).for_each(|v| {
            v.copy_from_slice(value);
        });
    }
}

/// The values of a column that were [taken](Columns::take) out, to change them while its tile is at
/// work.
#[derive(Debug)]
pub struct TakenColumn<T> {
    values: Aligned,
    column: Column<T>,
}

impl<T: ColumnValue> std::ops::Deref for TakenColumn<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        cast_slice(self.values.bytes())
    }
}

impl<T: ColumnValue> std::ops::DerefMut for TakenColumn<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        cast_slice_mut(self.values.bytes_mut())
    }
}

impl Columns {
    /// The values of `column`.
    ///
    /// # Errors
    ///
    /// If it is not there: the stage that asks did not declare it.
    pub fn get<T: ColumnValue>(&self, column: &Column<T>) -> Result<&[T]> {
        self.find(column).ok_or_else(|| undeclared(column.kind()))
    }

    /// The values of `column`, if it is there.
    pub fn find<T: ColumnValue>(&self, column: &Column<T>) -> Option<&[T]> {
        self.bytes_of(column.kind()).map(cast_slice)
    }

    /// The values of `column`, to change.
    ///
    /// # Errors
    ///
    /// As for [`get`](Columns::get).
    pub fn get_mut<T: ColumnValue>(&mut self, column: &Column<T>) -> Result<&mut [T]> {
        let found = self.find_mut(column.kind()).ok_or_else(|| undeclared(column.kind()))?;
        Ok(cast_slice_mut(found.bytes_mut()))
    }

    /// Takes the values of `column` out, to be [put](Columns::put) back.
    ///
    /// # Errors
    ///
    /// As for [`get`](Columns::get).
    pub fn take<T: ColumnValue>(&mut self, column: &Column<T>) -> Result<TakenColumn<T>> {
        let kind = column.kind();
        let found = self.find_mut(kind).ok_or_else(|| undeclared(kind))?;
        let column = Column::of_kind(kind);
        Ok(TakenColumn { values: std::mem::take(found), column })
    }

    /// Puts back what was taken out.
    pub fn put<T: ColumnValue>(&mut self, taken: TakenColumn<T>) {
        if let Some(place) = self.find_mut(taken.column.kind()) {
            *place = taken.values;
        }
    }

    /// Adds `column` with these values, in the place of those that it had.
    pub fn set<T: ColumnValue>(&mut self, column: &Column<T>, values: &[T]) {
        self.declare(&[column.kind()]);
        if let Some(place) = self.find_mut(column.kind()) {
            place.len = 0;
            place.extend(cast_slice(values));
        }
    }

    /// Adds columns of these kinds with `len` values each, which are unknown: NaN, or 0 where
    /// numbers are whole.
    pub fn add(&mut self, kinds: &[ColumnKind], len: usize) {
        self.declare(kinds);
        self.resize(len);
    }

    /// Takes the columns out that are `asked` for, to be [put back](Columns::put_back).
    #[cfg(feature = "testing")]
    pub(crate) fn take_out(&mut self, asked: impl Fn(ColumnKind) -> bool) -> Columns {
        Columns(self.0.extract_if(.., |(kind, _)| asked(*kind)).collect())
    }

    /// Puts back what was taken out.
    #[cfg(feature = "testing")]
    pub(crate) fn put_back(&mut self, columns: Columns) {
        self.0.extend(columns.0);
    }

    /// What columns there are.
    pub(crate) fn kinds(&self) -> Vec<ColumnKind> {
        self.0.iter().map(|(kind, _)| *kind).collect()
    }

    /// The bytes of a column's values, one after the other.
    pub(crate) fn bytes_of(&self, kind: ColumnKind) -> Option<&[u8]> {
        self.0.iter().find(|(known, _)| *known == kind).map(|(_, values)| values.bytes())
    }

    /// The numbers of `dimension` for `points` positions, each in this machine's bytes.
    ///
    /// # Errors
    ///
    /// If they are not there: what writes them was created for columns that no stage computes.
    pub(crate) fn bytes_of_dimension(
        &self,
        dimension: &ComputedDimension,
        points: usize,
    ) -> Result<impl Iterator<Item = &[u8]>> {
        let (size, range) = (dimension.column.bytes(), dimension.range());
        let bytes = self.bytes_of(dimension.column).filter(|bytes| bytes.len() == points * size);
        let name = dimension.name;
        let missing = || Error::internal(format!("{name} is to be written and not computed"));
        Ok(bytes.ok_or_else(missing)?.chunks_exact(size).map(move |value| &value[range.clone()]))
    }

    /// The numbers of `dimension` for `points` positions.
    ///
    /// # Errors
    ///
    /// As for [`bytes_of_dimension`](Columns::bytes_of_dimension).
    pub(crate) fn numbers(
        &self,
        dimension: &ComputedDimension,
        points: usize,
    ) -> Result<impl Iterator<Item = Value>> {
        let field = Dimension::new(dimension.name, dimension.scalar(), 0);
        let bytes = self.bytes_of_dimension(dimension, points)?;
        Ok(bytes.map(move |number| field.get(number, COLUMN_ENDIAN)))
    }

    fn find_mut(&mut self, kind: ColumnKind) -> Option<&mut Aligned> {
        self.0.iter_mut().find(|(known, _)| *known == kind).map(|(_, values)| values)
    }

    /// Sees to it that there are columns of these kinds.
    pub(crate) fn declare(&mut self, kinds: &[ColumnKind]) {
        for kind in kinds {
            if self.find_mut(*kind).is_none() {
                self.0.push((*kind, Aligned::default()));
            }
        }
    }

    /// Forgets all values, and keeps the columns and their memory.
    pub(crate) fn clear_values(&mut self) {
        self.0.iter_mut().for_each(|(_, values)| values.len = 0);
    }

    /// Makes room for so many values of each column.
    pub(crate) fn reserve(&mut self, values: usize) {
        for (kind, column) in &mut self.0 {
            column.words.reserve_exact((values * kind.bytes()).div_ceil(size_of::<u64>()));
        }
    }

    /// Gives each column `len` values: those that are missing are unknown.
    pub(crate) fn resize(&mut self, len: usize) {
        for (kind, values) in &mut self.0 {
            values.fill(len * kind.bytes(), &kind.unknown());
        }
    }

    /// Leaves each column its first `len` values.
    pub(crate) fn truncate(&mut self, len: usize) {
        self.0.iter_mut().for_each(|(kind, values)| {
            values.set_len(values.len.min(len * kind.bytes()));
        });
    }

    /// Appends values of one column, some after others, behind `len` that it gets first.
    pub(crate) fn append<'a>(
        &mut self,
        kind: ColumnKind,
        len: usize,
        values: impl Iterator<Item = &'a [u8]>,
    ) {
        if let Some(column) = self.find_mut(kind) {
            column.fill(len * kind.bytes(), &kind.unknown());
            values.for_each(|values| column.extend(values));
        }
    }

    /// Copies value `from` of every column to `to`.
    pub(crate) fn copy(&mut self, from: usize, to: usize) {
        for (kind, values) in &mut self.0 {
            let size = kind.bytes();
            values.bytes_mut().copy_within(from * size..(from + 1) * size, to * size);
        }
    }

    /// Swaps two values of every column.
    pub(crate) fn swap(&mut self, a: usize, b: usize) {
        for (kind, values) in self.0.iter_mut().filter(|_| a != b) {
            let (low, high, size) = (a.min(b), a.max(b), kind.bytes());
            let (before, behind) = values.bytes_mut().split_at_mut(high * size);
            before[low * size..(low + 1) * size].swap_with_slice(&mut behind[..size]);
        }
    }
}

fn undeclared(kind: ColumnKind) -> Error {
    let name = kind.name();
    let told = format!("a stage asks for the column {name}, which it does not declare");
    Error::undeclared(Undeclared::Column, told)
}

/// The order of the bytes of columns: this machine's, since they never leave it.
pub(crate) const COLUMN_ENDIAN: Endian =
    if cfg!(target_endian = "big") { Endian::Big } else { Endian::Little };
