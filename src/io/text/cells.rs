//! What is in the cells of a PTX file, found by looking through it once; around damage, where that
//! is wanted.
//!
//! A line that is no cell is one that is lost, and the cells behind it keep their places. If the
//! next scan begins there, the rest of the cells is. Of a scan whose first lines are wrong nobody
//! knows grid and pose: its cells are passed over up to the next scan whose first lines are right.

use std::fs::File;
use std::path::Path;

use super::names::LONGEST_LINE;
use super::ptx::{HEAD_LINES, PtxReader, PtxScan, begin, is_empty, may_begin_scan};
use super::survey::{Surveyor, TextSurvey};
use crate::error::shown;
use crate::io::damage::{PartLosses, advised};
use crate::io::rows::fields::{Delimiter, is_count};
use crate::io::rows::lines::Lines;
use crate::{Error, ErrorKind, Result};

/// Scans of one file that are told apart.
const SCANS_MOST: usize = u16::MAX as usize;
/// Bytes that the first lines of a scan take at most where they are looked for.
const HEAD_BYTES: u64 = 1 << 13;
/// Cells that are asked how many numbers one has.
const ASKED: u64 = 100;

/// What a PTX file holds.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PtxText {
    pub scans: Vec<PtxScan>,
    /// Numbers on a line.
    pub columns: usize,
    /// Cells without a point.
    pub empty: u64,
    /// What is wrong with it and cost no point.
    pub warnings: Vec<String>,
}

/// Looks through a PTX file; what is wrong is counted in `lost`.
///
/// # Errors
///
/// The first line that is not what it should be, and a file that ends before its cells do, unless
/// such are passed over.
pub(super) fn survey_cells(
    file: File,
    path: &Path,
    length: u64,
    lost: PartLosses,
) -> Result<(PtxText, TextSurvey)> {
    let again = file.try_clone().map_err(|e| Error::io(path, "open once more", e))?;
    let mut survey = CellSurvey {
        path,
        file: again,
        length,
        reader: begin(file, path, length)?,
        surveyor: None,
        text: PtxText { scans: Vec::new(), columns: 4, empty: 0, warnings: Vec::new() },
        lost,
    };
    loop {
        let begins = [survey.reader.lines.at(), survey.reader.lines.number()];
        match survey.reader.scan() {
            Ok(None) => break,
            Ok(Some(scan)) => survey.cells(scan)?,
            Err(error) => survey.pass_over(begins, error)?,
        }
    }
    let CellSurvey { surveyor, mut text, lost, .. } = survey;
    let surveyor = surveyor
        .unwrap_or_else(|| Surveyor::new(path, Delimiter::Blanks, vec![false, false, false, true]));
    let found = surveyor.finish(length, None);
    text.columns = found.facts.len();
    Ok((text, TextSurvey { lost, ..found }))
}

struct CellSurvey<'a> {
    path: &'a Path,
    file: File,
    length: u64,
    reader: PtxReader<'a>,
    /// None before the first cell.
    surveyor: Option<Surveyor<'a>>,
    text: PtxText,
    lost: PartLosses,
}

impl<'a> CellSurvey<'a> {
    /// Looks through the cells of the next scan.
    fn cells(&mut self, scan: PtxScan) -> Result<()> {
        let cells = scan.columns * scan.rows;
        let (mut cell, mut is_new) = (0, true);
        while cell < cells {
            let mut byte = self.reader.lines.at();
            let number = self.text.scans.len() + 1;
            let (error, gone) = match self.reader.lines.next_or_error(self.lost.mends()) {
                Ok(Some(line)) => match self.cell(line, [cell, cells], &mut is_new) {
                    Ok(()) => {
                        cell += 1;
                        continue;
                    }
                    Err(_) if self.turns_to_scan(line)? => {
                        let told = format!(
                            "scan {number} has {cell} of its {cells} cells, and the next begins"
                        );
                        byte = self.reader.lines.at();
                        (Error::data(self.path, told), cells - cell)
                    }
                    Err(error) => (error, 1),
                },
                Ok(None) => {
                    let told =
                        format!("the file ends after {cell} of {cells} cells of scan {number}");
                    let error = Error::data(self.path, told).at_byte(self.length);
                    (error.help(CUT), cells - cell)
                }
                Err(error) => (error, 1),
            };
            self.lost.lose(self.path, error.byte().unwrap_or(byte), gone, error)?;
            cell += gone;
        }
        if let Some(surveyor) = &mut self.surveyor {
            surveyor.end(self.reader.lines.at());
        }
        self.add_scan(scan)
    }

