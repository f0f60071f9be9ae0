//! Reads the points of a part of a PCD file, however they are written.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::sync::atomic::{AtomicU64, Ordering};

use super::file::PcdFile;
use super::lzf::Unpacker;
use crate::io::damage::PartLosses;
use crate::io::rows::fields::{Delimiter, Fields};
use crate::io::rows::lines::{Lines, shown};
use crate::io::rows::number;
use crate::point::{Dimension, Endian, PointBatch, Scalar, Schema};
use crate::stage::Part;
use crate::{Error, Result};

/// Points one after the other, as records but for rows and columns.
pub(super) enum Points<'a> {
    /// At this byte of the file.
    Binary(File, u64),
    /// On lines.
    Ascii(AsciiPoints<'a>),
    /// Each field where its values are unpacked.
    Packed(Vec<Unpacker<'a>>),
}

/// Points on lines.
pub(super) struct AsciiPoints<'a> {
    pub lines: Lines<'a>,
    /// Where the numbers of a line go; None for padding.
    pub numbers: Vec<Option<(Scalar, usize)>>,
    /// Numbers that lost digits.
    pub rounded: u64,
}

/// The points of a part.
pub(super) struct PcdPart<'a> {
    pub file: &'a PcdFile,
    pub points: Points<'a>,
    pub schema: &'a Schema,
    /// Bytes of a record without row and column.
    pub own: usize,
    /// The cell of the next point, and how many are left.
    pub cell: u64,
    pub left: u64,
    pub source: u32,
    /// Where it says how many cells have no point, and how many had none so far.
    pub empty: (&'a AtomicU64, u64),
    /// Its number in the file, and what is lost of it.
    pub losses: (usize, PartLosses),
    /// The points of a grid before they get their rows and columns; or the values of one field.
    pub buffer: Vec<u8>,
}

impl Part for PcdPart<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        batch.source = self.source;
        batch.clear();
        let outcome = loop {
            let outcome = self.fill(batch).or_else(|error| self.give_up(error, batch));
            // Cells without a point may have been all.
            if outcome.is_err() || !batch.is_empty() || self.left == 0 {
                break outcome;
            }
        };
        self.file.origin.vouch(outcome, batch.is_empty())
    }
}

impl PcdPart<'_> {
    fn fill(&mut self, batch: &mut PointBatch) -> Result<()> {
        let points = self.left.min(batch.capacity() as u64) as usize;
        let (own, stride) = (self.own, self.schema.stride);
        let records = batch.refill(points);
        if matches!(self.points, Points::Ascii(_)) {
            return self.lines(batch, points);
        }
        match &mut self.points {
            Points::Binary(file, at) if own == stride => read_at(self.file, file, at, records)?,
            Points::Binary(file, at) => {
                self.buffer.resize(points * own, 0);
                read_at(self.file, file, at, &mut self.buffer)?;
                for (point, record) in
                    self.buffer.chunks_exact(own).zip(records.chunks_exact_mut(stride))
                {
                    record[..own].copy_from_slice(point);
                }
            }
            Points::Ascii(_) => {}
            Points::Packed(fields) => {
                let mut place = 0;
                for (unpacker, field) in fields.iter_mut().zip(&self.file.header.fields) {
                    let bytes = field.bytes();
                    self.buffer.resize(points * bytes, 0);
                    unpacker.read(&mut self.buffer)?;
                    let values = self.buffer.chunks_exact(bytes);
                    for (value, record) in values.zip(records.chunks_exact_mut(stride)) {
                        record[place..place + bytes].copy_from_slice(value);
                    }
                    place += bytes;
                }
            }
        }
        if self.file.is_grid() {
            for (cell, record) in (self.cell..).zip(records.chunks_exact_mut(stride)) {
                record[own..own + 8].copy_from_slice(&self.file.place(cell));
            }
        }
        self.cell += points as u64;
        self.left -= points as u64;
        self.leave_out(batch);
        Ok(())
    }

    /// Reads points of lines; those that are wrong are passed over, if that is wanted.
    fn lines(&mut self, batch: &mut PointBatch, points: usize) -> Result<()> {
        let (own, stride, mut read) = (self.own, self.schema.stride, 0);
        while read < points && self.left > 0 {
            let Points::Ascii(ascii) = &mut self.points else { break };
            let at = ascii.lines.at();
            let record = &mut batch.records_mut()[read * stride..(read + 1) * stride];
            let mut gone = 1;
            let point = match ascii.lines.next_or_error(self.losses.1.mends()) {
                Ok(Some(line)) => ascii.point(self.file, line, record),
                Ok(None) => {
                    gone = self.left;
                    Err(ended(self.file, self.cell, ascii.lines.length()))
                }
                Err(error) => Err(error),
            };
            match point {
                Ok(()) => {
                    if self.file.is_grid() {
                        record[own..own + 8].copy_from_slice(&self.file.place(self.cell));
                    }
                    read += 1;
                }
                Err(error) => {
                    let byte = error.byte().unwrap_or(at);
                    self.losses.1.lose(&self.file.path, byte, gone, error)?;
                }
            }
            self.file.rounded.fetch_max(ascii.rounded, Ordering::Relaxed);
            (self.cell, self.left) = (self.cell + gone, self.left - gone);
        }
        self.file.losses.enter(self.losses.0, &self.losses.1);
        batch.truncate(read);
        self.leave_out(batch);
        Ok(())
    }

    /// Goes on without the points that are left of the part, if that is wanted.
    fn give_up(&mut self, error: Error, batch: &mut PointBatch) -> Result<()> {
        let byte = error.byte().unwrap_or(self.file.header.body);
        self.losses.1.lose(&self.file.path, byte, self.left, error)?;
        self.file.losses.enter(self.losses.0, &self.losses.1);
        self.left = 0;
        batch.clear();
        Ok(())
    }

    /// Leaves cells out that have no point.
    fn leave_out(&mut self, batch: &mut PointBatch) {
        let Some(axes) = self.schema.coordinates() else { return };
        let floats: Vec<&Dimension> = axes.into_iter().filter(|d| d.scalar.is_float()).collect();
        let is_empty = |record: &[u8]| {
            floats.iter().any(|axis| axis.get(record, Endian::Little).as_f64().is_nan())
        };
        let empty = batch.iter().filter(|record| is_empty(record)).count() as u64;
        if empty > 0 {
            self.empty.1 += empty;
            self.empty.0.fetch_max(self.empty.1, Ordering::Relaxed);
            batch.retain(|_, record| !is_empty(record));
        }
    }
}

