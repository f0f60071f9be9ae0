//! What a run sets down between its phases (points, their order, states, columns): in memory while the
//! budget allows, in scratch files beyond. Reading is the same call for both.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard};

use crate::budget::{Budget, Lease};
use crate::{Error, Result};

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

/// Locks, also after a panic of another thread: what is guarded here is never left half-changed.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Where an appended stretch begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
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
        Ok(Address(IN_FILE | (number as u64) << FILE_BITS | at))
    }

    /// Fills `into` with what was stored from `at` on, within one stretch.
    pub fn read(&self, at: Address, into: &mut [u8]) -> Result<()> {
        let lost = || Error::internal(format!("{}: read beyond a stretch", self.name));
        if at.0 & IN_FILE == 0 {
            let segments = self.segments.read().unwrap_or_else(PoisonError::into_inner);
            let from = at.0 as u32 as usize;
            let stored = segments
                .get((at.0 >> SEGMENT_BITS) as usize)
                .and_then(|(bytes, _)| bytes.get(from..from + into.len()))
                .ok_or_else(lost)?;
            into.copy_from_slice(stored);
            return Ok(());
        }
        let number = (at.0 & !IN_FILE) >> FILE_BITS;
        let scratch = self.files().get(number as usize).cloned().ok_or_else(lost)?;
        let byte = at.0 & ((1 << FILE_BITS) - 1);
        scratch.file.read_exact_at(into, byte).map_err(|e| scratch.fail("read scratch data", e))
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
