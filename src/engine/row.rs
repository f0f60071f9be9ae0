//! The values of columns that outputs write, side by side for each entry of records.
//!
//! A chunk is cut by rank, long before its records are fetched, and what was computed for them must
//! come along. It is kept as bytes of one length, so that lists of entries, in memory and in the
//! spill, need not know what it is.

use crate::point::{ColumnKind, Columns};

/// Which columns, in which order.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct RowLayout {
    kinds: Vec<ColumnKind>,
    bytes: usize,
}

impl RowLayout {
    /// These columns, each once.
    pub fn of(columns: impl IntoIterator<Item = ColumnKind>) -> Self {
        let mut layout = RowLayout::default();
        for column in columns {
            if !layout.kinds.contains(&column) {
                layout.kinds.push(column);
                layout.bytes += column.bytes();
            }
        }
        layout
    }

    /// Bytes of a row; 0 if no output writes a column.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// The columns.
    pub fn kinds(&self) -> &[ColumnKind] {
        &self.kinds
    }

    /// Appends `row` to `rows`, unless rows have no column.
    pub fn enter(&self, row: &[u8], rows: &mut Vec<u8>) {
        if self.bytes > 0 {
            rows.extend_from_slice(row);
        }
    }

    /// The columns of records of which `counts` each have one of `rows`.
    pub fn spread(&self, rows: &[u8], counts: impl Iterator<Item = usize> + Clone) -> Columns {
        let (mut columns, mut begin) = (Columns::default(), 0);
        columns.declare(&self.kinds);
        for kind in &self.kinds {
            let range = begin..begin + kind.bytes();
            let rows = rows.chunks_exact(self.bytes).zip(counts.clone());
            let each = rows.flat_map(|(row, n)| std::iter::repeat_n(&row[range.clone()], n));
            columns.append(*kind, 0, each);
            begin = range.end;
        }
        columns
    }
}
