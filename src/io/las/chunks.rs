//! Where the chunks of a LAZ file are. Every claim is held against the file's length before it
//! costs memory.

use super::damage::Mending;
use super::file::InputFile;
use super::header::Header;
use super::laz::{Compression, Compressor, Damage, Numbers, Why};
pub use super::table::Chunk;
use super::table::ChunkList;
use crate::error::shown;
use crate::{Error, Result};

/// Points that one compressed byte can hold at most: a point costs six symbols or more, and no
/// symbol costs less than 2^-9 bits.
const POINTS_PER_BYTE: u64 = 1 << 12;
/// Bytes in front of the first chunk, which say where the chunk table is.
const TABLE_OFFSET_BYTES: u64 = 8;

/// The chunks of a file.
#[derive(Debug, Clone)]
pub enum Chunks {
    /// Known one by one: they can be read in any order.
    Known(ChunkList),
    /// Known to follow each other: they are read in one go.
    InARow {
        /// All of them; `points` as the header claims.
        all: Chunk,
        /// Points of each but the last.
        chunk_points: u64,
    },
}

impl Chunks {
    /// Finds the chunks of `file` with so many points, which end before byte `end`; those that are
    /// not there are lost, if damage is mended.
    pub fn read(
        file: &InputFile,
        (header, points): (&Header, u64),
        compression: &Compression,
        end: u64,
        mending: &mut Mending,
    ) -> Result<Self> {
        let start = u64::from(header.offset_to_point_data);
        if points == 0 {
            return Ok(Chunks::Known(ChunkList::default()));
        }
        if compression.compressor == Compressor::PointWise {
            let all = Chunk { start, end, points, whole: true };
            let all = plausible(file, all, mending)?;
            return Ok(Chunks::Known(ChunkList::of(all)));
        }
        let first = start + TABLE_OFFSET_BYTES;
        if first > file.len() {
            let error = file
                .wrong(file.len(), "the file ends before its first point")
                .help("the copy or download is incomplete");
            mending.lose(file, file.len(), points, error)?;
            return Ok(Chunks::Known(ChunkList::default()));
        }
        let why = match table(file, start, points, compression, mending) {
            Ok(found) => return Ok(found),
            Err(Unusable::Because(why)) => why,
            Err(Unusable::Failed(error)) => return Err(error),
        };
        match (compression.compressor, compression.chunk_points) {
            (Compressor::Layered, _) => {
                mending.warnings.push(format!("{}: {why}", shown(file.path())));
                walk(file, first, points, compression, mending).map(Chunks::Known)
            }
            (_, Some(chunk_points)) => {
                let all = Chunk { start: first, end: file.len(), points, whole: false };
                let all = plausible(file, all, mending)?;
                let chunk_points = u64::from(chunk_points);
                let warning = format!("{}: {why}; it is read by one thread", shown(file.path()));
                mending.warnings.push(warning);
                Ok(Chunks::InARow { all, chunk_points })
            }
            (_, None) => Err(file
                .wrong(start, format!("{why}, and chunks of varying size need one"))
                .help("the copy or download is incomplete")),
        }
    }

    /// Points to read.
    pub fn points(&self) -> u64 {
        match self {
            Chunks::Known(chunks) => chunks.points(),
            Chunks::InARow { all, .. } => all.points,
        }
    }
}

/// `all`, whose points can be in its bytes.
fn plausible(file: &InputFile, all: Chunk, mending: &mut Mending) -> Result<Chunk> {
    let most = all.end.saturating_sub(all.start).saturating_mul(POINTS_PER_BYTE);
    if all.points <= most {
        return Ok(all);
    }
    let error = file
        .wrong(all.start, format!("{} points cannot be in the bytes left from here", all.points))
        .help("the file is cut off, or its header's count is damaged");
    mending.lose(file, all.end, all.points - most, error)?;
    Ok(Chunk { points: most, ..all })
}

