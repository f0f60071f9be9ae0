//! PCD as a registered format: how `read` and `write` come to its files.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::names::{CALLED, FAMILY, RECORDS};
use super::{info, sink, source};
use crate::Result;
use crate::point::{Metadata, Schema};
use crate::stage::{ChunkSize, Format, ReadKeys, Sink, Source, WriteKeys};

/// The format of PCD files.
#[derive(Debug, Clone, Copy)]
pub struct PcdFormat;

/// PCD.
pub const PCD: PcdFormat = PcdFormat;

impl Format for PcdFormat {
    fn name(&self) -> &'static str {
        "pcd"
    }

    fn family(&self) -> &'static str {
        FAMILY
    }

    fn about(&self) -> &'static str {
        "PCD, the points of the Point Cloud Library."
    }

    fn called(&self) -> &'static str {
        CALLED
    }

    fn sniff(&self, first: &[u8]) -> bool {
        let begins = |with: &str| first.starts_with(with.as_bytes());
        ["# .PCD", "VERSION .", "VERSION 0.", "FIELDS ", "COLUMNS "].into_iter().any(begins)
    }

    fn read_keys(&self) -> &'static [&'static str] {
        &["on_error"]
    }

    fn open(&self, files: &[PathBuf], keys: &ReadKeys) -> Result<Box<dyn Source>> {
        source::open(files, keys)
    }

    fn describe(&self, path: &Path) -> Result<serde_json::Value> {
        info::describe(path)
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
        Ok(sink::plan(keys, schema, metadata)?.chunk())
    }

    fn create(
        &self,
        staged: &Path,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
        _whole: bool,
    ) -> Result<Box<dyn Sink>> {
        sink::create(staged, keys, schema, metadata)
    }

    fn disk_bytes(
        &self,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<[u64; 2]> {
        Ok(sink::plan(keys, schema, metadata)?.disk_bytes())
    }

    fn carries(&self, keys: &WriteKeys, schema: &Schema) -> bool {
        let is_asked = keys.encoding.is_some() || !keys.drop.is_empty();
        schema.layout == RECORDS && !is_asked
    }

    fn holds_computed(&self) -> bool {
        true
    }

    fn unread<'a>(&self, keys: &'a WriteKeys) -> &'a [String] {
        &keys.drop
    }
}
