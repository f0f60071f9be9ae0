//! One output for each input, in a folder: their names, and that no two are alike.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::connect::Output;
use super::kinds::{Format, Write, unknown_extension};
use crate::error::shown;
use crate::point::{Layout, Metadata, PointBatch, Schema};
use crate::stage::{ChunkSize, CreateSink, Input, Order, Sink};
use crate::{Error, ErrorKind, Result};

/// The sink that writes a file for each input.
pub struct Outputs {
    /// The keys.
    pub write: Write,
    /// Where the files are to be.
    pub folder: PathBuf,
}

impl Outputs {
    /// Refuses a folder that is something else or cannot be made.
    fn check_folder(&self) -> Result<()> {
        if self.folder.is_dir() {
            return Ok(());
        }
        if self.folder.symlink_metadata().is_ok() {
            return Err(Error::pipeline("this is no folder for outputs").at(&self.folder));
        }
        let parent = self.folder.parent().unwrap_or(Path::new(""));
        if parent == Path::new("") || parent.is_dir() {
            return Ok(());
        }
        let told =
            Error::new(ErrorKind::Io, "the folder does not exist, and the next is to be in it");
        Err(told.at(parent).help("create it first"))
    }

    /// One of the outputs, for what all have in common.
    fn any(&self, schema: &Schema) -> Output {
        // Compressing takes most: where inputs say their formats, some may be LAZ.
        let format = self.write.format.unwrap_or(match schema.layout {
            Layout::Ply => Format::Ply,
            Layout::Las { .. } => Format::Laz,
        });
        let (write, path) = (self.write.clone(), self.folder.clone());
        Output { write, path, format, of_one: true }
    }

    /// The output of the input at `path`: its name, with the extension of the format that is asked
    /// for unless it says that already.
    fn of(&self, input: &Path) -> Result<Output> {
        let path = &Format::without_copc(input).unwrap_or_else(|| input.to_owned());
        let told = Format::of(path);
        let format =
            self.write.format.or(told).ok_or_else(|| unknown_extension(path, "write.format"))?;
        let Some(name) = path.file_name() else {
            return Err(Error::pipeline("the input has no name for its output").at(path));
        };
        let name = match told {
            Some(told) if told == format => name.to_owned(),
            Some(_) => Path::new(name).with_extension(format.extension()).into_os_string(),
            // Behind a dot that is part of the name, such as that of `tile.12`.
            None => {
                [name, ".".as_ref(), format.extension().as_ref()].into_iter().collect::<OsString>()
            }
        };
        let path = self.folder.join(name);
        self.write.check(format).map_err(|(_, error)| error.at(&path))?;
        Ok(Output { write: self.write.clone(), path, format, of_one: true })
    }
}

impl CreateSink for Outputs {
    fn path(&self) -> &Path {
        &self.folder
    }

    fn is_folder(&self) -> bool {
        true
    }

    fn each_input(&self, inputs: &[Input]) -> Result<Option<Vec<Box<dyn CreateSink>>>> {
        self.check_folder()?;
        if inputs.is_empty() {
            return Err(Error::pipeline("the points come from no file that an output could be of")
                .at(&self.folder)
                .help("write one file: give `write.path` instead of `write.folder`"));
        }
        let mut taken: BTreeMap<PathBuf, &Path> = BTreeMap::new();
        let mut all: Vec<Box<dyn CreateSink>> = Vec::with_capacity(inputs.len());
        for Input { path, .. } in inputs {
            let output = self.of(path)?;
            if let Some(other) = taken.insert(output.path.clone(), path) {
                let told = format!("{} and {} would both become this", shown(other), shown(path));
                return Err(Error::pipeline(told)
                    .at(&output.path)
                    .help("rename one of them, or run them one by one"));
            }
            all.push(Box::new(output));
        }
        Ok(Some(all))
    }

    fn order(&self) -> Order {
        self.write.stage_order()
    }

    fn wants_normals(&self) -> bool {
        !self.write.dimensions.is_empty()
    }

    fn chunk(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<ChunkSize> {
        self.any(schema).chunk(schema, metadata)
    }

    fn disk_bytes(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<[u64; 2]> {
        self.any(schema).disk_bytes(schema, metadata)
    }

    fn warnings(&self, schema: &Schema, metadata: &Metadata) -> Vec<String> {
        self.any(schema).warnings(schema, metadata)
    }

    fn checks(&self, schema: &Schema) -> bool {
        self.any(schema).checks(schema)
    }

    fn check(&self, metadata: &Metadata, records: &PointBatch) -> Result<()> {
        self.any(records.schema()).check(metadata, records)
    }

    fn create(
        &self,
        _staged: &Path,
        _schema: &Arc<Schema>,
        _metadata: &Metadata,
        _whole: bool,
    ) -> Result<Box<dyn Sink>> {
        Err(Error::internal("a folder is not written as one file").at(&self.folder))
    }
}
