//! The pipeline language: from a text, and what arguments put in the place of its values, to a
//! [`Graph`](crate::graph::Graph); every mistake with its place. Knows no plan and no input.

mod builtin;
mod described;
mod draft;
mod fault;
mod foreign;
mod keys;
mod mistake;
mod node;
mod place;
mod registry;
mod schema;
mod set;
mod text;
mod written;

pub use described::{KeyDescription, TableDescription, WordDescription};
pub use registry::Registry;
pub use set::Set;
