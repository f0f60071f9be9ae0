//! LAS and LAZ files as a source: one or several, read in independent parts.

use std::path::PathBuf;
use std::sync::Arc;

use super::boxed::Wanted;
use super::chunked::LazPart;
use super::chunks::{Chunk, Chunks};
use super::copc::selected::has_octree;
use super::crs;
use super::form::OneForm;
use super::format::{has_gps_time, selection};
use super::input::{LasInput, Storage};
use super::laz::Layers;
use super::merge::LasMerge;
use super::native::Native;
use super::read::{PlainPart, Shift};
use super::table::is_held;
use super::verify::{Evidence, Found, Watched};
use super::waveforms;
use crate::io::damage;
use crate::io::united::ToOneForm;
use crate::point::{Dimension, Metadata, Schema, Value};
use crate::report::LostPoints;
use crate::stage::{self, OnError, Part, ReadKeys, Source};
use crate::{Error, Result};

/// Plain records of one part.
const PLAIN_POINTS: u64 = 1 << 18;

/// Opens LAS and LAZ files as one scan: headers and records only, no point.
///
/// # Errors
///
/// A file that is not LAS, is damaged, or claims more than its length can hold is named with the
/// byte; files that do not agree (point format, record length, extra bytes, scale, GPS time type,
/// CRS; offsets apart from whole steps) are named both.
pub fn open(paths: &[PathBuf]) -> Result<Box<dyn Source>> {
    open_with(paths, &ReadKeys::default())
}

/// The same as `keys` want it: inputs that differ may be brought to one form.
pub(super) fn open_with(paths: &[PathBuf], keys: &ReadKeys) -> Result<Box<dyn Source>> {
    Ok(Box::new(opened(paths, keys)?))
}

/// As [`open_with`].
pub fn opened(paths: &[PathBuf], keys: &ReadKeys) -> Result<LasSource> {
    opened_where(paths, keys, Wanted::of(keys))
}

/// As [`open_with`], those points that are wanted.
fn opened_where(paths: &[PathBuf], keys: &ReadKeys, wanted: Wanted) -> Result<LasSource> {
    let Some((first, others)) = paths.split_first() else {
        return Err(Error::pipeline("there is no input file"));
    };
    let (form, mut has_levels) = (OneForm::of(keys, paths)?, true);
    let mut open = |path: &PathBuf| {
        let mut input = LasInput::open(path, form.on_error)?;
        has_levels &= has_octree(&input);
        wanted.apply(&mut input)?;
        form.bring(input)
    };
    let first = open(first)?;
    let mut schema = first.schema();
    let own_form =
        |input: &LasInput| input.own.as_ref().map(|_| (input.own_schema(), input.absent()));
    let mut own = vec![own_form(&first)];
    let mut inputs = vec![first.clone().without_records()];
    let (mut tables, mut points) = (first.table_bytes(), first.points());
    let mut merge = LasMerge::of(first, &form)?;
    for path in others {
        let input = open(path)?;
        own.push(own_form(&input));
        tables = tables.saturating_add(input.table_bytes());
        points = points.saturating_add(input.points());
        if !is_held(tables, points) {
            let told = "the inputs up to this one have more chunks of few points than are held";
            return Err(Error::data(path, told).help("run them in several parts"));
        }
        merge.add(&input)?;
        inputs.push(input.without_records());
    }
    let (native, shifts) = merge.finish(&inputs)?;
    for (axis, dimension) in schema.dimensions.iter_mut().take(3).enumerate() {
        dimension.origin = native.header.offset()[axis];
    }
    let told = |i: &LasInput| i.warnings.clone().into_iter().chain(wanted.told(i));
    let warnings = inputs.iter().flat_map(told).collect();
    let (crs, units) =
        (crs::text(&native.vlrs, &native.evlrs)?, crs::units(&native.vlrs, &native.evlrs)?);
    let gps_time = has_gps_time(native.header.format()).then(|| native.header.gps_time());
    let native = Some(Arc::new(native) as Arc<_>);
    let metadata = Metadata { crs, units, gps_time, native, ..Metadata::default() };
    let each = inputs.into_iter().zip(shifts).zip(own);
    let open = |((input, shift), own)| Opened::new(input, shift, own, &schema, form.on_error);
    let files = each.map(open).collect::<Result<Vec<Opened>>>()?;
    let mut start = 0;
    let parts = files.iter().enumerate().flat_map(|(i, file)| file.parts(i, &mut start)).collect();
    let schema = Arc::new(schema);
    let again = has_levels.then(|| keys.clone());
    Ok(LasSource { files, parts, schema, metadata, form, wanted, again, warnings })
}

/// LAS and LAZ files opened together.
pub struct LasSource {
    files: Vec<Opened>,
    parts: Vec<PartPlace>,
    schema: Arc<Schema>,
    metadata: Metadata,
    form: OneForm,
    wanted: Wanted,
    /// How files that all have an octree are opened again, for some of its levels.
    again: Option<ReadKeys>,
    warnings: Vec<String>,
}

