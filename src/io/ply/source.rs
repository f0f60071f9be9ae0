//! Reads the vertices of PLY files.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use super::ascii::AsciiPart;
use super::binary::{BinaryPart, ListedPart};
use super::file::PlyFile;
use super::header::{Element, PropertyKind};
use super::names::{self, RECORDS};
use crate::io::origin::Origin;
use crate::io::rows::Encoding;
use crate::io::rows::comments::{self, Said};
use crate::io::rows::lines::shown;
use crate::io::rows::parts::PartEnds;
use crate::io::rows::schema::placed;
use crate::point::names::{GPS_TIME, XYZ};
use crate::point::{GpsTime, Metadata, Scalar, Schema};
use crate::stage::{Contradiction, Input, Part, Source};
use crate::{Error, Result};

/// Vertices of one part of a binary file.
const PART_POINTS: u64 = 1 << 17;

/// What PLY outputs carry on besides points and text: how the input was written.
#[derive(Debug)]
pub(super) struct PlyNative {
    pub encoding: Encoding,
    /// Dimension and property names.
    pub properties: Vec<(String, String)>,
    pub obj_info: Vec<String>,
    /// What else is in the file; None if there were several, or if it is not binary.
    pub rest: Option<Rest>,
}

/// The elements of a binary file other than its vertices.
#[derive(Debug)]
pub(super) struct Rest {
    pub origin: Origin,
    pub before: Vec<Element>,
    pub after: Vec<Element>,
    /// Byte of the first element, of the first vertex, behind the last vertex, and of the file's
    /// end.
    pub cuts: [u64; 4],
    pub points: u64,
}

/// Opens PLY files that agree in encoding, vertex properties and coordinate reference system: their
/// headers, and what stands before the vertices.
///
/// # Errors
///
/// A file that is no PLY, has no vertices with `x`, `y` and `z`, has lists in them, or is too short
/// for the count it claims; files that do not agree.
pub fn open(paths: &[PathBuf]) -> Result<Box<dyn Source>> {
    Ok(Box::new(PlySource::open(paths)?))
}

/// The vertices of one or several PLY files.
struct PlySource {
    schema: Arc<Schema>,
    metadata: Metadata,
    files: Vec<PlyFile>,
    ends: PartEnds,
    warnings: Vec<String>,
}

impl PlySource {
    pub fn open(paths: &[PathBuf]) -> Result<PlySource> {
        let files = paths.iter().map(|path| PlyFile::open(path)).collect::<Result<Vec<_>>>()?;
        let Some(first) = files.first() else {
            return Err(Error::pipeline("no PLY file to read"));
        };
        let texts: Vec<Texts> = files.iter().map(Texts::of).collect();
        for (file, text) in files.iter().zip(&texts).skip(1) {
            agree((first, &texts[0]), (file, text))?;
        }
        let wide = first.header.encoding == Encoding::Ascii && needs_double(&files, &texts[0])?;
        let all: Vec<Schema> =
            files.iter().map(|file| schema(file, &texts[0].dimensions, wide)).collect();
        if let Some(other) = all.iter().position(|schema| *schema != all[0]) {
            return Err(disagree(first, &files[other], "types of vertex properties are"));
        }
        let schema = Arc::new(schema(first, &texts[0].dimensions, wide));
        if schema.coordinates().is_none() {
            return Err(Error::data(&first.path, "a comment gives x, y or z another dimension"));
        }
        let metadata = metadata(&files, texts);
        let parts = |file: &PlyFile| {
            let own = match file.header.encoding {
                _ if !file.lists().is_empty() => u64::from(file.points > 0),
                Encoding::Ascii => u64::from(file.points > 0),
                _ => file.points.div_ceil(PART_POINTS),
            };
            usize::try_from(own).unwrap_or(usize::MAX)
        };
        let ends = PartEnds::of(files.iter().map(parts));
        let told = |file| [listed(file), dropped(file), cut(file)].into_iter().flatten();
        let warnings = files.iter().flat_map(told);
        let warnings = warnings.collect();
        Ok(PlySource { schema, metadata, files, ends, warnings })
    }
}

/// What the comments of a file say to us, and the others.
struct Texts {
    crs: Option<String>,
    gps_time: Option<GpsTime>,
    dimensions: Vec<String>,
    comments: Vec<String>,
}

