//! Reads vertices as one scan.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::kind::VerticesKind;
use super::lines::{LONGEST_LINE, VertexLine, VertexTexts, sniff};
use super::stl::{self, StlPart};
use crate::error::shown;
use crate::io::origin::Origin;
use crate::io::rows::facts::ColumnFacts;
use crate::io::rows::lines::Lines;
use crate::io::rows::number;
use crate::io::rows::parts::PartEnds;
use crate::io::rows::schema::placed;
use crate::io::systems;
use crate::point::names::{BLUE, GREEN, NORMAL, RED, XYZ};
use crate::point::{Dimension, Endian, Layout, Metadata, PointBatch, Scalar, Schema, Value};
use crate::report::Grouped;
use crate::stage::{Input, Part, ReadKeys, Source, foreign};
use crate::{Error, Result};

/// Facets of one part of a binary file.
const PART_FACETS: u64 = 1 << 16;

/// What the numbers of a vertex are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum VertexNumber {
    /// This dimension.
    Of(&'static str),
    /// A colour.
    Color(&'static str),
    /// Nothing that is read.
    Skipped,
}

/// How colours are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum VertexShade {
    /// 0 to 255.
    Bytes,
    /// 0 to 1; held as 16 bits.
    Fractions,
}

/// One file.
struct VerticesFile {
    path: PathBuf,
    origin: Origin,
    points: u64,
    /// Facets of a binary STL.
    facets: Option<u64>,
    numbers: Vec<VertexNumber>,
    shade: VertexShade,
    warnings: Vec<String>,
}

const COLORS: [&str; 3] = [RED, GREEN, BLUE];

impl VerticesFile {
    fn open(path: &Path, kind: VerticesKind) -> Result<VerticesFile> {
        let (file, origin) = Origin::open(path)?;
        let length = origin.length();
        let mut first = vec![0; length.min(512) as usize];
        let read = std::os::unix::fs::FileExt::read_exact_at(&file, &mut first, 0);
        read.map_err(|e| Error::io(path, "read it", e))?;
        let is_text = sniff(&first, kind);
        if kind == VerticesKind::Stl && !is_text {
            return Self::binary(path, origin, stl::facets(&file, path, length)?);
        }
        if !is_text {
            return Err(foreign(path, kind.names()[1]));
        }
        let mut lines = VertexTexts::new(file, path, length, kind)?;
        let (mut facts, mut points) = (Vec::<ColumnFacts>::new(), 0);
        while let Some(line) = lines.next()? {
            let mut count = 0;
            for word in lines.numbers(&line) {
                if points == 0 {
                    facts.push(ColumnFacts::NONE);
                }
                count += 1;
                let Some(facts) = facts.get_mut(count - 1) else { break };
                if !facts.add(word) {
                    return Err(lines.no_number(&line, word));
                }
            }
            if count != facts.len() {
                let told = "it has more or fewer numbers than the first vertex";
                return Err(lines.fail(&line, told));
            }
            points += 1;
        }
        let numbers = meaning(path, &lines, kind, facts.len())?;
        let shade = shade(path, &numbers, &facts, kind)?;
        let mut warnings = Vec::new();
        if numbers.contains(&VertexNumber::Skipped) {
            let told = "numbers of its vertices that are no coordinates, normals or colours are \
                        not read";
            warnings.push(format!("{}: {told}", shown(path)));
        }
        if kind == VerticesKind::Stl {
            warnings.extend(corners(path, points / 3));
        }
        let path = path.to_owned();
        Ok(VerticesFile { path, origin, points, facets: None, numbers, shade, warnings })
    }

    fn binary(path: &Path, origin: Origin, facets: Option<u64>) -> Result<VerticesFile> {
        let Some(facets) = facets else {
            return Err(foreign(path, VerticesKind::Stl.names()[1]));
        };
        let warnings = corners(path, facets).into_iter().collect();
        let (path, shade) = (path.to_owned(), VertexShade::Bytes);
        let (points, facets) = (facets * 3, Some(facets));
        Ok(VerticesFile { path, origin, points, facets, numbers: Vec::new(), shade, warnings })
    }

