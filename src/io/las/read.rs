//! Reading plain records straight into a batch, by position.

use super::file::InputFile;
use crate::point::PointBatch;
use crate::stage::Part;
use crate::{Error, Result};

/// How far a file's stored coordinates are moved so that all inputs share one offset.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Shift(pub [i64; 3]);

impl Shift {
    /// Moves the coordinates of all records; False if one would leave i32.
    pub fn apply(self, records: &mut [u8], stride: usize) -> bool {
        if self.0 == [0; 3] {
            return true;
        }
        records.chunks_exact_mut(stride).all(|record| {
            let stored = record.first_chunk_mut::<12>();
            stored.is_some_and(|stored| {
                stored.as_chunks_mut().0.iter_mut().zip(self.0).all(|(bytes, by)| {
                    let moved = i64::from(i32::from_le_bytes(*bytes)).checked_add(by);
                    let Some(moved) = moved.and_then(|v| i32::try_from(v).ok()) else {
                        return false;
                    };
                    *bytes = moved.to_le_bytes();
                    true
                })
            })
        })
    }

    pub fn overflow(file: &InputFile) -> Error {
        Error::data(
            file.path(),
            "a point is too far from the other inputs' offset for its stored coordinates",
        )
        .help("bring the files to one offset first, or reduce them one by one")
    }
}

/// A stretch of plain records.
pub struct PlainPart {
    /// The file.
    pub file: InputFile,
    /// Number of the file among the inputs.
    pub source: u32,
    /// Position of the next record.
    pub at: u64,
    /// Records left.
    pub left: u64,
    /// See [`Shift`].
    pub shift: Shift,
}

impl Part for PlainPart {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        let outcome = self.fill(batch);
        self.file.origin().vouch(outcome, batch.is_empty())
    }
}

impl PlainPart {
    fn fill(&mut self, batch: &mut PointBatch) -> Result<()> {
        let n = self.left.min(batch.capacity() as u64) as usize;
        batch.source = self.source;
        let stride = batch.schema().stride;
        let records = batch.refill(n);
        self.file.read_at(records, self.at)?;
        if !self.shift.apply(records, stride) {
            return Err(Shift::overflow(&self.file));
        }
        self.at += (n * stride) as u64;
        self.left -= n as u64;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifts_are_exact_and_overflow_is_told() {
        let mut records = vec![0u8; 40];
        records[0..4].copy_from_slice(&(i32::MAX - 5).to_le_bytes());
        assert!(Shift([5, -7, 0]).apply(&mut records, 20));
        assert_eq!(records[0..4], i32::MAX.to_le_bytes());
        assert_eq!(records[24..28], (-7i32).to_le_bytes());
        assert!(!Shift([1, 0, 0]).apply(&mut records, 20));
        assert!(!Shift([0, 0, i64::MAX]).apply(&mut records, 20));
    }
}
