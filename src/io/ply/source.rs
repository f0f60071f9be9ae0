//! Reads the vertices of PLY files.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use super::agree::{Agreed, Texts, agreed};
use super::ascii::AsciiPart;
use super::binary::{BinaryPart, ListedPart};
use super::file::PlyFile;
use super::header::Element;
use crate::io::origin::Origin;
use crate::io::rows::Encoding;
use crate::io::rows::lines::shown;
use crate::io::rows::parts::PartEnds;
use crate::io::systems;
use crate::io::united::{ToOneForm, assumes_dimensions};
use crate::point::{Metadata, Schema};
use crate::report::LostPoints;
use crate::stage::{Contradiction, Input, Part, ReadKeys, Source};
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

/// Opens PLY files that agree in vertex properties and coordinate reference system: their headers,
/// and what stands before the vertices. Where encodings, the order of properties or their types
/// differ, or where it is assumed that what some lack is nothing, records are brought to one form.
///
/// # Errors
///
/// A file that is no PLY, has no vertices with `x`, `y` and `z`, has lists in them, or is too short
/// for the count it claims; files that do not agree.
pub fn open(paths: &[PathBuf]) -> Result<Box<dyn Source>> {
    open_with(paths, &ReadKeys::default())
}

/// The same, where `keys` may say in which system all are.
pub(super) fn open_with(paths: &[PathBuf], keys: &ReadKeys) -> Result<Box<dyn Source>> {
    Ok(Box::new(PlySource::open(paths, keys)?))
}

/// The vertices of one or several PLY files.
struct PlySource {
    schema: Arc<Schema>,
    /// What the records of each file are, and how they become those of all where they are others.
    own: Vec<Arc<Schema>>,
    forms: Vec<Option<ToOneForm>>,
    metadata: Metadata,
    crs: Option<String>,
    files: Vec<PlyFile>,
    ends: PartEnds,
    warnings: Vec<String>,
}

impl PlySource {
    pub fn open(paths: &[PathBuf], keys: &ReadKeys) -> Result<PlySource> {
        let files = paths.iter().map(|path| PlyFile::open(path, keys.on_error));
        let files = files.collect::<Result<Vec<_>>>()?;
        let Some(first) = files.first() else {
            return Err(Error::pipeline("no PLY file to read"));
        };
        let texts: Vec<Texts> = files.iter().map(Texts::of).collect();
        let Agreed { schema, own } = agreed(&files, &texts, assumes_dimensions(keys))?;
        if schema.coordinates().is_none() {
            return Err(Error::data(&first.path, "a comment gives x, y or z another dimension"));
        }
        let said = files.iter().zip(&texts).map(|(file, text)| (&*file.path, text.crs.clone()));
        let crs = systems::of_all(keys, &said.collect::<Vec<_>>())?;
        let form = |(own, file): (&Arc<Schema>, &PlyFile)| {
            ToOneForm::of((**own).clone(), &schema, &[]).map_err(|error| error.at(&file.path))
        };
        let forms = own.iter().zip(&files).map(form).collect::<Result<Vec<_>>>()?;
        let metadata = metadata(&files, texts, crs.clone());
        let parts = |file: &PlyFile| {
            let own = match file.header.encoding {
                _ if !file.lists().is_empty() => u64::from(file.points > 0),
                Encoding::Ascii => u64::from(file.points > 0),
                _ => file.points.div_ceil(PART_POINTS),
            };
            usize::try_from(own).unwrap_or(usize::MAX)
        };
        let ends = PartEnds::of(files.iter().map(parts));
        let odd = |file| [listed(file), dropped(file), cut(file)].into_iter().flatten();
        let warnings = files.iter().flat_map(odd);
        let warnings = warnings.collect();
        Ok(PlySource { schema, own, forms, metadata, crs, files, ends, warnings })
    }
}

impl PlySource {
    /// The part `within` the file `number`, with records as the file has them.
    fn own_part(&self, number: usize, within: usize) -> Result<Box<dyn Part + '_>> {
        let (Some(file), Some(schema)) = (self.files.get(number), self.own.get(number)) else {
            return Err(Error::internal(format!("file {number} of {}", self.files.len())));
        };
        let handle = file.origin.reopen()?;
        let source = number as u32;
        if file.header.encoding == Encoding::Ascii {
            return Ok(Box::new(AsciiPart::new(handle, file, schema, source)));
        }
        if !file.lists().is_empty() {
            let properties = (file.properties(), schema.endian);
            let (at, left) = (file.body, file.points);
            let part = ListedPart::new((handle, file), properties, at, left, source);
            return Ok(Box::new(part));
        }
        let start = within as u64 * PART_POINTS;
        Ok(Box::new(BinaryPart {
            file: handle,
            origin: &file.origin,
            at: file.body + start * schema.stride as u64,
            left: PART_POINTS.min(file.points - start),
            source,
        }))
    }
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

