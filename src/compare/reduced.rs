//! The reduced scan, as it is looked at beside the original.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU32, Ordering};

use super::records::{Beginnings, Comparison, RecordKeys};
use crate::budget::{Bytes, whole_mebibytes};
use crate::geom::hash::PlaceHashes;
use crate::point::{PointBatch, Scalar, Schema, names};
use crate::stage::{BATCH, Source};
use crate::{Error, ErrorKind, Result};

/// The rank of exceptions: kept, and no part of the surface.
const EXCEPTION: f64 = 65535.0;
/// Bytes of a record while it is looked at: its place, its positions as they are searched, and its
/// entry in a table that is at most half empty, and its first bits.
const BYTES: usize = size_of::<[f64; 3]>() + 3 * size_of::<[i64; 3]>() + 90;

/// How often a record is in the reduced scan, and how often it was met in the original.
#[derive(Debug, Default)]
struct Occurrences {
    kept: u32,
    met: AtomicU32,
}

/// The records of the reduced scan.
#[derive(Debug)]
pub(super) struct Reduced {
    /// World coordinates, and whether the point is a part of the surface.
    pub points: Vec<([f64; 3], bool)>,
    records: HashMap<u128, Occurrences, PlaceHashes>,
    /// What they begin with.
    beginnings: Beginnings,
}

/// Records that the original does not have, or not as often.
#[derive(Debug, Default)]
pub(super) struct ForeignRecords {
    pub count: u64,
    /// Those with the synthetic flag, which a stage sets that moves them.
    pub synthetic: u64,
    /// The first by its number in the file, and where it is.
    pub first: Option<(u64, [f64; 3])>,
}

impl Reduced {
    /// Bytes that a reduced scan of so many records takes.
    pub fn bytes(records: u64) -> Bytes {
        Bytes::of(records, BYTES)
    }

    /// Refuses a reduced scan that does not fit in half of `memory`, and says what would do.
    pub fn check_memory(records: u64, memory: u64) -> Result<()> {
        let bytes = Reduced::bytes(records);
        if bytes.fit(memory / 2) {
            return Ok(());
        }
        let enough = whole_mebibytes((bytes + bytes).0);
        let told = format!(
            "a reduced scan of {records} points takes half of the memory or less, and this one \
             takes more"
        );
        Err(Error::memory(told).help(format!("give `run.memory = \"{enough}\"` or more")))
    }

    /// Reads all records.
    pub fn read(source: &dyn Source, comparison: &Comparison) -> Result<Reduced> {
        let (mut points, mut beginnings) = (Vec::new(), Beginnings::of(source.points()));
        let mut records = HashMap::<u128, Occurrences, PlaceHashes>::default();
        let keys = &comparison.reduced;
        let schema = source.schema();
        let rank = schema.find(names::KEEP_RANK).filter(|rank| rank.scalar == Scalar::U16);
        each_record(source, |_, world, record| {
            let is_surface = rank.is_none_or(|d| d.world(record, schema.endian) != EXCEPTION);
            points.push((world, is_surface));
            beginnings.enter(keys, record);
            records.entry(keys.key(record)).or_default().kept += 1;
            Ok(())
        })?;
        Ok(Reduced { points, records, beginnings })
    }

    /// Enters records of the original, known by `keys`; from several threads at once.
    pub fn meet<'a>(
        &self,
        keys: &RecordKeys,
        records: impl ExactSizeIterator<Item = &'a [u8]> + Clone,
    ) {
        let mut found = Vec::new();
        self.beginnings.find(keys, records.clone(), &mut found);
        let (mut records, mut next) = (records, 0);
        for number in found {
            let Some(record) = records.nth((number - next) as usize) else { return };
            next = number + 1;
            if let Some(occurrences) = self.records.get(&keys.key(record)) {
                occurrences.met.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    /// The records that are not in the original, or more often than there.
    pub fn foreign(&self, source: &dyn Source, comparison: &Comparison) -> Result<ForeignRecords> {
        let more =
            |of: &Occurrences| u64::from(of.kept.saturating_sub(of.met.load(Ordering::Relaxed)));
        let count = self.records.values().map(more).sum();
        let mut found = ForeignRecords { count, ..ForeignRecords::default() };
        if count == 0 {
            return Ok(found);
        }
        let schema = source.schema();
        let flag = schema.find(names::SYNTHETIC);
        let mut seen = HashMap::<u128, u32>::new();
        each_record(source, |number, world, record| {
            let hash = comparison.reduced.key(record);
            let met = self.records.get(&hash).map_or(0, |of| of.met.load(Ordering::Relaxed));
            let times = seen.entry(hash).or_default();
            *times += 1;
            if *times > met {
                found.first.get_or_insert((number, world));
                let is_set = flag.is_some_and(|flag| flag.world(record, schema.endian) != 0.0);
                found.synthetic += u64::from(is_set);
            }
            Ok(())
        })?;
        Ok(found)
    }
}

/// Calls `visit` with the number, the place and the bytes of every record, in the order of the
/// file.
fn each_record(
    source: &dyn Source,
    mut visit: impl FnMut(u64, [f64; 3], &[u8]) -> Result<()>,
) -> Result<()> {
    let schema: &Schema = source.schema();
    let nowhere = || Error::new(ErrorKind::Data, "the reduced scan has no coordinates");
    let axes = schema.coordinates().ok_or_else(nowhere)?;
    let mut batch = PointBatch::new(source.schema().clone(), BATCH);
    let mut number = 0;
    for part in 0..source.parts() {
        let mut part = source.part(part)?;
        loop {
            batch.clear();
            part.read(&mut batch)?;
            if batch.is_empty() {
                break;
            }
            for record in batch.iter() {
                let world = axes.map(|axis| axis.world(record, schema.endian));
                visit(number, world, record)?;
                number += 1;
            }
        }
    }
    Ok(())
}
