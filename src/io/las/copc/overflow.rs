//! Records of nodes that have more points than are held, in a file that is gone when the output is
//! done: scans that fill space, or have one position a million times.

use std::fs::File;
use std::io::Write;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::{Error, Result};

/// Records of a node.
#[derive(Debug)]
pub enum NodePiece {
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
    /// Bytes of its records.
    pub fn len(&self) -> usize {
        match self {
            NodePiece::Held(records) => records.len(),
            NodePiece::Stored(_, _, bytes) => *bytes,
        }
    }

    /// Its records.
    pub fn records(self) -> Result<Vec<u8>> {
        match self {
            NodePiece::Held(records) => Ok(records),
            NodePiece::Stored(stored, at, bytes) => {
                let mut records = vec![0; bytes];
                let read = stored.file.read_exact_at(&mut records, at);
                read.map_err(|e| Error::io(&stored.path, "read it", e))?;
                Ok(records)
            }
        }
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

    /// Stores records.
    pub fn store(&mut self, records: &[u8]) -> Result<NodePiece> {
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
        Ok(NodePiece::Stored(stored, at, records.len()))
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
