//! Reads the scans of E57 files as one.

use std::path::PathBuf;
use std::sync::Arc;

use e57::RecordDataType;

use super::fields::{Meaning, both, scalar};
use super::file::{E57File, E57Scan};
use super::names::RECORDS;
use super::part::E57Part;
use super::reading::Windowed;
use crate::error::shown;
use crate::io::rows::schema::placed;
use crate::io::systems;
use crate::point::names::{POINT_SOURCE_ID, XYZ};
use crate::point::{Endian, Metadata, Scalar, Schema};
use crate::report::{Grouped, LostPoints};
use crate::stage::{Input, Part, ReadKeys, Source};
use crate::{Error, Result};

/// Scans that are told apart by number.
const SCANS_MOST: usize = u16::MAX as usize;

/// Opens E57 files: what they say of their scans.
///
/// # Errors
///
/// A file that is no E57 or damaged, a scan without coordinates, more points than the file could
/// hold.
pub(super) fn open(paths: &[PathBuf], keys: &ReadKeys) -> Result<E57Source> {
    let files = paths.iter().map(|path| E57File::open(path, keys.scans.as_deref(), keys.on_error));
    let files = files.collect::<Result<Vec<_>>>()?;
    let Some(first) = files.first() else {
        return Err(Error::pipeline("no E57 file to read"));
    };
    let said: Vec<_> = files.iter().map(|file| (&*file.path, file.crs.clone())).collect();
    let crs = systems::of_all(keys, &said)?;
    let (mut places, mut warnings) = (Vec::new(), Vec::new());
    for (n, file) in files.iter().enumerate() {
        places.extend((0..file.scans.len()).map(|scan| (n, scan)));
        warnings.extend(file.warnings.iter().cloned());
    }
    if places.len() > SCANS_MOST {
        let told =
            format!("there are {} scans, of which {SCANS_MOST} are told apart", places.len());
        return Err(Error::data(&first.path, told).help("read some of the files at a time"));
    }
    let scans: Vec<&E57Scan> = files.iter().flat_map(|file| &file.scans).collect();
    let (schema, told) = schema(&scans);
    warnings.extend(told);
    let units = crs.as_deref().map(crate::io::wkt::units).unwrap_or_default();
    let metadata = Metadata { crs, units, ..Metadata::default() };
    Ok(E57Source { schema: Arc::new(schema), metadata, files, places, warnings })
}

/// The dimensions and types of a scan's values, coordinates left out.
fn dimensions(scan: &E57Scan) -> Vec<(String, Scalar)> {
    let fields = scan.cloud.prototype.iter().zip(&scan.meanings);
    let of_one = |(record, meaning): (&e57::Record, &Meaning)| {
        let own = scalar(&record.data_type);
        Some(match meaning {
            Meaning::Color(name, None) => ((*name).to_owned(), both(own, Scalar::U8)),
            Meaning::Color(name, Some(_)) => ((*name).to_owned(), Scalar::U16),
            Meaning::FromZero(name) => ((*name).to_owned(), both(own, Scalar::U8)),
            Meaning::Of(name) => (name.clone(), own),
            _ => return None,
        })
    };
    fields.filter_map(of_one).collect()
}

