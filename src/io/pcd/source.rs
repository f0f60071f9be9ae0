//! Reads PCD files as one scan.

use std::path::PathBuf;
use std::sync::Arc;

use super::file::{PART_POINTS, PcdFile};
use super::header::{LONGEST_LINE, PcdData, PcdField};
use super::lzf::Unpacker;
use super::part::{AsciiPoints, PcdPart, Points};
use crate::error::shown;
use crate::io::rows::comments::Said;
use crate::io::rows::lines::Lines;
use crate::io::rows::parts::PartEnds;
use crate::io::systems;
use crate::point::names::XYZ;
use crate::point::{Metadata, Scalar, Schema};
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
    let Some(first) = files.first() else {
        return Err(Error::pipeline("no PCD file to read"));
    };
    let wide = needs_double(&files)?;
    let schema = first.schema(wide).0;
    if let Some(other) = files.iter().find(|file| file.schema(wide).0 != schema) {
        let told = format!("its fields are not those of {}", shown(&first.path));
        return Err(Error::data(&other.path, told).help("convert one of them first"));
    }
    let said: Vec<Said> = files.iter().map(|file| Said::of(file.header.comments.clone())).collect();
    if let Some(n) = said.iter().position(|one| one.gps_time != said[0].gps_time) {
        let told = format!("its times do not count what those of {} do", shown(&first.path));
        return Err(Error::data(&files[n].path, told).help("convert one of them first"));
    }
    let systems: Vec<_> =
        files.iter().zip(&said).map(|(file, said)| (&*file.path, said.crs.clone())).collect();
    let crs = systems::of_all(keys, &systems)?;
    let metadata = metadata(first, said.into_iter().next().unwrap_or_default(), crs);
    let ends = PartEnds::of(files.iter().map(PcdFile::parts));
    Ok(Box::new(PcdSource { schema: Arc::new(schema), metadata, files, ends, wide }))
}

fn metadata(file: &PcdFile, said: Said, crs: Option<String>) -> Metadata {
    let fields = file.header.fields.iter();
    let names = file.names().into_iter().zip(fields.flat_map(|f| std::iter::repeat_n(f, f.count)));
    let of_one = |(dimension, field): (String, &PcdField)| {
        (field.count == 1).then(|| (dimension, field.name.clone()))
    };
    let viewpoint = file.header.viewpoint;
    let native =
        PcdNative { names: names.filter_map(of_one).collect(), data: file.header.data, viewpoint };
    Metadata {
        units: crs.as_deref().map(crate::io::wkt::units).unwrap_or_default(),
        crs,
        gps_time: said.gps_time,
        comments: said.others.into_iter().filter(|text| !text.starts_with(".PCD")).collect(),
        native: Some(Arc::new(native)),
        ..Metadata::default()
    }
}

/// True if coordinates of these texts are to be held as `double`, so that none loses a digit: where
/// one has more than a `float` holds, or where another file calls them `double`.
fn needs_double(files: &[PcdFile]) -> Result<bool> {
    if files.iter().any(|file| file.header.data != PcdData::Ascii) {
        return Ok(false);
    }
    let mut is_double = false;
    for file in files {
        let names = file.names();
        let scalars: Vec<Option<Scalar>> =
            file.schema(false).1.into_iter().map(|n| Some(n?.0)).collect();
        let of = |wanted: Scalar| -> Vec<usize> {
            let is_axis = |n: &usize| XYZ.contains(&names[*n].as_str());
            (0..names.len()).filter(is_axis).filter(|&n| scalars[n] == Some(wanted)).collect()
        };
        is_double |= !of(Scalar::F64).is_empty();
        let floats = of(Scalar::F32);
        if !floats.is_empty() && !is_double {
            is_double |= ascii(file, false)?.outgrow_float(&floats, file.losses.part())?;
        }
    }
    Ok(is_double)
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
        Ok(metadata(file, Said::of(file.header.comments.clone()), self.metadata.crs.clone()))
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
        self.files.iter().map(of_file).max().unwrap_or(0)
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
        let own = self.schema.stride - grid;
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
        let schema = &*self.schema;
        let empty = (&file.empty[within], 0);
        let losses = (within, file.losses.part());
        Ok(Box::new(PcdPart {
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
        }))
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
