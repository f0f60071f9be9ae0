//! Target `las`: header, records, chunk table and points of a LAS or LAZ file.

use std::path::Path;

use pointmill::ErrorKind::{self, Data, Pipeline};
use pointmill::internals::las::{LasOptions, create, describe};
use pointmill::io::las::open;
use pointmill::point::{PointBatch, Schema};
use pointmill::stage::Source;

use super::judge::{self, Judgement, Outcome, Read, magnitude, shape};
use super::las_seeds::seeds;
use super::{Target, mutate};
use crate::support::las_file::header_size;
use crate::support::random::Random;

/// The target.
pub const TARGET: Target =
    Target { name: "las", judge: target, seeds: |_| seeds(), mutate: change, at_home: false };

/// How a file that is no good is refused.
const REFUSED: &[ErrorKind] = &[Data];

fn target(path: &Path, data: &[u8]) -> Judgement {
    if let Err(error) = describe(path) {
        judge::proper("describe", &error, REFUSED)?;
    }
    let source = match open(&[path.to_owned()]) {
        Ok(source) => source,
        Err(error) => return judge::refused("open", &error, REFUSED),
    };
    let schema = source.schema().clone();
    let mut marks: Vec<String> =
        source.warnings().iter().map(|w| format!("warning: {}", shape(w))).collect();
    marks.push(format!(
        "schema: {:?} of {} dimensions",
        schema.layout,
        schema.dimensions.len().min(40)
    ));
    let crs = source.metadata().crs.as_deref().map(|crs| shape(crs).chars().take(6).collect());
    marks.push(format!("crs: {:?}", crs.unwrap_or_else(String::new)));
    let parts = magnitude(source.parts() as u64);
    marks.push(format!("size: 2^{} points in 2^{parts} parts", magnitude(source.points())));
    twice_the_file(path, &*source)?;
    let Some(read) = judge::read_twice(&*source, REFUSED)? else {
        marks.push("a part holds too much".to_owned());
        return Ok(Outcome { accepted: true, marks });
    };
    marks.push(match &read.error {
        Some(error) => format!("points: {}", shape(error)),
        None => format!("format {:?} read, {}", schema.layout, read.all),
    });
    if read.all && read.error.is_none() {
        // An encoder of very long records holds more than is worth trying.
        let compressed = data.len().is_multiple_of(2) && schema.stride < 4096;
        marks.extend(written(path, &*source, &schema, &read, compressed)?);
    }
    Ok(Outcome { accepted: read.error.is_none(), marks })
}

/// A file agrees with itself, or says why not.
fn twice_the_file(path: &Path, once: &dyn Source) -> Result<(), String> {
    match open(&[path.to_owned(), path.to_owned()]) {
        Ok(both) if both.points() == once.points().saturating_mul(2) => Ok(()),
        Ok(both) => Err(format!("{} points twice are {}", once.points(), both.points())),
        Err(error) => judge::proper("merge", &error, REFUSED).map(drop),
    }
}

/// What was read can be written, and is the same when read again.
fn written(
    path: &Path,
    source: &dyn Source,
    schema: &std::sync::Arc<Schema>,
    read: &Read,
    compressed: bool,
) -> Result<Option<String>, String> {
    let copy = path.with_extension(if compressed { "laz" } else { "las" });
    let options = LasOptions { compressed, computed: Vec::new() };
    match copy_of(&copy, source, schema, options) {
        Ok(()) => {}
        Err(error) => {
            let text = judge::proper("write", &error, &[Data, Pipeline])?;
            return Ok(Some(format!("write: {}", shape(&text))));
        }
    }
    let again = open(&[copy]).map_err(|e| format!("our own output does not open: {e:?}"))?;
    match judge::read_twice(&*again, REFUSED)? {
        Some(same) if same == *read => Ok(None),
        Some(other) => Err(format!(
            "written and read again, compressed {compressed}: {read:?} became {other:?}"
        )),
        None => Ok(None),
    }
}

fn copy_of(
    copy: &Path,
    source: &dyn Source,
    schema: &std::sync::Arc<Schema>,
    options: LasOptions,
) -> pointmill::Result<()> {
    let mut sink = create(copy, &options, schema, source.metadata())?;
    let encoder = sink.encoder();
    let mut batch = PointBatch::new(schema.clone(), 64);
    // The plan would see that a chunk fits the memory; here are few points, however long.
    let mut all = PointBatch::new(schema.clone(), source.points() as usize);
    for index in 0..source.parts() {
        let mut part = source.part(index)?;
        loop {
            batch.clear();
            part.read(&mut batch)?;
            if batch.is_empty() {
                break;
            }
            all.extend(batch.records());
        }
    }
    if !all.is_empty() {
        sink.append(encoder.encode(&all)?)?;
    }
    sink.finish().map(drop)
}

/// Fields of the header: byte and width.
const FIELDS: [(usize, usize); 26] = [
    (6, 2),
    (24, 1),
    (25, 1),
    (94, 2),
    (96, 4),
    (100, 4),
    (104, 1),
    (105, 2),
    (107, 4),
    (111, 4),
    (227, 8),
    (235, 8),
    (243, 4),
    (247, 8),
    (255, 8),
    (131, 0),
    (139, 0),
    (147, 0),
    (155, 0),
    (163, 0),
    (171, 0),
    (179, 0),
    (187, 0),
    (195, 0),
    (203, 0),
    (219, 0),
];

