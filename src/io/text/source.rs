//! Reads texts as one scan, stretch by stretch.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::cells::{PtxText, survey_cells};
use super::columns::{dimensions, guessed, scalar};
use super::head::{TextHead, without_mark};
use super::names::{LONGEST_LINE, RECORDS};
use super::ptx::{self, PtxGrid, PtxScan};
use super::survey::{CORRECT, TextStretch, TextSurvey, belied, few, no_number, survey};
use crate::error::shown;
use crate::io::damage::PartLosses;
use crate::io::origin::Origin;
use crate::io::rows::facts::ColumnFacts;
use crate::io::rows::fields::{Delimiter, Fields, is_comment, is_count};
use crate::io::rows::lines::Lines;
use crate::io::rows::number;
use crate::io::rows::parts::PartEnds;
use crate::io::rows::schema::placed;
use crate::io::systems;
use crate::io::united::{assumes_dimensions, in_order, unlike};
use crate::point::names::{BLUE, COLUMN, GREEN, INTENSITY, NIR, POINT_SOURCE_ID, RED, ROW, XYZ};
use crate::point::{Dimension, Endian, Layout, Metadata, PointBatch, Scalar, Schema};
use crate::report::LostPoints;
use crate::stage::{Contradiction, Input, OnError, Part, ReadKeys, Source};
use crate::{Error, ErrorKind, Result};

/// Kinds of texts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TextKind {
    /// A point a line.
    Lines,
    /// The same, of known columns.
    Pts,
    /// Scans with grids and poses.
    Ptx,
}

/// One text that was looked through.
struct TextFile {
    path: PathBuf,
    origin: Origin,
    separator: Delimiter,
    /// What the columns are; None for those that are not read.
    columns: Vec<Option<String>>,
    scans: Vec<PtxScan>,
    found: TextSurvey,
    /// What it says of its points, and is not so.
    belied: Option<String>,
    warnings: Vec<String>,
}

impl TextFile {
    fn open(path: &Path, kind: TextKind, keys: &ReadKeys) -> Result<TextFile> {
        let (file, origin) = Origin::open(path)?;
        let opened = match kind {
            TextKind::Ptx => Self::ptx(file, path, &origin, keys.on_error),
            _ => Self::lines(file, path, &origin, kind, keys),
        }?;
        origin.unchanged()?;
        if opened.columns.iter().flatten().count() > DIMENSIONS_MOST {
            let told = format!("it has more than {DIMENSIONS_MOST} columns");
            return Err(Error::data(path, told).help("name those that are read in `read.columns`"));
        }
        Ok(opened)
    }

    fn lines(
        file: File,
        path: &Path,
        origin: &Origin,
        kind: TextKind,
        keys: &ReadKeys,
    ) -> Result<TextFile> {
        let length = origin.length();
        let asked = keys.columns.as_ref();
        let reads: Option<Vec<bool>> =
            asked.map(|names| names.iter().map(|name| name != "_").collect());
        let head = TextHead::read(file, path, length, reads.as_deref())?;
        let named = match &keys.columns {
            Some(names) if names.len() != head.columns => {
                let told = format!(
                    "`read.columns` names {} columns, and the first point has {} numbers",
                    names.len(),
                    head.columns
                );
                return Err(Error::pipeline(told).at(path).help("name a column `_` to skip it"));
            }
            given => given.as_ref().or(head.names.as_ref()),
        };
        let named = named.map(|names| dimensions(names)).transpose().map_err(|told| {
            let help = "`read.columns = [\"x\", \"y\", \"z\"]` would say what the columns are";
            Error::data(path, told).help(help)
        })?;
        let looks = |n: usize| match &named {
            None => n >= 3,
            Some(named) => named[n].as_deref().is_some_and(|name| !XYZ.contains(&name)),
        };
        // Lines that are wrong are to be known before they are read.
        let all = keys.on_error != OnError::Fail;
        let is_read = |n: usize| named.as_ref().is_none_or(|named| named[n].is_some());
        let looks = (0..head.columns).map(|n| looks(n) || all && is_read(n)).collect();
        let lost = PartLosses::new(keys.on_error);
        let mut found = survey(origin.reopen()?, path, length, &head, looks, lost)?;
        let mut warnings = Vec::new();
        let columns = match named {
            Some(named) => named,
            None => {
                let (names, told) = guessed(path, &found.facts, kind == TextKind::Pts)?;
                warnings.extend(told);
                names.into_iter().map(|name| Some(name.to_owned())).collect()
            }
        };
        let belied = belied(path, length, &mut found)?;
        let (path, origin) = (path.to_owned(), origin.clone());
        let separator = head.separator;
        Ok(TextFile {
            path,
            origin,
            separator,
            columns,
            scans: Vec::new(),
            found,
            belied,
            warnings,
        })
    }