    fn dimensions(&self) -> (Vec<Dimension>, usize) {
        if self.facets.is_some() {
            let names = XYZ.into_iter().chain(NORMAL);
            return placed(names.map(|name| (name.to_owned(), Scalar::F32)));
        }
        placed(self.numbers.iter().filter_map(|number| {
            let (name, scalar) = match (number, self.shade) {
                (VertexNumber::Of(name), _) => (name, Scalar::F64),
                (VertexNumber::Color(name), VertexShade::Bytes) => (name, Scalar::U8),
                (VertexNumber::Color(name), VertexShade::Fractions) => (name, Scalar::U16),
                (VertexNumber::Skipped, _) => return None,
            };
            Some(((*name).to_owned(), scalar))
        }))
    }
}

fn corners(path: &Path, facets: u64) -> Option<String> {
    let told = |facets| {
        format!(
            "{}: its points are the corners of {facets} facets: one that facets share comes as \
             often as they do",
            shown(path)
        )
    };
    (facets > 0).then(|| told(Grouped(facets)))
}

/// What the numbers of a vertex are, by their count and what the file says of them.
fn meaning(
    path: &Path,
    lines: &VertexTexts<'_>,
    kind: VerticesKind,
    count: usize,
) -> Result<Vec<VertexNumber>> {
    let mut all: Vec<VertexNumber> = XYZ.into_iter().map(VertexNumber::Of).collect();
    if count == 0 {
        return Ok(all);
    }
    let colors = COLORS.into_iter().map(VertexNumber::Color);
    let normal = NORMAL.into_iter().map(VertexNumber::Of);
    match (kind, count) {
        (_, 3) => {}
        (VerticesKind::Obj, 4) => all.push(VertexNumber::Skipped),
        (VerticesKind::Obj, 6) => all.extend(colors),
        (VerticesKind::Stl, 6) => all.extend(normal),
        (VerticesKind::Off, _) => {
            if lines.head.has_normals {
                all.extend(normal);
            }
            let texture = if lines.head.has_texture { 2 } else { 0 };
            let left = count.saturating_sub(all.len() + texture);
            if left >= 3 {
                all.extend(colors);
            }
            let is_known = [0, 3, 4].contains(&left) && (left > 0 || !lines.head.has_colors);
            if !is_known || all.len() > count {
                return Err(unknown(path, count));
            }
            all.resize(count, VertexNumber::Skipped);
        }
        _ => return Err(unknown(path, count)),
    }
    Ok(all)
}

fn unknown(path: &Path, count: usize) -> Error {
    Error::data(path, format!("its vertices have {count} numbers, and nothing says which they are"))
        .help("write it as PLY, whose header names them")
}

fn shade(
    path: &Path,
    numbers: &[VertexNumber],
    facts: &[ColumnFacts],
    kind: VerticesKind,
) -> Result<VertexShade> {
    let colors = numbers.iter().zip(facts).filter(|(n, _)| matches!(n, VertexNumber::Color(_)));
    let colors: Vec<&ColumnFacts> = colors.map(|(_, facts)| facts).collect();
    let are_bytes = colors.iter().all(|facts| facts.is_byte());
    let are_fractions = colors.iter().all(|facts| facts.is_fraction());
    match (are_bytes, are_fractions) {
        // Colours of 0 and 1 alone are what the format's are as a rule.
        (true, true) if kind == VerticesKind::Obj => Ok(VertexShade::Fractions),
        (true, _) => Ok(VertexShade::Bytes),
        (_, true) => Ok(VertexShade::Fractions),
        _ => {
            let told = "its colours are neither whole numbers up to 255 nor fractions from 0 to 1";
            Err(Error::data(path, told))
        }
    }
}

/// Opens files of one kind whose vertices hold the same.
///
/// # Errors
///
/// A file that is none of the kind, a line that is not like the others, and files that differ.
pub(super) fn open(
    paths: &[PathBuf],
    kind: VerticesKind,
    keys: &ReadKeys,
) -> Result<Box<dyn Source>> {
    let files = paths.iter().map(|path| VerticesFile::open(path, kind));
    let files = files.collect::<Result<Vec<_>>>()?;
    let Some(first) = files.first() else {
        return Err(Error::pipeline("no file to read"));
    };
    let (dimensions, stride) = first.dimensions();
    if let Some(other) = files.iter().find(|file| file.dimensions().0 != dimensions) {
        let told = format!("its vertices do not hold what those of {} do", shown(&first.path));
        return Err(Error::data(&other.path, told).help("convert one of them first"));
    }
    let layout = Layout::plain(kind.names()[0]);
    let schema = Arc::new(Schema { layout, endian: Endian::Little, stride, dimensions });
    let parts = |file: &VerticesFile| match file.facets {
        Some(facets) => facets.div_ceil(PART_FACETS) as usize,
        None => usize::from(file.points > 0),
    };
    let ends = PartEnds::of(files.iter().map(parts));
    let metadata = systems::said(keys);
    Ok(Box::new(VerticesSource { schema, metadata, kind, files, ends }))
}

