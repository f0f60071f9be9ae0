//! The vertices of a binary file, which are records as they stand there.

use std::fs::File;
use std::os::unix::fs::FileExt;

use super::file::PlyFile;
use super::header::{Property, PropertyKind};
use crate::io::damage::PartLosses;
use crate::io::origin::Origin;
use crate::point::{Dimension, Endian, PointBatch, Scalar, Value};
use crate::stage::Part;
use crate::{Error, Result};

/// A range of the vertices of a binary file, read straight into the batch.
pub(super) struct BinaryPart<'a> {
    pub file: File,
    pub origin: &'a Origin,
    pub at: u64,
    pub left: u64,
    pub source: u32,
}

impl Part for BinaryPart<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        let outcome = self.fill(batch);
        self.origin.vouch(outcome, batch.is_empty())
    }
}

impl BinaryPart<'_> {
    fn fill(&mut self, batch: &mut PointBatch) -> Result<()> {
        let points = self.left.min(batch.capacity() as u64);
        batch.source = self.source;
        let bytes = batch.refill(points as usize);
        self.file.read_exact_at(bytes, self.at).map_err(|cause| {
            Error::io(self.origin.path(), "read vertices", cause).at_byte(self.at)
        })?;
        self.at += bytes.len() as u64;
        self.left -= points;
        Ok(())
    }
}

/// Bytes that vertices with lists are read through.
const WINDOW: usize = 1 << 16;

/// The vertices of a binary file whose lists are passed over: where one begins is known only from
/// those before.
pub(super) struct ListedPart<'a> {
    file: File,
    ply: &'a PlyFile,
    origin: &'a Origin,
    losses: PartLosses,
    properties: &'a [Property],
    endian: Endian,
    window: Vec<u8>,
    /// The next byte of the window, and the byte of the file where that begins.
    next: usize,
    from: u64,
    left: u64,
    source: u32,
}

impl<'a> ListedPart<'a> {
    /// Bytes that it holds besides the batch.
    pub const BYTES: u64 = WINDOW as u64;

    /// The vertices from byte `at` on.
    pub fn new(
        (file, ply): (File, &'a PlyFile),
        (properties, endian): (&'a [Property], Endian),
        at: u64,
        left: u64,
        source: u32,
    ) -> Self {
        let (window, origin, losses) = (Vec::new(), &ply.origin, ply.losses.part());
        let (next, from) = (0, at);
        ListedPart {
            file,
            ply,
            origin,
            losses,
            properties,
            endian,
            window,
            next,
            from,
            left,
            source,
        }
    }

    fn short(&self) -> Error {
        Error::data(self.origin.path(), "the file ends within its vertices")
            .at_byte(self.origin.length())
            .help("the file is cut short, or its header is wrong")
    }

    /// The next bytes, few.
    fn bytes(&mut self, count: usize) -> Result<&[u8]> {
        if self.window.len() - self.next < count {
            let at = self.from + self.next as u64;
            let held = self.origin.length().saturating_sub(at).min(WINDOW as u64) as usize;
            if held < count {
                return Err(self.short());
            }
            self.window.resize(held, 0);
            self.file.read_exact_at(&mut self.window, at).map_err(|cause| {
                Error::io(self.origin.path(), "read vertices", cause).at_byte(at)
            })?;
            (self.from, self.next) = (at, 0);
        }
        self.next += count;
        Ok(&self.window[self.next - count..self.next])
    }

    /// Passes over a list.
    fn pass(&mut self, count: Scalar, item: Scalar) -> Result<()> {
        let endian = self.endian;
        let at = self.from + self.next as u64;
        let stored = self.bytes(count.size())?;
        let items = match Dimension::new("count", count, 0).get(stored, endian) {
            Value::Unsigned(items) => Some(items),
            Value::Signed(items) => u64::try_from(items).ok(),
            _ => None,
        };
        let bytes = items.and_then(|items| items.checked_mul(item.size() as u64));
        let end = bytes.and_then(|bytes| (self.from + self.next as u64).checked_add(bytes));
        let Some(end) = end.filter(|end| *end <= self.origin.length()) else {
            let told = "a list of a vertex is longer than the file";
            return Err(Error::data(self.origin.path(), told).at_byte(at));
        };
        if end <= self.from + self.window.len() as u64 {
            self.next = (end - self.from) as usize;
        } else {
            (self.from, self.next) = (end, 0);
            self.window.clear();
        }
        Ok(())
    }

    fn vertex(&mut self, record: &mut [u8]) -> Result<()> {
        let mut place = 0;
        for property in self.properties {
            match property.kind {
                PropertyKind::Scalar(scalar) => {
                    let size = scalar.size();
                    record[place..place + size].copy_from_slice(self.bytes(size)?);
                    place += size;
                }
                PropertyKind::List { count, item } => self.pass(count, item)?,
            }
        }
        Ok(())
    }
}

impl ListedPart<'_> {
    /// Goes on without the vertices that are left, if that is wanted: where they begin is not
    /// known.
    fn give_up(&mut self, error: Error) -> Result<()> {
        let at = error.byte().unwrap_or(self.from);
        self.losses.lose(self.origin.path(), at, self.left, error)?;
        self.ply.losses.enter(0, &self.losses);
        self.left = 0;
        Ok(())
    }
}

impl Part for ListedPart<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        batch.source = self.source;
        batch.clear();
        let points = self.left.min(batch.capacity() as u64) as usize;
        let stride = batch.schema().stride;
        let mut read = 0;
        let mut outcome = Ok(());
        for record in batch.refill(points).chunks_exact_mut(stride) {
            outcome = self.vertex(record);
            if outcome.is_err() {
                break;
            }
            read += 1;
        }
        self.left -= read as u64;
        if let Err(error) = outcome {
            outcome = self.give_up(error);
            batch.truncate(read);
        }
        self.origin.vouch(outcome, read == 0)
    }
}
