//! A stretch of a file as a stream of bytes, a window of it at a time.

use super::super::file::InputFile;
use crate::{Error, Result};

/// Bytes of a window, a power of two.
pub const WINDOW: usize = 8 << 10;
/// Bytes behind the window that may be looked at.
const PAD: usize = 8;

/// The bytes of a window. Places beyond it are places in it again, so that no read needs a check:
/// what is read beyond the bytes of the file is found out later.
pub type Buffer = [u8; WINDOW + PAD];

/// A stretch of a file. Behind its end are zeros.
pub struct ByteStream {
    file: InputFile,
    buffer: Box<Buffer>,
    /// Next byte of `buffer`.
    next: usize,
    /// Bytes of the file in `buffer`.
    filled: usize,
    /// File position behind those.
    behind: u64,
    /// File position that is not read.
    end: u64,
    failed: Option<Error>,
}

/// Four bytes of a window, the first of them uppermost.
#[inline(always)]
pub fn peek(buffer: &Buffer, at: usize) -> u32 {
    let at = at & (WINDOW - 1);
    u32::from_be_bytes([buffer[at], buffer[at + 1], buffer[at + 2], buffer[at + 3]])
}

impl ByteStream {
    /// Nothing of `file` yet.
    pub fn new(file: InputFile) -> Self {
        let buffer = Box::new([0; WINDOW + PAD]);
        ByteStream { file, buffer, next: 0, filled: 0, behind: 0, end: 0, failed: None }
    }

    /// Moves to the stretch `start..end`.
    pub fn move_to(&mut self, start: u64, end: u64) {
        let first = self.behind - self.filled as u64;
        if (first..self.behind).contains(&start) && self.behind <= end && end == self.end {
            self.next = (start - first) as usize;
            return;
        }
        self.end = end;
        (self.next, self.filled) = (0, 0);
        self.behind = start;
    }

    /// File position of the next byte.
    pub fn position(&self) -> u64 {
        self.behind + self.next as u64 - self.filled as u64
    }

    /// File position that is not read.
    pub fn end(&self) -> u64 {
        self.end
    }

    /// True if bytes behind the end were read.
    pub fn is_beyond(&self) -> bool {
        self.next > self.filled
    }

    /// The error of a reading that failed.
    pub fn failed(&mut self) -> Result<()> {
        self.failed.take().map_or(Ok(()), Err)
    }

    /// The window, and the place of the next byte in it.
    #[inline(always)]
    pub fn window(&self) -> (&Buffer, usize) {
        (&self.buffer, self.next)
    }

    /// The bytes up to this place of the window were read.
    #[inline(always)]
    pub fn set_next(&mut self, next: usize) {
        self.next = next;
    }

    /// Makes the window hold the next `bytes`, at most half of it, as far as the stretch has them.
    #[inline(always)]
    pub fn ensure(&mut self, bytes: usize) {
        if self.next + bytes > self.filled && self.behind < self.end {
            self.refill();
        }
    }

    /// Takes bytes.
    pub fn take(&mut self, out: &mut [u8]) {
        for byte in out {
            self.ensure(1);
            *byte = (peek(&self.buffer, self.next) >> 24) as u8;
            self.next += 1;
        }
    }

    #[cold]
    #[inline(never)]
    fn refill(&mut self) {
        if self.next > self.filled {
            return;
        }
        let kept = self.filled - self.next;
        self.buffer.copy_within(self.next..self.filled, 0);
        let new = self.end.saturating_sub(self.behind).min((WINDOW - kept) as u64) as usize;
        if let Err(error) = self.file.read_at(&mut self.buffer[kept..kept + new], self.behind) {
            self.failed.get_or_insert(error);
        }
        self.behind += new as u64;
        (self.next, self.filled) = (0, kept + new);
        self.buffer[kept + new..].fill(0);
    }
}