struct VerticesSource {
    schema: Arc<Schema>,
    metadata: Metadata,
    kind: VerticesKind,
    files: Vec<VerticesFile>,
    ends: PartEnds,
}

impl VerticesSource {
    fn place(&self, index: usize) -> Option<(usize, &VerticesFile, u64)> {
        let (number, within) = self.ends.place(index);
        Some((number, self.files.get(number)?, within as u64))
    }
}

impl Source for VerticesSource {
    fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn inputs(&self) -> Vec<Input> {
        self.files.iter().map(|file| Input::new(&file.path, file.points)).collect()
    }

    fn points(&self) -> u64 {
        self.files.iter().map(|file| file.points).sum()
    }

    fn part_bytes(&self) -> u64 {
        (Lines::bytes(LONGEST_LINE) + StlPart::BYTES) as u64
    }

    fn parts(&self) -> usize {
        self.ends.parts()
    }

    fn first_record(&self, index: usize) -> Option<u64> {
        let (number, _, within) = self.place(index)?;
        let before: u64 = self.files[..number].iter().map(|file| file.points).sum();
        Some(before + within * PART_FACETS * 3)
    }

    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>> {
        let Some((number, file, within)) = self.place(index) else {
            return Err(Error::internal(format!("part {index} of {}", self.parts())));
        };
        let (handle, source) = (file.origin.reopen()?, number as u32);
        if let Some(facets) = file.facets {
            let next = within * PART_FACETS;
            let left = PART_FACETS.min(facets - next);
            let origin = &file.origin;
            let (corners, taken) = (Vec::new(), 0);
            let file = handle;
            return Ok(Box::new(StlPart { file, origin, next, left, source, corners, taken }));
        }
        let lines = VertexTexts::new(handle, &file.path, file.origin.length(), self.kind)?;
        Ok(Box::new(LinesPart { file, lines, schema: &self.schema, left: file.points, source }))
    }

    fn warnings(&self) -> Vec<String> {
        self.files.iter().flat_map(|file| file.warnings.clone()).collect()
    }
}

/// The vertices of a text.
struct LinesPart<'a> {
    file: &'a VerticesFile,
    lines: VertexTexts<'a>,
    schema: &'a Schema,
    left: u64,
    source: u32,
}

impl Part for LinesPart<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        let outcome = self.fill(batch);
        self.file.origin.vouch(outcome, batch.is_empty())
    }
}

impl LinesPart<'_> {
    fn fill(&mut self, batch: &mut PointBatch) -> Result<()> {
        batch.source = self.source;
        batch.clear();
        let points = self.left.min(batch.capacity() as u64) as usize;
        for record in batch.refill(points).chunks_exact_mut(self.schema.stride) {
            let Some(line) = self.lines.next()? else {
                let told = "the file has fewer vertices than when it was looked through";
                return Err(Error::data(&self.file.path, told));
            };
            self.vertex(&line, record)?;
            self.left -= 1;
        }
        Ok(())
    }

    fn vertex(&self, line: &VertexLine, record: &mut [u8]) -> Result<()> {
        let mut fields = self.schema.dimensions.iter();
        let mut words = self.lines.numbers(line);
        for number in &self.file.numbers {
            let word = words.next().unwrap_or_default();
            if *number == VertexNumber::Skipped {
                continue;
            }
            let Some(field) = fields.next() else { break };
            let is_fraction = self.file.shade == VertexShade::Fractions;
            let held = match number {
                VertexNumber::Color(_) if is_fraction => {
                    let mut bytes = [0; 8];
                    let is_number = number::parse(word, Scalar::F64, &mut bytes);
                    let color = (f64::from_le_bytes(bytes) * 65_535.0).round_ties_even();
                    is_number && field.put(record, Endian::Little, Value::Double(color))
                }
                _ => number::parse(word, field.scalar, &mut record[field.offset..]),
            };
            if !held {
                return Err(self.lines.no_number(line, word));
            }
        }
        Ok(())
    }
}
