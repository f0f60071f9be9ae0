//! What the PLY tests share: files from bytes, all records of a source, a sink run to its end.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pointmill::Result;
use pointmill::internals;
use pointmill::internals::ply::PlyOptions;
use pointmill::io::ply;
use pointmill::point::{Metadata, NORMAL, PointBatch, Schema};
use pointmill::stage::{SinkSummary, Source};

/// Writes a file into `folder`.
pub fn file(folder: &Path, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

/// All records of a source, in batches of `capacity`.
pub fn records(source: &dyn Source, capacity: usize) -> Result<Vec<u8>> {
    super::records::read_without(source, capacity, &[])
}

/// Opens a file and reads all of it: schema, metadata and records.
pub fn read(path: &Path, capacity: usize) -> Result<(Arc<Schema>, Metadata, Vec<u8>)> {
    let source = ply::open(&[path.to_owned()])?;
    let all = records(&*source, capacity)?;
    assert_eq!(all.len() as u64, source.points() * source.schema().stride as u64);
    Ok((source.schema().clone(), source.metadata().clone(), all))
}

/// Writes records through a sink, `chunk` at a time.
pub fn write(
    path: &Path,
    options: &PlyOptions,
    (schema, metadata, all): (&Arc<Schema>, &Metadata, &[u8]),
    normals: Option<&[[f32; 3]]>,
    chunk: usize,
) -> Result<SinkSummary> {
    let mut sink = internals::ply::create(path, options, schema, metadata)?;
    let encoder = sink.encoder();
    let mut batch = PointBatch::new(schema.clone(), chunk);
    for (n, piece) in all.chunks(chunk * schema.stride).enumerate() {
        batch.clear();
        batch.extend(piece);
        if let Some(all) = normals {
            batch.columns.set(&NORMAL, &all[n * chunk..][..batch.len()]);
        }
        sink.append(encoder.encode(&batch)?)?;
    }
    let summary = sink.finish()?;
    assert_eq!(summary.bytes, std::fs::metadata(path).unwrap().len());
    assert_eq!(summary.points as usize * schema.stride, all.len());
    Ok(summary)
}
