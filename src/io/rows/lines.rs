//! Lines of a text.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

use memchr::memchr2;

use crate::io::damage::PartLosses;
use crate::{Error, ErrorKind, Result};

/// Bytes read at once.
const WINDOW: usize = 1 << 18;

/// A word of a file, short and printable, for a message.
pub(crate) fn shown(word: &str) -> String {
    let mut short: String = word.chars().take(40).flat_map(char::escape_debug).collect();
    if word.chars().count() > 40 {
        short.push('…');
    }
    short
}

/// Lines of a file through a window that never grows. Lines end with a line feed, a carriage return
/// or both; blank ones are passed over.
pub(crate) struct Lines<'a> {
    file: File,
    path: &'a Path,
    window: Vec<u8>,
    /// What of the window is still to be read.
    start: usize,
    end: usize,
    /// Byte of the file where the window begins.
    from: u64,
    length: u64,
    /// Number of the last line read.
    line: u64,
    longest: usize,
    after_return: bool,
}

impl<'a> Lines<'a> {
    /// Bytes that reading lines of at most `longest` bytes holds.
    pub fn bytes(longest: usize) -> usize {
        WINDOW + longest
    }

    /// The lines from one byte of the file to another, the first of which is number `before` + 1.
    pub fn new(
        file: File,
        path: &'a Path,
        [from, to]: [u64; 2],
        before: u64,
        longest: usize,
    ) -> Self {
        Lines {
            file,
            path,
            window: vec![0; Self::bytes(longest)],
            start: 0,
            end: 0,
            from,
            length: to,
            line: before,
            longest,
            after_return: false,
        }
    }

    /// The text of a line that [`next`](Self::next) gave.
    pub fn text(&self, start: usize, end: usize) -> &[u8] {
        &self.window[start..end]
    }

    /// What the window holds from `start` on, which may end within a line.
    pub fn held(&self, start: usize) -> &[u8] {
        &self.window[start..self.end]
    }

    /// The byte of the file that is at `place` of the window.
    pub fn byte(&self, place: usize) -> u64 {
        self.from + place as u64
    }

    /// The byte of the file where the next line begins.
    pub fn at(&self) -> u64 {
        self.byte(self.start)
    }

    /// Number of the last line read.
    pub fn number(&self) -> u64 {
        self.line
    }

    /// Where the lines end.
    pub fn length(&self) -> u64 {
        self.length
    }

    /// The next line with something on it, as a range of the window.
    pub fn next(&mut self) -> Result<Option<(usize, usize)>> {
        loop {
            let held = &self.window[self.start..self.end];
            let found = memchr2(b'\n', b'\r', held);
            if found.is_none() && !self.at_end() && held.len() <= self.longest {
                self.fill()?;
                continue;
            }
            let length = found.unwrap_or(held.len());
            if length > self.longest {
                let message =
                    format!("line {} is longer than {} bytes", self.line + 1, self.longest);
                return Err(Error::data(self.path, message).at_byte(self.from + self.start as u64));
            }
            let (start, end) = (self.start, self.start + length);
            match found {
                Some(_) => self.end_line(end),
                None if length == 0 => return Ok(None),
                None => {
                    self.line += 1;
                    self.start = end;
                }
            }
            if self.window[start..end].iter().any(|b| !b.is_ascii_whitespace()) {
                return Ok(Some((start, end)));
            }
        }
    }

    /// As [`next`](Self::next). If it `mends`, a line that is too long is passed over: its error is
    /// given all the same, and the line behind it is the next.
    pub fn next_or_error(&mut self, mends: bool) -> Result<Option<(usize, usize)>> {
        let line = self.next();
        if line.as_ref().is_err_and(|error| mends && error.kind() == ErrorKind::Data) {
            self.pass(true)?;
        }
        line
    }

    /// As [`next`](Self::next), but for lines that are too long: each is lost as one point, if that
    /// is wanted.
    pub fn next_whole(&mut self, lost: &mut PartLosses) -> Result<Option<(usize, usize)>> {
        loop {
            let at = self.at();
            match self.next_or_error(lost.mends()) {
                Err(error) => lost.lose(self.path, error.byte().unwrap_or(at), 1, error)?,
                line => return line,
            }
        }
    }

    /// Passes over a line with something on it, however long; false at the file's end.
    pub fn pass_over(&mut self) -> Result<bool> {
        self.pass(false)
    }

    /// The same; if something is known to be `written` on the next line, over that one.
    fn pass(&mut self, mut written: bool) -> Result<bool> {
        loop {
            if self.start == self.end {
                if self.at_end() {
                    self.line += u64::from(written);
                    return Ok(written);
                }
                self.fill()?;
            }
            let held = &self.window[self.start..self.end];
            let found = memchr2(b'\n', b'\r', held);
            let part = &held[..found.unwrap_or(held.len())];
            written |= part.iter().any(|b| !b.is_ascii_whitespace());
            self.after_return &= part.is_empty();
            match found {
                Some(length) => {
                    self.end_line(self.start + length);
                    if written {
                        return Ok(true);
                    }
                }
                None => self.start = self.end,
            }
        }
    }

    /// Counts the line whose end is at `end` of the window and steps behind it. The line feed of a
    /// carriage return and a line feed ends no second line.
    fn end_line(&mut self, end: usize) {
        let second = self.after_return && end == self.start && self.window[end] == b'\n';
        self.line += u64::from(!second);
        self.after_return = self.window[end] == b'\r';
        self.start = end + 1;
    }

    /// True if the window reaches the file's end.
    fn at_end(&self) -> bool {
        self.from + self.end as u64 >= self.length
    }

    /// Moves what is left to the window's beginning and reads on behind it.
    fn fill(&mut self) -> Result<()> {
        self.window.copy_within(self.start..self.end, 0);
        self.from += self.start as u64;
        self.end -= self.start;
        self.start = 0;
        let at = self.from + self.end as u64;
        let room = ((self.window.len() - self.end) as u64).min(self.length.saturating_sub(at));
        let into = &mut self.window[self.end..self.end + room as usize];
        self.file
            .read_exact_at(into, at)
            .map_err(|cause| Error::io(self.path, "read lines", cause).at_byte(at))?;
        self.end += room as usize;
        Ok(())
    }
}
