//! What tiles leave behind becomes chunks of the output, cut by rank, and stored fates.

use super::survey::{FATE_BYTES, fate_code};
use crate::Result;
use crate::tile::{Fate, PIECE, Pieces, Tile};

/// What a tile leaves behind.
pub(super) struct Product {
    /// First record and number of records of each kept position.
    kept: Vec<(u64, u32)>,
    /// Normals of the kept positions, if the sink wants them.
    normals: Option<Vec<[f32; 3]>>,
    /// Fates of all core positions, as stored.
    fates: Vec<u8>,
}

impl Product {
    /// What `tile` leaves behind, whose core positions have these first records.
    pub fn of(tile: &Tile, first_records: &[u64], wants_normals: bool) -> Self {
        let core = tile.core.clone();
        let mut product = Product {
            kept: Vec::with_capacity(core.len()),
            normals: wants_normals.then(|| Vec::with_capacity(core.len())),
            fates: Vec::with_capacity(core.len() * FATE_BYTES),
        };
        for (&first, i) in first_records.iter().zip(core) {
            let records = match tile.fates[i] {
                Fate::Kept => tile.copies[i],
                Fate::KeptOnce => 1,
                Fate::Removed | Fate::Represented { .. } => 0,
            };
            product.fates.extend_from_slice(&fate_code(tile.fates[i]));
            if records > 0 {
                product.kept.push((first, records));
                if let Some(normals) = &mut product.normals {
                    normals.push(tile.normals[i]);
                }
            }
        }
        product
    }

    /// Positions of the tile's core.
    pub fn positions(&self) -> u64 {
        (self.fates.len() / FATE_BYTES) as u64
    }
}

/// Records that become one chunk of the output, as a product has them: a position with a million
/// copies is one entry of each chunk that it fills.
pub(super) struct Chunk {
    /// First record and number of records of each position.
    records: Vec<(u64, u32)>,
    /// Normals of the positions, if the sink wants them.
    normals: Option<Vec<[f32; 3]>>,
}

impl Chunk {
    fn empty(wants_normals: bool) -> Self {
        Chunk { records: Vec::new(), normals: wants_normals.then(Vec::new) }
    }

    /// Replaces `numbers` by the numbers of its records.
    pub fn number(&self, numbers: &mut Vec<u64>) {
        numbers.clear();
        numbers.extend(self.records.iter().flat_map(|&(first, n)| first..first + u64::from(n)));
    }

    /// The normal of each record.
    pub fn spread_normals(&self) -> Option<Vec<[f32; 3]>> {
        let each = self.records.iter().map(|&(_, n)| n as usize).zip(self.normals.as_ref()?);
        Some(each.flat_map(|(n, &normal)| std::iter::repeat_n(normal, n)).collect())
    }
}

/// Cuts kept records into chunks of the sink's size by their rank, and stores fates.
pub(super) struct Cutter<'a> {
    fates: &'a Pieces,
    fate_bytes: Vec<u8>,
    fates_stored: u64,
    chunk_points: usize,
    wants_normals: bool,
    open: Chunk,
    /// Records that the open chunk takes until it is full.
    room: usize,
    kept: u64,
}

impl<'a> Cutter<'a> {
    /// A cutter for chunks of `chunk_points` records that stores fates in `fates`.
    pub fn new(fates: &'a Pieces, chunk_points: usize, wants_normals: bool) -> Self {
        Cutter {
            fates,
            fate_bytes: Vec::with_capacity(PIECE * FATE_BYTES),
            fates_stored: 0,
            chunk_points,
            wants_normals,
            open: Chunk::empty(wants_normals),
            room: chunk_points,
            kept: 0,
        }
    }

    /// The chunks that the next product completes.
    pub fn cut(&mut self, product: Product) -> Result<Vec<Chunk>> {
        self.store_fates(&product.fates)?;
        let mut full = Vec::new();
        for (n, &(mut first, mut left)) in product.kept.iter().enumerate() {
            while left > 0 {
                let now = left.min(u32::try_from(self.room).unwrap_or(u32::MAX));
                self.open.records.push((first, now));
                if let (Some(open), Some(normals)) = (&mut self.open.normals, &product.normals) {
                    open.push(normals[n]);
                }
                (first, left) = (first + u64::from(now), left - now);
                self.room -= now as usize;
                if self.room == 0 {
                    full.push(self.close());
                }
            }
        }
        Ok(full)
    }

