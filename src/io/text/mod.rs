//! Texts with a point a line: XYZ, CSV, PTS and others of their kind, and PTX.
//!
//! No specification says what is on a line, so nothing is guessed in silence: the user says it, or
//! a heading, or the number of columns where it can be only one thing. Before a text is read it is
//! looked through once (`survey.rs`): how many points it has, which types hold its numbers, and
//! where its lines begin that threads may share out.

mod cells;
mod columns;
mod head;
mod info;
mod names;
mod ptx;
mod registered;
mod sink;
mod source;
mod survey;

pub(crate) use columns::check_columns;
pub use registered::{ASC, CSV, PTS, PTX, TXT, TextFormat, XYZ};
