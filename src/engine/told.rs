//! The report of a run as a file, where its outputs are complete and have no names yet: as JSON, or
//! as a page if its name ends in `.html`.

use std::fs::File;
use std::io::{BufRead, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::lines::TileLines;
use super::publish::Staged;
use super::task::Task;
use crate::page::{PageSource, html, is_page};
use crate::report::Report;
use crate::stage::Source;
use crate::{Error, Result};

impl Task {
    /// Writes the report that is to be at `path` to `staged` and brings it to disk. The files of
    /// the first branch's sink grew at `written`.
    pub(super) fn write_report(
        &self,
        (path, staged): (&Path, &Path),
        report: &Report,
        tiles: &[Option<TileLines>],
        written: &[Staged],
    ) -> Result<()> {
        let page = match is_page(path) {
            true => Some(self.page(report, tiles, written)?),
            false => None,
        };
        let write = || {
            let mut out = BufWriter::new(File::create(staged)?);
            match page {
                Some(page) => out.write_all(page.as_bytes())?,
                None => report.write(&mut out, tiles.iter().map(lines_of))?,
            }
            out.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()
        };
        // Lines that the spill cannot give back are its error, about its file.
        write().map_err(|e| match e.downcast::<Error>() {
            Ok(error) => error,
            Err(e) => Error::io(staged, "write the report", e),
        })
    }

    fn page(
        &self,
        report: &Report,
        tiles: &[Option<TileLines>],
        written: &[Staged],
    ) -> Result<String> {
        let mut streams = self.transforms.iter().chain(&self.filters);
        html(PageSource {
            report,
            unit: self.source.metadata().units.sign(),
            tiles: tiles.iter().map(lines_of).collect(),
            before: &*self.source,
            after: self.reopened(written),
            is_moved: streams.any(|stage| stage.moves()),
            threads: self.threads,
        })
    }

    /// What the first branch's last sink wrote, or why it cannot be looked at.
    fn reopened(&self, written: &[Staged]) -> Result<Box<dyn Source>, String> {
        let none = || "it is in no file".to_owned();
        let sink = self.sinks.get(self.first_sink()).ok_or_else(none)?;
        let files: Vec<PathBuf> = written.iter().map(|staged| staged.file().to_owned()).collect();
        if files.is_empty() {
            return Err(none());
        }
        let open = sink.reopen(&files).map_err(|error| error.to_string())?;
        open.ok_or_else(|| "its format is not read".to_owned())
    }

    /// The last sink of the first branch.
    pub(super) fn first_sink(&self) -> usize {
        self.branches.first().map_or(0, |branch| branch.last_sink)
    }
}

/// The lines of a branch's report tiles; none if it has none.
fn lines_of(tiles: &Option<TileLines>) -> Box<dyn BufRead + '_> {
    match tiles {
        Some(lines) => Box::new(lines.reader()),
        None => Box::new(std::io::empty()),
    }
}