    /// Adds the line of a cell, one of so many, which may be the first of its scan.
    fn cell(
        &mut self,
        (start, end): (usize, usize),
        [cell, cells]: [u64; 2],
        is_new: &mut bool,
    ) -> Result<()> {
        let mends = self.lost.mends();
        let lines = &self.reader.lines;
        let (at, line) = (lines.byte(start), lines.number());
        if self.surveyor.is_none() {
            let columns = self.columns((start, end), cells - cell)?;
            // Lines that are wrong are to be known before they are read.
            let looks = (0..columns).map(|n| n >= 3 || mends).collect();
            self.surveyor = Some(Surveyor::new(self.path, Delimiter::Blanks, looks));
        }
        let Some(surveyor) = &mut self.surveyor else { return Ok(()) };
        let text = self.reader.lines.text(start, end);
        surveyor.begin(at, line - 1, self.text.scans.len(), cell, *is_new);
        *is_new = false;
        match mends {
            true => surveyor.add_whole(text, line, at)?,
            false => surveyor.add(text, line, at)?,
        }
        if is_empty(text) {
            surveyor.take_back();
            self.text.empty += 1;
        }
        Ok(())
    }

    /// How many numbers a cell has: as the first of those that are left, or, if that may be wrong,
    /// as most.
    fn columns(&self, (start, end): (usize, usize), left: u64) -> Result<usize> {
        let lines = &self.reader.lines;
        let numbers = |text: &[u8]| Delimiter::Blanks.numbers(text).filter(|&n| n >= 3);
        let first = numbers(lines.text(start, end));
        if !self.lost.mends() {
            return Ok(first.unwrap_or(3));
        }
        let mut lines = self.lines([lines.byte(start), self.length], lines.number() - 1)?;
        let mut counts = [0; 8];
        for _ in 0..left.min(ASKED) {
            match lines.next_or_error(true) {
                Ok(Some((start, end))) => {
                    let known = [3, 4, 6, 7]
                        .into_iter()
                        .find(|&n| Some(n) == numbers(lines.text(start, end)));
                    counts[known.unwrap_or(0)] += 1;
                }
                Ok(None) => break,
                Err(error) if error.kind() == ErrorKind::Data => {}
                Err(error) => return Err(error),
            }
        }
        let most = [3, 4, 6, 7].into_iter().max_by_key(|&n| counts[n]);
        Ok(most.filter(|&n| counts[n] > 0).unwrap_or(4))
    }

    /// If damage is mended and the first lines of a scan begin with this one, goes back to it.
    fn turns_to_scan(&mut self, (start, end): (usize, usize)) -> Result<bool> {
        let lines = &self.reader.lines;
        // Most lines that are no cell begin no scan either, and a second reader is dear.
        let may_begin = || is_count(lines.text(start, end)) && may_begin_scan(lines.held(start));
        if !self.lost.mends() || !may_begin() {
            return Ok(false);
        }
        let (from, before) = (lines.byte(start), lines.number() - 1);
        let span = [from, self.length.min(from + HEAD_BYTES)];
        let mut ahead = PtxReader { path: self.path, lines: self.lines(span, before)? };
        if !matches!(ahead.scan(), Ok(Some(_))) {
            return Ok(false);
        }
        self.reader.lines = self.lines([from, self.length], before)?;
        Ok(true)
    }

    /// Goes on behind lines that do not begin a scan, from this byte and behind so many lines on.
    fn pass_over(&mut self, [from, before]: [u64; 2], error: Error) -> Result<()> {
        if !self.lost.mends() || error.kind() != ErrorKind::Data {
            return Err(advised(error));
        }
        self.reader.lines = self.lines([from, self.length], before)?;
        let passed = self.passed()?;
        let number = self.text.scans.len();
        let why = match passed.is_scan {
            true => format!(
                "{}, and without its first lines nobody knows where the points of scan {} are",
                error.message(),
                number + 1
            ),
            false => format!(
                "line {} is behind all cells of scan {number}, and begins no other",
                before + 1
            ),
        };
        if passed.is_scan {
            self.add_scan(PtxScan::UNREAD)?;
        }
        let byte = error.byte().unwrap_or(from);
        match passed.points {
            0 => self.text.warnings.push(format!("{}: at byte {byte}: {why}", shown(self.path))),
            points => self.lost.lose(self.path, byte, points, Error::data(self.path, why))?,
        }
        Ok(())
    }

