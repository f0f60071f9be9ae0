//! PTX: scans of a terrestrial scanner, each a grid of cells below ten lines of its own.
//!
//! These say how many columns and rows the grid has, where the scanner stood, and a matrix that
//! brings the points of this scan, as row vectors with a 1, to the coordinates that all scans
//! share. Cells follow column by column; one of which no light came back is `0 0 0`, and is no
//! point.

use std::fs::File;
use std::path::Path;

use super::names::LONGEST_LINE;
use super::survey::{Surveyor, TextSurvey};
use crate::io::rows::fields::{Delimiter, Fields};
use crate::io::rows::lines::Lines;
use crate::io::rows::number;
use crate::point::Scalar;
use crate::stage::foreign;
use crate::{Error, Result};

/// The family of PTX.
pub(super) const FAMILY: &str = "PTX";

/// What messages call a PTX file.
pub(super) const CALLED: &str = "a PTX file";

/// Scans of one file that are told apart.
const SCANS_MOST: usize = u16::MAX as usize;

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
    /// Where a point of the scan is in the coordinates of all.
    pub fn placed(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let [a, b, c, d] = self.pose;
        [0, 1, 2].map(|i| x * a[i] + y * b[i] + z * c[i] + d[i])
    }
}

/// True for the coordinates of a cell that has no point.
pub(super) fn is_empty(coordinates: [&[u8]; 3]) -> bool {
    let is_zero = |field: &[u8]| field.iter().all(|b| b"0.+-".contains(b)) && field.contains(&b'0');
    coordinates.into_iter().all(is_zero)
}

/// True if a file that begins so is PTX: two lines of one whole number and four of three numbers.
pub(super) fn sniff(first: &[u8]) -> bool {
    let mut lines = first.split(|&b| b == b'\n');
    let mut numbers = || lines.next().map(|line| Delimiter::Blanks.numbers(line));
    let counts = [1, 1, 3, 3, 3, 3];
    counts.into_iter().all(|count| numbers().flatten() == Some(count))
}

/// What a PTX file holds.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PtxText {
    pub scans: Vec<PtxScan>,
    /// Numbers on a line.
    pub columns: usize,
}

struct PtxReader<'a> {
    path: &'a Path,
    lines: Lines<'a>,
}

impl PtxReader<'_> {
    fn fail(&self, told: String, at: u64) -> Error {
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

    /// The ten lines of the next scan; None at the end of the file.
    fn scan(&mut self) -> Result<Option<PtxScan>> {
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
fn begin<'a>(file: File, path: &'a Path, length: u64) -> Result<PtxReader<'a>> {
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

/// Looks through a PTX file.
///
/// # Errors
///
/// The first line that is not what it should be, and a file that ends before its cells do.
pub(super) fn survey(file: File, path: &Path, length: u64) -> Result<(PtxText, TextSurvey)> {
    let mut reader = begin(file, path, length)?;
    let mut scans: Vec<PtxScan> = Vec::new();
    let mut surveyor: Option<Surveyor<'_>> = None;
    loop {
        let Some(scan) = reader.scan()? else { break };
        if scans.len() == SCANS_MOST {
            let told = format!("it has more than {SCANS_MOST} scans");
            return Err(reader.fail(told, reader.lines.at()));
        }
        for cell in 0..scan.columns * scan.rows {
            let Some((start, end)) = reader.lines.next()? else {
                let (n, cells) = (scans.len() + 1, scan.columns * scan.rows);
                let told = format!("the file ends after {cell} of {cells} cells of scan {n}");
                return Err(Error::data(path, told)
                    .at_byte(length)
                    .help("the file is cut short, or the counts before its cells are wrong"));
            };
            let (text, at, line) =
                (reader.lines.text(start, end), reader.lines.byte(start), reader.lines.number());
            let surveyor = surveyor.get_or_insert_with(|| {
                let columns = Delimiter::Blanks.numbers(text).unwrap_or(3).max(3);
                let looks = (0..columns).map(|n| n >= 3).collect();
                Surveyor::new(path, Delimiter::Blanks, looks)
            });
            surveyor.begin(at, line - 1, scans.len(), cell, cell == 0);
            let mut fields = Fields::new(text, Delimiter::Blanks);
            let mut next = || fields.next().unwrap_or_default();
            match is_empty([next(), next(), next()]) {
                true => surveyor.pass(text, line, at)?,
                false => surveyor.add(text, line, at)?,
            }
        }
        if let Some(surveyor) = &mut surveyor {
            surveyor.end(reader.lines.at());
        }
        scans.push(scan);
    }
    let Some(surveyor) = surveyor else {
        let none = Surveyor::new(path, Delimiter::Blanks, vec![false, false, false, true]);
        return Ok((PtxText { scans, columns: 4 }, none.finish(length, None)));
    };
    let survey = surveyor.finish(length, None);
    Ok((PtxText { scans, columns: survey.facts.len() }, survey))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";

    fn surveyed(text: &str) -> Result<(PtxText, TextSurvey)> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ptx");
        std::fs::write(&path, text).unwrap();
        survey(File::open(&path).unwrap(), &path, text.len() as u64)
    }

    #[test]
    fn scans_have_their_grids_and_poses_and_empty_cells_are_no_points() {
        let turned = "0 1 0 0\n-1 0 0 0\n0 0 1 0\n10 20 30 1\n";
        let cells = "1 2 3 0.5\n0.000 -0 0 0.5\n";
        let text = format!("1\n2\n{HEAD}{turned}{cells}2\n1\n{HEAD}{turned}{cells}");
        assert!(sniff(text.as_bytes()));
        let (ptx, survey) = surveyed(&text).unwrap();
        assert_eq!((ptx.columns, ptx.scans.len(), survey.points), (4, 2, 2));
        assert_eq!((ptx.scans[1].columns, ptx.scans[1].rows), (2, 1));
        assert_eq!(ptx.scans[0].placed([1.0, 2.0, 3.0]), [8.0, 21.0, 33.0]);
        assert_eq!(survey.stretches.len(), 2);
        assert_eq!((survey.stretches[1].first, survey.stretches[1].points), (1, 1));
        assert_eq!(&text[survey.stretches[1].span[0] as usize..][..9], "1 2 3 0.5");
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        let pose = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
        let told = |text: &str| surveyed(text).unwrap_err().to_string();
        let cut = format!("2\n2\n{HEAD}{pose}1 2 3 0.5\n");
        assert!(told(&cut).contains("after 1 of 4 cells of scan 1"));
        let more = format!("1\n1\n{HEAD}{pose}1 2 3 0.5\n1 2 3 0.5\n");
        assert!(told(&more).contains("line 12 has more than 1 numbers"));
        assert!(told("1 2 3\n").contains("by its first bytes"));
        let odd = format!("1\n1\n{HEAD}{}1 2 3 0.5\n", pose.replace("0 0 1 0", "0 0 1 7"));
        assert!(told(&odd).contains("the matrix of a scan"));
    }
}
