//! Texts with a point a line: XYZ, CSV, PTS and others of their kind, and PTX.
//!
//! No specification says what is on a line, so nothing is guessed in silence: the user says it, or
//! a heading, or the number of columns where it can be only one thing. Before a text is read it is
//! looked through once ([`survey`]): how many points it has, which types hold its numbers, and
//! where its lines begin that threads may share out.

mod columns;
mod head;
mod info;
mod ptx;
mod registered;
mod sink;
mod source;
mod survey;

pub(crate) use columns::check_columns;
pub use registered::{ASC, CSV, PTS, PTX, TXT, TextFormat, XYZ};

use crate::point::Layout;

/// The family of texts.
const FAMILY: &str = "text";

/// Numbers of a line in the order of the columns, little-endian.
const RECORDS: Layout = Layout::plain(FAMILY);

/// What messages call such a file.
const CALLED: &str = "a text of numbers";