impl LasSource {
    /// What the points of the first file come to; None before all of them were read.
    pub fn found(&self) -> Option<Found> {
        self.files.first()?.evidence.found()
    }

    /// What turned up behind the points that the headers count, while points were read.
    pub fn found_behind(&self) -> Vec<String> {
        self.files.iter().flat_map(|file| file.evidence.warnings()).collect()
    }
}

/// What the records of a file are, and what stands in the values of all that it lacks.
type OwnForm = (Schema, Vec<(Dimension, Value)>);

struct Opened {
    input: LasInput,
    shift: Shift,
    /// How its records become those of all inputs, where they are others.
    to_one_form: Option<ToOneForm>,
    compression: Option<Arc<super::laz::Compression>>,
    evidence: Arc<Evidence>,
    on_error: OnError,
}

/// Which file a part is of, and its stretch there: records of a plain file, or a part of a LAZ.
struct PartPlace {
    file: usize,
    /// Its number among the parts of that file.
    number: usize,
    first: u64,
    count: u64,
    /// Records of all inputs before its first.
    start: u64,
}

impl Opened {
    /// `own` is what its records are, where they must become such of `schema`, and what these have
    /// that it lacks.
    fn new(
        input: LasInput,
        shift: Shift,
        own: Option<OwnForm>,
        schema: &Schema,
        on_error: OnError,
    ) -> Result<Self> {
        let compression = match &input.storage {
            Storage::Plain(_) => None,
            Storage::Laz(compression, _) => Some(Arc::new(compression.clone())),
        };
        let evidence = Evidence::new(input.own_header(), stretches(&input).len());
        input.lost.iter().cloned().for_each(|lost| evidence.lose(lost));
        let evidence = Arc::new(evidence);
        let formed = own.map(|(own, absent)| ToOneForm::of(own, schema, &absent)).transpose();
        let to_one_form = formed.map_err(|error| error.at(&input.path))?.flatten();
        Ok(Opened { input, shift, to_one_form, compression, evidence, on_error })
    }

    /// The parts of this file, the number `file` of all; `start` counts the records before each.
    fn parts(&self, file: usize, start: &mut u64) -> Vec<PartPlace> {
        let place = |(number, (first, count))| {
            let place = PartPlace { file, number, first, count, start: *start };
            *start = start.saturating_add(self.points_of(&place));
            place
        };
        stretches(&self.input).into_iter().enumerate().map(place).collect()
    }

    /// Records of a part.
    fn points_of(&self, place: &PartPlace) -> u64 {
        match &self.input.storage {
            Storage::Plain(_) => place.count,
            Storage::Laz(_, Chunks::InARow { all, .. }) => all.points,
            Storage::Laz(_, Chunks::Known(chunks)) => {
                chunks.part(place.first as usize).iter().map(|chunk| chunk.points).sum()
            }
        }
    }

    fn part_bytes(&self) -> u64 {
        let formed = self.to_one_form.as_ref().map_or(0, ToOneForm::part_bytes);
        let Some(compression) = &self.compression else { return formed };
        let list = match &self.input.storage {
            Storage::Laz(_, Chunks::Known(chunks)) => chunks.part_bytes(),
            _ => 0,
        };
        list + compression.state_bytes() + formed
    }

    /// Opens a part, its points looked at. Coordinates and returns are in layers that are always
    /// decoded.
    fn open(
        &self,
        place: &PartPlace,
        selection: Layers,
        wanted: &Wanted,
    ) -> Result<Box<dyn Part + '_>> {
        let part = self.unwatched(place, selection)?;
        let part = wanted.part(part, self.input.own_header(), self.shift);
        let part = Watched::new(part, self.evidence.clone(), place.number, self.shift.0);
        Ok(match &self.to_one_form {
            Some(form) => form.part(Box::new(part), &self.input.path),
            None => Box::new(part),
        })
    }

    fn unwatched(&self, place: &PartPlace, selection: Layers) -> Result<Box<dyn Part>> {
        let file = self.input.reopen()?;
        let (shift, source) = (self.shift, place.file as u32);
        let (before, chunks, in_a_row): (u64, Vec<Chunk>, _) = match &self.input.storage {
            Storage::Plain(_) => {
                let header = self.input.own_header();
                let each = u64::from(header.point_data_record_length);
                let at = u64::from(header.offset_to_point_data) + place.first * each;
                return Ok(Box::new(PlainPart { file, source, at, left: place.count, shift }));
            }
            Storage::Laz(_, Chunks::InARow { all, chunk_points }) => {
                (0, vec![*all], Some(*chunk_points))
            }
            Storage::Laz(_, Chunks::Known(chunks)) => {
                let part = place.first as usize;
                (chunks.before(part), chunks.part(part), None)
            }
        };
        let compression = self
            .compression
            .clone()
            .ok_or_else(|| Error::internal("a LAZ file without its compression"))?;
        let chunks = (before, chunks);
        let part = LazPart::new(file, (source, shift), compression, chunks, in_a_row);
        let part = part.mend(self.on_error);
        Ok(Box::new(part.select(selection).tell(self.evidence.clone())))
    }
}

