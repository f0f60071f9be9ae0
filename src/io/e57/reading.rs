//! The bytes of a file as the crate wants them: it seeks before each page of a kilobyte.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::os::unix::fs::FileExt;

/// Bytes read at once.
const WINDOW: usize = 1 << 17;

/// A file that is read at positions, through a window.
pub(super) struct Windowed {
    file: File,
    length: u64,
    at: u64,
    window: Vec<u8>,
    /// Where the window begins.
    from: u64,
}

impl Windowed {
    /// Bytes that it holds.
    pub const BYTES: usize = WINDOW;

    pub fn new(file: File, length: u64) -> Self {
        Windowed { file, length, at: 0, window: Vec::new(), from: 0 }
    }
}

impl Read for Windowed {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let behind = self.from + self.window.len() as u64;
        if !(self.from..behind).contains(&self.at) {
            let held = self.length.saturating_sub(self.at).min(WINDOW as u64) as usize;
            self.window.resize(held, 0);
            self.file.read_exact_at(&mut self.window, self.at)?;
            self.from = self.at;
        }
        let held = &self.window[(self.at - self.from) as usize..];
        let now = held.len().min(into.len());
        into[..now].copy_from_slice(&held[..now]);
        self.at += now as u64;
        Ok(now)
    }
}

impl Seek for Windowed {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => self.length.checked_add_signed(by),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
        };
        self.at = at.ok_or_else(|| io::Error::from(io::ErrorKind::InvalidInput))?;
        Ok(self.at)
    }
}
