//! A file of rows that grows.
//!
//! Its header has one length from the beginning, whatever the count of rows in it, and is written
//! once more when that is known. Whether colours have 8 bits or 16 is known in the end, too: the
//! rows are written anew where it turns out otherwise ([`colors`](super::colors)).

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::Encoding;
use super::colors::{Depth, Recoloring, WrittenColors, note};
use super::plan::{CHUNK_POINTS, FULL, RowPlan, WIDE};
use super::schema::RowShape;
use crate::io::project::rounded;
use crate::stage::{Colors, Encode, Encoded, Sink, SinkSummary};
use crate::{Error, Result};

/// Bytes carried at once.
const CARRY: usize = 1 << 18;

/// What stands in front of the rows: of one length whatever the count.
pub(crate) trait Heading: Send {
    /// The header of a file of so many rows.
    fn text(&self, rows: u64) -> Vec<u8>;

    /// Puts into it what is known in the end alone, which changes no length.
    ///
    /// # Errors
    ///
    /// What cannot be known.
    fn settle(&mut self) -> Result<()> {
        Ok(())
    }
}

/// A file of rows.
pub(crate) struct RowFile<H> {
    pub file: File,
    pub path: PathBuf,
    pub plan: Arc<RowPlan>,
    pub header: H,
    /// The header with colours of as many bits as the file does not have, where they can have 8 or
    /// 16.
    pub other: Option<H>,
    /// True if the file has colours of 16 bits.
    wide: bool,
    /// What the appended colours are.
    depth: Depth,
    pub points: u64,
    pub bytes: u64,
    /// Points of which values were rounded, and by how much at most.
    rounded: (u64, f64),
    /// What the user should know of it.
    pub notes: Vec<String>,
}

impl<H: Heading> RowFile<H> {
    /// Creates it at `staged`; `heading` makes its header for rows of a shape.
    pub fn create(
        staged: &Path,
        plan: RowPlan,
        heading: impl Fn(&RowShape) -> H,
    ) -> Result<RowFile<H>> {
        let full = heading(plan.shape(true));
        let (header, other) = match plan.narrow.is_some() {
            true => (heading(plan.shape(false)), Some(full)),
            false => (full, None),
        };
        let mut file = File::create(staged).map_err(|e| Error::io(staged, "create", e))?;
        let text = header.text(0);
        file.write_all(&text).map_err(|e| Error::io(staged, "write the header", e))?;
        Ok(RowFile {
            file,
            path: staged.to_owned(),
            plan: Arc::new(plan),
            header,
            wide: other.is_none(),
            other,
            depth: Depth::default(),
            points: 0,
            bytes: text.len() as u64,
            rounded: (0, 0.0),
            notes: Vec::new(),
        })
    }

    /// What the rows of the file so far are.
    pub fn shape(&self) -> &RowShape {
        self.plan.shape(self.wide)
    }

    /// Appends encoded rows.
    pub fn append(&mut self, mut chunk: Encoded) -> Result<()> {
        self.fit_colors(&mut chunk)?;
        self.file.write_all(&chunk.bytes).map_err(|e| Error::io(&self.path, "write points", e))?;
        let (points, largest) = chunk.rounded.unwrap_or_default();
        self.rounded = (self.rounded.0 + points, self.rounded.1.max(largest));
        self.points += chunk.points;
        self.bytes += chunk.bytes.len() as u64;
        if self.plan.encoding != Encoding::Ascii {
            self.plan.spare.put(chunk.bytes);
        }
        Ok(())
    }

