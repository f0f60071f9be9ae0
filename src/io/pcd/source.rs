//! Reads PCD files as one scan.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use super::file::{PART_POINTS, PcdFile};
use super::header::{LONGEST_LINE, PcdData, PcdHeader};
use super::lzf::Unpacker;
use super::names::{FORM, RECORDS};
use super::part::{AsciiPoints, PcdPart, Points};
use crate::error::shown;
use crate::io::rows::comments::Said;
use crate::io::rows::lines::Lines;
use crate::io::rows::parts::PartEnds;
use crate::io::rows::schema::{place, placed};
use crate::io::systems;
use crate::io::united::{ToOneForm, assumes_dimensions, together, unlike};
use crate::point::names::{GPS_TIME, XYZ};
use crate::point::{Endian, Metadata, Scalar, Schema};
use crate::report::LostPoints;
use crate::stage::{Contradiction, Input, Part, ReadKeys, Source};
use crate::{Error, Result};

/// What PCD outputs carry on besides points and text.
#[derive(Debug)]
pub(super) struct PcdNative {
    /// Dimension and field names.
    pub names: Vec<(String, String)>,
    pub data: PcdData,
    pub viewpoint: Option<[f64; 7]>,
}

/// Opens PCD files whose points have the same fields: their headers, and where a text calls
/// coordinates `float` whether one has more digits.
///
/// # Errors
///
/// A file that is no PCD, has no `x`, `y` and `z`, or is too short for the count that it claims;
/// files whose fields differ.
pub(super) fn open(paths: &[PathBuf], keys: &ReadKeys) -> Result<Box<dyn Source>> {
    let files = paths.iter().map(|path| PcdFile::open(path, keys.on_error));
    let files = files.collect::<Result<Vec<_>>>()?;
    if files.is_empty() {
        return Err(Error::pipeline("no PCD file to read"));
    }
    let wide = needs_double(&files)?;
    let own: Vec<Arc<Schema>> = files.iter().map(|file| Arc::new(file.schema(wide).0)).collect();
    let schema = schema_of_all(&files, &own, assumes_dimensions(keys))?;
    let said: Vec<Said> = files.iter().map(|file| Said::of(file.header.comments.clone())).collect();
    let is_timed = |n: &usize| own[*n].find(GPS_TIME).is_some();
    let timed = (0..files.len()).find(is_timed).unwrap_or(0);
    let is_other = |n: &usize| said[*n].gps_time != said[timed].gps_time;
    if let Some(n) = (0..files.len()).filter(is_timed).find(is_other) {
        let told = format!("its times do not count what those of {} do", shown(&files[timed].path));
        return Err(Error::data(&files[n].path, told).help("convert one of them first"));
    }
    let systems: Vec<_> =
        files.iter().zip(&said).map(|(file, said)| (&*file.path, said.crs.clone())).collect();
    let crs = systems::of_all(keys, &systems)?;
    let form = |(own, file): (&Arc<Schema>, &PcdFile)| {
        ToOneForm::of((**own).clone(), &schema, &[]).map_err(|error| error.at(&file.path))
    };
    let forms = own.iter().zip(&files).map(form).collect::<Result<Vec<_>>>()?;
    let gps_time = said[timed].gps_time;
    let metadata = metadata(&files, said.into_iter().next().unwrap_or_default(), crs);
    let metadata = Metadata { gps_time, ..metadata };
    let ends = PartEnds::of(files.iter().map(PcdFile::parts));
    Ok(Box::new(PcdSource { schema, own, forms, metadata, files, ends, wide }))
}

/// What holds the points of all files; refuses those that have other fields, unless what some lack
/// `is_nothing`.
fn schema_of_all(files: &[PcdFile], own: &[Arc<Schema>], is_nothing: bool) -> Result<Arc<Schema>> {
    let Some(odd) = own.iter().position(|schema| *schema != own[0]) else {
        return Ok(own[0].clone());
    };
    // Texts whose coordinates are held wide go with others that have the same types.
    let narrow = |file: &PcdFile| file.schema(false).0;
    let is_one = files.iter().all(|file| narrow(file) == narrow(&files[0]));
    if !is_nothing && !is_one {
        let names = |n: usize| own[n].dimensions.iter().map(|dimension| &dimension.name);
        let paths = [&*files[odd].path, &files[0].path];
        return Err(unlike(paths, "fields", names(odd), names(0)));
    }
    let fields = together(own).map_err(|(n, name)| {
        let first = shown(&files[0].path);
        let told = format!("no type holds all numbers of `{name}` here and in {first}");
        Error::data(&files[n].path, told).help("convert one of them first")
    })?;
    let (dimensions, stride) = placed(fields);
    let mut schema = Schema { layout: RECORDS, endian: Endian::Little, stride, dimensions };
    place(&mut schema, &FORM);
    Ok(Arc::new(schema))
}

