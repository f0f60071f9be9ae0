//! From a pipeline file to a finished run: parse, plan, run.

mod beside;
mod builtin;
mod by_rank;
mod by_time;
mod chunks;
mod clock;
mod connect;
mod cut;
mod draft;
mod each;
mod files;
mod forecast;
mod foreign;
mod grind;
mod inputs;
mod job;
mod keys;
mod kinds;
mod limits;
mod look;
mod mill;
mod mistake;
mod node;
mod outlet;
mod outline;
mod outputs;
mod passes;
mod plan;
mod product;
mod publish;
mod registry;
mod room;
mod rounded;
mod run;
mod scratch;
mod set;
mod settings;
mod shares;
mod shown;
mod stream;
mod stretch;
mod survey;
mod tagger;
mod text;
mod watch;
mod written;

pub(crate) use files::{Clash, Files, Use};
pub use inputs::{expand, expand_any, unreadable};
pub use kinds::{Encoding, Format, OutputOrder, Read, Synth, Write};
pub use limits::{LimitKeys, Sees};
pub use outline::Outline;
pub use plan::Plan;
pub(crate) use publish::{make_folder, publish_bytes, refuse_existing};
pub use registry::{Registry, StageKind, StagePlace};
pub use run::Done;
pub(crate) use scratch::Trouble;
pub use set::Set;
pub use settings::{
    Existing, MOST_THREADS, MixedUnits, Nonfinite, Overrides, RunSettings, Simd, Spill, Treatment,
    ZScale, parse_bytes,
};
pub use stretch::Stretch;
pub use text::{Pipeline, PlacedStage};
pub use watch::{Quiet, Watch};
