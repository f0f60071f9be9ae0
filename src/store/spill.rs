//! What a run sets down between its phases (points, their order, states, columns): in memory while
//! the budget allows, in scratch files beyond.
//!
//! Reading is the same call for both, so nothing else in a run asks whether a scan fits in memory.
//! Files are read by calls and not mapped into memory: mapped pages count as the process's own, and
//! the bound on memory could not be kept. What comes from a file is compared with the checksum of
//! what was written, so that a disk that damages data fails a run and changes no output.

use serde::{Deserialize, Serialize};

use std::fs::File;
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, RwLock, RwLockReadGuard};

use crate::budget::{Budget, Lease};
use crate::host::lock;
use crate::{Error, ErrorKind, Result};

/// What all spills of a run share: how much may stay in memory, and the folder for the rest.
#[derive(Debug)]
pub struct SpillArea {
    budget: Budget,
    in_memory: Mutex<u64>,
    folder: Box<dyn Folder>,
    written: AtomicU64,
}

/// Names files in a scratch folder, which is made when the first one is asked for.
pub trait Folder: Send + Sync + std::fmt::Debug {
    /// The path for a new scratch file called `name`.
    fn file(&self, name: &str) -> Result<PathBuf>;
}

impl SpillArea {
    /// Keeps up to `memory` bytes, leased from `budget`; the rest goes into `folder`.
    pub fn new(budget: Budget, memory: u64, folder: Box<dyn Folder>) -> Arc<Self> {
        Arc::new(SpillArea {
            budget,
            in_memory: Mutex::new(memory),
            folder,
            written: AtomicU64::new(0),
        })
    }

    /// What stays in memory is leased from this.
    pub(crate) fn budget(&self) -> &Budget {
        &self.budget
    }

    /// Bytes written to scratch files so far.
    pub fn written(&self) -> u64 {
        self.written.load(Ordering::Relaxed)
    }

    fn keep(&self, bytes: u64) -> Option<Lease> {
        let mut left = lock(&self.in_memory);
        let rest = left.checked_sub(bytes)?;
        let lease = self.budget.lease(bytes, "points kept in memory").ok()?;
        *left = rest;
        Some(lease)
    }

    fn give_back(&self, bytes: u64) {
        *lock(&self.in_memory) += bytes;
    }
}

/// Where an appended stretch begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Address(u64);

/// Set in addresses that lie in a scratch file. Below it are the number of the segment or the file
/// and a byte in it.
const IN_FILE: u64 = 1 << 63;
const SEGMENT_BITS: u32 = 32;
const FILE_BITS: u32 = 55;

/// Scratch files of a spill at most: more threads than these write to them in turn.
const FILES: usize = 8;

impl Address {
    /// The address `bytes` further in the same stretch.
    pub fn plus(self, bytes: u64) -> Address {
        Address(self.0 + bytes)
    }

    /// The checksum of `bytes`, which are stored from here on.
    ///
    /// It depends on the address, so that a part that comes from another place is noticed too. What
    /// stays in memory is not verified and costs nothing.
    pub fn checksum(self, bytes: &[u8]) -> Checksum {
        match self.is_in_file() {
            true => Checksum(self.sum(bytes)),
            false => Checksum::default(),
        }
    }

    /// True if it lies in a scratch file.
    pub fn is_in_file(self) -> bool {
        self.0 & IN_FILE != 0
    }

    fn sum(self, bytes: &[u8]) -> u32 {
        // Addresses of one file differ in their low bits, those of two files in the highest.
        let mut sum = crc32fast::Hasher::new_with_initial(self.0 as u32 ^ (self.0 >> 32) as u32);
        sum.update(bytes);
        sum.finalize()
    }

    /// Byte `byte` of scratch file `file`.
    pub(super) fn in_file(file: usize, byte: u64) -> Address {
        Address(IN_FILE | (file as u64) << FILE_BITS | byte)
    }

    /// The scratch file and the byte of it; None in memory.
    pub(super) fn file_and_byte(self) -> Option<(usize, u64)> {
        let within = self.0 & !IN_FILE;
        let place = ((within >> FILE_BITS) as usize, within & ((1 << FILE_BITS) - 1));
        self.is_in_file().then_some(place)
    }

    /// The stretch in memory and the byte of it.
    pub(super) fn stretch_and_byte(self) -> (u64, u64) {
        (self.0 >> SEGMENT_BITS, u64::from(self.0 as u32))
    }

    /// Compares `bytes`, read from here on, with the checksum of what was written here.
    ///
    /// # Errors
    ///
    /// Of kind [`ErrorKind::Io`], with the byte, if they are others.
    pub(super) fn verify(self, checksum: Checksum, bytes: &[u8]) -> Result<()> {
        let Some((_, byte)) = self.file_and_byte() else { return Ok(()) };
        if self.sum(bytes) == checksum.0 {
            return Ok(());
        }
        let told = "what was read of this scratch file is not what was written to it";
        Err(Error::new(ErrorKind::Io, told).at_byte(byte).help(
            "the disk or the memory damages data: check them, or name a folder on another disk as \
             `run.scratch`",
        ))
    }
}

