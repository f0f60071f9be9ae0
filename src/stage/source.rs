//! Where records come from: what a stage says of its inputs, and how their records are read.

use std::path::PathBuf;
use std::sync::Arc;

use super::keys::ReadKeys;
use crate::point::{Metadata, PointBatch, Schema};
use crate::report::{LostPoints, Reprojection};
use crate::{Error, Result};

/// Opens the inputs of a source: headers only, no point.
pub trait OpenSource: Send + Sync {
    /// Reads every header, checks that the inputs agree, and bounds what they claim by their
    /// length.
    ///
    /// # Errors
    ///
    /// Files that cannot be read, that do not agree, or whose headers their length refutes.
    fn open(&self) -> Result<Box<dyn Source>>;

    /// Files that it reads, so that no output is written over one of them.
    fn paths(&self) -> Vec<PathBuf> {
        Vec::new()
    }

    /// The family of formats of its files, if it is nothing but these files.
    fn family(&self) -> Option<&str> {
        None
    }

    /// How its files are read, if it is nothing but these files.
    fn keys(&self) -> Option<&ReadKeys> {
        None
    }

    /// This source and `other` as one, whose inputs come behind its own.
    ///
    /// # Errors
    ///
    /// If they cannot be read as one: as it is here, where nothing is known of the two.
    fn merged(&self, _other: &dyn OpenSource) -> Result<Box<dyn OpenSource>> {
        Err(Error::pipeline("this source cannot be merged with another"))
    }
}

/// Where records come from.
///
/// ```
/// use pointmill::point::PointBatch;
/// use pointmill::stage::OpenSource;
/// use pointmill::synth::{Scene, Synthetic};
///
/// let scan = Synthetic { scene: Scene::Plane, points: 10_000, ..Synthetic::default() };
/// let source = scan.open()?;
/// let (mut batch, mut count) = (PointBatch::new(source.schema().clone(), 4096), 0);
/// // Parts are independent of each other: threads may share them out.
/// for index in 0..source.parts() {
///     let mut part = source.part(index)?;
///     loop {
///         part.read(&mut batch)?;
///         if batch.is_empty() {
///             break;
///         }
///         count += batch.len();
///     }
/// }
/// assert_eq!(count, 10_000);
/// # Ok::<(), pointmill::Error>(())
/// ```
pub trait Source: Send + Sync {
    /// What every record holds.
    fn schema(&self) -> &Arc<Schema>;

    /// What outputs carry on besides points.
    fn metadata(&self) -> &Metadata;

    /// The smallest and the largest x, y and z that headers claim, in world units; None where they
    /// claim nothing. Points may lie nearer to each other, and those of a damaged file beyond.
    fn claimed_box(&self) -> Option<[[f64; 3]; 2]> {
        None
    }

    /// The files, in input order, as the report names them; empty when there are none.
    fn inputs(&self) -> Vec<Input> {
        Vec::new()
    }

    /// What the output of one of the [`inputs`](Source::inputs) alone carries on: its own header
    /// and records, where [`metadata`](Source::metadata) is what all have in common. Read again
    /// from the file, so that thousands of headers are not held; a file that changed since is an
    /// error.
    ///
    /// The records of a batch still are in the source's schema: a sink that is created with this
    /// brings them to what the input's own header says of them.
    ///
    /// # Errors
    ///
    /// A file that cannot be read again or that changed.
    fn metadata_of(&self, _input: usize) -> Result<Metadata> {
        Ok(self.metadata().clone())
    }

    /// How many points the headers claim, cut to what the files could hold at most.
    fn points(&self) -> u64;

    /// Bytes that reading one part holds besides the caller's batch (decoder state, read buffers).
    fn part_bytes(&self) -> u64;

    /// How many parts there are. Parts are independent and numbered in input order.
    fn parts(&self) -> usize;

    /// The number of the first record of part `index`, over all inputs from 0: the records of all
    /// parts before it. None if that is not known before they are read.
    fn first_record(&self, index: usize) -> Option<u64> {
        (index == 0).then_some(0)
    }

    /// Opens part `index < parts()`.
    ///
    /// # Errors
    ///
    /// A file that cannot be read, or that changed since its header was read.
    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>>;

    /// Opens a part of which nobody will look at the dimensions `unread`: their fields may hold
    /// anything, so that a source need not decode them. Coordinates are never among them.
    ///
    /// # Errors
    ///
    /// As [`part`](Source::part).
    fn part_without(&self, index: usize, _unread: &[String]) -> Result<Box<dyn Part + '_>> {
        self.part(index)
    }

    /// The same scan by its coarsest levels that have `points` points together, or a few more: a
    /// thinner picture of the whole. None where its files have no levels that can be read by
    /// themselves, and where all of them are needed for so many.
    fn coarser(&self, _points: u64) -> Option<Box<dyn Source>> {
        None
    }

    /// True if its records come once: then none is looked at before the run.
    fn is_read_once(&self) -> bool {
        false
    }

    /// Warnings for the user that opening or reading gave rise to (dropped faces, odd headers).
    fn warnings(&self) -> Vec<String> {
        Vec::new()
    }

    /// Points of damaged inputs that were not read, as the user wanted. Asked when every part was
    /// read to its end.
    fn lost(&self) -> Vec<LostPoints> {
        Vec::new()
    }

    /// How its points came to the system that they are in, where inputs are in another.
    fn reprojection(&self) -> Option<Reprojection> {
        None
    }

    /// What headers say of points and is not so. Asked when every part was read to its end; of
    /// inputs that were not, nothing is known.
    fn contradictions(&self) -> Vec<Contradiction> {
        Vec::new()
    }
}

/// Records that a part is asked for at once, by whoever reads points.
pub(crate) const BATCH: usize = 8192;

/// A file that a source reads.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Input {
    /// Its path, as given.
    pub path: PathBuf,
    /// Its points; a source that does not find as many while it reads fails.
    pub points: u64,
    /// A file that its records refer to, such as waveforms, and that is to be beside outputs, under
    /// their names with another extension: where it is, and that extension.
    pub beside: Option<(PathBuf, &'static str)>,
}

impl Input {
    /// A file of so many points that refers to no other.
    pub fn new(path: impl Into<PathBuf>, points: u64) -> Self {
        Input { path: path.into(), points, beside: None }
    }
}

/// Something that the header of an input says of its points and that is not so.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Contradiction {
    /// The file.
    pub path: PathBuf,
    /// Byte of the header's field.
    pub byte: u64,
    /// What it says, and what was found.
    pub message: String,
    /// True if the points may be damaged, false if it must be the header that is wrong.
    pub is_damage: bool,
}

impl Contradiction {
    /// What the header of the file at `path` says from `byte` on, and what was found instead; it is
    /// the header that is wrong unless [`is_damage`](Contradiction::is_damage) is set.
    pub fn new(path: impl Into<PathBuf>, byte: u64, message: impl Into<String>) -> Self {
        Contradiction { path: path.into(), byte, message: message.into(), is_damage: false }
    }
}

/// A stretch of a source's records, in input order.
pub trait Part: Send {
    /// Refills `batch` with up to its capacity of the next records and sets its source number; an
    /// empty batch is the end. After an error the part is not read again.
    ///
    /// # Errors
    ///
    /// What the system refuses to read, and bytes that are no records, with their place.
    fn read(&mut self, batch: &mut PointBatch) -> Result<()>;
}
