//! Reading a file at positions, never past its end and never as a whole.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
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

/// Bytes that one [`Window`] holds.
pub const WINDOW_BYTES: usize = 64 << 10;

/// A buffered stream over a stretch of a file: positions are the file's own, the end is the
/// stretch's.
#[derive(Debug)]
pub struct Window {
    file: InputFile,
    buffer: Vec<u8>,
    /// Next byte of `buffer`.
    next: usize,
    /// File position just behind `buffer`.
    behind: u64,
    /// File position that is not read.
    end: u64,
}

impl Window {
    /// A stream over the bytes `start..end` of `file`.
    pub fn new(file: InputFile, start: u64, end: u64) -> Self {
        let end = end.min(file.len());
        let buffer = Vec::with_capacity(WINDOW_BYTES);
        Window { file, buffer, next: 0, behind: start, end }
    }

    /// Moves to the stretch `start..end`.
    pub fn move_to(&mut self, start: u64, end: u64) {
        self.end = end.min(self.file.len());
        self.jump(start);
    }

    /// File position of the next byte.
    pub fn position(&self) -> u64 {
        self.behind - (self.buffer.len() - self.next) as u64
    }

    fn jump(&mut self, to: u64) {
        let first = self.behind - self.buffer.len() as u64;
        if (first..self.behind).contains(&to) && self.behind <= self.end {
            self.next = (to - first) as usize;
        } else {
            self.buffer.clear();
            self.next = 0;
            self.behind = to;
        }
    }

    #[cold]
    fn refill(&mut self) -> io::Result<()> {
        let len = self.end.saturating_sub(self.behind).min(WINDOW_BYTES as u64) as usize;
        self.buffer.resize(len, 0);
        self.next = 0;
        let at = self.behind;
        self.behind += len as u64;
        self.file.read_at(&mut self.buffer, at).map_err(|e| {
            self.buffer.clear();
            io::Error::other(e)
        })
    }
}

impl Read for Window {
    #[inline]
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.next == self.buffer.len() {
            self.refill()?;
        }
        let n = out.len().min(self.buffer.len() - self.next);
        out[..n].copy_from_slice(&self.buffer[self.next..self.next + n]);
        self.next += n;
        Ok(n)
    }

    #[inline]
    fn read_exact(&mut self, out: &mut [u8]) -> io::Result<()> {
        if let Some(bytes) = self.buffer.get(self.next..self.next + out.len()) {
            out.copy_from_slice(bytes);
            self.next += out.len();
            return Ok(());
        }
        let mut done = 0;
        while done < out.len() {
            match self.read(&mut out[done..])? {
                0 => return Err(io::ErrorKind::UnexpectedEof.into()),
                n => done += n,
            }
        }
        Ok(())
    }
}

impl Seek for Window {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let target = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::Current(by) => self.position().checked_add_signed(by),
            SeekFrom::End(by) => self.end.checked_add_signed(by),
        };
        let target = target.ok_or(io::ErrorKind::InvalidInput)?;
        self.jump(target);
        Ok(target)
    }
}
