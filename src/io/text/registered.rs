//! Texts as registered formats: how `read` and `write` come to their files.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::head::sniff;
use super::names::{CALLED, FAMILY, RECORDS};
use super::sink::Habit;
use super::source::TextKind;
use super::{info, ptx, sink, source};
use crate::Result;
use crate::point::{Metadata, Schema};
use crate::stage::{ChunkSize, Format, ReadKeys, Separator, Sink, Source, WriteKeys};

/// The format of texts of one extension.
#[derive(Debug, Clone, Copy)]
pub struct TextFormat {
    name: &'static str,
    about: &'static str,
    habit: Habit,
}

const LINES: Habit =
    Habit { kind: TextKind::Lines, separator: Separator::Blank, mark: "", always_names: false };

/// Coordinates of a point a line, and what a heading names besides.
pub const XYZ: TextFormat = TextFormat {
    name: "xyz",
    about: "Text with a point a line; names of columns behind `#`.",
    habit: Habit { mark: "# ", ..LINES },
};

/// Text with columns of any kind.
pub const TXT: TextFormat =
    TextFormat { name: "txt", about: "Text with a point a line.", habit: LINES };

/// The same under another name.
pub const ASC: TextFormat =
    TextFormat { name: "asc", about: "Text with a point a line.", habit: LINES };

/// Values between commas, below their names.
pub const CSV: TextFormat = TextFormat {
    name: "csv",
    about: "Text with a point a line and commas, below the names of the columns.",
    habit: Habit { separator: Separator::Comma, always_names: true, ..LINES },
};

/// Leica's text of points, below their count.
pub const PTS: TextFormat = TextFormat {
    name: "pts",
    about: "Text with a point a line, below their count: coordinates, intensity, colours.",
    habit: Habit { kind: TextKind::Pts, ..LINES },
};

/// Leica's text of scans with their grids and poses.
pub const PTX: TextFormat = TextFormat {
    name: "ptx",
    about: "Text with a cell of a scan a line, below the scan's grid and pose. Read only.",
    habit: Habit { kind: TextKind::Ptx, ..LINES },
};

impl Format for TextFormat {
    fn name(&self) -> &'static str {
        self.name
    }

    fn family(&self) -> &'static str {
        match self.habit.kind {
            TextKind::Ptx => ptx::FAMILY,
            _ => FAMILY,
        }
    }

    fn about(&self) -> &'static str {
        self.about
    }

    fn called(&self) -> &'static str {
        match self.habit.kind {
            TextKind::Ptx => ptx::CALLED,
            _ => CALLED,
        }
    }

    fn sniff(&self, first: &[u8]) -> bool {
        match self.habit.kind {
            TextKind::Ptx => ptx::sniff(first),
            _ => sniff(first) && !ptx::sniff(first),
        }
    }

    fn owns_extension(&self) -> bool {
        ["xyz", "pts", "ptx"].contains(&self.name)
    }

    fn read_keys(&self) -> &'static [&'static str] {
        match self.habit.kind {
            TextKind::Ptx => &["on_error"],
            _ => &["columns", "on_error"],
        }
    }

    fn open(&self, files: &[PathBuf], keys: &ReadKeys) -> Result<Box<dyn Source>> {
        source::open(files, self.habit.kind, keys)
    }

    fn describe(&self, path: &Path) -> Result<serde_json::Value> {
        info::describe(path, self.habit.kind, self.name)
    }

    fn unwritten(&self) -> Option<&'static str> {
        let is_ptx = self.habit.kind == TextKind::Ptx;
        is_ptx.then_some("name it .pts, .xyz or .csv, which have rows and columns as numbers")
    }

    fn keys(&self) -> &'static [&'static str] {
        match self.habit.kind {
            TextKind::Ptx => &[],
            _ => &["types", "colors", "separator", "decimals", "header"],
        }
    }

    fn chunk(
        &self,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<ChunkSize> {
        Ok(sink::plan(self.habit, keys, schema, metadata)?.chunk())
    }

    fn create(
        &self,
        staged: &Path,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
        _whole: bool,
    ) -> Result<Box<dyn Sink>> {
        sink::create(staged, self.habit, keys, schema, metadata)
    }

    fn disk_bytes(
        &self,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<[u64; 2]> {
        Ok(sink::plan(self.habit, keys, schema, metadata)?.disk_bytes())
    }

    fn carries(&self, keys: &WriteKeys, schema: &Schema) -> bool {
        let is_asked = keys.given().next().is_some() || !keys.drop.is_empty();
        schema.layout == RECORDS && !is_asked
    }

    fn holds_crs(&self) -> bool {
        false
    }

    fn holds_gps_time_kind(&self) -> bool {
        false
    }

    fn holds_computed(&self) -> bool {
        true
    }

    fn unread<'a>(&self, keys: &'a WriteKeys) -> &'a [String] {
        &keys.drop
    }
}
