//! What can be said of one input: the marks of an ordinary outcome, or a broken promise.

use std::hash::{DefaultHasher, Hash, Hasher};

use pointmill::point::PointBatch;
use pointmill::stage::{Sink, Source};
use pointmill::{Error, ErrorKind};

use crate::support::allocator;

/// What came of an input that broke no promise, or the promise that it broke.
pub type Judgement = Result<Outcome, String>;

/// An ordinary outcome.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub struct Outcome {
    /// True if the input was taken, false if it was refused.
    pub accepted: bool,
    /// What there is to tell of it, each by itself: an input with a mark not seen before is worth
    /// keeping.
    pub marks: Vec<String>,
}

/// The outcome of an input that was refused by `error`; a broken promise if it may not be.
pub fn refused(stage: &str, error: &Error, allowed: &[ErrorKind]) -> Judgement {
    let text = proper(stage, error, allowed)?;
    let byte = if error.byte().is_some() { " at a byte" } else { "" };
    let marks = vec![format!("{stage}: {}{byte}", shape(&text))];
    Ok(Outcome { accepted: false, marks })
}

/// The text of an error that may be.
pub fn proper(stage: &str, error: &Error, allowed: &[ErrorKind]) -> Result<String, String> {
    let text = error.to_string();
    if !allowed.contains(&error.kind()) {
        return Err(format!("{stage} failed as {:?}: {error:?}", error.kind()));
    }
    if text.trim().is_empty() {
        return Err(format!("{stage} failed and does not say why"));
    }
    Ok(text)
}

/// A message without what differs from input to input: digits, and what stands in backticks, quotes
/// or brackets.
pub fn shape(message: &str) -> String {
    let mut shape = String::new();
    let mut quoted = None;
    for c in message.chars() {
        match quoted {
            Some(end) if c == end => quoted = None,
            Some(_) => continue,
            None if c == '`' || c == '"' => quoted = Some(c),
            None if c == '[' => quoted = Some(']'),
            None if c.is_ascii_digit() => {
                if !shape.ends_with('#') {
                    shape.push('#');
                }
                continue;
            }
            None => {}
        }
        shape.push(c);
        if shape.len() > 160 {
            break;
        }
    }
    shape
}

/// A number as its order of magnitude.
pub fn magnitude(number: u64) -> u32 {
    u64::BITS - number.leading_zeros()
}

/// Records that are read of each part, at most.
const MOST_RECORDS: usize = 4096;
/// Parts that are read, at most.
const MOST_PARTS: usize = 16;
/// Bytes of a batch, if a record is not longer.
const BATCH_BYTES: usize = 1 << 18;
/// Bytes that reading a part may hold besides what the source says: boxes, paths, the batch.
const SLACK: usize = BATCH_BYTES + (64 << 10);

/// What reading some records of a source came to.
#[derive(Debug, PartialEq, Eq)]
pub struct Read {
    /// Records that were read.
    pub records: u64,
    /// A hash of them.
    pub hash: u64,
    /// True if these are all.
    pub all: bool,
    /// What reading ended with.
    pub error: Option<String>,
}

/// Bytes that a part of a source may hold for it to be worth trying.
const MOST_BYTES: usize = 16 << 20;

/// Reads a source without the dimensions `unread`; none if a part holds too much to be worth
/// trying. The error is a broken promise.
pub fn read_without(
    source: &dyn Source,
    unread: &[String],
    allowed: &[ErrorKind],
) -> Result<Option<Read>, String> {
    let (stride, says) = (source.schema().stride, source.part_bytes());
    if says > MOST_BYTES as u64 || stride == 0 {
        return Ok(None);
    }
    read(source, (BATCH_BYTES / stride).clamp(1, 129), unread, allowed).map(Some)
}

