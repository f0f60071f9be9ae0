//! Records of nodes that have more points than are held, in a file that is gone when the output is
//! done: scans that fill space, or have one position a million times, or that are as dense around a
//! scanner on every level.

use std::fs::File;
use std::io::Write;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::{Error, Result};

/// Bytes that a piece has room for at least once it has records.
const LEAST_ROOM: usize = 4 << 10;

/// Records of a node in their order, of which those that came first may be stored.
#[derive(Debug, Default)]
pub struct NodePiece {
    /// Bytes of all of them.
    bytes: usize,
    earlier: Vec<PiecePart>,
    /// The last of them.
    last: Vec<u8>,
}

/// Records that follow one another.
#[derive(Debug)]
enum PiecePart {
    /// In memory.
    Held(Vec<u8>),
    /// So many bytes from this one of the file on.
    Stored(Arc<StoredFile>, u64, usize),
}

/// The file and its path.
#[derive(Debug)]
pub struct StoredFile {
    path: PathBuf,
    file: File,
}

impl NodePiece {
    /// Of these records.
    pub fn of(records: Vec<u8>) -> Self {
        NodePiece { bytes: records.len(), earlier: Vec::new(), last: records }
    }

    /// Bytes of its records.
    pub fn len(&self) -> usize {
        self.bytes
    }

    /// True without a record.
    pub fn is_empty(&self) -> bool {
        self.bytes == 0
    }

    /// Bytes of memory that it has, those that it could still fill included.
    pub fn held(&self) -> usize {
        let held = |part: &PiecePart| match part {
            PiecePart::Held(records) => records.capacity(),
            PiecePart::Stored(..) => 0,
        };
        self.last.capacity() + self.earlier.iter().map(held).sum::<usize>()
    }

    /// Adds records; memory grows by doubling up to `most` bytes. True if it grew.
    pub fn extend(&mut self, records: &[u8], most: usize) -> bool {
        self.bytes += records.len();
        let (len, room) = (self.last.len() + records.len(), self.last.capacity());
        let grows = len > room;
        if grows {
            let room = (2 * room).clamp(LEAST_ROOM.min(most), most).max(len);
            self.last.reserve_exact(room - self.last.len());
        }
        self.last.extend_from_slice(records);
        grows
    }

    /// Adds the records of `other`.
    pub fn append(&mut self, other: NodePiece) {
        self.bytes += other.bytes;
        self.close_part();
        self.earlier.extend(other.earlier);
        self.last = other.last;
    }

    /// Without a record, for others: keeps memory.
    pub fn clear(&mut self) {
        self.bytes = 0;
        self.earlier.clear();
        self.last.clear();
    }

    /// Gives back memory that it could still fill.
    pub fn shrink(&mut self) {
        self.last.shrink_to_fit();
    }

    /// What comes is no longer behind the last records in memory.
    fn close_part(&mut self) {
        let last = std::mem::take(&mut self.last);
        if !last.is_empty() {
            self.earlier.push(PiecePart::Held(last));
        }
    }

    /// Its records.
    pub fn records(self) -> Result<Vec<u8>> {
        if self.earlier.is_empty() {
            return Ok(self.last);
        }
        let mut records = Vec::with_capacity(self.bytes);
        for part in self.earlier {
            match part {
                PiecePart::Held(held) => records.extend(held),
                PiecePart::Stored(stored, at, bytes) => {
                    let from = records.len();
                    records.resize(from + bytes, 0);
                    let read = stored.file.read_exact_at(&mut records[from..], at);
                    read.map_err(|e| Error::io(&stored.path, "read it", e))?;
                }
            }
        }
        records.extend(self.last);
        Ok(records)
    }
}

/// Where pieces are stored.
#[derive(Debug)]
pub struct Overflow {
    path: PathBuf,
    stored: Option<Arc<StoredFile>>,
    bytes: u64,
}

impl Overflow {
    /// At `path`, where there is a file only if one is needed.
    pub fn at(path: &Path) -> Self {
        Overflow { path: path.to_owned(), stored: None, bytes: 0 }
    }

    /// Stores the records of a piece, which then has no memory.
    pub fn store(&mut self, piece: &mut NodePiece) -> Result<()> {
        piece.close_part();
        piece.earlier.iter_mut().try_for_each(|part| {
            if let PiecePart::Held(records) = part {
                *part = self.put(records)?;
            }
            Ok(())
        })
    }

    fn put(&mut self, records: &[u8]) -> Result<PiecePart> {
        let stored = match &self.stored {
            Some(stored) => stored.clone(),
            None => {
                let mut made = File::options();
                let made = made.read(true).write(true).create_new(true);
                let file = made.open(&self.path);
                let file = file.map_err(|e| Error::io(&self.path, "create it", e))?;
                let path = self.path.clone();
                self.stored.insert(Arc::new(StoredFile { path, file })).clone()
            }
        };
        let written = (&stored.file).write_all(records);
        written.map_err(|e| Error::io(&self.path, "write it", e))?;
        let at = self.bytes;
        self.bytes += records.len() as u64;
        Ok(PiecePart::Stored(stored, at, records.len()))
    }
}

impl Drop for Overflow {
    fn drop(&mut self) {
        if self.stored.is_some() {
            // What is left goes with the scratch folder that it is in.
            drop(std::fs::remove_file(&self.path));
        }
    }
}
