//! The roles a stage can play and what it tells the plan. Roles are closed, stages are open: an
//! embedding program adds its own by implementing one of these traits.

mod findings;
mod format;
mod keys;
mod kind;
mod needs;
mod renamed;
mod rounds;
mod scan;
mod sink;
mod source;
mod split;
mod tile_op;
mod triangles;
mod unread;
mod walk;
mod whole;

use std::path::PathBuf;

use crate::Result;
use crate::expression::KeyExpression;
use crate::point::{PointBatch, Schema};
use crate::report::Tally;

pub use crate::geom::lattice::{Lattice, Misplaced};
pub use crate::store::{KeptPoints, KeptReader, Levels};
pub use findings::{Finding, Findings, FoundPlace, PLACES_TOLD, Rule, Severity};
pub use format::{CreateFor, Format, FormatName, Formats, foreign};
pub use keys::{
    Assumption, Colors, FloatIntensity, OnError, OutputEncoding, ReadKeys, Separator, WriteKeys,
};
pub use kind::{StageKind, StagePlace};
pub use needs::Needs;
pub use renamed::{Renamed, Retyped};
pub use rounds::{
    GridBeside, Looks, NextRound, Offer, Round, RoundBefore, RoundChoice, RoundFound, RoundOp,
    RoundTile, SoFar,
};
pub use scan::{AnyScanOp, Gathered, ScanOp, StoredSummaries, Summary};
pub use sink::{
    ChunkSize, CreateSink, Encode, EncodeTriangles, Encoded, Extent, Order, PointsAhead, Sink,
    SinkSummary,
};
pub(crate) use source::BATCH;
pub use source::{Contradiction, Input, OpenSource, Part, Source};
pub use split::{OutputSplit, SplitKey};
pub use tile_op::{Forecast, ScanFacts, TileOp};
pub use triangles::{Triangle, Triangulation};
pub use unread::Unread;
pub use walk::{PointWalk, WalkProgress};
pub(crate) use whole::enter_error;
pub use whole::{WHOLE_RULES, read_whole};

/// Changes or removes points as they stream by; knows no neighbours.
///
/// ```
/// use pointmill::Result;
/// use pointmill::point::{PointBatch, names};
/// use pointmill::report::Tally;
/// use pointmill::stage::{Needs, Transform};
///
/// /// Leaves points out that the scanner hardly saw. What it decides is a function of the record:
/// /// which batch that comes in, and where in it, differs from run to run.
/// struct Bright;
///
/// impl Transform for Bright {
///     fn needs(&self) -> Needs {
///         // That the dimension is there is checked before the run.
///         Needs::none().looks_at([names::INTENSITY]).removes(None)
///     }
///
///     fn apply(&self, batch: &mut PointBatch, _tally: &mut Tally) -> Result<()> {
///         let schema = batch.schema().clone();
///         if let Some(intensity) = schema.find(names::INTENSITY) {
///             batch.retain(|_, record| intensity.world(record, schema.endian) > 8.0);
///         }
///         Ok(())
///     }
/// }
/// # let _: Box<dyn Transform> = Box::new(Bright);
/// ```
pub trait Transform: Send + Sync {
    /// What it reads and writes.
    fn needs(&self) -> Needs;

    /// The expressions among its keys, each with its key: their names are looked up before the run,
    /// and the columns that they name are there in each batch.
    fn expressions(&self) -> Vec<(&'static str, KeyExpression<'_>)> {
        Vec::new()
    }

    /// Refuses records of a schema that it cannot work on; called once, before any of them is read.
    ///
    /// # Errors
    ///
    /// What it cannot work on, said with the dimension.
    fn check(&self, _schema: &Schema) -> Result<()> {
        Ok(())
    }

    /// The schema of the records that it leaves of those of `schema`, where that is another: the
    /// same fields at the same bytes, of which coordinates have other scales or origins. Such a
    /// stage says that it [changes](Needs::changes) coordinates, and the engine has the batch say
    /// the new schema once it was applied.
    ///
    /// # Errors
    ///
    /// As [`check`](Transform::check), which was called before.
    fn leaves(&self, _schema: &Schema) -> Result<Option<Schema>> {
        Ok(None)
    }

    /// What it was asked to do and has nothing to do of with records of a schema.
    fn warnings(&self, _schema: &Schema) -> Vec<String> {
        Vec::new()
    }

    /// What to say where it leaves nothing of a scan whose headers claim these smallest and largest
    /// x, y and z; None where it may leave some.
    fn misses(&self, _claimed: [[f64; 3]; 2]) -> Option<String> {
        None
    }

    /// What it was asked to do and did not, where it removed no point of a scan whose records are
    /// of a schema. It need not repeat its [`warnings`](Transform::warnings).
    fn idle(&self, _schema: &Schema) -> Vec<String> {
        Vec::new()
    }

    /// What may explain, where no point of a scan was left and it removed some, that it did.
    fn emptied(&self) -> Option<String> {
        None
    }

    /// The keys that say what it removes, each with its stage, as in `filter.keep_classes`.
    fn removes_by(&self) -> Vec<&'static str> {
        Vec::new()
    }

    /// The files that say what it does, each with the key that names it: outputs note their hashes,
    /// as those of the inputs.
    fn files(&self) -> Vec<(&'static str, PathBuf)> {
        Vec::new()
    }

    /// Called for every batch, from several threads at once. Points that it removes are entered in
    /// the ledger by the caller; what it counts besides goes into `tally`, and is counted once for
    /// each record even where records come by twice.
    ///
    /// # Errors
    ///
    /// A record that it cannot make sense of; the run ends.
    fn apply(&self, batch: &mut PointBatch, tally: &mut Tally) -> Result<()>;
}

/// Which role a stage plays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RoleName {
    /// It yields records.
    Source,
    /// It makes one scan of several sources.
    Merge,
    /// It streams.
    Transform,
    /// It works on tiles, once or twice.
    OnTiles,
    /// It takes records.
    Sink,
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
    /// Works on tiles in rounds that choose what stays, then once more.
    RoundOp(Box<dyn RoundOp>),
    /// Takes records.
    Sink(Box<dyn CreateSink>),
    /// Gives what it takes from several stages one name, and does nothing to it.
    Merge,
}

impl Role {
    /// The files that say what it does, each with the key that names it; those that a source reads
    /// and a sink writes are theirs to tell.
    pub(crate) fn files(&self) -> Vec<(&'static str, PathBuf)> {
        match self {
            Role::Transform(stage) => stage.files(),
            Role::TileOp(stage) => stage.files(),
            Role::ScanOp(stage) => stage.files(),
            Role::RoundOp(stage) => stage.files(),
            Role::Source(_) | Role::Sink(_) | Role::Merge => Vec::new(),
        }
    }

    /// Which it is.
    pub fn name(&self) -> RoleName {
        match self {
            Role::Source(_) => RoleName::Source,
            Role::Transform(_) => RoleName::Transform,
            Role::TileOp(_) | Role::ScanOp(_) | Role::RoundOp(_) => RoleName::OnTiles,
            Role::Sink(_) => RoleName::Sink,
            Role::Merge => RoleName::Merge,
        }
    }
}