/// What holds a point of any of the scans, and what is to be told of those that hold less.
fn schema(scans: &[&E57Scan]) -> (Schema, Vec<String>) {
    let is_single = |scan: &&E57Scan| {
        let is_axis = |m: &Meaning| matches!(m, Meaning::Cartesian(_));
        let axes = scan.cloud.prototype.iter().zip(&scan.meanings).filter(|(_, m)| is_axis(m));
        let mut kinds = axes.map(|(record, _)| &record.data_type);
        scan.pose.is_none()
            && !scan.cloud.has_spherical()
            && kinds.all(|kind| matches!(kind, RecordDataType::Single { .. }))
    };
    let axis = match !scans.is_empty() && scans.iter().all(is_single) {
        true => Scalar::F32,
        false => Scalar::F64,
    };
    let mut all: Vec<(String, Scalar)> = XYZ.map(|name| (name.to_owned(), axis)).into();
    let each: Vec<Vec<(String, Scalar)>> = scans.iter().map(|scan| dimensions(scan)).collect();
    for (name, scalar) in each.iter().flatten() {
        match all.iter_mut().find(|(known, _)| known == name) {
            Some((_, known)) => *known = both(*known, *scalar),
            None => all.push((name.clone(), *scalar)),
        }
    }
    let mut warnings = Vec::new();
    for (name, _) in &all[3..] {
        let lacks = |own: &&Vec<(String, Scalar)>| !own.iter().any(|(known, _)| known == name);
        let lacking = each.iter().filter(lacks).count();
        if lacking > 0 {
            let of = each.len();
            warnings.push(format!("{lacking} of {of} scans have no {name}: it is 0 there"));
        }
    }
    let numbered = scans.len() > 1;
    if numbered && !all.iter().any(|(name, _)| name == POINT_SOURCE_ID) {
        all.push((POINT_SOURCE_ID.to_owned(), Scalar::U16));
    }
    let (dimensions, stride) = placed(all);
    (Schema { layout: RECORDS, endian: Endian::Little, stride, dimensions }, warnings)
}

/// The points of the scans of one or several E57 files.
pub(super) struct E57Source {
    schema: Arc<Schema>,
    metadata: Metadata,
    pub files: Vec<E57File>,
    /// File and scan of each part.
    places: Vec<(usize, usize)>,
    warnings: Vec<String>,
}

impl Source for E57Source {
    fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn inputs(&self) -> Vec<Input> {
        let found = |file: &E57File| {
            file.points().saturating_sub(file.invalid() + file.losses.while_read())
        };
        self.files.iter().map(|file| Input::new(&file.path, found(file))).collect()
    }

    fn points(&self) -> u64 {
        self.files.iter().fold(0, |sum, file| sum.saturating_add(file.points()))
    }

    fn part_bytes(&self) -> u64 {
        // A packet of 64 KiB, unpacked to values of 16 bytes, in queues that double as they grow.
        let of_scan = |scan: &E57Scan| {
            let points = (1 << 19) / scan.bits.max(1) + 1;
            points * scan.cloud.prototype.len() as u64 * 32
        };
        let scans = self.files.iter().flat_map(|file| &file.scans);
        scans.map(of_scan).max().unwrap_or(0) + 2 * Windowed::BYTES as u64
    }

    fn parts(&self) -> usize {
        self.places.len()
    }

    fn first_record(&self, index: usize) -> Option<u64> {
        // Points that are said to be invalid are known once they are read.
        (index == 0).then_some(0)
    }

    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>> {
        let Some(&(number, scan)) = self.places.get(index) else {
            return Err(Error::internal(format!("part {index} of {}", self.parts())));
        };
        let file = &self.files[number];
        let called = (self.places.len() > 1).then_some(index as u64 + 1);
        let part = E57Part::open(file, &file.scans[scan], &self.schema, called, number as u32)?;
        Ok(Box::new(part))
    }

    fn warnings(&self) -> Vec<String> {
        let invalid = |file: &E57File| {
            let invalid = file.invalid();
            let (points, path) = (Grouped(file.points()), shown(&file.path));
            (invalid > 0).then(|| {
                let n = Grouped(invalid);
                format!("{path}: {n} of {points} points are said to have no coordinates")
            })
        };
        let lost = self.files.iter().flat_map(|file| file.losses.told());
        let found = self.files.iter().filter_map(invalid).chain(lost);
        self.warnings.iter().cloned().chain(found).collect()
    }

    fn lost(&self) -> Vec<LostPoints> {
        self.files.iter().flat_map(|file| file.losses.all()).collect()
    }
}
