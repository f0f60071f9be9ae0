//! Reads the points of a scan.

use std::sync::atomic::Ordering;

use e57::{E57Reader, PointCloudReaderRaw, RecordDataType, RecordValue};
use self_cell::{MutBorrow, self_cell};

use super::fields::{Meaning, plain};
use super::file::{E57File, E57Scan, reader, unreadable};
use super::names::RECORDS;
use super::reading::Windowed;
use crate::host::lock;
use crate::io::damage::PartLosses;
use crate::point::names::{NORMAL, POINT_SOURCE_ID};
use crate::point::{Dimension, Endian, PointBatch, Schema, Value};
use crate::stage::Part;
use crate::{Error, Result};

type OpenedE57 = MutBorrow<E57Reader<Windowed>>;
type RawPoints<'a> = PointCloudReaderRaw<'a, Windowed>;

self_cell!(
    /// The crate's iterator, and what it borrows.
    struct ScanReader {
        owner: OpenedE57,
        #[not_covariant]
        dependent: RawPoints,
    }
);

/// Where a value goes.
pub(super) enum E57Target {
    Cartesian(usize),
    Spherical(usize),
    CartesianState,
    SphericalState,
    Color(Dimension, Option<[f64; 2]>),
    NoValue(Vec<Dimension>),
    FromZero(Dimension),
    Normal(usize),
    Of(Dimension),
}

/// The points of a scan.
pub(super) struct E57Part<'a> {
    file: &'a E57File,
    scan: &'a E57Scan,
    points: ScanReader,
    targets: Vec<E57Target>,
    axes: [Dimension; 3],
    normal: Option<[Dimension; 3]>,
    /// Where the number of the scan goes.
    numbered: Option<(Dimension, u64)>,
    source: u32,
    stride: usize,
    /// Points without coordinates so far.
    invalid: u64,
    /// Points that were read, and what is lost of the others.
    read: u64,
    losses: PartLosses,
    is_over: bool,
    /// What the others lie in, in coordinates of the scan.
    seen: Option<[[f64; 3]; 2]>,
}

impl<'a> E57Part<'a> {
    /// Opens a scan; `number` is what it is called among several.
    pub fn open(
        file: &'a E57File,
        scan: &'a E57Scan,
        schema: &Schema,
        number: Option<u64>,
        source: u32,
    ) -> Result<Self> {
        debug_assert_eq!(schema.layout, RECORDS);
        let opened = MutBorrow::new(reader(&file.path, &file.origin)?);
        let points =
            ScanReader::try_new(opened, |opened| opened.borrow_mut().pointcloud_raw(&scan.cloud));
        let told = format!("scan {}: its points are not read", scan.number);
        let points = points.map_err(|cause| unreadable(&file.path, &told, cause))?;
        let find = |name: &str| schema.find(name).cloned();
        let lacks = || Error::internal("a dimension of an E57 scan is not in its records");
        let [x, y, z] = schema.coordinates().ok_or_else(lacks)?;
        let axes = [x.clone(), y.clone(), z.clone()];
        let targets = scan.meanings.iter().map(|meaning| {
            Ok(match meaning {
                Meaning::Cartesian(axis) => E57Target::Cartesian(*axis),
                Meaning::Spherical(axis) => E57Target::Spherical(*axis),
                Meaning::CartesianState => E57Target::CartesianState,
                Meaning::SphericalState => E57Target::SphericalState,
                Meaning::Color(name, scale) => {
                    E57Target::Color(find(name).ok_or_else(lacks)?, *scale)
                }
                Meaning::NoValue(names) => {
                    E57Target::NoValue(names.iter().filter_map(|name| find(name)).collect())
                }
                Meaning::FromZero(name) => E57Target::FromZero(find(name).ok_or_else(lacks)?),
                Meaning::Of(name) => match NORMAL.iter().position(|axis| axis == name) {
                    Some(axis) => E57Target::Normal(axis),
                    None => E57Target::Of(find(name).ok_or_else(lacks)?),
                },
            })
        });
        let targets = targets.collect::<Result<Vec<_>>>()?;
        let [nx, ny, nz] = NORMAL.map(find);
        let normal = nx.zip(ny).zip(nz).map(|((nx, ny), nz)| [nx, ny, nz]);
        let has_own = scan.meanings.contains(&Meaning::Of(POINT_SOURCE_ID.to_owned()));
        let numbered = find(POINT_SOURCE_ID).zip(number.filter(|_| !has_own));
        let stride = schema.stride;
        Ok(E57Part {
            file,
            scan,
            points,
            targets,
            axes,
            normal,
            numbered,
            source,
            stride,
            invalid: 0,
            read: 0,
            losses: file.losses.part(),
            is_over: false,
            seen: None,
        })
    }

    fn fill(&mut self, batch: &mut PointBatch) -> Result<()> {
        batch.source = self.source;
        batch.clear();
        let mut record = vec![0; self.stride];
        while !self.is_over && batch.len() < batch.capacity() {
            let next = self.points.with_dependent_mut(|_, points| points.next());
            let Some(values) = next else { break };
            record.fill(0);
            let values = values.map_err(|cause| {
                let told = format!("scan {}: a point is not read", self.scan.number);
                unreadable(&self.file.path, &told, cause)
            });
            let point = values.and_then(|values| self.point(&values, &mut record));
            let point = match point {
                Ok(point) => point,
                Err(error) => return self.give_up(error),
            };
            self.read += 1;
            match point {
                true => batch.extend(&record),
                false => {
                    self.invalid += 1;
                    self.scan.invalid.fetch_max(self.invalid, Ordering::Relaxed);
                }
            }
        }
        Ok(())
    }