/// Reads points at a byte, which moves behind them.
fn read_at(pcd: &PcdFile, file: &File, at: &mut u64, into: &mut [u8]) -> Result<()> {
    let read = file.read_exact_at(into, *at);
    read.map_err(|e| Error::io(&pcd.path, "read points", e).at_byte(*at))?;
    *at += into.len() as u64;
    Ok(())
}

/// The error of a text that ends at byte `length`, after the lines of so many cells.
fn ended(file: &PcdFile, cells: u64, length: u64) -> Error {
    let told = format!("the file ends after {cells} of {} points", file.header.points);
    Error::data(&file.path, told)
        .at_byte(length)
        .help("the file is cut short, or its header is wrong")
}

impl AsciiPoints<'_> {
    /// Reads the numbers of a line into a record.
    fn point(
        &mut self,
        file: &PcdFile,
        (start, end): (usize, usize),
        record: &mut [u8],
    ) -> Result<()> {
        let path = &file.path;
        let line = self.lines.text(start, end);
        let number = self.lines.number();
        let fail = |told: String, place: usize| {
            Error::data(path, format!("line {number}: {told}"))
                .at_byte(self.lines.byte(start + place))
                .help(
                    "correct the line, or write the file again: each has the numbers of its point",
                )
        };
        let mut fields = Fields::new(line, Delimiter::blanks_or_commas(line));
        for (n, target) in self.numbers.iter().enumerate() {
            let Some(field) = fields.next() else {
                let told = format!("{n} numbers, the header has {}", self.numbers.len());
                return Err(fail(told, 0));
            };
            let Some((scalar, offset)) = target else { continue };
            if !number::parse(field, *scalar, &mut record[*offset..]) {
                let place = fields.place() - field.len();
                let shown = shown(&String::from_utf8_lossy(field));
                return Err(fail(format!("`{shown}` is no number of the header's type"), place));
            }
            if *scalar == Scalar::F32 && number::loses_digits(field) {
                self.rounded += 1;
            }
        }
        match fields.next() {
            None => Ok(()),
            Some(_) => {
                let told = format!("more numbers than the header's {}", self.numbers.len());
                Err(fail(told, fields.place()))
            }
        }
    }

    /// True if a coordinate has more digits than the 4 bytes of its type hold. What is wrong with a
    /// line is told when it is read.
    pub fn outgrow_float(mut self, axes: &[usize], mut lost: PartLosses) -> Result<bool> {
        while let Some((start, end)) = self.lines.next_whole(&mut lost)? {
            let line = self.lines.text(start, end);
            let mut fields = Fields::new(line, Delimiter::blanks_or_commas(line));
            for n in 0..=axes.last().copied().unwrap_or(0) {
                let Some(field) = fields.next() else { break };
                if axes.contains(&n) && number::loses_digits(field) {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }
}
