//! Records in bins, which are looked at one after the other: in memory while it does, in scratch
//! files beyond.

use std::sync::Arc;

use crate::store::{Spill, SpillArea, StoredStretch};
use crate::{Error, Result};

/// Records in bins, each with a few numbers before its bytes.
#[derive(Debug)]
pub struct RecordBins {
    spill: Spill,
    /// Bytes of an entry: its numbers and its record.
    entry: usize,
    /// Bytes of a bin that wait to be stored, at most.
    most: usize,
    bins: Vec<RecordBin>,
}

#[derive(Debug, Default)]
struct RecordBin {
    open: Vec<u8>,
    stored: Vec<StoredStretch>,
    entries: u64,
}

impl RecordBins {
    /// No entries yet, each `entry` bytes, in so many `bins`, of which `memory` bytes together wait
    /// to be stored at most.
    pub fn new(area: &Arc<SpillArea>, entry: usize, bins: usize, memory: u64) -> RecordBins {
        let each = usize::try_from(memory).unwrap_or(usize::MAX) / bins.max(1);
        let most = each.clamp(entry.max(512), 64 << 10);
        let spill = Spill::new(area, "compared");
        RecordBins { spill, entry, most, bins: (0..bins).map(|_| RecordBin::default()).collect() }
    }

    /// Adds an entry to a bin.
    pub fn push(&mut self, bin: usize, parts: &[&[u8]]) -> Result<()> {
        let nowhere = || Error::internal("a record has no bin");
        let RecordBin { open, stored, entries } = self.bins.get_mut(bin).ok_or_else(nowhere)?;
        if open.len() + self.entry > self.most {
            stored.push(self.spill.store(open)?);
            open.clear();
        }
        if open.capacity() == 0 {
            open.reserve_exact(self.most);
        }
        parts.iter().for_each(|part| open.extend_from_slice(part));
        *entries += 1;
        Ok(())
    }

    /// How many bins there are.
    pub fn bins(&self) -> usize {
        self.bins.len()
    }

    /// How many entries a bin has.
    pub fn entries(&self, bin: usize) -> u64 {
        self.bins.get(bin).map_or(0, |bin| bin.entries)
    }

    /// Calls `visit` with all entries of a bin; `buffer` is memory for some of them.
    pub fn each(
        &self,
        bin: usize,
        buffer: &mut Vec<u8>,
        mut visit: impl FnMut(&[u8]) -> Result<()>,
    ) -> Result<()> {
        let Some(RecordBin { open, stored, .. }) = self.bins.get(bin) else { return Ok(()) };
        for stretch in stored {
            self.spill.load(stretch, buffer)?;
            buffer.chunks_exact(self.entry).try_for_each(&mut visit)?;
        }
        open.chunks_exact(self.entry).try_for_each(visit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::store::Folder;

    #[derive(Debug)]
    struct At(std::path::PathBuf);

    impl Folder for At {
        fn file(&self, name: &str) -> Result<std::path::PathBuf> {
            Ok(self.0.join(name))
        }
    }

    #[test]
    fn bins_give_back_what_they_got_from_memory_and_from_files() {
        let at = tempfile::tempdir().unwrap();
        for in_memory in [0, 1 << 20] {
            let folder = Box::new(At(at.path().to_owned()));
            let area = SpillArea::new(Budget::new(1 << 20), in_memory, folder);
            let mut bins = RecordBins::new(&area, 9, 3, 0);
            for n in 0..1000u64 {
                bins.push((n % 3) as usize, &[&n.to_le_bytes(), &[7]]).unwrap();
            }
            assert_eq!(area.written() > 0, in_memory == 0);
            let mut buffer = Vec::new();
            for bin in 0..3 {
                let mut found = Vec::new();
                let number = |entry: &[u8]| u64::from_le_bytes(*entry.first_chunk().unwrap());
                let enter = |entry: &[u8]| {
                    found.push(number(entry));
                    Ok(())
                };
                bins.each(bin, &mut buffer, enter).unwrap();
                assert_eq!(found, (0..1000).filter(|n| n % 3 == bin as u64).collect::<Vec<_>>());
                assert_eq!(bins.entries(bin), found.len() as u64);
            }
            assert!(bins.push(3, &[&[0; 9]]).is_err());
        }
    }
}