    /// Goes on without the points that are left of the scan, if that is wanted: where they begin is
    /// not known.
    fn give_up(&mut self, error: Error) -> Result<()> {
        let left = self.scan.cloud.records.saturating_sub(self.read);
        let byte = self.scan.cloud.file_offset;
        self.losses.lose(&self.file.path, byte, left, error)?;
        self.file.losses.enter(self.scan.number as usize, &self.losses);
        self.is_over = true;
        Ok(())
    }

    /// Makes a record of a point; false if it has no coordinates.
    fn point(&mut self, values: &[RecordValue], record: &mut [u8]) -> Result<bool> {
        let (mut own, mut polar, mut normal) = ([None; 3], [None; 3], [0.0; 3]);
        let mut lacks = false;
        let mut is_valid = [true; 2];
        let fields = values.iter().zip(&self.scan.cloud.prototype).zip(&self.targets);
        for ((value, field), target) in fields {
            let number = plain(value, &field.data_type);
            match target {
                E57Target::Cartesian(axis) => own[*axis] = Some(number),
                E57Target::Spherical(axis) => polar[*axis] = Some(number),
                E57Target::CartesianState => is_valid[0] = number == 0.0,
                E57Target::SphericalState => is_valid[1] = number == 0.0,
                E57Target::Normal(axis) => normal[*axis] = number,
                E57Target::NoValue(_) => lacks |= number != 0.0,
                E57Target::Color(field, None) => self.put(field, Value::Double(number), record)?,
                E57Target::Color(field, Some([less, times])) => {
                    let color = ((number - less) * times).round_ties_even().clamp(0.0, 65_535.0);
                    self.put(field, Value::Double(color), record)?;
                }
                E57Target::FromZero(field) => {
                    self.put(field, Value::Double(number + 1.0), record)?
                }
                E57Target::Of(to) => self.put(to, stored(value, &field.data_type), record)?,
            }
        }
        let own = whole(own).filter(|_| is_valid[0]);
        let polar = whole(polar).filter(|_| is_valid[1]);
        let Some(own) = own.or_else(|| polar.map(from_polar)) else { return Ok(false) };
        if own.iter().any(|v| v.is_nan()) {
            return Ok(false);
        }
        let [low, high] = self.seen.unwrap_or([own; 2]);
        let each = |of: fn(f64, f64) -> f64, ends: [f64; 3]| [0, 1, 2].map(|i| of(ends[i], own[i]));
        self.seen = Some([each(f64::min, low), each(f64::max, high)]);
        let (own, normal) = match &self.scan.pose {
            Some(pose) => (pose.placed(own), pose.turned(normal)),
            None => (own, normal),
        };
        for (axis, v) in self.axes.iter().zip(own) {
            self.put(axis, Value::Double(v), record)?;
        }
        for (axis, v) in self.normal.iter().flatten().zip(normal) {
            let v = match axis.scalar {
                crate::point::Scalar::F32 => Value::Single(v as f32),
                _ => Value::Double(v),
            };
            self.put(axis, v, record)?;
        }
        if lacks {
            self.empty_what_is_none(values, record)?;
        }
        if let Some((field, number)) = &self.numbered {
            self.put(field, Value::Unsigned(*number), record)?;
        }
        Ok(true)
    }

    /// Puts 0 where a flag of the point says that there is no value: the flag may come before it.
    fn empty_what_is_none(&self, values: &[RecordValue], record: &mut [u8]) -> Result<()> {
        let fields = values.iter().zip(&self.scan.cloud.prototype).zip(&self.targets);
        for ((value, field), target) in fields {
            let E57Target::NoValue(of) = target else { continue };
            if plain(value, &field.data_type) != 0.0 {
                of.iter().try_for_each(|to| self.put(to, Value::Unsigned(0), record))?;
            }
        }
        Ok(())
    }

    fn put(&self, field: &Dimension, value: Value, record: &mut [u8]) -> Result<()> {
        if field.put(record, Endian::Little, value) {
            return Ok(());
        }
        let (name, number) = (&field.name, self.scan.number);
        let told = format!("scan {number}: {name} is beyond the limits that the scan gives");
        Err(Error::data(&self.file.path, format!("{told}: {}", value.as_f64())))
    }
}

/// A value in its own type.
fn stored(value: &RecordValue, kind: &RecordDataType) -> Value {
    match value {
        RecordValue::Single(v) => Value::Single(*v),
        RecordValue::Integer(v) => Value::Signed(*v),
        _ => Value::Double(plain(value, kind)),
    }
}

/// All three, if they are there.
fn whole([a, b, c]: [Option<f64>; 3]) -> Option<[f64; 3]> {
    Some([a?, b?, c?])
}

/// Coordinates from range, azimuth and elevation (ASTM E2807, 8.4.4.2).
fn from_polar([range, azimuth, elevation]: [f64; 3]) -> [f64; 3] {
    let (a, e) = (azimuth, elevation);
    let flat = range * libm::cos(e);
    [flat * libm::cos(a), flat * libm::sin(a), range * libm::sin(e)]
}

impl Part for E57Part<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        let outcome = self.fill(batch);
        if outcome.is_ok() && batch.is_empty() {
            *lock(&self.scan.seen) = self.seen;
        }
        self.file.origin.vouch(outcome, batch.is_empty())
    }
}
