//! One output for each input, in a folder: their names, and that no two are alike.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::checked::{check, unknown_extension};
use super::connect::OutputFile;
use super::settled::settled;
use crate::error::shown;
use crate::host::standard;
use crate::point::{Metadata, PointBatch, Schema};
use crate::stage::{
    ChunkSize, CreateSink, Format, Formats, Input, Lattice, Order, PointsAhead, ReadKeys, Sink,
    Source, WriteKeys,
};
use crate::{Error, ErrorKind, Result};

/// The sink that writes a file for each input.
pub struct Outputs {
    /// What each is to be; the path is that of the folder.
    pub keys: WriteKeys,
    /// The order of their records.
    pub order: Order,
    /// The format of all of them; None for those of the inputs.
    pub format: Option<Arc<dyn Format>>,
    /// All formats.
    pub formats: Formats,
}

/// Refuses a folder that is something else or cannot be made.
pub(super) fn check_folder(folder: &Path) -> Result<()> {
    if folder.is_dir() {
        return Ok(());
    }
    if folder.symlink_metadata().is_ok() {
        return Err(Error::pipeline("this is no folder for outputs").at(folder));
    }
    let parent = folder.parent().unwrap_or(Path::new(""));
    if parent == Path::new("") || parent.is_dir() {
        return Ok(());
    }
    let told = Error::new(ErrorKind::Io, "the folder does not exist, and the next is to be in it");
    Err(told.at(parent).help("create it first"))
}

impl Outputs {
    /// An output of `format` at `path`.
    fn output(&self, path: PathBuf, format: &Arc<dyn Format>) -> OutputFile {
        let keys = WriteKeys { path, ..self.keys.clone() };
        let (format, formats) = (format.clone(), self.formats.clone());
        OutputFile { keys, order: self.order, format, formats, of_one: true }
    }

    /// An output of each format that there may be, for records of `schema`.
    fn possible(&self, schema: &Schema) -> Vec<OutputFile> {
        let formats: Vec<_> = match &self.format {
            Some(format) => vec![format],
            // Those that the outputs may have: see `of`.
            None => {
                let family = self.formats.of_family(schema.layout.family);
                family.filter(|format| format.arranged().is_none()).collect()
            }
        };
        formats.into_iter().map(|format| self.output(self.keys.path.clone(), format)).collect()
    }

    /// One of these: what does not depend on it is alike in all formats of a family.
    fn any(&self, schema: &Schema) -> Option<OutputFile> {
        self.possible(schema).pop()
    }

    /// The output of the input at `path`: its name, with the extension of the format that is asked
    /// for unless it says that already.
    fn of(&self, input: &Path) -> Result<OutputFile> {
        if standard::is_input(input) {
            let told = "standard input has no name that its output in a folder could have";
            return Err(Error::pipeline(told).help("give a file as `write.path` instead"));
        }
        let told = self.formats.of(input);
        let unknown = || unknown_extension(input, "write.format", &self.formats);
        let own = || told.map(|told| self.formats.unarranged(told));
        let format = self.format.as_ref().or_else(own).ok_or_else(unknown)?;
        let (Some(name), Some(stem)) = (input.file_name(), self.formats.stem(input)) else {
            return Err(Error::pipeline("the input has no name for its output").at(input));
        };
        let extended = |stem: &OsStr| {
            [stem, ".".as_ref(), format.extension().as_ref()].into_iter().collect::<OsString>()
        };
        let name = match told {
            Some(told) if told.name() == format.name() => name.to_owned(),
            Some(_) => extended(stem),
            // Behind a dot that is part of the name, such as that of `tile.12`.
            None => extended(name),
        };
        let output = self.output(self.keys.path.join(name), format);
        let checked = check(&output.keys, &**format, &self.formats);
        checked.map_err(|(_, error)| error.at(&output.keys.path))?;
        Ok(output)
    }
}

impl CreateSink for Outputs {
    fn path(&self) -> &Path {
        &self.keys.path
    }