    fn ptx(file: File, path: &Path, origin: &Origin, on_error: OnError) -> Result<TextFile> {
        let lost = PartLosses::new(on_error);
        let (text, found) = survey_cells(file, path, origin.length(), lost)?;
        let PtxText { scans, columns, empty, mut warnings } = text;
        let further: &[&str] = match columns {
            3 => &[],
            4 => &[INTENSITY],
            6 => &[RED, GREEN, BLUE],
            7 => &[INTENSITY, RED, GREEN, BLUE],
            _ => {
                let told = format!("a cell of PTX has 3, 4, 6 or 7 numbers, not {columns}");
                return Err(Error::data(path, told));
            }
        };
        let names = XYZ.iter().chain(further);
        let columns = names.map(|&name| Some(name.to_owned())).collect();
        let cells = empty + found.points;
        let told = format!("{}: {empty} of {cells} cells have no point", shown(path));
        warnings.extend((empty > 0).then_some(told));
        let (path, origin) = (path.to_owned(), origin.clone());
        let (separator, belied) = (Delimiter::Blanks, None);
        Ok(TextFile { path, origin, separator, columns, scans, found, belied, warnings })
    }
}

/// The most columns that are read.
const DIMENSIONS_MOST: usize = 256;

/// Opens texts whose columns are the same.
///
/// # Errors
///
/// A file that is no such text, columns of which nobody says what they are, a line that is not like
/// the others, and files whose columns differ.
pub(super) fn open(paths: &[PathBuf], kind: TextKind, keys: &ReadKeys) -> Result<Box<dyn Source>> {
    let files = paths.iter().map(|path| TextFile::open(path, kind, keys));
    let files = files.collect::<Result<Vec<_>>>()?;
    let Some(first) = files.first() else {
        return Err(Error::pipeline("no text to read"));
    };
    if let Some(other) = files.iter().find(|file| file.columns != first.columns)
        && !assumes_dimensions(keys)
    {
        let [own, others] = [other, first].map(|file| file.columns.iter().flatten());
        return Err(unlike([&*other.path, &first.path], "columns", own, others));
    }
    let schema = Arc::new(schema(&files, kind == TextKind::Ptx));
    let ends = PartEnds::of(files.iter().map(|file| file.found.stretches.len()));
    let metadata = systems::said(keys);
    Ok(Box::new(TextSource { schema, metadata, files, ends }))
}

/// What holds the points of all files, of each column what holds its numbers in all of them.
fn schema(files: &[TextFile], is_ptx: bool) -> Schema {
    let names = |file: &TextFile| file.columns.iter().flatten().cloned().collect();
    let mut facts: BTreeMap<&String, ColumnFacts> = BTreeMap::new();
    for file in files {
        for (name, own) in file.columns.iter().zip(&file.found.facts) {
            let Some(name) = name else { continue };
            facts.entry(name).and_modify(|all| all.join(own)).or_insert(*own);
        }
    }
    let of = |name: String| facts.get(&name).map(|facts| (name.clone(), scalar(&name, facts)));
    let names = in_order(files.iter().map(names).collect());
    let mut read: Vec<(String, Scalar)> = names.into_iter().filter_map(of).collect();
    // Colours have one depth: a channel whose numbers are all small is of 16 bits if another is.
    let is_color = |name: &str| [RED, GREEN, BLUE, NIR].contains(&name);
    if read.iter().any(|(name, scalar)| is_color(name) && *scalar == Scalar::U16) {
        let bytes =
            read.iter_mut().filter(|(name, scalar)| is_color(name) && *scalar == Scalar::U8);
        bytes.for_each(|(_, scalar)| *scalar = Scalar::U16);
    }
    let of_grid = [(ROW, Scalar::U32), (COLUMN, Scalar::U32), (POINT_SOURCE_ID, Scalar::U16)];
    let of_grid = of_grid.into_iter().filter(|_| is_ptx);
    let of_grid = of_grid.map(|(name, scalar)| (name.to_owned(), scalar));
    let (dimensions, stride) = placed(read.into_iter().chain(of_grid));
    let layout = if is_ptx { Layout::plain(ptx::FAMILY) } else { RECORDS };
    Schema { layout, endian: Endian::Little, stride, dimensions }
}

/// The points of one or several texts.
struct TextSource {
    schema: Arc<Schema>,
    metadata: Metadata,
    files: Vec<TextFile>,
    ends: PartEnds,
}

impl TextSource {
    /// The file of a part, and its stretch.
    fn place(&self, index: usize) -> Option<(usize, &TextFile, TextStretch)> {
        let (number, within) = self.ends.place(index);
        let file = self.files.get(number)?;
        Some((number, file, *file.found.stretches.get(within)?))
    }
}

impl Source for TextSource {
    fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn inputs(&self) -> Vec<Input> {
        self.files.iter().map(|file| Input::new(&file.path, file.found.points)).collect()
    }

    fn points(&self) -> u64 {
        self.files.iter().map(|file| file.found.points).sum()
    }

    fn part_bytes(&self) -> u64 {
        let fields = self.schema.dimensions.len() * size_of::<Option<Dimension>>();
        (Lines::bytes(LONGEST_LINE) + fields + self.schema.stride) as u64
    }

