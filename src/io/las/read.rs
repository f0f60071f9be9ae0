//! Reading records straight into a batch: plain ones by position, compressed ones chunk by chunk.

use std::sync::Arc;

use super::chunks::{Chunk, layered_head};
use super::file::InputFile;
use super::laz::{Compression, Compressor, Damage, Decoder, Layers, Why};
use super::verify::Evidence;
use crate::error::shown;
use crate::point::PointBatch;
use crate::stage::Part;
use crate::{Error, Result};

/// How far a file's stored coordinates are moved so that all inputs share one offset.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Shift(pub [i64; 3]);

impl Shift {
    /// Moves the coordinates of all records; False if one would leave i32.
    pub fn apply(self, records: &mut [u8], stride: usize) -> bool {
        if self.0 == [0; 3] {
            return true;
        }
        records.chunks_exact_mut(stride).all(|record| {
            let stored = record.first_chunk_mut::<12>();
            stored.is_some_and(|stored| {
                stored.as_chunks_mut().0.iter_mut().zip(self.0).all(|(bytes, by)| {
                    let moved = i64::from(i32::from_le_bytes(*bytes)).checked_add(by);
                    let Some(moved) = moved.and_then(|v| i32::try_from(v).ok()) else {
                        return false;
                    };
                    *bytes = moved.to_le_bytes();
                    true
                })
            })
        })
    }

    fn overflow(file: &InputFile) -> Error {
        Error::data(
            file.path(),
            "a point is too far from the other inputs' offset for its stored coordinates",
        )
        .help("bring the files to one offset first, or reduce them one by one")
    }
}

/// A stretch of plain records.
pub struct PlainPart {
    /// The file.
    pub file: InputFile,
    /// Number of the file among the inputs.
    pub source: u32,
    /// Position of the next record.
    pub at: u64,
    /// Records left.
    pub left: u64,
    /// See [`Shift`].
    pub shift: Shift,
}

impl Part for PlainPart {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        let outcome = self.fill(batch);
        self.file.origin().vouch(outcome, batch.is_empty())
    }
}

impl PlainPart {
    fn fill(&mut self, batch: &mut PointBatch) -> Result<()> {
        let n = self.left.min(batch.capacity() as u64) as usize;
        batch.source = self.source;
        let stride = batch.schema().stride;
        let records = batch.refill(n);
        self.file.read_at(records, self.at)?;
        if !self.shift.apply(records, stride) {
            return Err(Shift::overflow(&self.file));
        }
        self.at += (n * stride) as u64;
        self.left -= n as u64;
        Ok(())
    }
}

/// Chunks of compressed records.
pub struct LazPart {
    file: InputFile,
    source: u32,
    shift: Shift,
    compression: Arc<Compression>,
    decoder: Decoder,
    chunks: std::vec::IntoIter<Chunk>,
    /// The chunk being read and how many of its points are left.
    now: Option<(Chunk, u64)>,
    /// Number of that chunk in the file, from 1.
    number: u64,
    /// Points after which the next chunk begins, where no table says it.
    in_a_row: Option<u64>,
    /// Who is told of points that the header does not count.
    evidence: Option<Arc<Evidence>>,
}

impl LazPart {
    /// Reads `chunks` one after the other, before which the file has `before`. With `in_a_row`,
    /// they are one stretch of chunks of that many points.
    pub fn new(
        file: InputFile,
        (source, shift): (u32, Shift),
        compression: Arc<Compression>,
        (before, chunks): (u64, Vec<Chunk>),
        in_a_row: Option<u64>,
    ) -> Self {
        let decoder = Decoder::new(&compression, &file);
        let chunks = chunks.into_iter();
        LazPart {
            file,
            source,
            shift,
            compression,
            decoder,
            chunks,
            now: None,
            number: before,
            in_a_row,
            evidence: None,
        }
    }

    /// Tells `evidence` of points that the header does not count.
    pub fn tell(self, evidence: Arc<Evidence>) -> Self {
        LazPart { evidence: Some(evidence), ..self }
    }

    /// Decodes these layers alone, where there are layers.
    pub fn select(mut self, wanted: Layers) -> Self {
        self.decoder.select(wanted);
        self
    }

    /// The chunk to read from and how many points to take from it at most; None at the end.
    fn current(&mut self) -> Result<Option<(Chunk, u64)>> {
        if let Some((chunk, left)) = self.now {
            if left > 0 {
                return Ok(Some((chunk, left)));
            }
            self.check_end(chunk)?;
            if let Some(each) = self.in_a_row
                && chunk.points > each
            {
                let start = self.decoder.position();
                let rest = Chunk { start, points: chunk.points - each, ..chunk };
                return self.begin(rest).map(Some);
            }
        }
        match self.chunks.next() {
            Some(chunk) => self.begin(chunk).map(Some),
            None => {
                self.now = None;
                Ok(None)
            }
        }
    }