    fn close(&mut self) -> Chunk {
        self.kept += (self.chunk_points - self.room) as u64;
        self.room = self.chunk_points;
        std::mem::replace(&mut self.open, Chunk::empty(self.wants_normals))
    }

    fn store_fates(&mut self, mut fates: &[u8]) -> Result<()> {
        while !fates.is_empty() {
            let room = PIECE * FATE_BYTES - self.fate_bytes.len();
            let (now, later) = fates.split_at(room.min(fates.len()));
            self.fate_bytes.extend_from_slice(now);
            fates = later;
            if self.fate_bytes.len() == PIECE * FATE_BYTES {
                self.flush_fates()?;
            }
        }
        Ok(())
    }

    fn flush_fates(&mut self) -> Result<()> {
        if !self.fate_bytes.is_empty() {
            self.fates.put(self.fates_stored, &self.fate_bytes)?;
            self.fates_stored += (self.fate_bytes.len() / FATE_BYTES) as u64;
            self.fate_bytes.clear();
        }
        Ok(())
    }

    /// The last chunk, and how many records are kept in all.
    pub fn finish(&mut self) -> Result<(Vec<Chunk>, u64)> {
        self.flush_fates()?;
        let rest = if self.open.records.is_empty() { Vec::new() } else { vec![self.close()] };
        Ok((rest, self.kept))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::tile::{Folder, SpillArea};

    #[derive(Debug)]
    struct Nowhere;

    impl Folder for Nowhere {
        fn file(&self, _name: &str) -> Result<std::path::PathBuf> {
            Err(crate::Error::internal("nothing spills here"))
        }
    }

    #[test]
    fn chunks_are_cut_by_rank_and_copies_are_one_entry() {
        let area = SpillArea::new(Budget::new(1 << 20), 1 << 20, Box::new(Nowhere));
        let fates = Pieces::new(&area, "fates", FATE_BYTES);
        fates.reserve(8);
        let mut cutter = Cutter::new(&fates, 1000, true);
        let product = |kept: &[(u64, u32)]| Product {
            kept: kept.to_vec(),
            normals: Some(kept.iter().map(|&(first, _)| [first as f32; 3]).collect()),
            fates: vec![0; kept.len() * FATE_BYTES],
        };
        let copies = 10_000_000;
        let mut chunks = cutter.cut(product(&[(0, 1), (1, 2), (7, copies)])).unwrap();
        assert_eq!(chunks.len(), 10_000);
        assert!(chunks.iter().all(|chunk| chunk.records.len() <= 3));
        chunks.extend(cutter.cut(product(&[(20_000_000, 5)])).unwrap());
        let (rest, kept) = cutter.finish().unwrap();
        chunks.extend(rest);
        assert_eq!(kept, 3 + u64::from(copies) + 5);
        let (mut numbers, mut ranks) = (Vec::new(), 0);
        let expected = (0..3).chain(7..7 + u64::from(copies)).chain(20_000_000..20_000_005);
        let mut expected = expected.peekable();
        for chunk in &chunks {
            chunk.number(&mut numbers);
            assert!(numbers.iter().all(|&number| expected.next() == Some(number)));
            let normals = chunk.spread_normals().unwrap();
            assert_eq!(normals.len(), numbers.len());
            assert!(numbers.iter().zip(normals).all(|(&n, normal)| match n {
                0 => normal[0] == 0.0,
                1..3 => normal[0] == 1.0,
                7..20_000_000 => normal[0] == 7.0,
                _ => normal[0] == 2e7,
            }));
            ranks += numbers.len();
            assert!(ranks % 1000 == 0 || expected.peek().is_none());
        }
        assert_eq!(expected.next(), None);
    }
}
