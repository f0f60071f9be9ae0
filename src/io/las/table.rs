//! The chunks of a LAZ file in little memory: a file may have millions of chunks of a point each.
//! Knows not where its figures come from.

/// Small chunks are read together until a part has this many points.
const PART_POINTS: u64 = 50_000;
/// Bytes that the sizes of all chunks take at most, besides one for so many points: a budget has
/// room for them before it is known, and no writer needs as many for less than 8 million chunks.
const SIZES_MOST: u64 = 16 << 20;
const POINTS_A_BYTE: u64 = 4096;

/// Bytes of sizes that stand in one piece, or a part more: a list that grows would for a moment be
/// held twice.
const PIECE: usize = 64 << 10;

/// One chunk: its stretch of the file and its points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chunk {
    /// First byte.
    pub start: u64,
    /// Byte behind the last.
    pub end: u64,
    /// Points to read.
    pub points: u64,
    /// True if the chunk holds no others.
    pub whole: bool,
}

/// Chunks that follow each other, in parts of some that are read together.
#[derive(Debug, Clone, Default)]
pub struct ChunkList {
    parts: Vec<Place>,
    /// Bytes and points of each chunk, in as few bytes as they take, in pieces; no part is in two.
    sizes: Vec<Vec<u8>>,
    /// Bytes of all of them.
    bytes: u64,
    chunks: u64,
    points: u64,
    last: Option<Chunk>,
    /// Chunks and points of the last part.
    open: (u64, u64),
    /// Chunks of the part that has most.
    most_chunks: u64,
}

/// Where the chunks of a part begin, in the file and among the sizes.
#[derive(Debug, Clone, Copy)]
struct Place {
    start: u64,
    piece: usize,
    at: usize,
    /// Chunks before it.
    before: u64,
}

impl ChunkList {
    /// The table of one chunk.
    pub fn of(chunk: Chunk) -> ChunkList {
        let mut table = ChunkList::default();
        table.push(chunk);
        table
    }

    /// Adds the next chunk; false if there are more than are held.
    pub fn push(&mut self, chunk: Chunk) -> bool {
        let start = self.last.map_or(chunk.start, |last| last.end);
        if self.open.1 >= PART_POINTS || self.parts.is_empty() {
            self.begin(start);
        }
        // Bytes between two chunks are those of one without points, which is left out.
        if start < chunk.start {
            self.put(chunk.start - start, 0);
        }
        self.put(chunk.end - chunk.start, chunk.points);
        self.open = (self.open.0 + 1, self.open.1 + chunk.points);
        (self.chunks, self.points) = (self.chunks + 1, self.points + chunk.points);
        self.most_chunks = self.most_chunks.max(self.open.0);
        self.last = Some(chunk);
        is_held(self.bytes(), self.points)
    }

    /// Begins a part.
    fn begin(&mut self, start: u64) {
        if self.sizes.last().is_none_or(|piece| piece.len() >= PIECE) {
            self.sizes.push(Vec::new());
        }
        let at = self.sizes.last().map_or(0, Vec::len);
        let piece = self.sizes.len() - 1;
        self.parts.push(Place { start, piece, at, before: self.chunks });
        self.open = (0, 0);
    }

    fn put(&mut self, bytes: u64, points: u64) {
        let Some(piece) = self.sizes.last_mut() else { return };
        let before = piece.len();
        put(piece, bytes);
        put(piece, points);
        self.bytes += (piece.len() - before) as u64;
    }

    /// The same in no more memory than it needs.
    pub fn closed(mut self) -> ChunkList {
        self.sizes.iter_mut().for_each(Vec::shrink_to_fit);
        self.parts.shrink_to_fit();
        self
    }

    /// Bytes of all sizes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Chunks in it.
    pub fn chunks(&self) -> u64 {
        self.chunks
    }

    /// Points in all chunks.
    pub fn points(&self) -> u64 {
        self.points
    }

    /// How many parts there are.
    pub fn parts(&self) -> usize {
        self.parts.len()
    }

    /// Bytes of the list of a part's chunks.
    pub fn part_bytes(&self) -> u64 {
        self.most_chunks.saturating_mul(size_of::<Chunk>() as u64)
    }

