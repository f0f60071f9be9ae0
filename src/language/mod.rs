//! The pipeline language: from a text, and what arguments put in the place of its values, to a
//! [`Graph`](crate::graph::Graph); every mistake with its place. Knows no plan and no input.

mod builder;
mod builtin;
mod described;
mod draft;
mod elsewhere;
mod explained;
mod fault;
mod foreign;
mod form;
mod json;
mod keys;
mod line;
mod mistake;
mod node;
mod origins;
mod outputs;
mod parameter;
mod params;
mod pipeline;
mod place;
mod references;
mod registry;
mod schema;
mod set;
mod text;
mod tree;
mod written;

pub use builder::GraphBuilder;
pub use described::{KeyDescription, TableDescription, WordDescription};
pub use explained::Explained;
pub use parameter::{Parameter, ParameterType};
pub use pipeline::PipelineText;
pub use registry::Registry;
pub use set::Set;