fn metadata(files: &[PcdFile], said: Said, crs: Option<String>) -> Metadata {
    let mut names: BTreeMap<String, String> = BTreeMap::new();
    for file in files {
        let fields = file.header.fields.iter().flat_map(|f| std::iter::repeat_n(f, f.count));
        for (dimension, field) in file.names().into_iter().zip(fields).filter(|(_, f)| f.count == 1)
        {
            names.entry(dimension).or_insert_with(|| field.name.clone());
        }
    }
    // What not all have is not said of all: the order of inputs plays no part.
    let PcdHeader { data: first, viewpoint: stood, .. } = files[0].header;
    let is_one = files.iter().all(|file| file.header.data == first);
    let data = if is_one { first } else { PcdData::Binary };
    let viewpoint = stood.filter(|_| files.iter().all(|f| f.header.viewpoint == stood));
    let native = PcdNative { names: names.into_iter().collect(), data, viewpoint };
    Metadata {
        units: crs.as_deref().map(crate::io::wkt::units).unwrap_or_default(),
        crs,
        gps_time: said.gps_time,
        comments: said.others.into_iter().filter(|text| !text.starts_with(".PCD")).collect(),
        native: Some(Arc::new(native)),
        ..Metadata::default()
    }
}

/// True if coordinates that texts call `float` are to be held as `double`, so that none loses a
/// digit: where one has more than a `float` holds, or where another file calls them `double`.
fn needs_double(files: &[PcdFile]) -> Result<bool> {
    let axes = |file: &PcdFile, wanted: Scalar| -> Vec<usize> {
        let numbers = file.names().into_iter().zip(file.schema(false).1).enumerate();
        let is_it = |name: &str, number: Option<(Scalar, usize)>| {
            XYZ.contains(&name) && number.is_some_and(|(scalar, _)| scalar == wanted)
        };
        numbers.filter(|(_, (name, number))| is_it(name, *number)).map(|(n, _)| n).collect()
    };
    if files.iter().any(|file| !axes(file, Scalar::F64).is_empty()) {
        return Ok(true);
    }
    for file in files.iter().filter(|file| file.header.data == PcdData::Ascii) {
        let floats = axes(file, Scalar::F32);
        if !floats.is_empty() && ascii(file, false)?.outgrow_float(&floats, file.losses.part())? {
            return Ok(true);
        }
    }
    Ok(false)
}

fn ascii(file: &PcdFile, wide: bool) -> Result<AsciiPoints<'_>> {
    let header = &file.header;
    let span = [header.body, file.origin.length()];
    let handle = file.origin.reopen()?;
    let lines = Lines::new(handle, &file.path, span, header.lines, LONGEST_LINE);
    Ok(AsciiPoints { lines, numbers: file.schema(wide).1, rounded: 0 })
}

/// The points of one or several PCD files.
struct PcdSource {
    schema: Arc<Schema>,
    /// What the records of each file are, and how they become those of all where they are others.
    own: Vec<Arc<Schema>>,
    forms: Vec<Option<ToOneForm>>,
    metadata: Metadata,
    files: Vec<PcdFile>,
    ends: PartEnds,
    /// True if coordinates of texts are held as `double`.
    wide: bool,
}

impl PcdSource {
    /// The number of the file of a part, the file, and the number of the part in it.
    fn place(&self, index: usize) -> Option<(usize, &PcdFile, usize)> {
        let (number, within) = self.ends.place(index);
        Some((number, self.files.get(number)?, within))
    }

    fn points_at(&self, file: &PcdFile, within: usize) -> Result<(u64, u64)> {
        let each = file.packed.map_or(PART_POINTS, |packed| packed.part_points);
        let start = within as u64 * each;
        Ok(match file.header.data {
            PcdData::Ascii => (0, file.header.points),
            _ => (start, each.min(file.header.points - start)),
        })
    }
}

