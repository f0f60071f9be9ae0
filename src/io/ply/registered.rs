//! PLY as a registered format: how `read` and `write` come to its files.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::header::CALLED;
use super::names::FAMILY;
use super::sink::PlyOptions;
use super::{info, sink, source};
use crate::Result;
use crate::io::describe::json;
use crate::io::rows::Encoding;
use crate::point::{Metadata, Schema};
use crate::stage::{ChunkSize, Format, OutputEncoding, ReadKeys, Sink, Source, WriteKeys};

/// The format of PLY files.
#[derive(Debug, Clone, Copy)]
pub struct PlyFormat;

/// PLY.
pub const PLY: PlyFormat = PlyFormat;

impl Format for PlyFormat {
    fn name(&self) -> &'static str {
        "ply"
    }

    fn family(&self) -> &'static str {
        FAMILY
    }

    fn about(&self) -> &'static str {
        "PLY with a vertex element."
    }

    fn called(&self) -> &'static str {
        CALLED
    }

    fn sniff(&self, first: &[u8]) -> bool {
        // Damaged line ends are for the header to tell.
        first.starts_with(b"ply")
    }

    fn read_keys(&self) -> &'static [&'static str] {
        &["on_error"]
    }

    fn open(&self, files: &[PathBuf], keys: &ReadKeys) -> Result<Box<dyn Source>> {
        source::open_with(files, keys)
    }

    fn describe(&self, path: &Path) -> Result<serde_json::Value> {
        json(&info::describe(path)?)
    }

    fn note(&self, path: &Path) -> Result<Option<String>> {
        info::note(path)
    }

    fn keys(&self) -> &'static [&'static str] {
        &["types", "encoding", "colors"]
    }

    fn chunk(
        &self,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<ChunkSize> {
        sink::chunk(&options(keys, metadata, false), schema, metadata)
    }

    fn create(
        &self,
        staged: &Path,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
        whole: bool,
    ) -> Result<Box<dyn Sink>> {
        sink::create(staged, &options(keys, metadata, whole), schema, metadata)
    }

    fn disk_bytes(
        &self,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<[u64; 2]> {
        Ok(sink::plan(&options(keys, metadata, false), schema, metadata)?.disk_bytes())
    }

    fn carries(&self, keys: &WriteKeys, schema: &Schema) -> bool {
        let is_asked = keys.encoding.is_some() || !keys.drop.is_empty();
        schema.layout.family == FAMILY && !is_asked
    }

    fn holds_computed(&self) -> bool {
        true
    }

    fn unread<'a>(&self, keys: &'a WriteKeys) -> &'a [String] {
        &keys.drop
    }
}

/// How a PLY output of these keys is written.
pub(crate) fn options(keys: &WriteKeys, metadata: &Metadata, whole: bool) -> PlyOptions {
    let encoding = keys.encoding.map(|encoding| match encoding {
        OutputEncoding::Ascii => Encoding::Ascii,
        OutputEncoding::Binary => Encoding::BinaryLittleEndian,
    });
    PlyOptions {
        encoding,
        computed: metadata.computed.clone(),
        drop: keys.drop.clone(),
        types: keys.types.clone(),
        colors: keys.colors,
        carry_rest: whole,
        triangles: false,
    }
}