    fn parts(&self) -> usize {
        self.ends.parts()
    }

    fn first_record(&self, index: usize) -> Option<u64> {
        let (number, _, stretch) = self.place(index)?;
        let before: u64 = self.files[..number].iter().map(|file| file.found.points).sum();
        Some(before + stretch.first)
    }

    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>> {
        let Some((number, file, stretch)) = self.place(index) else {
            return Err(Error::internal(format!("part {index} of {}", self.parts())));
        };
        let handle = file.origin.reopen()?;
        let lines = Lines::new(handle, &file.path, stretch.span, stretch.before, LONGEST_LINE);
        let field = |name: &String| self.schema.find(name).cloned();
        let fields = file.columns.iter().map(|name| name.as_ref().and_then(field)).collect();
        let grid = file.scans.get(stretch.scan).map(|&scan| PtxGrid {
            scan,
            number: stretch.scan as u64 + 1,
            next: stretch.cells,
        });
        let (left, source) = (stretch.points, number as u32);
        let (schema, mends) = (&*self.schema, file.found.lost.mends());
        Ok(Box::new(TextPart { file, lines, fields, schema, grid, left, source, mends }))
    }

    fn warnings(&self) -> Vec<String> {
        let lost = |file: &TextFile| file.found.lost.told();
        self.files.iter().flat_map(|file| file.warnings.iter().cloned().chain(lost(file))).collect()
    }

    fn lost(&self) -> Vec<LostPoints> {
        self.files.iter().flat_map(|file| file.found.lost.list().to_vec()).collect()
    }

    fn contradictions(&self) -> Vec<Contradiction> {
        // The count of points stands in the first line.
        let of = |file: &TextFile| Some(Contradiction::new(&file.path, 0, file.belied.clone()?));
        self.files.iter().filter_map(of).collect()
    }
}

/// The points of one stretch.
struct TextPart<'a> {
    file: &'a TextFile,
    lines: Lines<'a>,
    /// Of every column, where its numbers go.
    fields: Vec<Option<Dimension>>,
    schema: &'a Schema,
    grid: Option<PtxGrid>,
    left: u64,
    source: u32,
    /// True if what is wrong is passed over: it was found when the file was looked through.
    mends: bool,
}

impl Part for TextPart<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        let outcome = self.fill(batch);
        self.file.origin.vouch(outcome, batch.is_empty())
    }
}

impl TextPart<'_> {
    fn fill(&mut self, batch: &mut PointBatch) -> Result<()> {
        batch.source = self.source;
        batch.clear();
        let points = self.left.min(batch.capacity() as u64) as usize;
        let stride = self.schema.stride;
        let records = batch.refill(points);
        // What the file lacks is 0.
        records.fill(0);
        for record in records.chunks_exact_mut(stride) {
            self.point(record)?;
            self.left -= 1;
        }
        Ok(())
    }

    /// Reads the next point.
    fn point(&mut self, record: &mut [u8]) -> Result<()> {
        loop {
            let next = match self.lines.next_or_error(self.mends) {
                Err(error) if self.passes(&error) => {
                    self.grid.iter_mut().for_each(|grid| grid.next += 1);
                    continue;
                }
                next => next?,
            };
            let Some((start, end)) = next else {
                let told = "the file has fewer points than when it was looked through";
                return Err(Error::data(&self.file.path, told).at_byte(self.lines.length()));
            };
            let at = self.lines.byte(start);
            let line = without_mark(self.lines.text(start, end), at);
            let is_point = match &mut self.grid {
                None => is_comment(line).is_none() && !is_count(line),
                Some(grid) => {
                    grid.next += 1;
                    !ptx::is_empty(line)
                }
            };
            if !is_point {
                continue;
            }
            match self.numbers(line, at, record) {
                Err(error) if self.passes(&error) => {}
                read => {
                    read?;
                    return self.grid.as_ref().map_or(Ok(()), |grid| grid.put(self.schema, record));
                }
            }
        }
    }

    /// True for what is wrong and passed over.
    fn passes(&self, error: &Error) -> bool {
        self.mends && error.kind() == ErrorKind::Data
    }

    /// Reads the numbers of a line that begins at byte `at`.
    fn numbers(&self, line: &[u8], at: u64, record: &mut [u8]) -> Result<()> {
        let (path, number) = (&self.file.path, self.lines.number());
        let mut fields = Fields::new(line, self.file.separator);
        for (n, target) in self.fields.iter().enumerate() {
            let Some(field) = fields.next() else {
                return Err(few(path, number, n, self.fields.len()).at_byte(at));
            };
            let Some(target) = target else { continue };
            if !number::parse(field, target.scalar, &mut record[target.offset..]) {
                let at = at + (fields.place() - field.len()) as u64;
                return Err(no_number(path, number, n, field).at_byte(at));
            }
        }
        match fields.next() {
            None => Ok(()),
            Some(_) => {
                let told = format!("line {number} has more than {} numbers", self.fields.len());
                Err(Error::data(path, told).at_byte(at).help(CORRECT))
            }
        }
    }
}
