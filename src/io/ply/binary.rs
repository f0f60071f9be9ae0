//! The vertices of a binary file, which are records as they stand there.

use std::fs::File;
use std::os::unix::fs::FileExt;

use crate::io::origin::Origin;
use crate::point::PointBatch;
use crate::stage::Part;
use crate::{Error, Result};

/// A range of the vertices of a binary file, read straight into the batch.
pub(super) struct BinaryPart<'a> {
    pub file: File,
    pub origin: &'a Origin,
    pub at: u64,
    pub left: u64,
    pub source: u32,
}

impl Part for BinaryPart<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        let outcome = self.fill(batch);
        self.origin.vouch(outcome, batch.is_empty())
    }
}

impl BinaryPart<'_> {
    fn fill(&mut self, batch: &mut PointBatch) -> Result<()> {
        let points = self.left.min(batch.capacity() as u64);
        batch.source = self.source;
        let bytes = batch.refill(points as usize);
        self.file.read_exact_at(bytes, self.at).map_err(|cause| {
            Error::io(self.origin.path(), "read vertices", cause).at_byte(self.at)
        })?;
        self.at += bytes.len() as u64;
        self.left -= points;
        Ok(())
    }
}
