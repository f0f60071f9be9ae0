//! What tells the files of a split apart: how the records of a chunk are sorted by file.

use std::sync::Arc;

use super::super::by_time::ByTime;
use super::super::job::Job;
use crate::budget::Bytes;
use crate::point::{Dimension, Endian, PointBatch};
use crate::stage::{CreateSink, Encode, OutputSplit, SplitKey};
use crate::store::RecordState;
use crate::{Error, Result};

/// Bytes of a file that are left for what an output says of its run, and for tables at its end.
const RESERVE: u64 = 256 << 10;
/// Sides from the origin at most: whole numbers are exact in a `f64` up to here.
const FARTHEST: f64 = (1u64 << 52) as f64;
/// What sides are short of a whole number by, at most, if they are it: decimals are seldom exact in
/// binary, and 0.3 lies on the border of squares of 0.1.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// What a record says of the file that it belongs in.
pub(super) enum SplitSorter {
    /// Where it is, by the side of squares.
    Square([Dimension; 2], f64),
    /// A value of its own.
    Value(Dimension),
    /// Its place in the output, where a file has so many records.
    Points(u64),
    /// The same, where a file has as many chunks as fit so many bytes, encoded by this in the order
    /// that they have in the file.
    Bytes(u64, Arc<dyn Encode>, Option<ByTime>),
}

impl SplitSorter {
    /// The file of a record; None where its place decides.
    pub fn key(&self, record: &[u8], endian: Endian) -> Result<Option<SplitKey>> {
        match self {
            SplitSorter::Square(axes, side) => {
                let [x, y] = axes;
                let at = [x, y].map(|axis| axis.world(record, endian));
                square(at, *side).map(Some)
            }
            SplitSorter::Value(dimension) => value(dimension, record, endian).map(Some),
            SplitSorter::Points(_) | SplitSorter::Bytes(..) => Ok(None),
        }
    }

    /// True if the place of a record decides, and not what it holds.
    pub fn is_by_place(&self) -> bool {
        matches!(self, SplitSorter::Points(_) | SplitSorter::Bytes(..))
    }

    /// Bytes that a chunk takes in a file, where these decide; else 0.
    pub fn measure(&self, batch: &PointBatch) -> Result<u64> {
        let SplitSorter::Bytes(_, encoder, by_time) = self else { return Ok(0) };
        let encoded = match by_time {
            None => encoder.encode(batch)?,
            Some(by_time) => {
                let (mut batch, mut states) =
                    (batch.clone(), vec![RecordState::ALIVE; batch.len()]);
                by_time.sort(&mut batch, &mut states);
                encoder.encode(&batch)?
            }
        };
        Ok(encoded.bytes.len() as u64)
    }
}

/// How records are ordered within the chunks of a file of sink `number`, if not as they come.
pub(super) fn by_time(job: &Job<'_>, number: usize, create: &dyn CreateSink) -> Option<ByTime> {
    let task = job.task;
    let in_chunks = task.mills && !task.in_input_order[number] && create.likes_time();
    in_chunks.then(|| ByTime::of(task.schema())).flatten()
}

/// What sorts records into files of `bytes` at most: what a file takes without points, an empty one
/// tells.
pub(super) fn measured(
    job: &Job<'_>,
    number: usize,
    split: &OutputSplit,
    bytes: u64,
) -> Result<SplitSorter> {
    let missing = || Error::internal("an output that is split has no place");
    let create = job.task.sinks[number].of_split([1, 0], split)?;
    let empty = job.outputs[number].first().ok_or_else(missing)?.scratch().path("empty")?;
    let metadata = job.task.metadata(number, Some(job.task.pipeline(number)));
    let sink = create.create(&empty, job.task.schema(), &metadata, false)?;
    let encoder = sink.encoder();
    let taken = sink.finish()?.bytes.saturating_add(RESERVE);
    std::fs::remove_file(&empty).map_err(|e| Error::io(&empty, "remove it", e))?;
    // Tables of chunks and checksums of pages grow with the points.
    let room = bytes.saturating_sub(taken) / 100 * 99;
    Ok(SplitSorter::Bytes(room, encoder, by_time(job, number, &*create)))
}

/// The square of a position.
fn square(position: [f64; 2], side: f64) -> Result<SplitKey> {
    let mut square = [0; 2];
    for (at, v) in square.iter_mut().zip(position) {
        let sides = v / side;
        let number = (sides + sides.abs() * ROUNDING).floor();
        let is_near = number.abs() < FARTHEST;
        if !is_near {
            let told = format!("the point at {position:?} lies in no square of {side}");
            return Err(Error::pipeline(told).help("give a larger `write.side`"));
        }
        *at = number as i64;
    }
    Ok(square)
}

/// The value of a record, which is a whole number.
fn value(dimension: &Dimension, record: &[u8], endian: Endian) -> Result<SplitKey> {
    let value = dimension.world(record, endian);
    let name = &dimension.name;
    let (told, help) = match value {
        _ if value.fract() != 0.0 => (
            format!("a point has {name} {value}, which is no whole number"),
            "`write.by` takes a dimension of whole numbers, such as PointSourceId",
        ),
        _ if value.abs() >= FARTHEST => (
            format!("a point has {name} {value}, and numbers of files end at 2^52"),
            "`write.by` takes a dimension of smaller whole numbers, such as PointSourceId",
        ),
        _ => return Ok([value as i64, 0]),
    };
    Err(Error::pipeline(told).help(help))
}

/// Where the next record of an output goes, whose places decide.
#[derive(Default)]
pub(super) struct NextPlace {
    /// The number of the file that is filled, from 0, and what it has: records, or bytes.
    file: i64,
    filled: u64,
}

impl NextPlace {
    /// Calls `take` with stretches of `entries`, each in so many bytes, and the files they go to.
    /// They are one chunk, which takes `measured` bytes.
    pub fn put<'e>(
        &mut self,
        sorter: &SplitSorter,
        (entries, each): (&'e [u8], usize),
        measured: u64,
        mut take: impl FnMut(SplitKey, &'e [u8]) -> Result<()>,
    ) -> Result<()> {
        match sorter {
            SplitSorter::Bytes(room, ..) => {
                if measured > *room {
                    return Err(too_small(entries.len() / each, measured, *room));
                }
                if self.filled + measured > *room {
                    (self.file, self.filled) = (self.file + 1, 0);
                }
                self.filled += measured;
                take([self.file + 1, 0], entries)
            }
            SplitSorter::Points(points) => {
                let mut rest = entries;
                while !rest.is_empty() {
                    if self.filled == *points {
                        (self.file, self.filled) = (self.file + 1, 0);
                    }
                    let left = (rest.len() / each) as u64;
                    let now = left.min(points - self.filled);
                    let (first, later) = rest.split_at(now as usize * each);
                    take([self.file + 1, 0], first)?;
                    (rest, self.filled) = (later, self.filled + now);
                }
                Ok(())
            }
            SplitSorter::Square(..) | SplitSorter::Value(_) => {
                Err(Error::internal("records that say their file came by their place"))
            }
        }
    }
}

/// The error of bytes that not even one chunk fits.
fn too_small(points: usize, measured: u64, room: u64) -> Error {
    let (chunk, room) = (Bytes(measured), Bytes(room));
    let told = format!(
        "`write.bytes` is too small: {points} points are written at once and take {chunk}, and a \
         file has room for {room} of points"
    );
    Error::pipeline(told).help("give a larger size, or `write.points`")
}
