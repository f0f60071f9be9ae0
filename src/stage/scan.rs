//! Stages that decide by the whole scan: what they leave of each tile is stored in bytes, and comes
//! back as what it was.

use std::marker::PhantomData;

use bytemuck::Pod;

use super::needs::Needs;
use super::tile_op::TileOp;
use crate::report::Tally;
use crate::tile::Tile;
use crate::{Error, Result};

/// Decides by figures of the whole scan, in two phases: it gathers over all tiles, concludes, and
/// then runs as a [`TileOp`], on columns that the first phase left rather than on another search.
pub trait ScanOp: TileOp {
    /// What the first phase leaves of a tile.
    type Summary: Summary;

    /// What the first phase needs. Columns that it writes, and columns that stages above wrote and
    /// [`TileOp::needs`] reads, are kept for the second.
    fn gather_needs(&self) -> Needs;

    /// The first phase, called for every tile, from several threads at once. Summaries are stored
    /// in the order of the tiles, which is that of their positions; what they say together must not
    /// depend on how tiles are cut.
    ///
    /// # Errors
    ///
    /// As [`run`](TileOp::run).
    fn gather(&self, tile: &mut Tile, tally: &mut Tally) -> Result<Self::Summary>;

    /// Called once, between the phases. Returns what the user is to be warned of.
    ///
    /// # Errors
    ///
    /// Those of reading what was gathered, and figures that the scan does not allow.
    fn conclude(&mut self, gathered: &dyn Gathered<Self::Summary>) -> Result<Option<String>>;
}

/// What a first phase leaves of a tile, as it is stored.
pub trait Summary: Sized {
    /// Appends it to `bytes`.
    fn store(&self, bytes: &mut Vec<u8>);

    /// What was stored as all of `bytes`.
    ///
    /// # Errors
    ///
    /// Bytes that are none of its own.
    fn load(bytes: &[u8]) -> Result<Self>;
}

impl<T: Pod> Summary for Vec<T> {
    fn store(&self, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(bytemuck::cast_slice(self));
    }

    fn load(bytes: &[u8]) -> Result<Self> {
        match size_of::<T>() {
            0 => Ok(Vec::new()),
            size if bytes.len().is_multiple_of(size) => {
                Ok(bytemuck::allocation::pod_collect_to_vec(bytes))
            }
            _ => Err(Error::internal("what a stage gathered of a tile is cut off")),
        }
    }
}

/// What the tiles of a first phase left, wherever it is stored.
pub trait Gathered<S> {
    /// Calls `visit` with the summary of every tile, in their order; as often as one likes.
    ///
    /// # Errors
    ///
    /// Those of reading it, and of `visit`.
    fn each(&self, visit: &mut dyn FnMut(S) -> Result<()>) -> Result<()>;

    /// Records that the stage decides about.
    fn records(&self) -> u64;

    /// To be asked now and then by what takes more than a second.
    ///
    /// # Errors
    ///
    /// If the run is to end.
    fn go_on(&self) -> Result<()> {
        Ok(())
    }
}

/// A [`ScanOp`] for an engine, which does not know its summaries. Every `ScanOp` is one.
pub trait AnyScanOp: TileOp {
    /// See [`ScanOp::gather_needs`].
    fn gather_needs(&self) -> Needs;

    /// See [`ScanOp::gather`]; appends the summary as it is stored.
    ///
    /// # Errors
    ///
    /// Those of [`ScanOp::gather`].
    fn gather_into(&self, tile: &mut Tile, tally: &mut Tally, bytes: &mut Vec<u8>) -> Result<()>;

    /// See [`ScanOp::conclude`].
    ///
    /// # Errors
    ///
    /// Those of [`ScanOp::conclude`].
    fn conclude_from(&mut self, stored: &dyn StoredSummaries) -> Result<Option<String>>;
}

/// Stored summaries, of whatever stage.
pub trait StoredSummaries {
    /// As [`Gathered::each`], with the bytes of each.
    ///
    /// # Errors
    ///
    /// Those of reading it, and of `visit`.
    fn each(&self, visit: &mut dyn FnMut(&[u8]) -> Result<()>) -> Result<()>;

    /// As [`Gathered::records`].
    fn records(&self) -> u64;

    /// As [`Gathered::go_on`].
    ///
    /// # Errors
    ///
    /// If the run is to end.
    fn go_on(&self) -> Result<()> {
        Ok(())
    }
}

impl<S: ScanOp> AnyScanOp for S {
    fn gather_needs(&self) -> Needs {
        ScanOp::gather_needs(self)
    }

    fn gather_into(&self, tile: &mut Tile, tally: &mut Tally, bytes: &mut Vec<u8>) -> Result<()> {
        self.gather(tile, tally)?.store(bytes);
        Ok(())
    }

    fn conclude_from(&mut self, stored: &dyn StoredSummaries) -> Result<Option<String>> {
        self.conclude(&Loaded { stored, summary: PhantomData })
    }
}

/// Stored summaries as what they were.
struct Loaded<'a, S> {
    stored: &'a dyn StoredSummaries,
    summary: PhantomData<S>,
}

impl<S: Summary> Gathered<S> for Loaded<'_, S> {
    fn each(&self, visit: &mut dyn FnMut(S) -> Result<()>) -> Result<()> {
        self.stored.each(&mut |bytes| visit(S::load(bytes)?))
    }

    fn records(&self) -> u64 {
        self.stored.records()
    }

    fn go_on(&self) -> Result<()> {
        self.stored.go_on()
    }
}
