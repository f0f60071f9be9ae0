//! Reads vertices that are written as text, one a line.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::atomic::Ordering;

use super::file::PlyFile;
use super::header::shown;
use super::text;
use crate::point::{PointBatch, Scalar, Schema};
use crate::stage::Part;
use crate::{Error, Result};

/// Bytes read at once.
const WINDOW: usize = 1 << 18;

/// The longest line that is read: room for the longest number and some blanks, for every property.
fn longest_line(schema: &Schema) -> usize {
    4096 + 512 * schema.dimensions.len()
}

/// The vertices of a text file, in one part: where a line begins is known only from the lines
/// before.
pub(super) struct AsciiPart<'a> {
    path: &'a Path,
    file: &'a PlyFile,
    lines: Lines<'a>,
    /// Names (as the file has them), types and byte offsets in the record.
    fields: Vec<(&'a str, Scalar, usize)>,
    stride: usize,
    /// Lines to pass over before the first vertex.
    skip: u64,
    points: u64,
    left: u64,
    source: u32,
    /// Numbers that have more digits than the `float` that holds them.
    rounded: u64,
}

impl<'a> AsciiPart<'a> {
    /// Bytes that reading holds besides the batch.
    pub fn bytes(schema: &Schema) -> u64 {
        let fields = schema.dimensions.len() * size_of::<(&str, Scalar, usize)>();
        (WINDOW + longest_line(schema) + fields) as u64
    }

    pub fn new(handle: File, file: &'a PlyFile, schema: &'a Schema, source: u32) -> Self {
        let properties = file.properties();
        AsciiPart {
            path: &file.path,
            file,
            lines: Lines {
                file: handle,
                path: &file.path,
                window: vec![0; WINDOW + longest_line(schema)],
                start: 0,
                end: 0,
                from: file.body,
                length: file.length,
                line: file.header.lines,
                longest: longest_line(schema),
                after_return: false,
            },
            fields: properties
                .iter()
                .zip(&schema.dimensions)
                .map(|(p, d)| (p.name.as_str(), d.scalar, d.offset))
                .collect(),
            stride: schema.stride,
            skip: file.skipped_lines,
            points: file.points,
            left: file.points,
            source,
            rounded: 0,
        }
    }

    fn skip(&mut self) -> Result<()> {
        while self.skip > 0 {
            if !self.lines.pass_over()? {
                return Err(self.short("before its vertices"));
            }
            self.skip -= 1;
        }
        Ok(())
    }

    fn short(&self, when: &str) -> Error {
        Error::data(self.path, format!("the file ends {when}"))
            .at_byte(self.lines.length)
            .help("the file is cut short, or its header is wrong")
    }

    fn vertex(&mut self, record: &mut [u8]) -> Result<()> {
        let Some((start, end)) = self.lines.next()? else {
            let read = self.points - self.left;
            return Err(self.short(&format!("after {read} of {} vertices", self.points)));
        };
        let line = &self.lines.window[start..end];
        let fail = |place: usize, message: String| {
            Error::data(self.path, format!("line {}: {message}", self.lines.line))
                .at_byte(self.lines.from + place as u64)
                .help(
                    "correct the line, or write the file again: each line has the values of its \
                     vertex",
                )
        };
        let mut place = 0;
        for (n, (name, scalar, offset)) in self.fields.iter().enumerate() {
            let Some(token) = word(line, &mut place) else {
                let message = format!("{n} values, but {} vertex properties", self.fields.len());
                return Err(fail(start, message));
            };
            let at = start + place - token.len();
            if !text::parse(token, *scalar, &mut record[*offset..]) {
                let shown = shown(&String::from_utf8_lossy(token));
                let kind = self.file.properties()[n].kind.word();
                let message = format!("`{shown}` is no {kind} for property `{name}`");
                return Err(fail(at, message));
            }
            if *scalar == Scalar::F32 && text::loses_digits(token) {
                self.rounded += 1;
            }
        }
        match word(line, &mut place) {
            None => Ok(()),
            Some(token) => {
                let message =
                    format!("more values than the {} vertex properties", self.fields.len());
                Err(fail(start + place - token.len(), message))
            }
        }
    }
}

/// The next word of `line` from `place` on, which is moved behind it.
fn word<'a>(line: &'a [u8], place: &mut usize) -> Option<&'a [u8]> {
    let rest = &line[*place..];
    let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
    let length =
        rest[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - start);
    *place += start + length;
    Some(&rest[start..start + length])
}

impl Part for AsciiPart<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        let outcome = self.fill(batch);
        self.file.origin.vouch(outcome, batch.is_empty())
    }
}

impl AsciiPart<'_> {
    /// True if a number of one of the properties `columns` has more digits than a `float` holds.
    /// What is wrong with a line is told when it is read.
    pub fn outgrows_float(mut self, columns: &[usize]) -> Result<bool> {
        self.skip()?;
        for _ in 0..self.points {
            let Some((start, end)) = self.lines.next()? else { return Ok(false) };
            let line = &self.lines.window[start..end];
            let mut place = 0;
            for n in 0..=columns.last().copied().unwrap_or(0) {
                let Some(token) = word(line, &mut place) else { break };
                if columns.contains(&n) && text::loses_digits(token) {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    fn fill(&mut self, batch: &mut PointBatch) -> Result<()> {
        batch.source = self.source;
        batch.clear();
        self.skip()?;
        let points = self.left.min(batch.capacity() as u64) as usize;
        let stride = self.stride;
        for record in batch.refill(points).chunks_exact_mut(stride) {
            self.vertex(record)?;
            self.left -= 1;
        }
        // The file may be looked at before it is read.
        self.file.rounded.fetch_max(self.rounded, Ordering::Relaxed);
        // A line behind the last vertex may be too long to be read: it is there all the same.
        if points == 0 && self.file.ends_with_vertices() && !matches!(self.lines.next(), Ok(None)) {
            self.file.more_lines.store(true, Ordering::Relaxed);
        }
        Ok(())
    }
}

/// Lines of a file through a window that never grows. Lines end with a line feed, a carriage return
/// or both; blank ones are passed over.
struct Lines<'a> {
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

impl Lines<'_> {
    /// The next line with something on it, as a range of the window.
    fn next(&mut self) -> Result<Option<(usize, usize)>> {
        loop {
            let held = &self.window[self.start..self.end];
            let found = held.iter().position(|b| matches!(b, b'\n' | b'\r'));
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

    /// Passes over a line with something on it, however long; false at the file's end.
    fn pass_over(&mut self) -> Result<bool> {
        let mut written = false;
        loop {
            if self.start == self.end {
                if self.at_end() {
                    self.line += u64::from(written);
                    return Ok(written);
                }
                self.fill()?;
            }
            let held = &self.window[self.start..self.end];
            let found = held.iter().position(|b| matches!(b, b'\n' | b'\r'));
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
            .map_err(|cause| Error::io(self.path, "read vertices", cause).at_byte(at))?;
        self.end += room as usize;
        Ok(())
    }
}
