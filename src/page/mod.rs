//! A report as a page that people hand on: one HTML file, with pictures, maps and curves in it,
//! that asks nobody for anything. Knows no engine: it is given a report, the lines of its tiles,
//! and the scans before and after.
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
mod source;
mod words;
mod worst;

use std::path::Path;

use crate::{Error, Result};
pub(crate) use source::PageSource;

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
