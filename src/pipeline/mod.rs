//! From a pipeline file to a finished run: parse, plan, run.

mod builtin;
mod chunks;
mod clock;
mod connect;
mod cut;
mod draft;
mod each;
mod files;
mod forecast;
mod grind;
mod inputs;
mod job;
mod keys;
mod kinds;
mod limits;
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
mod rounded;
mod run;
mod scratch;
mod set;
mod settings;
mod shares;
mod shown;
mod stream;
mod survey;
mod tagger;
mod text;
mod watch;

pub(crate) use files::{Files, Use};
pub use inputs::expand;
pub use kinds::{Encoding, Format, OutputOrder, Read, Synth, Write};
pub use limits::{LimitKeys, Sees};
pub use outline::Outline;
pub use plan::Plan;
pub(crate) use publish::{make_folder, refuse_existing};
pub use registry::{Registry, StageKind, StagePlace};
pub use run::Done;
pub use set::Set;
pub use settings::{
    Existing, MixedUnits, Nonfinite, Overrides, RunSettings, Simd, Spill, Withheld, ZScale,
    parse_bytes,
};
pub use text::{Pipeline, PlacedStage};
pub use watch::{Quiet, Watch};