impl Source for PcdSource {
    fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn inputs(&self) -> Vec<Input> {
        let found = |file: &PcdFile| {
            let left_out = file.empty() + file.losses.while_read();
            file.header.points.saturating_sub(left_out)
        };
        self.files.iter().map(|file| Input::new(&file.path, found(file))).collect()
    }

    fn metadata_of(&self, input: usize) -> Result<Metadata> {
        let Some(file) = self.files.get(input) else {
            return Err(Error::internal(format!("input {input} of {}", self.files.len())));
        };
        let files = std::slice::from_ref(file);
        Ok(metadata(files, Said::of(file.header.comments.clone()), self.metadata.crs.clone()))
    }

    fn points(&self) -> u64 {
        self.files.iter().fold(0, |sum, file| sum.saturating_add(file.header.points))
    }

    fn part_bytes(&self) -> u64 {
        let of_file = |file: &PcdFile| match (&file.packed, file.header.data) {
            (Some(packed), _) => {
                let fields = file.header.fields.len() * Unpacker::BYTES;
                let values = packed.part_points * 8;
                packed.bytes(&file.header) + fields as u64 + values
            }
            (_, PcdData::Ascii) => Lines::bytes(LONGEST_LINE) as u64,
            _ if file.is_grid() => PART_POINTS * self.schema.stride as u64,
            _ => 0,
        };
        let formed = |form: &Option<ToOneForm>| form.as_ref().map_or(0, ToOneForm::part_bytes);
        let all = self.files.iter().zip(&self.forms);
        all.map(|(file, form)| of_file(file) + formed(form)).max().unwrap_or(0)
    }

    fn parts(&self) -> usize {
        self.ends.parts()
    }

    fn first_record(&self, index: usize) -> Option<u64> {
        // Cells without a point are known once they are read.
        let is_whole = |axis: &str| self.schema.find(axis).is_some_and(|d| !d.scalar.is_float());
        let mends = self.files.iter().any(|file| file.losses.mends());
        if index > 0 && (mends || !XYZ.into_iter().all(is_whole)) {
            return None;
        }
        let (number, file, within) = self.place(index)?;
        let before: u64 = self.files[..number].iter().map(|file| file.header.points).sum();
        Some(before + self.points_at(file, within).ok()?.0)
    }

    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>> {
        let Some((number, file, within)) = self.place(index) else {
            return Err(Error::internal(format!("part {index} of {}", self.parts())));
        };
        let (cell, left) = self.points_at(file, within)?;
        let grid = if file.is_grid() { 8 } else { 0 };
        let schema = &*self.own[number];
        let own = schema.stride - grid;
        let points = match (&file.packed, file.header.data) {
            (Some(packed), _) => {
                let (marks, handle) = (file.marks()?, Arc::new(file.origin.reopen()?));
                let fields = file.header.fields.len();
                let marks = &marks[within * fields..(within + 1) * fields];
                let at = |mark| Unpacker::at(handle.clone(), &file.path, mark, packed.span[1]);
                Points::Packed(marks.iter().map(at).collect())
            }
            (_, PcdData::Ascii) => Points::Ascii(ascii(file, self.wide)?),
            _ => Points::Binary(file.origin.reopen()?, file.header.body + cell * own as u64),
        };
        let (source, buffer) = (number as u32, Vec::new());
        let empty = (&file.empty[within], 0);
        let losses = (within, file.losses.part());
        let part = Box::new(PcdPart {
            file,
            points,
            schema,
            own,
            cell,
            left,
            source,
            empty,
            losses,
            buffer,
        });
        Ok(match &self.forms[number] {
            Some(form) => form.part(part, &file.path),
            None => part,
        })
    }

    fn warnings(&self) -> Vec<String> {
        let lost = self.files.iter().flat_map(|file| file.losses.told());
        self.files.iter().flat_map(PcdFile::warnings).chain(lost).collect()
    }

    fn lost(&self) -> Vec<LostPoints> {
        self.files.iter().flat_map(|file| file.losses.all()).collect()
    }

    fn contradictions(&self) -> Vec<Contradiction> {
        let of = |file: &PcdFile| {
            let at = file.header.points_at;
            Some(Contradiction::new(&file.path, at, file.belied.clone()?))
        };
        self.files.iter().filter_map(of).collect()
    }
}
