//! One output for each square of the plane: their names.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::connect::OutputFile;
use super::outputs::check_folder;
use crate::error::shown;
use crate::point::{Metadata, PointBatch, Schema, Units};
use crate::quantity::Length;
use crate::stage::{ChunkSize, CreateSink, Order, PointWalk, Sink, Source, WriteKeys};
use crate::{Error, Result};

/// What stands in a path for the corner of a square.
const CORNER: [&str; 2] = ["{x}", "{y}"];

/// The sink that writes a file for each square that has points.
pub struct Squares {
    /// What each is to be; the path is the pattern of their names.
    pub file: OutputFile,
    /// The side of the squares.
    pub side: Length,
}

impl Squares {
    /// True if `path` has a place for the corner of a square.
    pub fn is_pattern(path: &Path) -> bool {
        let text = path.to_string_lossy();
        // `${x}` is a parameter, or was to be one.
        let stands = |(at, _): (usize, &str)| !text[..at].ends_with('$');
        CORNER.iter().any(|corner| text.match_indices(corner).any(stands))
    }

    /// Refuses a path that does not tell squares apart.
    pub fn check(path: &Path) -> Result<()> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let folder = path.parent().unwrap_or(Path::new(""));
        let [x, y] = CORNER.map(|corner| name.matches(corner).count());
        if x == 1 && y == 1 && !Squares::is_pattern(folder) {
            return Ok(());
        }
        let told = format!(
            "`{}` names no file for each square: the name of the file has `{{x}}` and `{{y}}`, \
             each once, where the corner of a square is to stand",
            shown(path)
        );
        let extension = path.extension().unwrap_or("laz".as_ref()).to_string_lossy();
        let such = folder.join(format!("{{x}}_{{y}}.{extension}"));
        Err(Error::pipeline(told).help(format!("give one such as `{}`", shown(&such))))
    }

    /// The path of the file of `square`: its smallest x and y stand in it, in the unit of the scan.
    fn named(&self, square: [i64; 2], side: f64) -> PathBuf {
        let mut name = self.name();
        for (corner, number) in CORNER.iter().zip(square) {
            name = name.replacen(corner, &corner_text(number, side), 1);
        }
        self.file.keys.path.with_file_name(name)
    }

    fn name(&self) -> String {
        let name = self.file.keys.path.file_name();
        name.map_or(String::new(), |name| name.to_string_lossy().into_owned())
    }
}

/// `number` sides as text, with the decimals that a side has: the corners of two squares differ.
fn corner_text(number: i64, side: f64) -> String {
    let decimals = side.to_string().split_once('.').map_or(0, |(_, decimals)| decimals.len());
    // Six digits of a side tell its multiples apart.
    let decimals = decimals.min(6 + (-side.log10()).max(0.0) as usize);
    let corner = number as f64 * side;
    // No minus stands before zeros.
    format!("{:.decimals$}", if number == 0 { 0.0 } else { corner })
}

/// True if `text` is what [`corner_text`] could say.
fn is_corner(text: &str) -> bool {
    let digits = text.strip_prefix('-').unwrap_or(text);
    let (whole, decimals) = digits.split_once('.').unwrap_or((digits, "0"));
    [whole, decimals]
        .iter()
        .all(|part| !part.is_empty() && part.bytes().all(|digit| digit.is_ascii_digit()))
}

/// True if `name` is `pattern` with corners in their places.
fn matches(pattern: &str, name: &str) -> bool {
    let [mut a, mut b] = CORNER;
    if pattern.find(b) < pattern.find(a) {
        (a, b) = (b, a);
    }
    let Some((before, rest)) = pattern.split_once(a) else { return false };
    let Some((between, after)) = rest.split_once(b) else { return false };
    let inner = name.strip_prefix(before).and_then(|name| name.strip_suffix(after));
    let Some(inner) = inner else { return false };
    match between {
        // Any two numbers side by side.
        "" => inner.bytes().all(|c| c.is_ascii_digit() || c == b'-' || c == b'.'),
        between => inner
            .match_indices(between)
            .any(|(at, _)| is_corner(&inner[..at]) && is_corner(&inner[at + between.len()..])),
    }
}