/// What was stored from an address on, as a number that a read compares with what comes: see
/// [`Address::checksum`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Checksum(u32);

/// An appended stretch that is always read whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredStretch {
    address: Address,
    length: u32,
    checksum: Checksum,
}

/// A stretch can begin with the place of another, so that a chain of them is known by its last.
impl StoredStretch {
    /// Bytes of such a place.
    pub const LINK: usize = size_of::<u64>() + 2 * size_of::<u32>();

    /// The place of `stretch` as bytes; that of none is zeros.
    pub fn link(stretch: Option<StoredStretch>) -> [u8; Self::LINK] {
        let mut bytes = [0; Self::LINK];
        if let Some(StoredStretch { address, length, checksum }) = stretch {
            bytes[..8].copy_from_slice(&address.0.to_le_bytes());
            bytes[8..12].copy_from_slice(&length.to_le_bytes());
            bytes[12..].copy_from_slice(&checksum.0.to_le_bytes());
        }
        bytes
    }

    /// The place that a stretch of these bytes begins with.
    ///
    /// # Errors
    ///
    /// A stretch that is too short to begin with one.
    pub fn linked(bytes: &[u8]) -> Result<Option<StoredStretch>> {
        let short = || Error::internal("a stretch of a chain has no link");
        let (address, rest) = bytes.split_first_chunk().ok_or_else(short)?;
        let (length, rest) = rest.split_first_chunk().ok_or_else(short)?;
        let checksum = rest.first_chunk().ok_or_else(short)?;
        let stretch = StoredStretch {
            address: Address(u64::from_le_bytes(*address)),
            length: u32::from_le_bytes(*length),
            checksum: Checksum(u32::from_le_bytes(*checksum)),
        };
        Ok((stretch.length > 0).then_some(stretch))
    }
}

/// Appended stretches of bytes of one sort. Dropping it frees its memory and removes its files.
#[derive(Debug)]
pub struct Spill {
    area: Arc<SpillArea>,
    name: &'static str,
    segments: RwLock<Vec<(Box<[u8]>, Lease)>>,
    files: RwLock<Vec<Arc<ScratchFile>>>,
}

/// One scratch file. Threads that write at the same time write to different ones, for the system
/// lets only one at a time write to a file.
#[derive(Debug)]
struct ScratchFile {
    file: File,
    path: PathBuf,
    end: AtomicU64,
    writers: AtomicUsize,
}

impl Spill {
    /// An empty spill; `name` is that of its scratch files, should it need any.
    pub fn new(area: &Arc<SpillArea>, name: &'static str) -> Self {
        Spill { area: area.clone(), name, segments: RwLock::default(), files: RwLock::default() }
    }

    /// Stores a stretch of less than 4 GiB; from several threads at once.
    pub fn append(&self, bytes: &[u8]) -> Result<Address> {
        if let Some(lease) = self.area.keep(bytes.len() as u64) {
            let mut segments = self.segments.write().unwrap_or_else(PoisonError::into_inner);
            segments.push((bytes.into(), lease));
            return Ok(Address((segments.len() as u64 - 1) << SEGMENT_BITS));
        }
        let (number, scratch) = self.file_to_write()?;
        let at = scratch.end.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        let outcome = scratch.file.write_all_at(bytes, at);
        scratch.writers.fetch_sub(1, Ordering::Relaxed);
        outcome.map_err(|e| scratch.fail("write scratch data", e))?;
        self.area.written.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        Ok(Address::in_file(number, at))
    }

    /// Stores a stretch of less than 4 GiB that [`load`](Spill::load) reads again.
    pub fn store(&self, bytes: &[u8]) -> Result<StoredStretch> {
        let address = self.append(bytes)?;
        let checksum = address.checksum(bytes);
        Ok(StoredStretch { address, length: bytes.len() as u32, checksum })
    }

    /// Replaces what is in `into` by a stored stretch.
    pub fn load(&self, stretch: &StoredStretch, into: &mut Vec<u8>) -> Result<()> {
        into.resize(stretch.length as usize, 0);
        self.read(stretch.address, stretch.checksum, into)
    }

    /// Fills `into` with what was stored from `at` on, within one stretch, and has this `checksum`.
    ///
    /// # Errors
    ///
    /// Of kind [`ErrorKind::Io`], with the scratch file and the byte, if something else comes back.
    pub fn read(&self, at: Address, checksum: Checksum, into: &mut [u8]) -> Result<()> {
        self.read_unverified(at, into)?;
        self.verify(at, checksum, into)
    }

    /// Compares `bytes`, read from `at` on, with the checksum of what was written there.
    pub(crate) fn verify(&self, at: Address, checksum: Checksum, bytes: &[u8]) -> Result<()> {
        at.verify(checksum, bytes).map_err(|error| {
            let files = self.files();
            match at.file_and_byte().and_then(|(number, _)| files.get(number)) {
                Some(scratch) => error.at(&scratch.path),
                None => error,
            }
        })
    }