const WORDS: [&[u8]; 10] = [
    b"LASF",
    b"LASF_Projection\0",
    b"LASF_Spec\0\0\0\0\0\0\0",
    b"laszip encoded\0\0",
    b"copc\0\0\0\0\0\0\0\0\0\0\0\0",
    b"LAStools\0\0\0\0\0\0\0\0",
    b"PROJCS[\"\"]",
    b"\x3e\x08",
    b"\xbc\x56",
    b"\xaf\x87",
];

/// Changes what describes the points, and bytes anywhere.
pub fn change(random: &mut Random, data: &mut Vec<u8>, other: &[u8]) {
    match random.below(10) {
        0..3 => {
            let (at, width) = random.one_of(&FIELDS);
            if width == 0 {
                mutate::put_float(random, data, at);
            } else {
                mutate::put_number(random, data, at, width);
            }
        }
        3..6 => field_of_a_record(random, data),
        6 => records(random, data, other),
        _ => mutate::bytes(random, data, other, &WORDS),
    }
}

/// The number of `N` bytes at `at`.
pub fn word<const N: usize>(data: &[u8], at: usize) -> u64 {
    let mut bytes = [0; 8];
    if let Some(field) = data.get(at..at + N) {
        bytes[..N].copy_from_slice(field);
    }
    u64::from_le_bytes(bytes)
}

/// Where the variable length records are: start and length, head included.
fn vlrs(data: &[u8]) -> Vec<(usize, usize)> {
    let mut all = Vec::new();
    let mut at = word::<2>(data, 94) as usize;
    for _ in 0..word::<4>(data, 100).min(64) {
        if at + 54 > data.len() {
            break;
        }
        let len = 54 + word::<2>(data, at + 20) as usize;
        all.push((at, len));
        at += len;
    }
    all
}

/// Changes a field of a record, of the laszip record, of the chunk table or of an extended record.
fn field_of_a_record(random: &mut Random, data: &mut [u8]) {
    let vlrs = vlrs(data);
    let start = word::<4>(data, 96) as usize;
    let table = word::<8>(data, start) as usize;
    let evlr = word::<8>(data, 235) as usize;
    let (at, (field, width)) = match random.below(8) {
        0 if !vlrs.is_empty() => {
            (random.one_of(&vlrs).0, random.one_of(&[(2, 8), (18, 2), (20, 2)]))
        }
        1..4 => {
            let named = |at: usize| data.get(at + 2..).is_some_and(|d| d.starts_with(b"laszip"));
            let Some(&(at, _)) = vlrs.iter().find(|(at, _)| named(*at)) else { return };
            const FIELDS: [(usize, usize); 8] =
                [(0, 2), (2, 2), (8, 4), (12, 4), (16, 8), (24, 8), (32, 2), (34, 2)];
            let item = (34 + 2 * random.below(12), 2);
            (at + 54, if random.one_in(2) { item } else { random.one_of(&FIELDS) })
        }
        4 => (start, (0, 8)),
        5 => (table, random.one_of(&[(0, 4), (4, 4), (8, 4), (12, 4), (9, 1), (11, 1)])),
        6 if word::<1>(data, 25) >= 4 => (evlr, random.one_of(&[(2, 8), (18, 2), (20, 8)])),
        _ => (start, (random.below(200), random.one_of(&[1, 2, 4]))),
    };
    mutate::put_number(random, data, at.saturating_add(field), width);
}

/// Adds, repeats or removes a whole variable length record, and mends the header.
fn records(random: &mut Random, data: &mut Vec<u8>, other: &[u8]) {
    let (ours, theirs) = (vlrs(data), vlrs(other));
    let at = ours.first().map_or(header_size(4), |v| v.0);
    let copied =
        |from: &[u8], (at, len): (usize, usize)| from.get(at..at + len).map(<[u8]>::to_vec);
    let count = word::<4>(data, 100);
    let start = word::<4>(data, 96);
    if random.one_in(3) && !ours.is_empty() {
        let (at, len) = random.one_of(&ours);
        data.drain(at..(at + len).min(data.len()));
        mend(data, start.wrapping_sub(len as u64), count.wrapping_sub(1));
        return;
    }
    let list = if random.one_in(2) { (data.as_slice(), ours) } else { (other, theirs) };
    if list.1.is_empty() {
        return;
    }
    let Some(record) = copied(list.0, random.one_of(&list.1)) else { return };
    let times = if random.one_in(8) { 1 + random.below(300) } else { 1 };
    mutate::insert(data, at, &record.repeat(times));
    mend(data, start + (record.len() * times) as u64, count + times as u64);
}

fn mend(data: &mut [u8], start: u64, vlrs: u64) {
    if let Some(fields) = data.get_mut(96..104) {
        fields[..4].copy_from_slice(&(start as u32).to_le_bytes());
        fields[4..].copy_from_slice(&(vlrs as u32).to_le_bytes());
    }
}