impl Texts {
    fn of(file: &PlyFile) -> Texts {
        let properties: Vec<&str> = file.properties().iter().map(|p| p.name.as_str()).collect();
        let header = &file.header;
        let dimensions = names::dimensions(&properties, &header.comments);
        let properties: BTreeSet<&str> = properties.into_iter().collect();
        // How this file was made is not how others are made of it.
        let Said { crs, gps_time, note: _, others } = Said::of(header.comments.clone());
        let is_ours = |comment: &String| {
            names::property_told(comment).is_some_and(|p| properties.contains(p))
                || comments::is_made(comment, file.points)
        };
        let comments = others.into_iter().filter(|comment| !is_ours(comment)).collect();
        Texts { crs, gps_time, dimensions, comments }
    }
}

/// Refuses two files whose vertices differ but for the types of properties.
fn agree((first, texts): (&PlyFile, &Texts), (other, of_other): (&PlyFile, &Texts)) -> Result<()> {
    let names = |file: &PlyFile| -> Vec<String> {
        file.properties().iter().map(|p| p.name.clone()).collect()
    };
    let differ = if first.header.encoding != other.header.encoding {
        "encoding is"
    } else if names(first) != names(other) {
        "vertex properties are"
    } else if texts.gps_time != of_other.gps_time {
        "GPS time type is"
    } else if texts.crs != of_other.crs {
        "coordinate reference system is"
    } else if texts.dimensions != of_other.dimensions {
        "dimension names are"
    } else {
        return Ok(());
    };
    Err(disagree(first, other, differ))
}

fn disagree(first: &PlyFile, other: &PlyFile, what: &str) -> Error {
    let told = format!("its {what} not the same as in {}", crate::error::shown(&first.path));
    Error::data(&other.path, told).help(
        "files that are read together agree in encoding, vertex properties and coordinate \
         reference system; convert one of them first",
    )
}

/// True for dimensions that many programs print with all digits into texts whose headers call them
/// `float`, which has room for seven.
fn is_long(dimension: &str) -> bool {
    XYZ.contains(&dimension) || dimension == GPS_TIME
}

