//! Reading a file at positions, never past its end and never as a whole.

use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::Arc;

use crate::io::origin::Origin;
use crate::{Error, Result};

/// A file open for reading, and what it was when it was first opened.
#[derive(Debug, Clone)]
pub struct InputFile {
    file: Arc<File>,
    origin: Origin,
}

impl InputFile {
    /// Opens `path`, which must be a plain file.
    pub fn open(path: &Path) -> Result<Self> {
        let (file, origin) = Origin::open(path)?;
        Ok(InputFile { file: Arc::new(file), origin })
    }

    /// Opens a file again; fails if it is not what it was.
    pub fn reopen(origin: &Origin) -> Result<Self> {
        Ok(InputFile { file: Arc::new(origin.reopen()?), origin: origin.clone() })
    }

    /// What it was when it was first opened.
    pub fn origin(&self) -> &Origin {
        &self.origin
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        self.origin.path()
    }

    /// Its length in bytes when it was opened.
    pub fn len(&self) -> u64 {
        self.origin.length()
    }

    /// Fills `bytes` from position `at`; an end of file before that is an error.
    pub fn read_at(&self, bytes: &mut [u8], at: u64) -> Result<()> {
        let mut done = 0;
        while done < bytes.len() {
            match read_some(&self.file, &mut bytes[done..], at + done as u64) {
                Ok(0) => {
                    return Err(self
                        .wrong(at + done as u64, "the file ends early")
                        .help("it is cut off, or shrank while it was read"));
                }
                Ok(n) => done += n,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => return Err(Error::io(self.path(), "read it", e).at_byte(at)),
            }
        }
        Ok(())
    }

    /// `len` bytes from `at`. The caller has bounded `len`; this checks it against the file's
    /// length before it allocates.
    pub fn bytes(&self, at: u64, len: usize) -> Result<Vec<u8>> {
        if at.checked_add(len as u64).is_none_or(|end| end > self.len()) {
            return Err(self.wrong(at, format!("{len} bytes from here exceed the file")));
        }
        let mut bytes = vec![0; len];
        self.read_at(&mut bytes, at)?;
        Ok(bytes)
    }

    /// An error about this file's content at `byte`.
    pub fn wrong(&self, byte: u64, message: impl Into<String>) -> Error {
        Error::data(self.path(), message).at_byte(byte)
    }
}

#[cfg(unix)]
fn read_some(file: &File, bytes: &mut [u8], at: u64) -> io::Result<usize> {
    std::os::unix::fs::FileExt::read_at(file, bytes, at)
}

#[cfg(windows)]
fn read_some(file: &File, bytes: &mut [u8], at: u64) -> io::Result<usize> {
    std::os::windows::fs::FileExt::seek_read(file, bytes, at)
}