/// Bytes of compressed points where the header counts none; None if there are none, or it counts
/// some.
pub fn uncounted(
    file: &InputFile,
    header: &Header,
    evlrs_start: Option<u64>,
    compression: &Compression,
) -> Result<Option<u64>> {
    let start = u64::from(header.offset_to_point_data);
    let first = start + TABLE_OFFSET_BYTES;
    if header.points() > 0 || first > file.len() {
        return Ok(None);
    }
    let table = table_start(file, start)?;
    let end = table.or(evlrs_start.filter(|&at| at >= first)).unwrap_or(file.len());
    // Less than one stored point are an empty chunk table, or what a writer pads with.
    Ok(Some(end - first).filter(|&bytes| bytes > compression.stride as u64))
}

/// Why a chunk table is not used.
pub enum Unusable {
    /// It is damaged or missing.
    Because(String),
    /// It cannot be read, so that what it says is not known, or is too long.
    Failed(Error),
}

impl<T: Into<String>> From<T> for Unusable {
    fn from(why: T) -> Self {
        Unusable::Because(why.into())
    }
}

/// Refuses a file of more chunks than are held.
fn too_many(file: &InputFile, chunks: &ChunkList) -> Error {
    let (chunks, points) = (chunks.chunks(), chunks.points());
    let told =
        format!("its first {chunks} chunks hold {points} points: that is a table too long to hold");
    Error::data(file.path(), told).help(
        "write it anew with chunks of more points (50,000 are usual); LASzip and PDAL do that by \
         themselves",
    )
}

/// The chunks as the chunk table says, or why it cannot be used.
fn table(
    file: &InputFile,
    start: u64,
    points: u64,
    compression: &Compression,
    mending: &mut Mending,
) -> Result<Chunks, Unusable> {
    let at = table_start(file, start).map_err(Unusable::Failed)?;
    let at = at.ok_or("the file has no chunk table where it says")?;
    let variable = compression.chunk_points.is_none();
    let mut chunks = ChunkList::default();
    let (mut byte, mut left, mut unread) = (start + TABLE_OFFSET_BYTES, points, 0u64);
    let entry = |bytes: u64, held: u64| {
        if left == 0 {
            unread += if variable { held } else { 1 };
        } else if held > 0 {
            if bytes < compression.stride as u64 {
                return Err("the chunk table's sizes cannot be".into());
            }
            // The table of fixed chunks does not say how many points the last one has.
            let whole = if variable { held <= left } else { true };
            let points = held.min(left);
            if !chunks.push(Chunk { start: byte, end: byte + bytes, points, whole }) {
                return Err(Unusable::Failed(too_many(file, &chunks)));
            }
            unread += if variable { held - points } else { 0 };
            left -= points;
        }
        byte += bytes;
        Ok(())
    };
    let room = at - start - TABLE_OFFSET_BYTES;
    entries(file, at, room, compression, entry)?;
    if left > 0 {
        let why = "the chunk table holds fewer points than the header claims";
        let error = file.wrong(at, why);
        if !mending.mends(&error) {
            return Err(why.into());
        }
        mending.lose(file, at, left, error).map_err(Unusable::Failed)?;
    }
    if unread > 0 {
        let what = if variable { "points" } else { "chunks" };
        mending.warnings.push(format!(
            "{}: {unread} {what} behind the {points} points of the header are not read",
            shown(file.path())
        ));
    }
    Ok(Chunks::Known(chunks.closed()))
}

/// Where the chunk table is: told in front of the first chunk, or, by writers that could not go
/// back, at the end of the file.
pub fn table_start(file: &InputFile, start: u64) -> Result<Option<u64>> {
    let inside = |at: u64| {
        let room = start + TABLE_OFFSET_BYTES..=file.len().checked_sub(8)?;
        room.contains(&at).then_some(at)
    };
    let told = |byte: u64| -> Result<u64> {
        let mut bytes = [0; 8];
        file.read_at(&mut bytes, byte)?;
        Ok(u64::from_le_bytes(bytes))
    };
    let Some(end) = file.len().checked_sub(8).filter(|end| start <= *end) else { return Ok(None) };
    let front = told(start)?;
    let unset = front as i64 <= start as i64;
    match inside(front) {
        None if unset => told(end).map(inside),
        found => Ok(found),
    }
}

