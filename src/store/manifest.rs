//! What the stores of a sealed scan consist of, as a list that can be written down: what is stored,
//! where, and the checksums of all that is in files.
//!
//! A run knows where its pieces are by tables that live and die with it. Written down, they would
//! let another process find the same pieces, and tell whether each is still what it was. No run
//! makes such a list yet, nor keeps its store: a list is as long as the scan has pieces, and a run
//! would have to lease memory for it.

#![cfg_attr(not(test), allow(dead_code, reason = "no run keeps its store yet"))]

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::pieces::Pieces;
use super::sealed::SealedTiles;
use super::spill::{Address, Checksum, Spill};
use crate::{Error, Result};

/// The stores of a sealed scan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoreManifest {
    /// Positions, order, records, and the places of records in the input where they are kept.
    pub stores: Vec<ListedStore>,
}

/// One store and all that it has.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ListedStore {
    /// Its name, which its files have too.
    pub name: String,
    /// Bytes of an item; None where items are packed.
    pub item_bytes: Option<usize>,
    /// Its scratch files.
    pub files: Vec<PathBuf>,
    /// What it has, by the numbers of the items.
    pub pieces: Vec<ListedPiece>,
}

/// Items that follow one another in one place, and are verified together if that is in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ListedPiece {
    /// Number of the first item.
    pub first: u64,
    /// How many there are.
    pub items: u64,
    /// Bytes that they take.
    pub bytes: u64,
    /// Where they are.
    pub place: ListedPlace,
}

/// Where a piece is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ListedPlace {
    /// In the memory of the process.
    Memory {
        /// Which stretch of the store.
        stretch: u64,
        /// From which byte of it on.
        byte: u64,
    },
    /// In a scratch file.
    File {
        /// Which of the store's.
        file: usize,
        /// From which byte of it on.
        byte: u64,
        /// What its bytes must have.
        checksum: Checksum,
    },
}

impl SealedTiles {
    /// The list of all that is stored of the scan.
    pub fn manifest(&self) -> StoreManifest {
        let block = |number: usize| {
            let block = self.block(number);
            let (address, checksum, bytes) = block.stored();
            let place = ListedPlace::of(address, checksum);
            ListedPiece { first: block.first_position, items: block.len() as u64, bytes, place }
        };
        let blocks = (0..self.blocks()).map(block).collect();
        let numbered = [Some(&self.refs), Some(&self.records), self.places.as_ref()];
        let positions = ListedStore::of(&self.spill, None, blocks);
        let numbered = numbered.into_iter().flatten().map(ListedStore::numbered);
        StoreManifest { stores: [positions].into_iter().chain(numbered).collect() }
    }
}

impl StoreManifest {
    /// Reads again all that is in files.
    ///
    /// # Errors
    ///
    /// The file and the byte of the first piece that is not what was stored, or cannot be read.
    pub fn verify(&self) -> Result<()> {
        self.stores.iter().try_for_each(ListedStore::verify)
    }
}

impl ListedStore {
    fn of(spill: &Spill, item_bytes: Option<usize>, pieces: Vec<ListedPiece>) -> Self {
        ListedStore { name: spill.name().to_owned(), item_bytes, files: spill.paths(), pieces }
    }

    fn numbered(stored: &Pieces) -> Self {
        let (spill, stride) = (stored.spill(), stored.stride());
        let piece = |(first, items, address, checksum): (u64, u64, Address, Checksum)| {
            let place = ListedPlace::of(address, checksum);
            ListedPiece { first, items, bytes: items * stride as u64, place }
        };
        ListedStore::of(spill, Some(stride), stored.units().into_iter().map(piece).collect())
    }

    fn verify(&self) -> Result<()> {
        let open = |path: &PathBuf| File::open(path).map_err(|e| Error::io(path, "read it", e));
        let files: Vec<File> = self.files.iter().map(open).collect::<Result<_>>()?;
        let mut bytes = Vec::new();
        for piece in &self.pieces {
            let ListedPlace::File { file, byte, checksum } = piece.place else { continue };
            let unknown = || Error::internal(format!("{}: a file that is not listed", self.name));
            let (path, open) = self.files.get(file).zip(files.get(file)).ok_or_else(unknown)?;
            bytes.resize(piece.bytes as usize, 0);
            open.read_exact_at(&mut bytes, byte).map_err(|e| Error::io(path, "read it", e))?;
            let at = Address::in_file(file, byte);
            at.verify(checksum, &bytes).map_err(|error| error.at(path))?;
        }
        Ok(())
    }
}

