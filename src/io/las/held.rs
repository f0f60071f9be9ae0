//! How many points there are in the chunks of a file, whatever its header counts. Knows not what is
//! done about the difference.

use super::chunks::{entries, layered_head, table_start};
use super::file::InputFile;
use super::header::Header;
use super::laz::{Compression, Compressor, Decoder};
use crate::Result;

/// How many points there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HeldPoints {
    /// So many at least.
    pub least: u64,
    /// So many at most: the same where the chunks tell it.
    pub most: u64,
}

impl HeldPoints {
    fn exactly(points: u64) -> HeldPoints {
        HeldPoints { least: points, most: points }
    }
}

/// The points of all chunks that the chunk table of `file` has; None where it has no table that can
/// be used, or a chunk does not say how many points it has and its bytes do not either.
///
/// # Errors
///
/// What the system refuses to read.
pub fn held(
    file: &InputFile,
    header: &Header,
    compression: &Compression,
) -> Result<Option<HeldPoints>> {
    let start = u64::from(header.offset_to_point_data);
    if compression.compressor == Compressor::PointWise || start > file.len() {
        return Ok(None);
    }
    let Some(table) = table_start(file, start)? else { return Ok(None) };
    let first = start + 8;
    let Some(room) = table.checked_sub(first) else { return Ok(None) };
    // Where the last chunk begins and ends, and its points by the table.
    let (mut points, mut byte, mut last) = (0u64, first, None);
    let found = entries(file, table, room, compression, |bytes, held| {
        if held > 0 {
            points += held;
            last = Some((byte, byte + bytes, held));
        }
        byte += bytes;
        Ok(())
    });
    let (Ok(()), Some((from, to, full))) = (found, last) else { return Ok(None) };
    if compression.chunk_points.is_none() {
        return Ok(Some(HeldPoints::exactly(points)));
    }
    let in_last = match compression.compressor {
        Compressor::Layered => {
            let head = layered_head(file, from, to, compression).ok();
            head.map(|head| HeldPoints::exactly(head.points))
        }
        _ => decoded(file, compression, (from, to), full),
    };
    let before = points - full;
    Ok(in_last.filter(|last| last.most <= full).map(|HeldPoints { least, most }| HeldPoints {
        least: before + least,
        most: before + most,
    }))
}

/// The points of a chunk that says nothing of them: as many as it takes to come to its end. Where
/// records are alike they cost next to no bits, and the end may be that of several counts.
fn decoded(
    file: &InputFile,
    compression: &Compression,
    (from, to): (u64, u64),
    most: u64,
) -> Option<HeldPoints> {
    let mut decoder = Decoder::new(compression, file);
    let mut record = vec![0; compression.stride];
    decoder.begin(from, to);
    let mut found: Option<HeldPoints> = None;
    for points in 1..=most {
        if decoder.read(&mut record).is_err() {
            break;
        }
        if decoder.finish().is_ok() {
            found.get_or_insert(HeldPoints::exactly(points)).most = points;
        }
    }
    found
}
