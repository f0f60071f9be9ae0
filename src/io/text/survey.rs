//! What is in a text, found by looking through it once: points, types, and where threads may begin.

use std::fs::File;
use std::path::Path;

use super::head::TextHead;
use super::names::LONGEST_LINE;
use crate::io::damage::PartLosses;
use crate::io::rows::facts::ColumnFacts;
use crate::io::rows::fields::{Delimiter, Fields, is_comment, is_count};
use crate::io::rows::lines::{Lines, shown};
use crate::{Error, Result};

/// Bytes of text that one part reads at least.
const PART_BYTES: u64 = 1 << 22;

/// Lines that one part reads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TextStretch {
    /// Bytes from where to where.
    pub span: [u64; 2],
    /// Lines before it.
    pub before: u64,
    /// Points before it in the file, and in it.
    pub first: u64,
    pub points: u64,
    /// In PTX: which scan of the file it is of, and cells of that scan before it.
    pub scan: usize,
    pub cells: u64,
}

/// What a survey finds.
#[derive(Debug, Clone)]
pub(super) struct TextSurvey {
    /// Of every column.
    pub facts: Vec<ColumnFacts>,
    /// In the order of the file.
    pub stretches: Vec<TextStretch>,
    pub points: u64,
    /// How many points lines with one number say that there are.
    pub claimed: Option<u64>,
    /// Lines that are wrong, and passed over.
    pub lost: PartLosses,
}

/// Collects the facts and stretches of a text.
pub(super) struct Surveyor<'a> {
    path: &'a Path,
    separator: Delimiter,
    facts: Vec<ColumnFacts>,
    /// What these were before the last line that was added as a whole.
    before: Vec<ColumnFacts>,
    /// Columns of which the numbers are looked at; the others are only counted.
    looks: Vec<bool>,
    stretches: Vec<TextStretch>,
    points: u64,
}

impl<'a> Surveyor<'a> {
    pub fn new(path: &'a Path, separator: Delimiter, looks: Vec<bool>) -> Self {
        let facts = vec![ColumnFacts::NONE; looks.len()];
        let (before, stretches) = (Vec::new(), Vec::new());
        Surveyor { path, separator, facts, before, looks, stretches, points: 0 }
    }

    /// Numbers of a line.
    pub fn columns(&self) -> usize {
        self.looks.len()
    }

    /// As [`add`](Self::add), but a line that is wrong says nothing of the columns.
    pub fn add_whole(&mut self, text: &[u8], line: u64, at: u64) -> Result<()> {
        self.before.clone_from(&self.facts);
        let added = self.add(text, line, at);
        if added.is_err() {
            self.facts.clone_from(&self.before);
        }
        added
    }

    /// Adds the line `text`, number `line`, which begins at byte `at`.
    pub fn add(&mut self, text: &[u8], line: u64, at: u64) -> Result<()> {
        let mut fields = Fields::new(text, self.separator);
        for (n, (looks, facts)) in self.looks.iter().zip(&mut self.facts).enumerate() {
            let Some(field) = fields.next() else {
                return Err(few(self.path, line, n, self.looks.len()).at_byte(at));
            };
            if *looks && !facts.add(field) {
                let at = at + (fields.place() - field.len()) as u64;
                return Err(no_number(self.path, line, n, field).at_byte(at));
            }
        }
        if fields.next().is_some() {
            let told = format!("line {line} has more than the {} numbers", self.looks.len());
            return Err(Error::data(self.path, format!("{told} of the first point"))
                .at_byte(at)
                .help(CORRECT));
        }
        self.points += 1;
        Ok(())
    }

    /// Begins a new stretch at byte `at` if the last one is long enough, or `must` end.
    pub fn begin(&mut self, at: u64, before: u64, scan: usize, cells: u64, must: bool) {
        if let Some(last) = self.stretches.last_mut() {
            if !must && at - last.span[0] < PART_BYTES {
                return;
            }
            last.span[1] = last.span[1].min(at);
            last.points = self.points - last.first;
        }
        let (span, first) = ([at, u64::MAX], self.points);
        self.stretches.push(TextStretch { span, before, first, points: 0, scan, cells });
    }

