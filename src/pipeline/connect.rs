//! From checked keys to the code that reads and writes formats.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::kinds::{Format, Synth, Write};
use crate::point::{Metadata, Schema};
use crate::stage::{CreateSink, OpenSource, Order, Sink, Source};
use crate::{Error, Result};

/// The source that reads `files`, each of its format; all LAS and LAZ, or all PLY.
pub fn read(files: Vec<PathBuf>, formats: Vec<Format>) -> Box<dyn OpenSource> {
    Box::new(Files { files, _formats: formats })
}

/// The source that makes a scan up.
pub fn synth(_synth: Synth) -> Box<dyn OpenSource> {
    Box::new(Files { files: Vec::new(), _formats: Vec::new() })
}

/// The sink that writes a file of `format`.
pub fn write(write: Write, format: Format) -> Box<dyn CreateSink> {
    Box::new(Output { write, _format: format })
}

struct Files {
    files: Vec<PathBuf>,
    _formats: Vec<Format>,
}

impl OpenSource for Files {
    fn open(&self) -> Result<Box<dyn Source>> {
        Err(Error::internal("formats are not connected"))
    }

    fn paths(&self) -> Vec<PathBuf> {
        self.files.clone()
    }
}

struct Output {
    write: Write,
    _format: Format,
}

impl CreateSink for Output {
    fn path(&self) -> &Path {
        &self.write.path
    }

    fn order(&self) -> Order {
        self.write.stage_order()
    }

    fn wants_normals(&self) -> bool {
        !self.write.dimensions.is_empty()
    }

    fn create(&self, _: &Path, _: &Arc<Schema>, _: &Metadata) -> Result<Box<dyn Sink>> {
        Err(Error::internal("formats are not connected"))
    }
}