    fn is_folder(&self) -> bool {
        true
    }

    fn each_input(&self, inputs: &[Input]) -> Result<Option<Vec<Box<dyn CreateSink>>>> {
        check_folder(&self.keys.path)?;
        if inputs.is_empty() {
            return Err(Error::pipeline("the points come from no file that an output could be of")
                .at(&self.keys.path)
                .help("write one file: give `write.path` instead of `write.folder`"));
        }
        let mut taken: BTreeMap<PathBuf, &Path> = BTreeMap::new();
        let mut all: Vec<Box<dyn CreateSink>> = Vec::with_capacity(inputs.len());
        for Input { path, .. } in inputs {
            let output = self.of(path)?;
            if let Some(other) = taken.insert(output.keys.path.clone(), path) {
                let told = format!("{} and {} would both become this", shown(other), shown(path));
                return Err(Error::pipeline(told)
                    .at(&output.keys.path)
                    .help("rename one of them, or run them one by one"));
            }
            all.push(Box::new(output));
        }
        Ok(Some(all))
    }

    fn settled(&self, ahead: &PointsAhead<'_>) -> Result<Option<Box<dyn CreateSink>>> {
        let Some(keys) = settled(&self.keys, ahead)? else { return Ok(None) };
        let (order, format, formats) = (self.order, self.format.clone(), self.formats.clone());
        Ok(Some(Box::new(Outputs { keys, order, format, formats })))
    }

    fn order(&self) -> Order {
        self.order
    }

    fn computed(&self) -> &[String] {
        &self.keys.computed
    }

    fn chunk(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<ChunkSize> {
        let mut largest = ChunkSize { points: 0, bytes: 0 };
        for output in self.possible(schema) {
            let chunk = output.chunk(schema, metadata)?;
            largest.points = largest.points.max(chunk.points);
            largest.bytes = largest.bytes.max(chunk.bytes);
        }
        Ok(largest)
    }

    fn arranged(
        &self,
        lattice: &Lattice,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<Option<u64>> {
        let possible = self.possible(schema);
        let held = possible.iter().map(|output| output.arranged(lattice, schema, metadata));
        Ok(held.collect::<Result<Vec<_>>>()?.into_iter().max().flatten())
    }

    fn disk_bytes(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<[u64; 2]> {
        let possible = self.possible(schema);
        let bytes = possible.iter().map(|output| output.disk_bytes(schema, metadata));
        Ok(bytes.collect::<Result<Vec<_>>>()?.into_iter().min().unwrap_or_default())
    }

    fn carries(&self, schema: &Schema) -> bool {
        let possible = self.possible(schema);
        !possible.is_empty() && possible.iter().all(|output| output.carries(schema))
    }

    fn warnings(&self, schema: &Schema, metadata: &Metadata) -> Vec<String> {
        self.any(schema).map_or(Vec::new(), |output| output.warnings(schema, metadata))
    }

    fn reopen(&self, staged: &[PathBuf]) -> Result<Option<Box<dyn Source>>> {
        // Files of one family are read together by any format of it.
        let one = self.formats.iter().find(|format| {
            let first = staged.first().map(std::slice::from_ref);
            first.is_some_and(|file| format.open(file, &ReadKeys::default()).is_ok())
        });
        one.map(|format| format.open(staged, &ReadKeys::default())).transpose()
    }

    fn checks(&self, schema: &Schema) -> bool {
        self.any(schema).is_some_and(|output| output.checks(schema))
    }

    fn check(&self, metadata: &Metadata, records: &PointBatch) -> Result<()> {
        self.any(records.schema()).map_or(Ok(()), |output| output.check(metadata, records))
    }

    fn create(
        &self,
        _staged: &Path,
        _schema: &Arc<Schema>,
        _metadata: &Metadata,
        _whole: bool,
    ) -> Result<Box<dyn Sink>> {
        Err(Error::internal("a folder is not written as one file").at(&self.keys.path))
    }
}