    fn begin(&mut self, chunk: Chunk) -> Result<(Chunk, u64)> {
        self.number += 1;
        if self.compression.compressor == Compressor::Layered {
            let head = layered_head(&self.file, chunk.start, chunk.end, &self.compression)?;
            if head.points < chunk.points || (chunk.whole && head.points > chunk.points) {
                let (has, wanted) = (head.points, chunk.points);
                return Err(self.damaged(chunk, &format!("it has {has} points, not {wanted}")));
            }
        }
        self.decoder.begin(chunk.start, chunk.end);
        let left = self.in_a_row.map_or(chunk.points, |each| each.min(chunk.points));
        self.now = Some((chunk, left));
        Ok((chunk, left))
    }

    /// A chunk ends where its decoder does. Points behind those that the header leaves for the last
    /// one are told, if they are points.
    fn check_end(&mut self, chunk: Chunk) -> Result<()> {
        let ended = match self.in_a_row {
            Some(_) => self.decoder.pause(),
            None if chunk.whole => self.decoder.finish(),
            None => return Ok(()),
        };
        let Err(damage) = ended else { return Ok(()) };
        if self.compression.compressor == Compressor::Layered || !matches!(damage.why, Why::Long) {
            return Err(self.failed(chunk, None, damage));
        }
        let Some(more) = self.uncounted(chunk)? else {
            return Err(self.damaged(chunk, "the header's points end before its bytes"));
        };
        if let Some(evidence) = &self.evidence {
            let path = shown(self.file.path());
            evidence.warn(format!(
                "{path}: {more} points or more behind those that the header counts are not read"
            ));
        }
        Ok(())
    }

    /// How many points follow in the chunk, whose points so far were read, up to its last byte;
    /// None if what follows makes no points of this file.
    fn uncounted(&mut self, chunk: Chunk) -> Result<Option<u64>> {
        let full = match self.compression.compressor {
            Compressor::PointWise => u64::MAX,
            _ => u64::from(self.compression.chunk_points.unwrap_or(0)),
        };
        let Some(evidence) = self.evidence.clone() else { return Ok(None) };
        let mut record = vec![0; self.compression.stride];
        let mut more = 0;
        while self.decoder.finish().is_err() {
            let is_point = self.decoder.read(&mut record).is_ok();
            if more >= full.saturating_sub(chunk.points) || !is_point {
                return Ok(None);
            }
            if !evidence.are_likely(&record, self.compression.stride) {
                return Ok(None);
            }
            more += 1;
        }
        Ok(Some(more))
    }

    fn damaged(&self, chunk: Chunk, why: &str) -> Error {
        let number = self.number;
        self.file
            .wrong(
                chunk.start,
                format!("chunk {number} of the compressed points is damaged: {why}"),
            )
            .help("the file is cut off or damaged; ask for it again")
    }

    /// What the decoder found while it read these points of the chunk, or behind all of them.
    fn failed(&self, chunk: Chunk, points: Option<(u64, u64)>, damage: Damage) -> Error {
        let Damage { why, byte, layer } = damage;
        let what = match why {
            Why::Unread(error) => return error,
            Why::Short => "the bytes end before the points",
            Why::Long => "the points end before the bytes",
            Why::Wrong => "the bytes make no points",
        };
        let layer = layer.map_or_else(String::new, |name| format!(" in the layer of {name}"));
        let place = points.map_or("behind its points".to_owned(), |(first, last)| {
            format!("while its points {first} to {last} are read")
        });
        self.damaged(chunk, &format!("{what}{layer}, which shows at byte {byte} {place}"))
    }
}

impl Part for LazPart {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        let outcome = self.fill(batch);
        self.file.origin().vouch(outcome, batch.is_empty())
    }
}

impl LazPart {
    fn fill(&mut self, batch: &mut PointBatch) -> Result<()> {
        let stride = batch.schema().stride;
        let capacity = batch.capacity();
        batch.source = self.source;
        batch.refill(capacity);
        let mut filled = 0;
        while filled < capacity {
            let Some((chunk, left)) = self.current()? else { break };
            let n = left.min((capacity - filled) as u64) as usize;
            let out = &mut batch.records_mut()[filled * stride..(filled + n) * stride];
            if let Err(damage) = self.decoder.read(out) {
                let all = self.in_a_row.map_or(chunk.points, |each| each.min(chunk.points));
                let read = all - left.min(all);
                return Err(self.failed(chunk, Some((read + 1, read + n as u64)), damage));
            }
            if !self.shift.apply(out, stride) {
                return Err(Shift::overflow(&self.file));
            }
            self.now = Some((chunk, left - n as u64));
            filled += n;
        }
        batch.truncate(filled);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifts_are_exact_and_overflow_is_told() {
        let mut records = vec![0u8; 40];
        records[0..4].copy_from_slice(&(i32::MAX - 5).to_le_bytes());
        assert!(Shift([5, -7, 0]).apply(&mut records, 20));
        assert_eq!(records[0..4], i32::MAX.to_le_bytes());
        assert_eq!(records[24..28], (-7i32).to_le_bytes());
        assert!(!Shift([1, 0, 0]).apply(&mut records, 20));
        assert!(!Shift([0, 0, i64::MAX]).apply(&mut records, 20));
    }
}
