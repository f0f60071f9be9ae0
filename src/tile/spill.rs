//! Where points wait between the decode and the mill: in memory while the budget allows, in scratch
//! files beyond. Reading is the same call for both.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

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

/// Set in addresses that lie in the scratch file; others are a segment's number and a byte in it.
const IN_FILE: u64 = 1 << 63;
const SEGMENT_BITS: u32 = 32;

impl Address {
    /// The address `bytes` further in the same stretch.
    pub fn plus(self, bytes: u64) -> Address {
        Address(self.0 + bytes)
    }
}

/// Appended stretches of bytes of one sort. Dropping it frees its memory and removes its file.
#[derive(Debug)]
pub struct Spill {
    area: Arc<SpillArea>,
    name: &'static str,
    segments: RwLock<Vec<(Box<[u8]>, Lease)>>,
    file: Mutex<Option<Arc<File>>>,
    path: Mutex<Option<PathBuf>>,
    end: AtomicU64,
}

impl Spill {
    /// An empty spill; `name` is that of its scratch file, should it need one.
    pub fn new(area: &Arc<SpillArea>, name: &'static str) -> Self {
        Spill {
            area: area.clone(),
            name,
            segments: RwLock::default(),
            file: Mutex::default(),
            path: Mutex::default(),
            end: AtomicU64::new(0),
        }
    }

    /// Stores a stretch of less than 4 GiB; from several threads at once.
    pub fn append(&self, bytes: &[u8]) -> Result<Address> {
        if let Some(lease) = self.area.keep(bytes.len() as u64) {
            let mut segments = self.segments.write().unwrap_or_else(PoisonError::into_inner);
            segments.push((bytes.into(), lease));
            return Ok(Address((segments.len() as u64 - 1) << SEGMENT_BITS));
        }
        let file = self.file()?;
        let at = self.end.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        file.write_all_at(bytes, at).map_err(|e| self.fail("write scratch data", e))?;
        self.area.written.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        Ok(Address(at | IN_FILE))
    }

    /// Fills `into` with what was stored from `at` on, within one stretch.
    pub fn read(&self, at: Address, into: &mut [u8]) -> Result<()> {
        if at.0 & IN_FILE == 0 {
            let segments = self.segments.read().unwrap_or_else(PoisonError::into_inner);
            let from = at.0 as u32 as usize;
            let stored = segments
                .get((at.0 >> SEGMENT_BITS) as usize)
                .and_then(|(bytes, _)| bytes.get(from..from + into.len()))
                .ok_or_else(|| Error::internal(format!("{}: read beyond a stretch", self.name)))?;
            into.copy_from_slice(stored);
            return Ok(());
        }
        let file = self.file()?;
        file.read_exact_at(into, at.0 & !IN_FILE).map_err(|e| self.fail("read scratch data", e))
    }

    fn file(&self) -> Result<Arc<File>> {
        let mut slot = lock(&self.file);
        if let Some(file) = slot.as_ref() {
            return Ok(file.clone());
        }
        let path = self.area.folder.file(self.name)?;
        let file = File::options()
            .read(true)
            .write(true)
            .create_new(true)
            .open(&path)
            .map_err(|e| Error::io(&path, "create a scratch file", e))?;
        *lock(&self.path) = Some(path);
        Ok(slot.insert(Arc::new(file)).clone())
    }

    fn fail(&self, doing: &str, cause: std::io::Error) -> Error {
        let path = lock(&self.path).clone().unwrap_or_else(|| PathBuf::from(self.name));
        let full = cause.kind() == std::io::ErrorKind::StorageFull;
        let error = Error::io(path, doing, cause);
        if full {
            return error.help("free some disk space, or name another folder with --scratch");
        }
        error
    }
}

impl Drop for Spill {
    fn drop(&mut self) {
        let segments = self.segments.get_mut().unwrap_or_else(PoisonError::into_inner);
        self.area.give_back(segments.iter().map(|(bytes, _)| bytes.len() as u64).sum());
        if let Some(path) = lock(&self.path).take() {
            // The scratch folder is removed as a whole at the end; this only frees the disk early.
            let _ = std::fs::remove_file(path);
        }
    }
}