    /// As [`read`](Spill::read), for a caller that verifies what comes part by part.
    pub(crate) fn read_unverified(&self, at: Address, into: &mut [u8]) -> Result<()> {
        let lost = || Error::internal(format!("{}: read beyond a stretch", self.name));
        let Some((number, byte)) = at.file_and_byte() else {
            let segments = self.segments.read().unwrap_or_else(PoisonError::into_inner);
            let (stretch, from) = at.stretch_and_byte();
            let from = from as usize;
            let stored = segments
                .get(stretch as usize)
                .and_then(|(bytes, _)| bytes.get(from..from + into.len()))
                .ok_or_else(lost)?;
            into.copy_from_slice(stored);
            return Ok(());
        };
        let scratch = self.files().get(number).cloned().ok_or_else(lost)?;
        scratch.file.read_exact_at(into, byte).map_err(|e| scratch.fail("read scratch data", e))
    }

    /// The name that its scratch files have.
    pub(super) fn name(&self) -> &'static str {
        self.name
    }

    /// The paths of its scratch files, by their numbers.
    pub(super) fn paths(&self) -> Vec<PathBuf> {
        self.files().iter().map(|scratch| scratch.path.clone()).collect()
    }

    fn files(&self) -> RwLockReadGuard<'_, Vec<Arc<ScratchFile>>> {
        self.files.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// A file and its number, for one write: the one with the fewest writers, a new one where each
    /// has some and there are fewer than [`FILES`]. The caller is counted among them.
    fn file_to_write(&self) -> Result<(usize, Arc<ScratchFile>)> {
        let mut files = self.files.write().unwrap_or_else(PoisonError::into_inner);
        let writers = |n: &usize| files[*n].writers.load(Ordering::Relaxed);
        let least = (0..files.len()).min_by_key(writers);
        let number = match least.filter(|n| files.len() == FILES || writers(n) == 0) {
            Some(number) => number,
            None => {
                let path = self.area.folder.file(&format!("{}-{}", self.name, files.len()))?;
                files.push(Arc::new(ScratchFile::create(path)?));
                files.len() - 1
            }
        };
        files[number].writers.fetch_add(1, Ordering::Relaxed);
        Ok((number, files[number].clone()))
    }
}

impl ScratchFile {
    fn create(path: PathBuf) -> Result<Self> {
        let file = File::options()
            .read(true)
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(&path)
            .map_err(|e| Error::io(&path, "create a scratch file", e))?;
        Ok(ScratchFile { file, path, end: AtomicU64::new(0), writers: AtomicUsize::new(0) })
    }

    fn fail(&self, doing: &str, cause: std::io::Error) -> Error {
        let full = cause.kind() == std::io::ErrorKind::StorageFull;
        let error = Error::io(&self.path, doing, cause);
        if full {
            return error.help("free some disk space, or name another folder with `run.scratch`");
        }
        error
    }
}

impl Drop for Spill {
    fn drop(&mut self) {
        let segments = self.segments.get_mut().unwrap_or_else(PoisonError::into_inner);
        self.area.give_back(segments.iter().map(|(bytes, _)| bytes.len() as u64).sum());
        for scratch in self.files.get_mut().unwrap_or_else(PoisonError::into_inner) {
            // The scratch folder is removed as a whole at the end; this only frees the disk early.
            let _ = std::fs::remove_file(&scratch.path);
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::path::Path;

    use super::*;

    /// A folder for files of tests.
    #[derive(Debug)]
    pub struct In(pub PathBuf);

    impl Folder for In {
        fn file(&self, name: &str) -> Result<PathBuf> {
            Ok(self.0.join(name))
        }
    }

    fn spill(at: &Path) -> Spill {
        let folder = Box::new(In(at.to_owned()));
        Spill::new(&SpillArea::new(Budget::new(1 << 20), 0, folder), "found")
    }

    #[test]
    fn a_stretch_that_comes_back_as_another_is_told_with_its_file_and_byte() {
        let at = tempfile::tempdir().unwrap();
        let spill = spill(at.path());
        let first = spill.store(&[7; 300]).unwrap();
        let second = spill.store(&[7; 300]).unwrap();
        let mut into = Vec::new();
        spill.load(&second, &mut into).unwrap();
        assert_eq!(into, [7; 300]);
        let file = at.path().join("found-0");
        let mut bytes = std::fs::read(&file).unwrap();
        for at in [300, 411, 599] {
            bytes[at] ^= 1;
            std::fs::write(&file, &bytes).unwrap();
            let error = spill.load(&second, &mut into).unwrap_err();
            assert_eq!((error.kind(), error.byte()), (ErrorKind::Io, Some(300)));
            assert_eq!(error.path(), Some(file.as_path()));
            assert!(error.remedy().unwrap().contains("`run.scratch`"), "{error:?}");
            bytes[at] ^= 1;
        }
        spill.load(&first, &mut into).unwrap();
        // Equal bytes at another address have another checksum.
        assert_ne!(first.checksum, second.checksum);
    }
}
