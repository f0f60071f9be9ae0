//! E57 as a registered format: how `read` and `write` come to its files.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::names::{CALLED, FAMILY, MAGIC, RECORDS};
use super::{info, sink, source, validate};
use crate::Result;
use crate::point::{Metadata, Schema};
use crate::stage::{
    ChunkSize, Findings, Format, PointWalk, ReadKeys, Rule, Sink, Source, WriteKeys,
};

/// The format of E57 files.
#[derive(Debug, Clone, Copy)]
pub struct E57Format;

/// E57.
pub const E57: E57Format = E57Format;

impl Format for E57Format {
    fn name(&self) -> &'static str {
        "e57"
    }

    fn family(&self) -> &'static str {
        FAMILY
    }

    fn about(&self) -> &'static str {
        "E57, scans with poses (ASTM E2807)."
    }

    fn called(&self) -> &'static str {
        CALLED
    }

    fn sniff(&self, first: &[u8]) -> bool {
        first.starts_with(MAGIC)
    }

    fn read_keys(&self) -> &'static [&'static str] {
        &["scans", "on_error"]
    }

    fn open(&self, files: &[PathBuf], keys: &ReadKeys) -> Result<Box<dyn Source>> {
        Ok(Box::new(source::open(files, keys)?))
    }

    fn describe(&self, path: &Path) -> Result<serde_json::Value> {
        info::describe(path)
    }

    fn validate(&self, path: &Path, walk: &PointWalk<'_>, findings: &mut Findings) -> Result<()> {
        validate::validate(path, walk, findings)
    }

    fn rules(&self) -> Vec<&'static Rule> {
        validate::rules()
    }

    fn note(&self, path: &Path) -> Result<Option<String>> {
        info::note(path)
    }

    fn keys(&self) -> &'static [&'static str] {
        &["types", "colors"]
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
        let [rows, again] = sink::plan(keys, schema, metadata)?.disk_bytes();
        Ok([rows, rows.max(again)])
    }

    fn carries(&self, keys: &WriteKeys, schema: &Schema) -> bool {
        schema.layout == RECORDS && keys.drop.is_empty()
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
