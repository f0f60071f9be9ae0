//! Nothing is lost.

mod edges;
mod records;
