//! PTX: scans of a terrestrial scanner, each a grid of cells below ten lines of its own.
//!
//! These say how many columns and rows the grid has, where the scanner stood, and a matrix that
//! brings the points of this scan, as row vectors with a 1, to the coordinates that all scans
//! share. Cells follow column by column; one of which no light came back is `0 0 0`, and is no
//! point. What is in the cells of a file `cells` finds.

use std::fs::File;
use std::path::Path;

use super::names::LONGEST_LINE;
use crate::io::rows::fields::{Delimiter, Fields};
use crate::io::rows::lines::Lines;
use crate::io::rows::number;
use crate::point::names::{COLUMN, POINT_SOURCE_ID, ROW};
use crate::point::{Endian, Scalar, Schema, Value};
use crate::stage::foreign;
use crate::{Error, Result};

/// The family of PTX.
pub(super) const FAMILY: &str = "PTX";

/// What messages call a PTX file.
pub(super) const CALLED: &str = "a PTX file";

/// How many numbers are on each line of a scan before its cells.
const HEAD: [usize; 10] = [1, 1, 3, 3, 3, 3, 4, 4, 4, 4];
/// Lines of a scan before its cells.
pub(super) const HEAD_LINES: u64 = HEAD.len() as u64;

/// First bytes that tell whether a file is PTX.
const FIRST: u64 = 512;

/// One scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PtxScan {
    /// Columns and rows of its grid.
    pub columns: u64,
    pub rows: u64,
    /// From its own coordinates to those of all.
    pose: [[f64; 4]; 4],
}

impl PtxScan {
    /// In the place of a scan whose first lines are wrong: no cell of it is read.
    pub const UNREAD: PtxScan = PtxScan { columns: 0, rows: 0, pose: [[0.0; 4]; 4] };

    /// Where a point of the scan is in the coordinates of all.
    pub fn placed(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let [a, b, c, d] = self.pose;
        [0, 1, 2].map(|i| x * a[i] + y * b[i] + z * c[i] + d[i])
    }
}

/// Where a part of PTX is in its scan.
pub(super) struct PtxGrid {
    pub scan: PtxScan,
    pub number: u64,
    /// The cell of the next line.
    pub next: u64,
}

impl PtxGrid {
    /// Brings the point of the last line to the coordinates of all scans, and says which cell it is
    /// of.
    pub fn put(&self, schema: &Schema, record: &mut [u8]) -> Result<()> {
        let missing = || Error::internal("a PTX record lacks a dimension");
        let axes = schema.coordinates().ok_or_else(missing)?;
        let own = axes.map(|axis| axis.world(record, Endian::Little));
        let all = self.scan.placed(own).map(Value::Double);
        let mut held = axes.iter().zip(all).all(|(axis, v)| axis.put(record, Endian::Little, v));
        let (cell, rows) = (self.next.saturating_sub(1), self.scan.rows.max(1));
        for (name, number) in
            [(ROW, cell % rows), (COLUMN, cell / rows), (POINT_SOURCE_ID, self.number)]
        {
            let field = schema.find(name).ok_or_else(missing)?;
            held &= field.put(record, Endian::Little, Value::Unsigned(number));
        }
        if held { Ok(()) } else { Err(Error::internal("a number of PTX does not fit its field")) }
    }
}

/// True for the line of a cell that has no point.
pub(super) fn is_empty(line: &[u8]) -> bool {
    let is_zero = |field: &[u8]| field.iter().all(|b| b"0.+-".contains(b)) && field.contains(&b'0');
    let mut fields = Fields::new(line, Delimiter::Blanks);
    (0..3).all(|_| fields.next().is_some_and(is_zero))
}

/// True if a file that begins so is PTX: two lines of one whole number and four of three numbers.
pub(super) fn sniff(first: &[u8]) -> bool {
    let mut lines = first.split(|&b| b == b'\n');
    let mut numbers = || lines.next().map(|line| Delimiter::Blanks.numbers(line));
    HEAD[..6].iter().all(|&count| numbers().flatten() == Some(count))
}

/// False if these bytes of a file, whose last line may be cut off, begin no scan: a look at as many
/// lines as tell it.
pub(super) fn may_begin_scan(held: &[u8]) -> bool {
    let is_end = |b: &u8| matches!(b, b'\n' | b'\r');
    let whole = held.split_inclusive(is_end).take_while(|line| line.last().is_some_and(is_end));
    let mut lines = whole.filter(|line| !line.trim_ascii().is_empty()).zip(HEAD);
    lines.all(|(line, count)| Delimiter::Blanks.numbers(line) == Some(count))
}

