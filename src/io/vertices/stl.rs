//! Binary STL: facets of 50 bytes behind a header of 84.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

use crate::io::origin::Origin;
use crate::point::PointBatch;
use crate::stage::Part;
use crate::{Error, Result};

/// Bytes before the first facet, of which the last four are their count.
pub(super) const HEAD: u64 = 84;
/// Bytes of a facet: its normal, three corners, two bytes that mean nothing.
const FACET: usize = 50;
/// Facets read at once.
const FACETS: usize = 4096;
/// Bytes of a record: a corner and the normal.
const RECORD: usize = 24;

/// How many facets a file of `length` bytes has, if it is binary STL: the format has no other mark
/// than that its count and its length agree. Some writers leave bytes behind.
pub(super) fn facets(file: &File, path: &Path, length: u64) -> Result<Option<u64>> {
    if length < HEAD {
        return Ok(None);
    }
    let mut count = [0; 4];
    let read = file.read_exact_at(&mut count, HEAD - 4);
    read.map_err(|e| Error::io(path, "read how many facets it has", e).at_byte(HEAD - 4))?;
    let facets = u64::from(u32::from_le_bytes(count));
    Ok((HEAD + facets * FACET as u64 <= length).then_some(facets))
}

/// The corners of the facets of a part.
pub(super) struct StlPart<'a> {
    pub file: File,
    pub origin: &'a Origin,
    /// The next facet, and how many are left.
    pub next: u64,
    pub left: u64,
    pub source: u32,
    /// Corners that were read, and bytes of them that are in a batch.
    pub corners: Vec<u8>,
    pub taken: usize,
}

impl StlPart<'_> {
    /// Bytes that it holds.
    pub const BYTES: usize = FACETS * (FACET + 3 * RECORD);

    fn facets(&mut self) -> Result<()> {
        let facets = self.left.min(FACETS as u64);
        let (mut bytes, at) = (vec![0; facets as usize * FACET], HEAD + self.next * FACET as u64);
        let read = self.file.read_exact_at(&mut bytes, at);
        read.map_err(|e| Error::io(self.origin.path(), "read facets", e).at_byte(at))?;
        self.corners.clear();
        for facet in bytes.chunks_exact(FACET) {
            let (normal, corners) = facet[..48].split_at(12);
            for corner in corners.chunks_exact(12) {
                self.corners.extend_from_slice(corner);
                self.corners.extend_from_slice(normal);
            }
        }
        self.taken = 0;
        self.next += facets;
        self.left -= facets;
        Ok(())
    }
}

impl Part for StlPart<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        batch.source = self.source;
        batch.clear();
        let mut outcome = Ok(());
        while batch.len() < batch.capacity() {
            if self.taken == self.corners.len() {
                if self.left == 0 {
                    break;
                }
                outcome = self.facets();
            }
            if outcome.is_err() {
                break;
            }
            let room = (batch.capacity() - batch.len()) * RECORD;
            let end = self.corners.len().min(self.taken + room);
            batch.extend(&self.corners[self.taken..end]);
            self.taken = end;
        }
        self.origin.vouch(outcome, batch.is_empty())
    }
}