/// True if coordinates and times of these texts are to be held as `double`, so that none loses a
/// digit: where one has more than a `float` holds, or where another file calls them `double`.
fn needs_double(files: &[PlyFile], texts: &Texts) -> Result<bool> {
    let kind = |file: &PlyFile, n: usize| file.properties()[n].kind;
    let long: Vec<usize> = (0..texts.dimensions.len())
        .filter(|&n| is_long(&texts.dimensions[n]))
        .filter(|&n| files.iter().any(|file| kind(file, n) == PropertyKind::Scalar(Scalar::F32)))
        .collect();
    let double =
        |file: &PlyFile| long.iter().any(|&n| kind(file, n) == PropertyKind::Scalar(Scalar::F64));
    if long.is_empty() || files.iter().any(double) {
        return Ok(!long.is_empty());
    }
    for file in files {
        let narrow = schema(file, &texts.dimensions, false);
        let part = AsciiPart::new(file.origin.reopen()?, file, &narrow, 0);
        if part.outgrows_float(&long)? {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Coordinates and times that a file calls `float` are `double` if they are to be `wide`.
fn schema(file: &PlyFile, dimensions: &[String], wide: bool) -> Schema {
    let fields = file.properties().iter().zip(dimensions).filter_map(|(property, name)| {
        let PropertyKind::Scalar(scalar) = property.kind else { return None };
        let widens = wide && scalar == Scalar::F32 && is_long(name);
        Some((name.clone(), if widens { Scalar::F64 } else { scalar }))
    });
    let (dimensions, stride) = placed(fields);
    Schema { layout: RECORDS, endian: file.header.encoding.endian(), stride, dimensions }
}

/// Texts equal in all files are carried as they are, else the union, sorted: the order of the
/// inputs changes nothing.
fn union(lists: Vec<Vec<String>>) -> Vec<String> {
    if lists.windows(2).all(|pair| pair[0] == pair[1]) {
        return lists.into_iter().next().unwrap_or_default();
    }
    let mut all: Vec<String> = lists.into_iter().flatten().collect();
    all.sort();
    all.dedup();
    all
}

fn metadata(files: &[PlyFile], mut texts: Vec<Texts>) -> Metadata {
    let first = &files[0];
    let properties = first
        .properties()
        .iter()
        .zip(&texts[0].dimensions)
        .map(|(property, dimension)| (dimension.clone(), property.name.clone()))
        .collect();
    let native = PlyNative {
        encoding: first.header.encoding,
        properties,
        obj_info: union(files.iter().map(|f| f.header.obj_info.clone()).collect()),
        rest: rest(files),
    };
    let crs = texts[0].crs.take();
    Metadata {
        units: crs.as_deref().map(crate::io::wkt::units).unwrap_or_default(),
        crs,
        gps_time: texts[0].gps_time,
        comments: union(texts.into_iter().map(|t| t.comments).collect()),
        native: Some(Arc::new(native)),
        ..Metadata::default()
    }
}

fn rest(files: &[PlyFile]) -> Option<Rest> {
    let [file] = files else { return None };
    let elements = &file.header.elements;
    let size = elements[file.vertex].size()?;
    let (before, after) = (&elements[..file.vertex], &elements[file.vertex + 1..]);
    if file.header.encoding == Encoding::Ascii || (before.is_empty() && after.is_empty()) {
        return None;
    }
    let end = file.body + file.points * size; // within the file: bounded on opening
    Some(Rest {
        origin: file.origin.clone(),
        before: before.to_vec(),
        after: after.to_vec(),
        cuts: [file.header.body, file.body, end, file.length],
        points: file.points,
    })
}

/// A warning for elements that are not milled.
fn dropped(file: &PlyFile) -> Option<String> {
    let others: Vec<String> = file
        .header
        .elements
        .iter()
        .filter(|e| e.name != "vertex" && e.count > 0)
        .map(|e| format!("{} of `{}`", e.count, shown(&e.name)))
        .collect();
    (!others.is_empty()).then(|| {
        format!(
            "{}: {} are not points: a binary PLY converted to PLY of the same encoding carries \
             them, all other outputs drop them",
            crate::error::shown(&file.path),
            others.join(", ")
        )
    })
}

/// A warning for lists that vertices have.
fn listed(file: &PlyFile) -> Option<String> {
    let lists: Vec<String> = file.lists().iter().map(|name| format!("`{}`", shown(name))).collect();
    (!lists.is_empty()).then(|| {
        let path = crate::error::shown(&file.path);
        format!("{path}: lists of its vertices are not read: {}", lists.join(", "))
    })
}

/// A warning for a text that ends within a line.
fn cut(file: &PlyFile) -> Option<String> {
    file.ends_in_a_number.then(|| {
        format!(
            "{}: the file ends without the end of a line: its last number may be cut short",
            crate::error::shown(&file.path)
        )
    })
}

impl Source for PlySource {
    fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn inputs(&self) -> Vec<Input> {
        let input = |f: &PlyFile| Input::new(&f.path, f.points);
        self.files.iter().map(input).collect()
    }

    fn metadata_of(&self, input: usize) -> Result<Metadata> {
        let Some(file) = self.files.get(input) else {
            return Err(Error::internal(format!("input {input} of {}", self.files.len())));
        };
        Ok(metadata(std::slice::from_ref(file), vec![Texts::of(file)]))
    }

    fn points(&self) -> u64 {
        self.files.iter().fold(0, |sum, f| sum.saturating_add(f.points))
    }

    fn part_bytes(&self) -> u64 {
        match self.files[0].header.encoding {
            Encoding::Ascii => AsciiPart::bytes(&self.schema),
            _ if self.files.iter().any(|file| !file.lists().is_empty()) => ListedPart::BYTES,
            _ => 0,
        }
    }

    fn parts(&self) -> usize {
        self.ends.parts()
    }

    fn first_record(&self, index: usize) -> Option<u64> {
        let (number, within) = self.ends.place(index);
        let before = self.files.get(..number)?.iter().map(|file| file.points).sum::<u64>();
        Some(before + within as u64 * PART_POINTS)
    }

    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>> {
        let (number, within) = self.ends.place(index);
        let Some(file) = self.files.get(number) else {
            return Err(Error::internal(format!("part {index} of {}", self.parts())));
        };
        let handle = file.origin.reopen()?;
        let source = number as u32;
        if file.header.encoding == Encoding::Ascii {
            return Ok(Box::new(AsciiPart::new(handle, file, &self.schema, source)));
        }
        if !file.lists().is_empty() {
            let properties = (file.properties(), self.schema.endian);
            let (at, left) = (file.body, file.points);
            let part = ListedPart::new((handle, &file.origin), properties, at, left, source);
            return Ok(Box::new(part));
        }
        let start = within as u64 * PART_POINTS;
        Ok(Box::new(BinaryPart {
            file: handle,
            origin: &file.origin,
            at: file.body + start * self.schema.stride as u64,
            left: PART_POINTS.min(file.points - start),
            source,
        }))
    }

    fn warnings(&self) -> Vec<String> {
        let found = self.files.iter().filter_map(PlyFile::rounded);
        self.warnings.iter().cloned().chain(found).collect()
    }

    fn contradictions(&self) -> Vec<Contradiction> {
        let found = |file: &PlyFile| Some(Contradiction::new(&file.path, 0, file.unread()?));
        self.files.iter().filter_map(found).collect()
    }
}