/// Reads a source twice, in batches of different capacity, and compares; none if a part holds too
/// much to be worth trying. The error is a broken promise.
pub fn read_twice(source: &dyn Source, allowed: &[ErrorKind]) -> Result<Option<Read>, String> {
    let stride = source.schema().stride;
    let says = usize::try_from(source.part_bytes()).unwrap_or(usize::MAX);
    if says > MOST_BYTES || stride == 0 {
        return Ok(None);
    }
    // Powers of two divide the number of records after which reading stops.
    let large = (BATCH_BYTES / stride).clamp(1, MOST_RECORDS);
    let large = if large.is_power_of_two() { large } else { large.next_power_of_two() / 2 };
    let one = read(source, large, &[], allowed)?;
    let (two, peak) = allocator::peak_of(|| read(source, (large / 32).max(1), &[], allowed));
    let two = two?;
    if one.error.is_some() != two.error.is_some() || (one.error.is_none() && one != two) {
        return Err(format!("read twice, it differs: {one:?} and {two:?}"));
    }
    if peak > says + SLACK + stride {
        return Err(format!("reading holds {peak} bytes and said {says} for a part"));
    }
    // Where cells of a grid have no point, the inputs say how many there were once all are read.
    let inputs = source.inputs();
    let points = inputs.iter().map(|input| input.points).sum();
    let points = if inputs.is_empty() { source.points() } else { points };
    if one.all && one.error.is_none() && one.records != points {
        return Err(format!("{} records of {points} and no error", one.records));
    }
    Ok(Some(one))
}

fn read(
    source: &dyn Source,
    capacity: usize,
    unread: &[String],
    allowed: &[ErrorKind],
) -> Result<Read, String> {
    let mut hasher = DefaultHasher::new();
    let mut read = Read { records: 0, hash: 0, all: source.parts() <= MOST_PARTS, error: None };
    let mut batch = PointBatch::new(source.schema().clone(), capacity);
    for index in 0..source.parts().min(MOST_PARTS) {
        match read_part(source, index, unread, &mut batch, &mut hasher) {
            Ok((records, all)) => {
                read.records += records as u64;
                read.all &= all;
            }
            Err(error) => {
                read.error = Some(proper("reading", &error, allowed)?);
                break;
            }
        }
    }
    read.hash = hasher.finish();
    Ok(read)
}

/// Hashes a record, the same for a GPS time of 0 and of -0: LAZ writes the second as the first.
fn hash(record: &[u8], layered: bool, hasher: &mut DefaultHasher) {
    match record.split_at_checked(30).filter(|_| layered) {
        Some((point, rest)) if point[22..] == (-0.0f64).to_le_bytes() => {
            (&point[..22], &[0u8; 8][..], rest).hash(hasher);
        }
        Some((point, rest)) => (&point[..22], &point[22..], rest).hash(hasher),
        None => record.hash(hasher),
    }
}

/// Records read of a part, and whether these are all.
fn read_part(
    source: &dyn Source,
    index: usize,
    unread: &[String],
    batch: &mut PointBatch,
    hasher: &mut DefaultHasher,
) -> pointmill::Result<(usize, bool)> {
    let mut part = source.part_without(index, unread)?;
    let mut records = 0;
    while records < MOST_RECORDS {
        batch.clear();
        part.read(batch)?;
        if batch.is_empty() {
            return Ok((records, true));
        }
        assert!(batch.len() <= batch.capacity(), "a batch has more than its capacity");
        let layered = batch.schema().layout.form.is_some_and(|format| format >= 6);
        batch.iter().for_each(|record| hash(record, layered, hasher));
        records += batch.len();
    }
    Ok((records, false))
}

/// Writes all the points of a source.
pub fn pour(source: &dyn Source, mut sink: Box<dyn Sink>) -> pointmill::Result<()> {
    let schema = source.schema();
    let encoder = sink.encoder();
    let mut batch = PointBatch::new(schema.clone(), sink.chunk_points().min(512));
    for index in 0..source.parts() {
        let mut part = source.part(index)?;
        loop {
            batch.clear();
            part.read(&mut batch)?;
            if batch.is_empty() {
                break;
            }
            sink.append(encoder.encode(&batch)?)?;
        }
    }
    sink.finish().map(drop)
}
