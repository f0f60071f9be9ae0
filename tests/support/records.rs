//! Records of files: read, written, and compared as multisets.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pointmill::point::{Metadata, NORMAL, PointBatch, Schema};
use pointmill::stage::{ReadKeys, Sink, SinkSummary, Source, WriteKeys};
use pointmill::{Done, Registry, Result};

/// Points of a batch: a prime, so that no chunk is a whole number of them.
const BATCH: usize = 7_001;

/// Opens files of one kind, by their extension.
pub fn open(paths: &[PathBuf]) -> Result<Box<dyn Source>> {
    Registry::builtin()
        .formats()
        .of(&paths[0])
        .expect("a known extension")
        .open(paths, &ReadKeys::default())
}

/// The first `limit` records of a source.
pub fn read_source(source: &dyn Source, limit: usize) -> Result<Vec<u8>> {
    let most = limit.saturating_mul(source.schema().stride);
    let mut records = read_parts(source, BATCH, &[], most)?;
    records.truncate(most);
    Ok(records)
}

/// All records of a source, in batches of `capacity`, without the dimensions `unread`.
pub fn read_without(source: &dyn Source, capacity: usize, unread: &[String]) -> Result<Vec<u8>> {
    read_parts(source, capacity, unread, usize::MAX)
}

/// Part after part, until there are `most` bytes or more.
fn read_parts(
    source: &dyn Source,
    capacity: usize,
    unread: &[String],
    most: usize,
) -> Result<Vec<u8>> {
    let mut batch = PointBatch::new(source.schema().clone(), capacity);
    let mut records = Vec::new();
    for index in 0..source.parts() {
        let mut part = source.part_without(index, unread)?;
        while records.len() < most {
            part.read(&mut batch)?;
            if batch.is_empty() {
                break;
            }
            assert!(batch.len() <= capacity);
            records.extend_from_slice(batch.records());
        }
    }
    Ok(records)
}

/// Schema and records of files, at most `limit` records.
pub fn read_some(paths: &[PathBuf], limit: usize) -> Result<(Arc<Schema>, Vec<u8>)> {
    let source = open(paths)?;
    Ok((source.schema().clone(), read_source(&*source, limit)?))
}

/// Schema and records of a file.
pub fn read(path: &Path) -> (Arc<Schema>, Vec<u8>) {
    read_some(&[path.to_owned()], usize::MAX).unwrap_or_else(|e| panic!("{e:?}"))
}

/// A file of the format that its extension names.
pub fn sink(path: &Path, schema: &Arc<Schema>, metadata: &Metadata) -> Result<Box<dyn Sink>> {
    let registry = Registry::builtin();
    let format = registry.formats().of(path).expect("a known extension");
    format.create(path, &WriteKeys::default(), schema, metadata, false)
}

/// Writes records to their end.
pub fn write(sink: Box<dyn Sink>, schema: &Arc<Schema>, records: &[u8]) -> Result<SinkSummary> {
    write_with(sink, schema, records, None)
}

/// The same with normals, by the number of the record.
pub fn write_with(
    mut sink: Box<dyn Sink>,
    schema: &Arc<Schema>,
    records: &[u8],
    normals: Option<&dyn Fn(usize) -> [f32; 3]>,
) -> Result<SinkSummary> {
    let (encoder, chunk) = (sink.encoder(), sink.chunk_points());
    let mut batch = PointBatch::new(schema.clone(), chunk);
    for (n, records) in records.chunks(chunk * schema.stride).enumerate() {
        batch.clear();
        batch.extend(records);
        let numbers = n * chunk..n * chunk + batch.len();
        if let Some(normal) = normals {
            batch.columns.set(&NORMAL, &numbers.map(normal).collect::<Vec<_>>());
        }
        sink.append(encoder.encode(&batch)?)?;
    }
    sink.finish()
}

/// Asserts that every record of `part` is one of `whole`, as often at most, byte for byte.
pub fn assert_contained(what: &str, part: &[u8], whole: &[u8], stride: usize) {
    assert_eq!((part.len() % stride, whole.len() % stride), (0, 0), "{what}: whole records");
    let mut part: Vec<&[u8]> = part.chunks_exact(stride).collect();
    let mut whole: Vec<&[u8]> = whole.chunks_exact(stride).collect();
    part.sort_unstable();
    whole.sort_unstable();
    let mut rest = whole.iter();
    for record in &part {
        assert!(
            rest.any(|r| r == record),
            "{what}: the output has a record that the input has not, or not as often: {record:?}"
        );
    }
}

/// Asserts that the report's figures agree with each other and with `output`, which it returns.
pub fn accounted(what: &str, done: &Done, output: &Path, read_points: u64) -> Vec<u8> {
    let ledger = &done.report.result.ledger;
    assert_eq!(ledger.read, read_points, "{what}: records read");
    assert_eq!(ledger.read, ledger.kept + ledger.removed_records(), "{what}: {ledger:?}");
    assert_eq!(done.report.run.outputs.len(), 1, "{what}");
    let told = &done.report.run.outputs[0];
    let (schema, records) = read(output);
    assert_eq!((records.len() / schema.stride) as u64, told.points, "{what}: points of the output");
    assert_eq!(told.points, ledger.kept, "{what}");
    assert_eq!(told.bytes, Some(std::fs::metadata(output).unwrap().len()), "{what}");
    records
}
