//! Lines of the report's tiles, on their way from the survey to the file of the report.
//!
//! A report has a line for each tile, of which there may be millions. They are figures and texts of
//! unknown length, so they are not kept but written as lines at once, and go through the spill like
//! everything else that grows with the scan.

use std::io::{self, BufRead, Read};

use crate::report::TileFigures;
use crate::store::{Spill, StoredStretch};
use crate::{Error, Result};

/// Lines of the report's tiles, in order, wherever points are kept: there may be millions.
pub(crate) struct TileLines {
    spill: Spill,
    stretches: Vec<StoredStretch>,
}

impl TileLines {
    /// Of the stretches of all ranges, in order.
    pub fn new(spill: Spill, stretches: Vec<StoredStretch>) -> Self {
        TileLines { spill, stretches }
    }

    /// Reads the lines one stretch after the other.
    pub fn reader(&self) -> LineReader<'_> {
        LineReader { spill: &self.spill, left: self.stretches.iter(), open: Vec::new(), at: 0 }
    }
}

/// See [`TileLines::reader`]. Its errors hold the [`Error`] of the spill.
pub(crate) struct LineReader<'a> {
    spill: &'a Spill,
    left: std::slice::Iter<'a, StoredStretch>,
    open: Vec<u8>,
    at: usize,
}

impl BufRead for LineReader<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.at == self.open.len() {
            self.open.clear();
            self.at = 0;
            if let Some(stretch) = self.left.next() {
                self.spill.load(stretch, &mut self.open).map_err(io::Error::other)?;
            }
        }
        Ok(&self.open[self.at..])
    }

    fn consume(&mut self, bytes: usize) {
        self.at += bytes;
    }
}

impl Read for LineReader<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let read = self.fill_buf()?.read(into)?;
        self.consume(read);
        Ok(read)
    }
}

/// Lines are handed to the spill in stretches of about this size.
pub(crate) const LINES_AT_ONCE: usize = 1 << 18;

/// The lines of the tiles that begin in one range.
pub(crate) struct RangeLines<'a> {
    spill: &'a Spill,
    open: Vec<u8>,
    stretches: Vec<StoredStretch>,
}

impl<'a> RangeLines<'a> {
    /// None yet.
    pub fn new(spill: &'a Spill) -> Self {
        RangeLines { spill, open: Vec::new(), stretches: Vec::new() }
    }

    /// Adds the line of the next tile.
    pub fn add(&mut self, figures: &TileFigures) -> Result<()> {
        figures
            .write_line(&mut self.open)
            .map_err(|e| Error::internal("a report line could not be written").because(e))?;
        if self.open.len() >= LINES_AT_ONCE { self.store() } else { Ok(()) }
    }

    fn store(&mut self) -> Result<()> {
        if !self.open.is_empty() {
            self.stretches.push(self.spill.store(&self.open)?);
            self.open.clear();
        }
        Ok(())
    }

    /// Where all lines of the range are.
    pub fn finish(mut self) -> Result<Vec<StoredStretch>> {
        self.store()?;
        Ok(self.stretches)
    }
}