fn metadata(files: &[PlyFile], texts: Vec<Texts>, crs: Option<String>) -> Metadata {
    let first = &files[0];
    let encoding = first.header.encoding;
    let is_one = files.iter().all(|file| file.header.encoding == encoding);
    // Of two names for one dimension the first in their order: that of the inputs plays no part.
    let mut properties = BTreeMap::new();
    for (property, dimension) in files
        .iter()
        .zip(&texts)
        .flat_map(|(file, texts)| file.properties().iter().zip(&texts.dimensions))
    {
        let known = properties.entry(dimension.clone()).or_insert_with(|| property.name.clone());
        if property.name < *known {
            known.clone_from(&property.name);
        }
    }
    let timed = texts.iter().find(|texts| texts.has_times()).unwrap_or(&texts[0]);
    let gps_time = timed.gps_time;
    let native = PlyNative {
        encoding: if is_one { encoding } else { Encoding::BinaryLittleEndian },
        properties: properties.into_iter().collect(),
        obj_info: union(files.iter().map(|f| f.header.obj_info.clone()).collect()),
        rest: rest(files),
    };
    Metadata {
        units: crs.as_deref().map(crate::io::wkt::units).unwrap_or_default(),
        crs,
        gps_time,
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
    let is_whole = !file.is_cut && file.header.encoding != Encoding::Ascii;
    if !is_whole || (before.is_empty() && after.is_empty()) {
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
        let input = |f: &PlyFile| Input::new(&f.path, f.points - f.losses.while_read());
        self.files.iter().map(input).collect()
    }

    fn metadata_of(&self, input: usize) -> Result<Metadata> {
        let Some(file) = self.files.get(input) else {
            return Err(Error::internal(format!("input {input} of {}", self.files.len())));
        };
        Ok(metadata(std::slice::from_ref(file), vec![Texts::of(file)], self.crs.clone()))
    }

    fn points(&self) -> u64 {
        self.files.iter().fold(0, |sum, f| sum.saturating_add(f.points))
    }

    fn part_bytes(&self) -> u64 {
        let of = |((file, own), form): ((&PlyFile, &Arc<Schema>), &Option<ToOneForm>)| {
            let formed = form.as_ref().map_or(0, ToOneForm::part_bytes);
            formed
                + match file.header.encoding {
                    Encoding::Ascii => AsciiPart::bytes(own),
                    _ if !file.lists().is_empty() => ListedPart::BYTES,
                    _ => 0,
                }
        };
        self.files.iter().zip(&self.own).zip(&self.forms).map(of).max().unwrap_or(0)
    }

    fn parts(&self) -> usize {
        self.ends.parts()
    }

    fn first_record(&self, index: usize) -> Option<u64> {
        // What is left out of a file is known once it is read.
        if index > 0 && self.files.iter().any(|file| file.losses.mends()) {
            return None;
        }
        let (number, within) = self.ends.place(index);
        let before = self.files.get(..number)?.iter().map(|file| file.points).sum::<u64>();
        Some(before + within as u64 * PART_POINTS)
    }

    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>> {
        let (number, within) = self.ends.place(index);
        let part = self.own_part(number, within)?;
        Ok(match self.forms.get(number).and_then(Option::as_ref) {
            Some(form) => form.part(part, &self.files[number].path),
            None => part,
        })
    }

    fn warnings(&self) -> Vec<String> {
        let found = self.files.iter().filter_map(PlyFile::rounded);
        let lost = self.files.iter().flat_map(|file| file.losses.told());
        self.warnings.iter().cloned().chain(found).chain(lost).collect()
    }

    fn lost(&self) -> Vec<LostPoints> {
        self.files.iter().flat_map(|file| file.losses.all()).collect()
    }

    fn contradictions(&self) -> Vec<Contradiction> {
        let found = |file: &PlyFile| Some(Contradiction::new(&file.path, 0, file.unread()?));
        self.files.iter().filter_map(found).collect()
    }
}