    /// Says that the stretch ends at byte `at`.
    pub fn end(&mut self, at: u64) {
        if let Some(last) = self.stretches.last_mut() {
            last.span[1] = last.span[1].min(at);
            last.points = self.points - last.first;
        }
    }

    /// Says that the line that was added last is no point.
    pub fn take_back(&mut self) {
        self.points = self.points.saturating_sub(1);
    }

    pub fn finish(mut self, end: u64, claimed: Option<u64>) -> TextSurvey {
        self.end(end);
        self.stretches.retain(|stretch| stretch.points > 0);
        let Surveyor { facts, stretches, points, .. } = self;
        TextSurvey { facts, stretches, points, claimed, lost: PartLosses::default() }
    }
}

/// What helps where a line is wrong.
pub(super) const CORRECT: &str =
    "correct the line, or write the file again: each line has as many numbers as the first";

/// The error of a line with too few numbers.
pub(super) fn few(path: &Path, line: u64, found: usize, columns: usize) -> Error {
    let told = format!("line {line} has {found} numbers, the first point has {columns}");
    Error::data(path, told).help(CORRECT)
}

/// The error of a field that is no number.
pub(super) fn no_number(path: &Path, line: u64, column: usize, field: &[u8]) -> Error {
    let field = shown(&String::from_utf8_lossy(field));
    let told = format!("line {line}: `{field}` in column {} is no number", column + 1);
    Error::data(path, told).help(CORRECT)
}

/// What a text says of the number of its points, if it has more.
///
/// # Errors
///
/// If it has fewer, unless it is read without those that are missing: they are lost at its end.
pub(super) fn belied(path: &Path, length: u64, found: &mut TextSurvey) -> Result<Option<String>> {
    let (points, claimed) = (found.points, found.claimed.unwrap_or(found.points));
    let missing = claimed.saturating_sub(points + found.lost.points());
    if missing > 0 {
        let told = format!("it says that it has {claimed} points, and ends after {points}");
        let error = Error::data(path, told)
            .at_byte(length)
            .help("the file is cut short, or the number is wrong: correct it");
        found.lost.lose(path, length, missing, error)?;
        return Ok(None);
    }
    let told = || format!("it says that it has {claimed} points, and has {points}");
    Ok((claimed < points).then(told))
}

/// Looks through a text that begins with `head`; `looks` says at which of its columns. What is
/// wrong is counted in `lost`.
///
/// # Errors
///
/// The first line that has more or fewer numbers than the first point, or something else, unless
/// such lines are passed over.
pub(super) fn survey(
    file: File,
    path: &Path,
    length: u64,
    head: &TextHead,
    looks: Vec<bool>,
    mut lost: PartLosses,
) -> Result<TextSurvey> {
    let mut lines = Lines::new(file, path, [head.body, length], head.lines, LONGEST_LINE);
    let mut surveyor = Surveyor::new(path, head.separator, looks);
    let mut claimed: Option<u64> = None;
    while let Some((start, end)) = lines.next_whole(&mut lost)? {
        let (text, at) = (lines.text(start, end), lines.byte(start));
        let text = super::head::without_mark(text, at);
        if is_comment(text).is_some() {
            continue;
        }
        if is_count(text) {
            let count = std::str::from_utf8(text.trim_ascii()).ok().and_then(|t| t.parse().ok());
            claimed = Some(claimed.unwrap_or(0).saturating_add(count.unwrap_or(u64::MAX)));
            continue;
        }
        surveyor.begin(at, lines.number() - 1, 0, 0, false);
        let added = match lost.mends() {
            true => surveyor.add_whole(text, lines.number(), at),
            false => surveyor.add(text, lines.number(), at),
        };
        if let Err(error) = added {
            lost.lose(path, at, 1, error)?;
        }
    }
    Ok(TextSurvey { lost, ..surveyor.finish(length, claimed) })
}