/// Reads the first lines of scans.
pub(super) struct PtxReader<'a> {
    pub path: &'a Path,
    pub lines: Lines<'a>,
}

impl PtxReader<'_> {
    /// An error at a byte.
    pub fn fail(&self, told: String, at: u64) -> Error {
        Error::data(self.path, told).at_byte(at).help(
            "each scan of PTX has two lines of counts, four of three numbers, four of four, and \
             then a line for each cell",
        )
    }

    /// The numbers of the next line, which are to be as many as this; None at the end of the file.
    fn numbers<const N: usize>(&mut self) -> Result<Option<[f64; N]>> {
        let Some((start, end)) = self.lines.next()? else { return Ok(None) };
        let (mut fields, mut all) =
            (Fields::new(self.lines.text(start, end), Delimiter::Blanks), [0.0; N]);
        let mut bytes = [0; 8];
        for number in &mut all {
            let read = |field| number::parse(field, Scalar::F64, &mut bytes);
            if !fields.next().is_some_and(read) {
                let told = format!("line {} is not {N} numbers", self.lines.number());
                return Err(self.fail(told, self.lines.byte(start)));
            }
            *number = f64::from_le_bytes(bytes);
        }
        match fields.next() {
            None => Ok(Some(all)),
            Some(_) => {
                let told = format!("line {} has more than {N} numbers", self.lines.number());
                Err(self.fail(told, self.lines.byte(start)))
            }
        }
    }

    /// The first lines of the next scan; None at the end of the file.
    pub fn scan(&mut self) -> Result<Option<PtxScan>> {
        let at = self.lines.at();
        let Some([columns]) = self.numbers()? else { return Ok(None) };
        let ended = |reader: &Self| {
            let told = "the file ends within the first lines of a scan".to_owned();
            reader.fail(told, reader.lines.length())
        };
        let Some([rows]) = self.numbers()? else { return Err(ended(self)) };
        for _ in 0..4 {
            let place: Option<[f64; 3]> = self.numbers()?;
            place.ok_or_else(|| ended(self))?;
        }
        let mut pose = [[0.0; 4]; 4];
        for line in &mut pose {
            *line = self.numbers()?.ok_or_else(|| ended(self))?;
        }
        let is_count = |v: f64| v.fract() == 0.0 && (0.0..=u32::MAX.into()).contains(&v);
        if !is_count(columns) || !is_count(rows) {
            let told = format!("{columns} columns and {rows} rows are no grid of a scan");
            return Err(self.fail(told, at));
        }
        let is_affine = pose.map(|line| line[3]) == [0.0, 0.0, 0.0, 1.0];
        if !is_affine || !pose.as_flattened().iter().all(|v| v.is_finite()) {
            let told = "the matrix of a scan moves points otherwise than by turning, scaling and \
                        shifting them";
            return Err(self.fail(told.to_owned(), at));
        }
        Ok(Some(PtxScan { columns: columns as u64, rows: rows as u64, pose }))
    }
}

/// Opens a file that begins as PTX does.
pub(super) fn begin<'a>(file: File, path: &'a Path, length: u64) -> Result<PtxReader<'a>> {
    let mut first = vec![0; length.min(FIRST) as usize];
    let failed = |e| Error::io(path, "read its first lines", e);
    std::os::unix::fs::FileExt::read_exact_at(&file, &mut first, 0).map_err(failed)?;
    if !sniff(&first) {
        return Err(foreign(path, CALLED));
    }
    Ok(PtxReader { path, lines: Lines::new(file, path, [0, length], 0, LONGEST_LINE) })
}

/// Numbers on the line of the first cell, and the byte where it begins.
pub(super) fn first_cell(file: File, path: &Path, length: u64) -> Result<(usize, u64)> {
    let mut reader = begin(file, path, length)?;
    reader.scan()?;
    let Some((start, end)) = reader.lines.next()? else { return Ok((4, length)) };
    let columns = Delimiter::Blanks.numbers(reader.lines.text(start, end));
    Ok((columns.unwrap_or(4), reader.lines.byte(start)))
}
