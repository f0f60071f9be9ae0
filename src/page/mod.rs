//! A report as a page that people hand on: one HTML file, with pictures, maps and curves in it, that
//! asks nobody for anything. Knows no engine: it is given a report, the lines of its tiles, and the
//! scans before and after.
//!
//! What it says follows from the result and from the names and sizes of files alone, so that it has
//! the same bytes whatever memory and threads the run had. Seconds and memory are in the report of
//! a name that does not end in `.html`. The layout is the template `templates/page.html`, which is
//! checked as it is compiled; curves are SVG, all else is PNG, both made here.

mod bits;
mod branch;
mod chart;
mod map;
mod model;
mod scenes;
mod words;
mod worst;

use std::io::BufRead;
use std::path::Path;

use crate::report::Report;
use crate::stage::Source;
use crate::{Error, Result};

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

/// True if the report of this name is a page.
pub(crate) fn is_page(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("html"))
}

/// The page as HTML.
///
/// # Errors
///
/// Lines of tiles that cannot be read. What cannot be drawn is said on the page instead.
pub(crate) fn html(source: PageSource<'_>) -> Result<String> {
    let page = model::Page::of(source)?;
    askama::Template::render(&page)
        .map_err(|e| Error::internal("the page could not be laid out").because(e))
}