/// Hands bytes and points of every chunk to `take`, as the table at byte `at` says. Stops as
/// soon as they exceed the `room` that chunks have.
pub fn entries(
    file: &InputFile,
    at: u64,
    room: u64,
    compression: &Compression,
    mut take: impl FnMut(u64, u64) -> Result<(), Unusable>,
) -> Result<(), Unusable> {
    let cut = |damage: Damage| match damage.why {
        Why::Unread(error) => Unusable::Failed(error),
        _ => Unusable::from("the chunk table is cut off"),
    };
    let mut head = [0; 8];
    file.read_at(&mut head, at).map_err(Unusable::Failed)?;
    let claimed = u32::from_le_bytes([head[4], head[5], head[6], head[7]]);
    if head[..4] != [0; 4] {
        return Err("the chunk table is of an unknown version".into());
    }
    let smallest = compression.stride as u64;
    if u64::from(claimed) > room / smallest {
        let told = format!("the chunk table claims {claimed} chunks, more than there is room for");
        return Err(told.into());
    }
    let mut numbers = Numbers::new(file, at + 8);
    let (mut last_bytes, mut last_points, mut used) = (0i32, 0i32, 0u64);
    for _ in 0..claimed {
        let held = match compression.chunk_points {
            Some(fixed) => u64::from(fixed),
            None => {
                last_points = numbers.read(last_points, 0).map_err(cut)?;
                u64::from(last_points as u32)
            }
        };
        last_bytes = numbers.read(last_bytes, 1).map_err(cut)?;
        let bytes = u64::from(last_bytes as u32);
        used += bytes;
        if used > room {
            return Err("the chunk table's sizes exceed the bytes of the chunks".into());
        }
        take(bytes, held)?;
    }
    // Points of chunks of varying size cannot be found without the table: then it is taken as it
    // is.
    let is_needed =
        compression.compressor != Compressor::Layered && compression.chunk_points.is_none();
    if used != room && !is_needed {
        return Err("the chunk table's sizes do not add up to the bytes of the chunks".into());
    }
    Ok(())
}

/// The chunks of a layered file without a usable table: each says how long its layers are.
fn walk(
    file: &InputFile,
    first: u64,
    points: u64,
    compression: &Compression,
    mending: &mut Mending,
) -> Result<ChunkList> {
    let (mut start, mut left) = (first, points);
    let mut chunks = ChunkList::default();
    while left > 0 {
        let head = match layered_head(file, start, file.len(), compression) {
            Ok(head) => head,
            Err(error) => {
                mending.lose(file, start, left, error)?;
                break;
            }
        };
        let held = head.points.min(left);
        let end = start + head.bytes;
        if !chunks.push(Chunk { start, end, points: held, whole: held == head.points }) {
            return Err(too_many(file, &chunks));
        }
        left -= held;
        start = end;
    }
    Ok(chunks.closed())
}

/// What a layered chunk says of itself behind its first point.
#[derive(Debug, Clone, Copy)]
pub struct LayeredHead {
    /// Points in it, above 0.
    pub points: u64,
    /// Bytes of it; within the file.
    pub bytes: u64,
}

/// Reads the head of the layered chunk at `start`, which must not reach beyond `end`.
pub fn layered_head(
    file: &InputFile,
    start: u64,
    end: u64,
    compression: &Compression,
) -> Result<LayeredHead> {
    let at = start + compression.stride as u64;
    let cut = |byte: u64| {
        file.wrong(byte, "the compressed points end inside a chunk")
            .help("the file is cut off or damaged; ask for it again")
    };
    let len = 4 + 4 * compression.layers;
    if at + len as u64 > end.min(file.len()) {
        return Err(cut(end.min(file.len())));
    }
    let head = file.bytes(at, len)?;
    let mut words = head.as_chunks().0.iter().map(|b| u64::from(u32::from_le_bytes(*b)));
    let points = words.next().unwrap_or(0);
    if points == 0 {
        return Err(file
            .wrong(at, "a chunk says that it is empty and has a point")
            .help("the file is damaged; ask for it again"));
    }
    let bytes = at + len as u64 - start + words.sum::<u64>();
    if start + bytes > end.min(file.len()) {
        return Err(cut(at));
    }
    Ok(LayeredHead { points, bytes })
}
