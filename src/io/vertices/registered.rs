//! OBJ, OFF and STL as registered formats: how `read` comes to their files.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::json;

use super::kind::VerticesKind;
use super::lines::sniff;
use super::source;
use crate::host::standard;
use crate::point::{Metadata, Schema};
use crate::stage::{ChunkSize, Format, ReadKeys, Sink, Source, WriteKeys};
use crate::{Error, Result};

/// The format of meshes whose vertices are read.
#[derive(Debug, Clone, Copy)]
pub struct VerticesFormat(VerticesKind);

/// The vertices of OBJ.
pub const OBJ: VerticesFormat = VerticesFormat(VerticesKind::Obj);

/// The vertices of OFF.
pub const OFF: VerticesFormat = VerticesFormat(VerticesKind::Off);

/// The corners of the facets of STL.
pub const STL: VerticesFormat = VerticesFormat(VerticesKind::Stl);

impl VerticesFormat {
    fn help(self) -> &'static str {
        match self.0 {
            VerticesKind::Off => {
                "name it .ply; the stage `mesh` writes triangles, as PLY, OBJ or STL"
            }
            _ => "name it .ply or .xyz; the stage `mesh` writes it, of triangles",
        }
    }
}

impl Format for VerticesFormat {
    fn name(&self) -> &'static str {
        match self.0 {
            VerticesKind::Obj => "obj",
            VerticesKind::Off => "off",
            VerticesKind::Stl => "stl",
        }
    }

    fn family(&self) -> &'static str {
        self.0.names()[0]
    }

    fn about(&self) -> &'static str {
        match self.0 {
            VerticesKind::Stl => "STL, the corners of its facets. Read only.",
            VerticesKind::Obj => "OBJ, its vertices. Read only.",
            VerticesKind::Off => "OFF, its vertices. Read only.",
        }
    }

    fn called(&self) -> &'static str {
        self.0.names()[1]
    }

    fn sniff(&self, first: &[u8]) -> bool {
        sniff(first, self.0)
    }

    fn open(&self, files: &[PathBuf], keys: &ReadKeys) -> Result<Box<dyn Source>> {
        source::open(files, self.0, keys)
    }

    fn describe(&self, path: &Path) -> Result<serde_json::Value> {
        let opened = source::open(&[path.to_owned()], self.0, &ReadKeys::default())?;
        let dimensions: Vec<&str> =
            opened.schema().dimensions.iter().map(|d| d.name.as_str()).collect();
        let bytes = standard::about(path)?.len();
        let (kind, points) = (self.0.names()[0], opened.points());
        Ok(json!({ "kind": kind, "bytes": bytes, "points": points, "dimensions": dimensions }))
    }

    // A folder of points may well have meshes beside them.
    fn owns_extension(&self) -> bool {
        false
    }

    fn unwritten(&self) -> Option<&'static str> {
        Some(self.help())
    }

    fn chunk(&self, _: &WriteKeys, _: &Arc<Schema>, _: &Metadata) -> Result<ChunkSize> {
        Err(Error::pipeline("it is not written").help(self.help()))
    }

    fn create(
        &self,
        _: &Path,
        _: &WriteKeys,
        _: &Arc<Schema>,
        _: &Metadata,
        _: bool,
    ) -> Result<Box<dyn Sink>> {
        Err(Error::pipeline("it is not written").help(self.help()))
    }
}