    /// Makes the colours of a chunk and those of the file so far have as many bits.
    fn fit_colors(&mut self, chunk: &mut Encoded) -> Result<()> {
        let plan = self.plan.clone();
        let Some(narrow) = &plan.narrow else { return Ok(()) };
        let WrittenColors { depth, wide } = WrittenColors::from_code(chunk.form);
        let before = self.depth;
        self.depth = before.join(depth);
        if narrow.asked == Colors::Eight {
            return Ok(());
        }
        if !self.depth.is_narrow() {
            let known = if self.depth == Depth::Full { FULL } else { WIDE };
            plan.widened.store(known, Ordering::Relaxed);
            if !self.wide {
                self.rewrite(plan.widening(before))?;
            }
        }
        if self.wide
            && !wide
            && let Some(widening) = plan.widening(depth)
        {
            let mut widened = Vec::new();
            widening.append(&chunk.bytes, &mut widened)?;
            chunk.bytes = widened;
        }
        Ok(())
    }

    /// Writes the file anew with colours of as many bits as it does not have now.
    fn rewrite(&mut self, recoloring: Option<Recoloring<'_>>) -> Result<()> {
        let (Some(other), Some(recoloring)) = (&mut self.other, recoloring) else {
            return Ok(());
        };
        let path = self.path.with_extension("colors");
        let failed = |e| Error::io(&self.path, "write its colours anew", e);
        let mut file = File::create(&path).map_err(failed)?;
        let text = other.text(0);
        file.write_all(&text).map_err(failed)?;
        let written = File::open(&self.path).map_err(failed)?;
        let (mut at, end) = (self.header.text(0).len() as u64, self.bytes);
        let mut bytes = text.len() as u64;
        let (mut buffer, mut anew) = (vec![0; CARRY.max(self.plan.row_bytes())], Vec::new());
        while at < end {
            let piece = (end - at).min(buffer.len() as u64) as usize;
            written.read_exact_at(&mut buffer[..piece], at).map_err(failed)?;
            anew.clear();
            match recoloring.append(&buffer[..piece], &mut anew)? {
                0 => return Err(Error::internal("a row is longer than it can be")),
                taken => at += taken as u64,
            }
            file.write_all(&anew).map_err(failed)?;
            bytes += anew.len() as u64;
        }
        std::fs::rename(&path, &self.path).map_err(failed)?;
        std::mem::swap(&mut self.header, other);
        (self.file, self.bytes, self.wide) = (file, bytes, !self.wide);
        Ok(())
    }

    /// Gives the file colours of 8 bits, if it has those of 16 and they need not be.
    pub fn narrow(&mut self) -> Result<()> {
        let plan = self.plan.clone();
        let is_mixed = self.wide && self.depth == Depth::Mixed;
        if is_mixed { self.rewrite(plan.narrowing()) } else { Ok(()) }
    }

    /// Writes the header with the count, and brings all to disk.
    pub fn finish(&mut self) -> Result<SinkSummary> {
        self.header.settle()?;
        let text = self.header.text(self.points);
        let failed = |e| Error::io(&self.path, "write the header", e);
        self.file.seek(SeekFrom::Start(0)).map_err(failed)?;
        self.file.write_all(&text).map_err(failed)?;
        self.file.sync_all().map_err(|e| Error::io(&self.path, "flush", e))?;
        let family = self.plan.form.layout.family;
        let narrow = self.plan.narrow.as_ref();
        self.notes.extend(narrow.and_then(|narrow| note(narrow.asked, self.depth, family)));
        let rounded_to = self.plan.rounded_to();
        self.notes.extend(rounded_to.and_then(|to| rounded(self.rounded, to)));
        let notes = std::mem::take(&mut self.notes);
        Ok(SinkSummary { points: self.points, bytes: self.bytes, notes })
    }
}

/// A file of rows and nothing else.
impl<H: Heading> Sink for RowFile<H> {
    fn chunk_points(&self) -> usize {
        CHUNK_POINTS
    }

    fn chunk_bytes(&self) -> u64 {
        self.plan.chunk().bytes
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        self.plan.clone()
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        RowFile::append(self, chunk)
    }

    fn finish(mut self: Box<Self>) -> Result<SinkSummary> {
        self.narrow()?;
        RowFile::finish(&mut self)
    }
}
