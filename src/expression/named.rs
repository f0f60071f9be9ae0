//! The numbers of one dimension or column of a batch, by its name.

use super::bind::Names;
use super::eval;
use super::lanes::LoadedField;
use crate::Result;
use crate::point::PointBatch;

/// A dimension of the records of a batch, or a number of one of its columns.
pub(crate) struct NamedField(LoadedField);

impl NamedField {
    /// The one called `name`.
    pub fn find(name: &str, batch: &PointBatch) -> Result<NamedField> {
        let names = Names { schema: batch.schema(), columns: &batch.columns.kinds() };
        let field = names.field(name, &(0..name.len()));
        field.map(NamedField).map_err(|fault| fault.error(name))
    }

    /// World units of a stored one, and the world value of a stored 0.
    pub fn units(&self) -> [f64; 2] {
        self.0.units()
    }

    /// True if its stored numbers are whole and below 2^32.
    pub fn is_whole(&self) -> bool {
        self.0.is_whole()
    }

    /// Calls `visit` with its stored numbers, some at a time, in order.
    pub fn each(&self, batch: &PointBatch, mut visit: impl FnMut(&[f64])) {
        eval::each_stored(&self.0, batch, &mut visit);
    }
}
