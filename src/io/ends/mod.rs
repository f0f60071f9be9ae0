//! The stages at both ends of a pipeline that name files, `read` and `write`: from their keys to
//! sources and sinks of formats.

mod checked;
mod connect;
mod discard;
mod inputs;
mod keys;
mod kinds;
mod list;
mod mesh;
#[cfg(feature = "cli")]
mod mirror;
mod outputs;
mod placed;
mod reshaped;
mod roles;
mod settled;
mod split;
mod values;

pub(crate) use discard::CountedSink;
pub use discard::Discard;
#[cfg(feature = "cli")]
pub(crate) use inputs::{expand, expand_any, unreadable};
pub use kinds::{OutputOrder, Read, Write};
pub use mesh::Mesh;
#[cfg(feature = "cli")]
pub(crate) use mirror::{MirroredFile, expand_mirrored};
