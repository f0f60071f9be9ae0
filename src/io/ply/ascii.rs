//! Reads vertices that are written as text, one a line.

use std::fs::File;
use std::path::Path;
use std::sync::atomic::Ordering;

use super::file::PlyFile;
use super::header::{Property, PropertyKind};
use crate::io::damage::PartLosses;
use crate::io::rows::fields::{Delimiter, Fields};
use crate::io::rows::lines::{Lines, shown};
use crate::io::rows::number;
use crate::point::{PointBatch, Scalar, Schema};
use crate::stage::Part;
use crate::{Error, Result};

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
    /// Names (as the file has them), types and byte offsets in the record; no place for lists.
    fields: Vec<(&'a str, Option<(Scalar, usize)>)>,
    stride: usize,
    /// Lines to pass over before the first vertex.
    skip: u64,
    points: u64,
    left: u64,
    source: u32,
    /// Numbers that have more digits than the `float` that holds them.
    rounded: u64,
    losses: PartLosses,
}

impl<'a> AsciiPart<'a> {
    /// Bytes that reading holds besides the batch.
    pub fn bytes(schema: &Schema) -> u64 {
        let fields = schema.dimensions.len() * size_of::<(&str, Option<(Scalar, usize)>)>();
        (Lines::bytes(longest_line(schema)) + fields) as u64
    }

    pub fn new(handle: File, file: &'a PlyFile, schema: &'a Schema, source: u32) -> Self {
        let mut dimensions = schema.dimensions.iter();
        let mut field = |property: &Property| match property.kind {
            PropertyKind::Scalar(_) => dimensions.next().map(|d| (d.scalar, d.offset)),
            PropertyKind::List { .. } => None,
        };
        let fields = file.properties().iter().map(|p| (p.name.as_str(), field(p))).collect();
        AsciiPart {
            path: &file.path,
            file,
            lines: Lines::new(
                handle,
                &file.path,
                [file.body, file.length],
                file.header.lines,
                longest_line(schema),
            ),
            fields,
            stride: schema.stride,
            skip: file.skipped_lines,
            points: file.points,
            left: file.points,
            source,
            rounded: 0,
            losses: file.losses.part(),
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
            .at_byte(self.lines.length())
            .help("the file is cut short, or its header is wrong")
    }

    /// Reads the vertices of lines until there is one, or no line is left. Those that are wrong are
    /// passed over, if that is wanted.
    fn vertex(&mut self, record: &mut [u8]) -> Result<bool> {
        while self.left > 0 {
            let at = self.lines.at();
            let error = match self.lines.next_or_error(self.losses.mends()) {
                Ok(Some(line)) => match self.numbers(line, record) {
                    Ok(()) => {
                        self.left -= 1;
                        return Ok(true);
                    }
                    Err(error) => error,
                },
                Ok(None) => {
                    let read = self.points - self.left;
                    let error = self.short(&format!("after {read} of {} vertices", self.points));
                    self.losses.lose(self.path, self.lines.length(), self.left, error)?;
                    self.left = 0;
                    break;
                }
                Err(error) => error,
            };
            let byte = error.byte().unwrap_or(at);
            self.losses.lose(self.path, byte, 1, error)?;
            self.left -= 1;
        }
        Ok(false)
    }

    /// Reads the numbers of a line into a record.
    fn numbers(&mut self, (start, end): (usize, usize), record: &mut [u8]) -> Result<()> {
        let line = self.lines.text(start, end);
        let fail = |place: usize, message: String| {
            Error::data(self.path, format!("line {}: {message}", self.lines.number()))
                .at_byte(self.lines.byte(place))
                .help(
                    "correct the line, or write the file again: each line has the values of its \
                     vertex",
                )
        };
        let mut words = Fields::new(line, Delimiter::Blanks);
        for (n, (name, target)) in self.fields.iter().enumerate() {
            let Some(token) = words.next() else {
                let message = format!("{n} values, but {} vertex properties", self.fields.len());
                return Err(fail(start, message));
            };
            let Some((scalar, offset)) = target else {
                if !pass_list(token, &mut words) {
                    let message = format!("the list `{name}` is not as long as it says");
                    return Err(fail(start, message));
                }
                continue;
            };
            let at = start + words.place() - token.len();
            if !number::parse(token, *scalar, &mut record[*offset..]) {
                let shown = shown(&String::from_utf8_lossy(token));
                let kind = self.file.properties()[n].kind.word();
                let message = format!("`{shown}` is no {kind} for property `{name}`");
                return Err(fail(at, message));
            }
            if *scalar == Scalar::F32 && number::loses_digits(token) {
                self.rounded += 1;
            }
        }
        match words.next() {
            None => Ok(()),
            Some(token) => {
                let message =
                    format!("more values than the {} vertex properties", self.fields.len());
                Err(fail(start + words.place() - token.len(), message))
            }
        }
    }
}

/// Passes over the values of a list whose count is `token`; false if there are not as many.
fn pass_list(token: &[u8], words: &mut Fields<'_>) -> bool {
    let count = std::str::from_utf8(token).ok().and_then(|text| text.parse::<u64>().ok());
    count.is_some_and(|count| (0..count).all(|_| words.next().is_some()))
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
            let Some((start, end)) = self.lines.next_whole(&mut self.losses)? else {
                return Ok(false);
            };
            let line = self.lines.text(start, end);
            let mut words = Fields::new(line, Delimiter::Blanks);
            for n in 0..=columns.last().copied().unwrap_or(0) {
                let Some(token) = words.next() else { break };
                match self.fields.get(n) {
                    Some((_, None)) => {
                        pass_list(token, &mut words);
                    }
                    _ if columns.contains(&n) && number::loses_digits(token) => return Ok(true),
                    _ => {}
                }
            }
        }
        Ok(false)
    }

    fn fill(&mut self, batch: &mut PointBatch) -> Result<()> {
        batch.source = self.source;
        batch.clear();
        self.skip()?;
        let mut points = self.left.min(batch.capacity() as u64) as usize;
        let (stride, mut read) = (self.stride, 0);
        for record in batch.refill(points).chunks_exact_mut(stride) {
            if !self.vertex(record)? {
                break;
            }
            read += 1;
        }
        batch.truncate(read);
        points = read;
        self.file.losses.enter(0, &self.losses);
        // The file may be looked at before it is read.
        self.file.rounded.fetch_max(self.rounded, Ordering::Relaxed);
        // A line behind the last vertex may be too long to be read: it is there all the same.
        if points == 0 && self.file.ends_with_vertices() && !matches!(self.lines.next(), Ok(None)) {
            self.file.more_lines.store(true, Ordering::Relaxed);
        }
        Ok(())
    }
}
