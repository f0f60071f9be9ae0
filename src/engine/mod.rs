//! From a plan to a report: the phases of a run over the store, on threads; outputs that appear
//! when they are complete. Knows no format, and no stage by name.
//!
//! A phase is a list of items that read only what earlier phases have sealed and write pieces of
//! their own. So any thread may take any item, no item waits for another, and what comes out is put
//! together in the order of the items and not in that of the threads.

mod account;
mod arranged;
pub(crate) mod beside;
pub(crate) mod by_input;
pub(crate) mod by_rank;
pub(crate) mod by_split;
mod by_time;
mod chunk;
mod chunks;
mod clock;
mod compared;
mod cut;
mod decode;
mod demands;
mod each;
mod encoding;
mod filtering;
mod finished;
mod forecast;
mod grind;
mod hashing;
pub(crate) mod job;
mod lines;
pub(crate) mod mesh;
mod mill;
pub(crate) mod moved;
mod outlet;
pub(crate) mod pass;
pub(crate) mod phase;
mod placed;
mod product;
pub(crate) mod provenance;
pub(crate) mod publish;
mod room;
mod rounded;
mod rounds;
mod row;
mod run;
pub(crate) mod scratch;
mod settled;
pub(crate) mod shares;
mod standing;
mod stream;
mod survey;
pub(crate) mod tagger;
pub(crate) mod task;
mod told;
mod watch;

#[cfg(feature = "cli")]
pub(crate) use publish::{make_folder, publish_bytes, refuse_existing};
pub use run::Done;
#[cfg(feature = "cli")]
pub(crate) use scratch::Trouble;
pub use watch::{Quiet, Watch};
