//! Proof for stages of your own: a check that a test calls.

mod allocator;
mod answer;
mod bench;
mod broken;
mod chain;
mod check;
mod hidden;
mod made;
mod probes;
mod promise;
mod setup;
mod shrink;
mod split;
mod tile_state;
mod watched;
mod witness;

pub use allocator::CountingAllocator;
pub use broken::{Broken, Conduct};
pub use check::Conformance;
pub use promise::Promise;
pub use witness::MemoryTaken;
