//! What a page is made of.

use std::io::BufRead;

use crate::report::Report;
use crate::stage::Source;

/// What a page is made of.
pub(crate) struct PageSource<'a> {
    /// What the run says it did.
    pub report: &'a Report,
    /// The sign of the unit of lengths, where the scan tells it.
    pub unit: Option<&'a str>,
    /// The lines of the tiles of each branch, as a report has them.
    pub tiles: Vec<Box<dyn BufRead + 'a>>,
    /// The scan that was read.
    pub before: &'a dyn Source,
    /// What the first branch wrote, or why it is not drawn.
    pub after: Result<Box<dyn Source>, String>,
    /// True if points were moved, so that places before and after are not the same.
    pub is_moved: bool,
    /// Threads that decode and draw.
    pub threads: usize,
}