/// Items of one size, stored in pieces and found by number.
///
/// Writers reserve a stretch of numbers, which begins a new piece, and store its pieces in any
/// order; numbers between two stretches name nothing.
#[derive(Debug)]
pub struct Pieces {
    spill: Spill,
    stride: usize,
    table: RwLock<Vec<Option<(Address, u32)>>>,
}

/// Items in a piece.
pub const PIECE: usize = 4096;

impl Pieces {
    /// No items yet, each `stride` bytes.
    pub fn new(area: &Arc<SpillArea>, name: &'static str, stride: usize) -> Self {
        Pieces { spill: Spill::new(area, name), stride, table: RwLock::default() }
    }

    /// Reserves `items` numbers and returns the first.
    pub fn reserve(&self, items: u64) -> u64 {
        let mut table = self.table.write().unwrap_or_else(PoisonError::into_inner);
        let first = table.len() as u64;
        let pieces = items.div_ceil(PIECE as u64) as usize;
        table.resize(first as usize + pieces, None);
        first * PIECE as u64
    }

    /// How many numbers are reserved so far.
    pub fn reserved(&self) -> u64 {
        let table = self.table.read().unwrap_or_else(PoisonError::into_inner);
        table.len() as u64 * PIECE as u64
    }

    /// Stores the items from number `first` on, a multiple of [`PIECE`]: one piece, full or the
    /// last of its stretch.
    pub fn put(&self, first: u64, bytes: &[u8]) -> Result<()> {
        let address = self.spill.append(bytes)?;
        let mut table = self.table.write().unwrap_or_else(PoisonError::into_inner);
        let piece = (first / PIECE as u64) as usize;
        let slot = table
            .get_mut(piece)
            .ok_or_else(|| Error::internal("a piece was stored that nobody reserved"))?;
        *slot = Some((address, (bytes.len() / self.stride) as u32));
        Ok(())
    }

    /// Fills `into` with the items from number `first` on, all of one piece.
    pub fn read(&self, first: u64, into: &mut [u8]) -> Result<()> {
        let (address, _) = self.piece(first)?;
        self.spill.read(address.plus(first % PIECE as u64 * self.stride as u64), into)
    }

    /// Fills `into` with the items from number `first` on, of one stretch of numbers.
    pub fn fill(&self, mut first: u64, mut into: &mut [u8]) -> Result<()> {
        while !into.is_empty() {
            let in_piece = (PIECE - (first % PIECE as u64) as usize) * self.stride;
            let (now, later) = into.split_at_mut(in_piece.min(into.len()));
            self.read(first, now)?;
            first += (now.len() / self.stride) as u64;
            into = later;
        }
        Ok(())
    }

    /// How many items are stored from number `first` to the end of its piece.
    pub fn stored_in(&self, first: u64) -> Result<usize> {
        let (_, items) = self.piece(first)?;
        Ok((items as usize).saturating_sub((first % PIECE as u64) as usize))
    }

    fn piece(&self, item: u64) -> Result<(Address, u32)> {
        let table = self.table.read().unwrap_or_else(PoisonError::into_inner);
        let piece = table.get((item / PIECE as u64) as usize).copied().flatten();
        piece.ok_or_else(|| Error::internal("read of a piece that was never stored"))
    }

    /// Calls `visit` for the items numbered `first..first + count`, piece by piece: the number of
    /// the first of each stretch and its bytes.
    pub fn each(
        &self,
        first: u64,
        count: u64,
        buffer: &mut Vec<u8>,
        mut visit: impl FnMut(u64, &[u8]) -> Result<()>,
    ) -> Result<()> {
        let mut at = first;
        while at < first + count {
            let in_piece = (PIECE as u64 - at % PIECE as u64).min(first + count - at);
            buffer.resize(in_piece as usize * self.stride, 0);
            self.read(at, buffer)?;
            visit(at, buffer)?;
            at += in_piece;
        }
        Ok(())
    }
}