impl ListedPlace {
    fn of(address: Address, checksum: Checksum) -> Self {
        match address.file_and_byte() {
            Some((file, byte)) => ListedPlace::File { file, byte, checksum },
            None => {
                let (stretch, byte) = address.stretch_and_byte();
                ListedPlace::Memory { stretch, byte }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::*;
    use crate::ErrorKind;
    use crate::budget::Budget;
    use crate::host::Threads;
    use crate::store::spill::tests::In;
    use crate::store::{Intake, SpillArea, Tag, TileStore, seal};

    const STRIDE: usize = 37;
    const RECORDS: u64 = 30_000;

    /// A sealed scan of three runs with tags and places, whose every fifth record shares its
    /// position with another; `memory` bytes of it stay in memory.
    fn sealed(at: &Path, memory: u64) -> SealedTiles {
        let budget = Budget::new(1 << 30);
        let area: Arc<SpillArea> = SpillArea::new(budget.clone(), memory, Box::new(In(at.into())));
        let store = TileStore::new(&area, &budget, STRIDE, true).with_places();
        let mut intake = Intake::new(&store, RECORDS as usize / 3);
        for n in 0..RECORDS {
            let mixed = |salt: u64| ((n / 5 * 4 + n % 5 % 4) * salt % 100_003) as i64;
            let record: Vec<u8> = (0..STRIDE as u64).map(|i| (n * 31 + i) as u8).collect();
            let position = [mixed(7_919), mixed(104_729), mixed(31)];
            intake.push(position, &record, Tag::default()).unwrap();
        }
        intake.flush().unwrap();
        drop(intake);
        Threads::start(2, |threads| seal(store, threads, &|_| Ok(()))).unwrap()
    }

    #[test]
    fn the_manifest_of_a_spilled_scan_lists_every_piece_and_finds_a_flipped_byte() {
        let at = tempfile::tempdir().unwrap();
        let tiles = sealed(at.path(), 0);
        let manifest = tiles.manifest();
        let names: Vec<&str> = manifest.stores.iter().map(|store| &*store.name).collect();
        assert_eq!(names, ["positions", "order", "records", "places"]);
        assert!(tiles.positions() < RECORDS * 5 / 6 && tiles.points() == RECORDS);
        let text = serde_json::to_string(&manifest).unwrap();
        assert_eq!(serde_json::from_str::<StoreManifest>(&text).unwrap(), manifest);
        manifest.verify().unwrap();
        for store in &manifest.stores {
            let items: u64 = store.pieces.iter().map(|piece| piece.items).sum();
            let expected = if store.item_bytes.is_none() { tiles.positions() } else { RECORDS };
            assert_eq!(items, expected, "{}", store.name);
            assert!(store.pieces.len() > 10 && !store.files.is_empty(), "{}", store.name);
            // Together they are all bytes of the store's files, each once.
            let place = |piece: &ListedPiece| match piece.place {
                ListedPlace::File { file, byte, .. } => (file, byte, piece.bytes),
                ListedPlace::Memory { .. } => panic!("{}: {piece:?}", store.name),
            };
            let mut places: Vec<_> = store.pieces.iter().map(place).collect();
            places.sort_unstable();
            for (number, path) in store.files.iter().enumerate() {
                let of_file = places.iter().filter(|(file, ..)| *file == number);
                let end = of_file.fold(0, |end, &(_, byte, bytes)| {
                    assert_eq!(end, byte, "{}", store.name);
                    byte + bytes
                });
                assert_eq!(end, std::fs::metadata(path).unwrap().len());
                flipped_bytes_are_found(&manifest, path);
            }
        }
        manifest.verify().unwrap();
    }

    fn flipped_bytes_are_found(manifest: &StoreManifest, path: &Path) {
        let whole = std::fs::read(path).unwrap();
        for at in [0, whole.len() / 3, whole.len() - 1] {
            let mut damaged = whole.clone();
            damaged[at] ^= 16;
            std::fs::write(path, damaged).unwrap();
            let error = manifest.verify().unwrap_err();
            assert_eq!((error.kind(), error.path()), (ErrorKind::Io, Some(path)));
            let byte = error.byte().unwrap() as usize;
            assert!(byte <= at && at < byte + 8192, "{byte} {at}");
        }
        std::fs::write(path, whole).unwrap();
    }

    #[test]
    fn what_is_in_memory_is_listed_too() {
        let at = tempfile::tempdir().unwrap();
        let (kept, spilled) = (sealed(at.path(), 1 << 30).manifest(), sealed(at.path(), 0));
        let spilled = spilled.manifest();
        for (kept, spilled) in kept.stores.iter().zip(&spilled.stores) {
            assert!(kept.files.is_empty() && !kept.pieces.is_empty());
            let in_memory = |p: &ListedPiece| matches!(p.place, ListedPlace::Memory { .. });
            assert!(kept.pieces.iter().all(in_memory), "{}", kept.name);
            let bytes = |of: &ListedStore| of.pieces.iter().map(|piece| piece.bytes).sum::<u64>();
            assert_eq!(bytes(kept), bytes(spilled), "{}", kept.name);
        }
    }
}