    /// Passes over lines up to the next scan whose first lines are right.
    fn passed(&mut self) -> Result<Passed> {
        let mut passed = Passed { is_scan: false, points: 0 };
        let columns = self.surveyor.as_ref().map(Surveyor::columns);
        let (mut counts, mut cells) = (Vec::new(), 0);
        for n in 0u64.. {
            let (start, end) = match self.reader.lines.next_or_error(true) {
                Ok(Some(line)) => line,
                Ok(None) => break,
                Err(error) if error.kind() == ErrorKind::Data => continue,
                Err(error) => return Err(error),
            };
            if n > 0 && self.turns_to_scan((start, end))? {
                break;
            }
            let text = self.reader.lines.text(start, end);
            passed.is_scan |= n == 0 && is_count(text);
            if passed.is_scan && n < HEAD_LINES {
                let count = std::str::from_utf8(text).ok().and_then(|t| t.trim().parse().ok());
                counts.extend(count.filter(|_| n < 2).map(|count: u32| u64::from(count)));
                continue;
            }
            let numbers = Delimiter::Blanks.numbers(text).filter(|&numbers| numbers >= 3);
            if numbers.is_some_and(|numbers| columns.is_none_or(|columns| columns == numbers)) {
                cells += 1;
                passed.points += u64::from(!is_empty(text));
            }
        }
        // Cells that it counts and does not have are lost as well.
        if let [columns, rows] = counts[..] {
            passed.points += (columns * rows).saturating_sub(cells);
        }
        Ok(passed)
    }

    fn add_scan(&mut self, scan: PtxScan) -> Result<()> {
        if self.text.scans.len() == SCANS_MOST {
            let told = format!("it has more than {SCANS_MOST} scans");
            return Err(self.reader.fail(told, self.reader.lines.at()));
        }
        self.text.scans.push(scan);
        Ok(())
    }

    /// The lines from one byte to another, behind so many lines.
    fn lines(&self, span: [u64; 2], before: u64) -> Result<Lines<'a>> {
        let file = self.file.try_clone().map_err(|e| Error::io(self.path, "open once more", e))?;
        Ok(Lines::new(file, self.path, span, before, LONGEST_LINE))
    }
}

/// Lines that were passed over.
struct Passed {
    /// True if they begin as a scan does.
    is_scan: bool,
    /// Points among them, and cells that they count and do not have.
    points: u64,
}

/// What helps where a file ends too early.
const CUT: &str = "the file is cut short, or the counts before its cells are wrong";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::OnError;

    const HEAD: &str = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";

    fn surveyed(text: &str) -> Result<(PtxText, TextSurvey)> {
        surveyed_with(text, PartLosses::default())
    }

    fn surveyed_with(text: &str, lost: PartLosses) -> Result<(PtxText, TextSurvey)> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ptx");
        std::fs::write(&path, text).unwrap();
        let file = File::open(&path).unwrap();
        survey_cells(file, &path, text.len() as u64, lost)
    }

    #[test]
    fn scans_have_their_grids_and_poses_and_empty_cells_are_no_points() {
        let turned = "0 1 0 0\n-1 0 0 0\n0 0 1 0\n10 20 30 1\n";
        let cells = "1 2 3 0.5\n0.000 -0 0 0.5\n";
        let text = format!("1\n2\n{HEAD}{turned}{cells}2\n1\n{HEAD}{turned}{cells}");
        assert!(crate::io::text::ptx::sniff(text.as_bytes()));
        let (ptx, survey) = surveyed(&text).unwrap();
        assert_eq!((ptx.columns, ptx.scans.len(), survey.points, ptx.empty), (4, 2, 2, 2));
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

    #[test]
    fn lines_that_are_no_cell_are_looked_at_where_they_are_held() {
        use crate::io::text::ptx::may_begin_scan;
        let pose = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
        let head = format!("3\n2\n{HEAD}{pose}");
        for text in ["5\n5\n5\n", "5\n1 2 3\n", "5\nfive\n", "5\r5\r1 2 3\r5\r"] {
            assert!(!may_begin_scan(text.as_bytes()), "{text:?}");
        }
        // Where the bytes end before that is known, whoever reads on finds out.
        for end in 0..=head.len() {
            assert!(may_begin_scan(&head.as_bytes()[..end]), "{end}");
        }
        assert!(may_begin_scan(head.replace('\n', " \r\n\r\n").as_bytes()));
    }

    #[test]
    fn a_scan_behind_lines_that_are_no_cell_is_found_wherever_the_window_ends() {
        let pose = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
        let head = |rows: usize| format!("1\n{rows}\n{HEAD}{pose}");
        let first = head(1 << 20) + "1 2 3 0.5\n";
        let next = head(1) + "4 5 6 0.5\n";
        let window = Lines::bytes(LONGEST_LINE);
        for end in (0..=next.len()).step_by(3) {
            let between = "5\n".repeat((window - first.len() - end) / 2);
            let text = format!("{first}{between}{next}");
            let lost = PartLosses::new(OnError::Salvage);
            let (ptx, survey) = surveyed_with(&text, lost).unwrap();
            assert_eq!((ptx.scans.len(), survey.points), (2, 2), "{end}");
            // The cells behind these lines are lost with them, and no line is one twice.
            let last = survey.lost.told().pop().unwrap();
            assert!(last.contains("1,048,575 points are lost"), "{end}: {last}");
        }
    }
}