impl CreateSink for Squares {
    fn path(&self) -> &Path {
        self.file.path()
    }

    fn has_squares(&self) -> bool {
        true
    }

    fn square_side(&self, units: &Units) -> Result<Option<f64>> {
        let folder = self.path().parent().filter(|folder| *folder != Path::new(""));
        check_folder(folder.unwrap_or(Path::new(".")))?;
        Ok(Some(self.side.in_scan(units, "write.side")?.value()))
    }

    fn of_square(&self, square: [i64; 2], side: f64) -> Result<Box<dyn CreateSink>> {
        let keys = WriteKeys { path: self.named(square, side), ..self.file.keys.clone() };
        Ok(Box::new(OutputFile { keys, ..self.file.clone() }))
    }

    fn may_name(&self, path: &Path) -> bool {
        let folder = |path: &Path| match path.parent() {
            Some(folder) if folder != Path::new("") => folder.canonicalize(),
            _ => Path::new(".").canonicalize(),
        };
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let same = || matches!((folder(path), folder(self.path())), (Ok(a), Ok(b)) if a == b);
        matches(&self.name(), &name) && same()
    }

    fn settled(
        &self,
        source: &dyn Source,
        walk: &PointWalk,
        moved_by: Option<&str>,
    ) -> Result<Option<Box<dyn CreateSink>>> {
        let Some(keys) = self.file.settled_keys(source, walk, moved_by)? else { return Ok(None) };
        let file = OutputFile { keys, ..self.file.clone() };
        Ok(Some(Box::new(Squares { file, side: self.side })))
    }

    fn order(&self) -> Order {
        self.file.order()
    }

    fn computed(&self) -> &[String] {
        self.file.computed()
    }

    fn unread(&self) -> &[String] {
        self.file.unread()
    }

    fn chunk(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<ChunkSize> {
        // Its records are held once more while they are sorted by square.
        Ok(self.file.chunk(schema, metadata)?.and_records(schema.stride))
    }

    fn disk_bytes(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<[u64; 2]> {
        self.file.disk_bytes(schema, metadata)
    }

    fn carries(&self, schema: &Schema) -> bool {
        self.file.carries(schema)
    }

    fn warnings(&self, schema: &Schema, metadata: &Metadata) -> Vec<String> {
        self.file.warnings(schema, metadata)
    }

    fn reopen(&self, staged: &[PathBuf]) -> Result<Option<Box<dyn Source>>> {
        self.file.reopen(staged)
    }

    fn checks(&self, schema: &Schema) -> bool {
        self.file.checks(schema)
    }

    fn check(&self, metadata: &Metadata, records: &PointBatch) -> Result<()> {
        self.file.check(metadata, records)
    }

    fn create(
        &self,
        _staged: &Path,
        _schema: &Arc<Schema>,
        _metadata: &Metadata,
        _whole: bool,
    ) -> Result<Box<dyn Sink>> {
        Err(Error::internal("an output of squares is not written as one file").at(self.path()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_told_by_as_many_decimals_as_a_side_has() {
        let told = [(3, 500.0), (-1, 500.0), (0, 0.5), (3, 0.1), (-7, 0.25), (1, 1e3 / 0.3)];
        let told = told.map(|(number, side)| corner_text(number, side));
        assert_eq!(told, ["1500", "-500", "0.0", "0.3", "-1.75", "3333.333333"]);
    }

    #[test]
    fn what_a_square_could_be_named_is_known() {
        for (pattern, yes, no) in [
            ("{x}_{y}.laz", ["0_0.laz", "-500_1500.5.laz"], ["a_0.laz", "0_0.las"]),
            ("t_{y}-{x}.ply", ["t_5-7.ply", "t_-5--7.ply"], ["5-7.ply", "t_5_7.ply"]),
            ("{x}{y}.laz", ["0500.laz", "-5-5.laz"], ["a0.laz", "0 0.laz"]),
        ] {
            assert!(yes.iter().all(|name| matches(pattern, name)), "{pattern}");
            assert!(no.iter().all(|name| !matches(pattern, name)), "{pattern}");
        }
    }
}
