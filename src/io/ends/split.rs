//! One output for each file of a split: their names.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::connect::OutputFile;
use super::outputs::check_folder;
use super::settled::settled;
use crate::error::{nearest, shown};
use crate::point::{Metadata, PointBatch, Schema, Units};
use crate::quantity::Length;
use crate::stage::{
    ChunkSize, CreateSink, Lattice, Order, OutputSplit, PointsAhead, Sink, Source, SplitKey,
    WriteKeys,
};
use crate::{Error, Result};

/// What stands in a path for the corner of a square.
const CORNER: &[&str] = &["{x}", "{y}"];
/// What stands there for a value.
const VALUE: &[&str] = &["{value}"];
/// What stands there for the number of a file.
const NUMBER: &[&str] = &["{number}"];
/// Digits of such a number at least: shells and programs that sort names as texts keep the order.
const DIGITS: usize = 4;

/// The sink that writes a file for each part of its records.
pub struct SplitFiles {
    /// What each is to be; the path is the pattern of their names.
    pub file: OutputFile,
    /// What they are split by.
    pub by: SplitBy,
}

/// What records are split by, as users say it.
#[derive(Debug, Clone)]
pub enum SplitBy {
    /// The squares of this side that they lie in.
    Side(Length),
    /// Their values of this dimension.
    Dimension(String),
    /// How many they are.
    Points(u64),
    /// The bytes that they take.
    Bytes(u64),
}

impl SplitBy {
    /// The key that says it.
    pub fn key(&self) -> &'static str {
        match self {
            SplitBy::Side(_) => "side",
            SplitBy::Dimension(_) => "by",
            SplitBy::Points(_) => "points",
            SplitBy::Bytes(_) => "bytes",
        }
    }

    /// What stands in the pattern of their names, each once.
    pub fn places(&self) -> &'static [&'static str] {
        match self {
            SplitBy::Side(_) => CORNER,
            SplitBy::Dimension(_) => VALUE,
            SplitBy::Points(_) | SplitBy::Bytes(_) => NUMBER,
        }
    }

    /// What each file is one of, and what stands in its name.
    fn told(&self) -> [&'static str; 2] {
        match self {
            SplitBy::Side(_) => ["for each square", "the corner of a square is"],
            SplitBy::Dimension(_) => ["for each value", "a value is"],
            SplitBy::Points(_) | SplitBy::Bytes(_) => {
                ["for each number", "the number of a file is"]
            }
        }
    }
}

/// What stands in `path` for the files of a split, if anything does, and what to add for it.
pub fn pattern(path: &Path) -> Option<(&'static str, &'static str)> {
    let text = path.to_string_lossy();
    // `${x}` is a parameter, or was to be one.
    let is_free = |(at, _): (usize, &str)| !text[..at].ends_with('$');
    let stands = |place: &&&'static str| text.match_indices(**place).any(is_free);
    [
        (CORNER, "`side = \"500 m\"`, a file for each square"),
        (VALUE, "`by = \"PointSourceId\"`, a file for each value"),
        (NUMBER, "`points = \"10M\"` or `bytes = \"500 MiB\"`, one file after another"),
    ]
    .into_iter()
    .find_map(|(places, key)| Some((*places.iter().find(stands)?, key)))
}

impl SplitFiles {
    /// Refuses a path that does not tell the files apart.
    pub fn check(&self) -> Result<()> {
        let path = &self.file.keys.path;
        let name = self.name();
        let folder = path.parent().unwrap_or(Path::new(""));
        let places = self.by.places();
        // What stands for a split by another key would stay in the names.
        let rest = places.iter().fold(name.clone(), |rest, place| rest.replace(place, ""));
        let has_others = [folder, Path::new(&rest)].iter().any(|path| pattern(path).is_some());
        if places.iter().all(|place| name.matches(place).count() == 1) && !has_others {
            return Ok(());
        }
        let each: Vec<String> = places.iter().map(|place| format!("`{place}`")).collect();
        let [of, stands] = self.by.told();
        let once = if places.len() > 1 { "each once" } else { "once" };
        let told = format!(
            "`{}` names no file {of}: the name of the file has {}, {once}, where {stands} to \
             stand, and nothing else in braces",
            shown(path),
            each.join(" and ")
        );
        let extension = path.extension().unwrap_or("laz".as_ref()).to_string_lossy();
        let such = folder.join(format!("{}.{extension}", places.join("_")));
        Err(Error::pipeline(told).help(format!("give one such as `{}`", shown(&such))))
    }