/// The stretches that the parts of a file are: first and count of records, or a part of its chunks.
fn stretches(input: &LasInput) -> Vec<(u64, u64)> {
    match &input.storage {
        Storage::Plain(_) => {
            let points = input.points();
            (0..points.div_ceil(PLAIN_POINTS))
                .map(|i| i * PLAIN_POINTS)
                .map(|first| (first, PLAIN_POINTS.min(points - first)))
                .collect()
        }
        Storage::Laz(_, Chunks::InARow { .. }) => vec![(0, 1)],
        Storage::Laz(_, Chunks::Known(chunks)) => {
            (0..chunks.parts() as u64).map(|i| (i, 1)).collect()
        }
    }
}

impl Source for LasSource {
    fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn claimed_box(&self) -> Option<[[f64; 3]; 2]> {
        let filled = self.files.iter().filter(|file| file.input.points() > 0);
        let all = filled.map(|file| file.input.header.bounds());
        // A box of zeros is one that its writer left as it was: of its points nothing is claimed.
        if all.clone().any(|corners| corners == [[0.0; 3]; 2]) {
            return None;
        }
        let all = all.reduce(|[lo, hi], [other_lo, other_hi]| {
            let each = |of: fn(f64, f64) -> f64, a: [f64; 3], b: [f64; 3]| {
                [of(a[0], b[0]), of(a[1], b[1]), of(a[2], b[2])]
            };
            [each(f64::min, lo, other_lo), each(f64::max, hi, other_hi)]
        });
        all.map(|corners| self.wanted.within(corners))
    }

    fn inputs(&self) -> Vec<stage::Input> {
        let input = |f: &Opened| stage::Input {
            path: f.input.path.clone(),
            points: match self.wanted.is_some() {
                true => f.evidence.found().map_or(f.input.points(), |found| found.points),
                false => f.input.points() - f.evidence.lost_while_read(),
            },
            beside: f.input.waveforms.clone().map(|file| (file, waveforms::EXTENSION)),
        };
        self.files.iter().map(input).collect()
    }

    fn metadata_of(&self, input: usize) -> Result<Metadata> {
        let Some(Opened { input, .. }) = self.files.get(input) else {
            return Err(Error::internal(format!("input {input} of {}", self.files.len())));
        };
        let native = Native::again(&input.reopen()?, input.own_header(), &self.form)?;
        // The CRS is that of all inputs, or they would have been refused.
        Ok(Metadata { native: Some(Arc::new(native)), ..self.metadata.clone() })
    }

    fn points(&self) -> u64 {
        self.files.iter().fold(0, |all, f| all.saturating_add(f.input.points()))
    }

    fn part_bytes(&self) -> u64 {
        self.files.iter().map(Opened::part_bytes).max().unwrap_or(0)
    }

    fn parts(&self) -> usize {
        self.parts.len()
    }

    fn first_record(&self, index: usize) -> Option<u64> {
        // What is left out is known once it is read.
        let is_known = self.form.on_error == OnError::Fail && !self.wanted.is_some();
        if index > 0 && !is_known {
            return None;
        }
        self.parts.get(index).map(|place| place.start)
    }

    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>> {
        self.part_without(index, &[])
    }

    fn part_without(&self, index: usize, unread: &[String]) -> Result<Box<dyn Part + '_>> {
        let place = &self.parts[index];
        self.files[place.file].open(place, selection(&self.schema, unread), &self.wanted)
    }

    fn coarser(&self, points: u64) -> Option<Box<dyn Source>> {
        let keys = self.again.as_ref().filter(|_| points < self.points())?;
        let paths: Vec<PathBuf> = self.files.iter().map(|file| file.input.path.clone()).collect();
        let wanted = Wanted::of(keys).of_all(points, self.points());
        // An octree that cannot be followed is none: the file is read whole.
        let coarser = opened_where(&paths, keys, wanted).ok()?;
        (coarser.points() < self.points()).then(|| Box::new(coarser) as Box<dyn Source>)
    }

    fn warnings(&self) -> Vec<String> {
        let rounded = |file: &Opened| file.to_one_form.as_ref()?.told(&file.input.path);
        let told = |file: &Opened| {
            let lost = file.evidence.lost();
            let lost = damage::told(&lost, lost.len() as u64);
            lost.into_iter().chain(file.evidence.warnings()).chain(rounded(file))
        };
        self.warnings.iter().cloned().chain(self.files.iter().flat_map(told)).collect()
    }

    fn lost(&self) -> Vec<LostPoints> {
        self.files.iter().flat_map(|file| file.evidence.lost()).collect()
    }

    fn contradictions(&self) -> Vec<stage::Contradiction> {
        let of =
            |file: &Opened| file.evidence.contradictions(&file.input.path, file.input.own_header());
        self.files.iter().flat_map(of).collect()
    }
}
