//! The roles a stage can play and what it tells the plan. Roles are closed, stages are open: an
//! embedding program adds its own by implementing one of these traits.

mod format;
mod kind;
mod needs;
mod scan;
mod sink;
mod source;
mod tile_op;

use crate::Result;
use crate::point::{PointBatch, Schema};

pub use format::{
    Colors, CreateFor, Format, FormatName, Formats, OutputEncoding, WriteKeys, foreign,
};
pub use kind::{StageKind, StagePlace};
pub use needs::Needs;
pub use scan::{AnyScanOp, Gathered, ScanOp, StoredSummaries, Summary};
pub use sink::{ChunkSize, CreateSink, Encode, Encoded, Order, Sink, SinkSummary};
pub use source::{Contradiction, Input, OpenSource, Part, Source};
pub use tile_op::{Forecast, ScanFacts, TileOp};

/// Changes or removes points as they stream by; knows no neighbours.
pub trait Transform: Send + Sync {
    /// What it reads and writes.
    fn needs(&self) -> Needs;

    /// Refuses records of a schema that it cannot work on; called once, before any of them is read.
    fn check(&self, _schema: &Schema) -> Result<()> {
        Ok(())
    }

    /// What it was asked to do and has nothing to do of with records of a schema.
    fn warnings(&self, _schema: &Schema) -> Vec<String> {
        Vec::new()
    }

    /// What it was asked to do and did not, where it removed no point of a scan whose records are
    /// of a schema. It need not repeat its [`warnings`](Transform::warnings).
    fn idle(&self, _schema: &Schema) -> Vec<String> {
        Vec::new()
    }

    /// The keys that say what it removes, each with its stage, as in `filter.keep_classes`.
    fn removes_by(&self) -> Vec<&'static str> {
        Vec::new()
    }

    /// Called for every batch, from several threads at once. Points that it removes are entered in
    /// the ledger by the caller.
    fn apply(&self, batch: &mut PointBatch) -> Result<()>;
}

/// A stage in its role.
pub enum Role {
    /// Yields records.
    Source(Box<dyn OpenSource>),
    /// Streams.
    Transform(Box<dyn Transform>),
    /// Works on tiles.
    TileOp(Box<dyn TileOp>),
    /// Works on tiles twice: gathers, then decides.
    ScanOp(Box<dyn AnyScanOp>),
    /// Takes records.
    Sink(Box<dyn CreateSink>),
}