    /// The path of a file: what it has stands in it.
    fn named(&self, key: SplitKey, split: &OutputSplit) -> PathBuf {
        let mut name = self.name();
        for (place, number) in self.by.places().iter().zip(key) {
            let text = match split {
                OutputSplit::Squares(side) => corner_text(number, *side),
                OutputSplit::Values(_) => number.to_string(),
                _ => format!("{number:0DIGITS$}"),
            };
            name = name.replacen(place, &text, 1);
        }
        self.file.keys.path.with_file_name(name)
    }

    fn name(&self) -> String {
        let name = self.file.keys.path.file_name();
        name.map_or(String::new(), |name| name.to_string_lossy().into_owned())
    }
}

/// The error of a dimension that the records of `schema` lack.
fn unknown(name: &str, schema: &Schema) -> Error {
    let names: Vec<String> = schema.dimensions.iter().map(|d| d.name.clone()).collect();
    let near = nearest(name, &names).map(|near| format!("did you mean `{near}`? "));
    let told = format!("`write.by` names {name}, which the points do not have");
    let help = format!("{}they have {}", near.unwrap_or_default(), names.join(", "));
    Error::pipeline(told).help(help)
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

/// True if `name` is `pattern` with numbers in its `places`.
fn matches(pattern: &str, name: &str, places: &[&str]) -> bool {
    let mut places: Vec<&str> = places.to_vec();
    places.sort_by_key(|place| pattern.find(place));
    let [a, rest @ ..] = &places[..] else { return false };
    let Some((before, behind)) = pattern.split_once(a) else { return false };
    let Some(inner) = name.strip_prefix(before) else { return false };
    let Some((between, after)) = rest.first().and_then(|b| behind.split_once(b)) else {
        return inner.strip_suffix(behind).is_some_and(is_corner);
    };
    let Some(inner) = inner.strip_suffix(after) else { return false };
    match between {
        // Any two numbers side by side.
        "" => inner.bytes().all(|c| c.is_ascii_digit() || c == b'-' || c == b'.'),
        between => inner
            .match_indices(between)
            .any(|(at, _)| is_corner(&inner[..at]) && is_corner(&inner[at + between.len()..])),
    }
}

impl CreateSink for SplitFiles {
    fn path(&self) -> &Path {
        self.file.path()
    }

    fn is_split(&self) -> bool {
        true
    }

    fn split(&self, schema: &Schema, units: &Units) -> Result<Option<OutputSplit>> {
        let folder = self.path().parent().filter(|folder| *folder != Path::new(""));
        check_folder(folder.unwrap_or(Path::new(".")))?;
        Ok(Some(match &self.by {
            SplitBy::Side(side) => OutputSplit::Squares(side.in_scan(units, "write.side")?.value()),
            SplitBy::Dimension(name) => match schema.find(name) {
                Some(_) => OutputSplit::Values(name.clone()),
                None => return Err(unknown(name, schema)),
            },
            SplitBy::Points(points) => OutputSplit::Points(*points),
            SplitBy::Bytes(bytes) => OutputSplit::Bytes(*bytes),
        }))
    }

    fn of_split(&self, key: SplitKey, split: &OutputSplit) -> Result<Box<dyn CreateSink>> {
        let keys = WriteKeys { path: self.named(key, split), ..self.file.keys.clone() };
        Ok(Box::new(OutputFile { keys, ..self.file.clone() }))
    }

    fn may_name(&self, path: &Path) -> bool {
        let folder = |path: &Path| match path.parent() {
            Some(folder) if folder != Path::new("") => folder.canonicalize(),
            _ => Path::new(".").canonicalize(),
        };
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let same = || matches!((folder(path), folder(self.path())), (Ok(a), Ok(b)) if a == b);
        matches(&self.name(), &name, self.by.places()) && same()
    }

    fn settled(&self, ahead: &PointsAhead<'_>) -> Result<Option<Box<dyn CreateSink>>> {
        let Some(keys) = settled(&self.file.keys, ahead)? else { return Ok(None) };
        let file = OutputFile { keys, ..self.file.clone() };
        Ok(Some(Box::new(SplitFiles { file, by: self.by.clone() })))
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
        // Its records are held once more while they are sorted by file, and once more to be
        // measured.
        let chunk = self.file.chunk(schema, metadata)?.and_records(schema.stride);
        Ok(match self.by {
            SplitBy::Bytes(_) => chunk.and_records(schema.stride),
            _ => chunk,
        })
    }

    fn arranged(
        &self,
        lattice: &Lattice,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<Option<u64>> {
        self.file.arranged(lattice, schema, metadata)
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
        Err(Error::internal("an output that is split is not written as one file").at(self.path()))
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
            assert!(yes.iter().all(|name| matches(pattern, name, CORNER)), "{pattern}");
            assert!(no.iter().all(|name| !matches(pattern, name, CORNER)), "{pattern}");
        }
    }
}