    /// The chunks of a part.
    pub fn part(&self, index: usize) -> Vec<Chunk> {
        let Some(place) = self.parts.get(index) else { return Vec::new() };
        let next = self.parts.get(index + 1);
        let piece = self.sizes.get(place.piece).map_or(&[][..], |piece| piece);
        let end = next.filter(|next| next.piece == place.piece).map_or(piece.len(), |next| next.at);
        let (mut start, mut sizes) = (place.start, piece.get(place.at..end).unwrap_or(&[]));
        let mut chunks = Vec::new();
        while let (Some(bytes), Some(points)) = (take(&mut sizes), take(&mut sizes)) {
            let end = start + bytes;
            if points > 0 {
                chunks.push(Chunk { start, end, points, whole: true });
            }
            start = end;
        }
        if let (None, Some(chunk), Some(last)) = (next, chunks.last_mut(), self.last) {
            *chunk = last;
        }
        chunks
    }

    /// How many chunks stand before those of a part.
    pub fn before(&self, index: usize) -> u64 {
        self.parts.get(index).map_or(self.chunks, |part| part.before)
    }

    /// The last chunk has but so many points.
    pub fn shorten_last(&mut self, points: u64) {
        if let Some(last) = &mut self.last {
            self.points -= last.points - points.min(last.points);
            last.points = points.min(last.points);
        }
    }

    /// The last chunk, to be corrected.
    pub fn last(&mut self) -> Option<&mut Chunk> {
        self.last.as_mut()
    }
}

/// True if so many bytes of sizes, of chunks with so many points, are held.
pub fn is_held(bytes: u64, points: u64) -> bool {
    bytes <= SIZES_MOST.saturating_add(points / POINTS_A_BYTE)
}

/// Adds a number, seven bits a byte, the lowest first.
fn put(to: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        to.push(number as u8 | 0x80);
        number >>= 7;
    }
    to.push(number as u8);
}

fn take(from: &mut &[u8]) -> Option<u64> {
    let (mut number, mut shift) = (0, 0);
    loop {
        let (&byte, rest) = from.split_first()?;
        *from = rest;
        number |= u64::from(byte & 0x7f).checked_shl(shift)?;
        if byte < 0x80 {
            return Some(number);
        }
        shift += 7;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_gives_the_chunks_that_it_was_given() {
        let mut chunks = Vec::new();
        let mut start = 1_000;
        for i in 0..300_000u64 {
            let points =
                [1, 1, 3, 70, 50_000, 127, 128][i as usize % 7 % if i < 200_000 { 4 } else { 7 }];
            // Empty chunks of any size are left out.
            start += if i % 1000 == 999 { i * i } else { 0 };
            let end = start + 20 + points * 3 + (i % 5) * (1 << 33) * u64::from(i % 50_000 == 1);
            chunks.push(Chunk { start, end, points, whole: true });
            start = end;
        }
        chunks.last_mut().unwrap().whole = false;
        let mut table = ChunkList::default();
        assert!(chunks.iter().all(|chunk| table.push(*chunk)));
        let table = table.closed();
        assert_eq!(table.chunks(), 300_000);
        assert_eq!(table.points(), chunks.iter().map(|chunk| chunk.points).sum::<u64>());
        let parts: Vec<Vec<Chunk>> = (0..table.parts()).map(|part| table.part(part)).collect();
        assert!(parts.len() > 100 && table.part(parts.len()).is_empty());
        let most = parts.iter().map(Vec::len).max().unwrap();
        assert_eq!(table.part_bytes(), (most * size_of::<Chunk>()) as u64);
        let (last, others) = parts.split_last().unwrap();
        let points = |part: &Vec<Chunk>| part.iter().map(|c| c.points).sum::<u64>();
        assert!(!last.is_empty() && others.iter().all(|part| points(part) >= PART_POINTS));
        assert!(parts.concat() == chunks);
        let before = |part: usize| parts[..part].iter().map(Vec::len).sum::<usize>() as u64;
        assert!((0..=parts.len()).all(|part| table.before(part) == before(part)));
    }

    #[test]
    fn a_chunk_of_a_point_takes_two_bytes_and_too_many_are_refused() {
        let mut table = ChunkList::default();
        let chunk = |i: u64| Chunk { start: 30 * i, end: 30 * i + 30, points: 1, whole: true };
        let held = (0..).take_while(|i| table.push(chunk(*i))).count() as u64;
        assert!((SIZES_MOST / 2..SIZES_MOST / 2 + 4096).contains(&held), "{held}");
        assert!(table.bytes() < SIZES_MOST + 4096);
        // A scan of any size in usual chunks is.
        let usual =
            |i: u64| Chunk { start: i << 19, end: (i + 1) << 19, points: 50_000, whole: true };
        let mut table = ChunkList::default();
        assert!((0..4_000_000).all(|i| table.push(usual(i))));
    }
}
