//! Reading compressed records chunk by chunk straight into a batch. A chunk that is damaged ends
//! the run, or costs its points, or those behind the damage.

use std::sync::Arc;

use super::chunks::{Chunk, layered_head};
use super::file::InputFile;
use super::laz::{Compression, Compressor, Damage, Decoder, Layers, Why};
use super::read::Shift;
use super::verify::Evidence;
use crate::error::shown;
use crate::io::damage::{advised, lost};
use crate::point::PointBatch;
use crate::stage::{OnError, Part};
use crate::{Error, ErrorKind, Result};

/// Bytes of records that are decoded at once where a chunk is tried.
const TRIED: usize = 64 << 10;

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
    /// Who is told of points that the header does not count, and of those that are lost.
    evidence: Option<Arc<Evidence>>,
    on_error: OnError,
    /// True if the chunk being read is cut at its damage.
    is_cut: bool,
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
            on_error: OnError::Fail,
            is_cut: false,
        }
    }

    /// Does this about damage.
    pub fn mend(self, on_error: OnError) -> Self {
        LazPart { on_error, ..self }
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
        loop {
            let rest = match self.now {
                Some((chunk, left)) if left > 0 => return Ok(Some((chunk, left))),
                Some((chunk, _)) => self.behind(chunk)?,
                None => None,
            };
            self.now = None;
            let Some(chunk) = rest.or_else(|| self.chunks.next()) else { return Ok(None) };
            match self.begin(chunk) {
                Ok(begun) => return Ok(Some(begun)),
                Err(error) => self.lose(chunk, chunk.points, error)?,
            }
        }
    }

    /// What follows a chunk whose points were read, where no table says it.
    fn behind(&mut self, chunk: Chunk) -> Result<Option<Chunk>> {
        if self.is_cut {
            return Ok(None);
        }
        let left = self.in_a_row.map_or(0, |each| chunk.points.saturating_sub(each));
        if let Err(error) = self.check_end(chunk) {
            // Where the next one begins is not known then.
            self.lose(chunk, left, error)?;
            return Ok(None);
        }
        let start = self.decoder.position();
        Ok((left > 0).then_some(Chunk { start, points: left, ..chunk }))
    }

    /// Goes on without `points` points of the chunk, if that is wanted, which is taken down; else
    /// fails with `error`.
    fn lose(&self, chunk: Chunk, points: u64, error: Error) -> Result<()> {
        self.lose_besides(chunk, points, error, "")
    }

    /// The same, with what is to be told besides.
    fn lose_besides(&self, chunk: Chunk, points: u64, error: Error, besides: &str) -> Result<()> {
        let evidence = self.evidence.as_ref().filter(|_| self.on_error != OnError::Fail);
        match evidence.filter(|_| error.kind() == ErrorKind::Data) {
            Some(evidence) if points > 0 => {
                evidence.lose_while_read(lost(
                    self.file.path(),
                    chunk.start,
                    points,
                    &format!("{}{besides}", error.message()),
                ));
            }
            Some(evidence) => evidence.warn(format!("{error}; its points are read all the same")),
            None => return Err(advised(error)),
        }
        Ok(())
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
        self.is_cut = false;
        if self.on_error != OnError::Fail {
            if let Err(error) = self.try_chunk(chunk, left) {
                return self.begin_cut(chunk, left, error);
            }
            self.decoder.begin(chunk.start, chunk.end);
        }
        self.now = Some((chunk, left));
        Ok((chunk, left))
    }

    /// Begins a chunk of which `error` says why it is damaged, to read the points that are before
    /// the damage, if they are wanted.
    fn begin_cut(&mut self, chunk: Chunk, points: u64, error: Error) -> Result<(Chunk, u64)> {
        let wanted = self.on_error == OnError::Salvage && error.kind() == ErrorKind::Data;
        let good = if wanted { self.undamaged(chunk, points) } else { 0 };
        if good == 0 {
            return Err(error);
        }
        let kept = format!("; of the {good} points before, which are kept, values may be wrong");
        self.lose_besides(chunk, chunk.points - good, error, &kept)?;
        self.decoder.begin(chunk.start, chunk.end);
        self.is_cut = true;
        let chunk = Chunk { points: good, whole: false, ..chunk };
        self.now = Some((chunk, good));
        Ok((chunk, good))
    }

    /// Decodes a chunk to its end: only one without damage is to be read.
    fn try_chunk(&mut self, chunk: Chunk, points: u64) -> Result<()> {
        let stride = self.compression.stride;
        let at_once = (TRIED / stride).max(1);
        let mut records = vec![0; at_once * stride];
        let mut left = points;
        while left > 0 {
            let n = left.min(at_once as u64);
            if let Err(damage) = self.decoder.read(&mut records[..n as usize * stride]) {
                let read = points - left;
                return Err(self.failed(chunk, Some((read + 1, read + n)), damage));
            }
            left -= n;
        }
        self.check_end(chunk)
    }

    /// How many of the points of a damaged chunk are decoded before the damage shows, or before one
    /// is where none of the file can be: damage makes other points long before it shows.
    fn undamaged(&mut self, chunk: Chunk, points: u64) -> u64 {
        let stride = self.compression.stride;
        let mut record = vec![0; stride];
        self.decoder.begin(chunk.start, chunk.end);
        let evidence = self.evidence.clone();
        let is_possible = |record: &[u8]| {
            evidence.as_ref().is_none_or(|evidence| evidence.are_possible(record, stride))
        };
        let mut good = 0;
        while good < points && self.decoder.read(&mut record).is_ok() && is_possible(&record) {
            good += 1;
        }
        good
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
                let error = self.failed(chunk, Some((read + 1, read + n as u64)), damage);
                return Err(if self.on_error == OnError::Fail { advised(error) } else { error });
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
