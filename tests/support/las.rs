//! What the tests of LAS share: whole files in and out, by the roles that a run uses.
#![allow(dead_code, unused_imports, reason = "each test file uses a part of it")]
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic and tell why")]

#[path = "../common/real.rs"]
#[allow(clippy::duplicate_mod, reason = "helpers are used apart, and by some together")]
pub mod real;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pointmill::Result;
use pointmill::io::las::{LasOptions, create, open};
use pointmill::point::{Metadata, PointBatch, Schema};
use pointmill::stage::{SinkSummary, Source};
pub use real::scans;

/// Numbers for tests: splitmix64.
pub struct Random(pub u64);

impl Random {
    pub fn number(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, end: usize) -> usize {
        (self.number() % end as u64) as usize
    }

    pub fn bytes(&mut self, len: usize) -> Vec<u8> {
        (0..len).map(|_| self.number() as u8).collect()
    }
}

/// Reads at most `limit` records of a source, part by part.
pub fn read(source: &dyn Source, limit: usize) -> Result<Vec<u8>> {
    let stride = source.schema().stride;
    let mut batch = PointBatch::new(source.schema().clone(), 7_001);
    let mut records = Vec::new();
    for i in 0..source.parts() {
        let mut part = source.part(i)?;
        loop {
            part.read(&mut batch)?;
            if batch.is_empty() || records.len() >= limit * stride {
                break;
            }
            records.extend_from_slice(batch.records());
        }
    }
    records.truncate(limit.saturating_mul(stride));
    Ok(records)
}

/// Opens files and reads all their records.
pub fn read_files(paths: &[PathBuf]) -> Result<(Box<dyn Source>, Vec<u8>)> {
    let source = open(paths)?;
    let records = read(&*source, usize::MAX / 4096)?;
    Ok((source, records))
}

/// Writes records with a header of `metadata`.
pub fn write(
    path: &Path,
    options: LasOptions,
    schema: &Arc<Schema>,
    metadata: &Metadata,
    records: &[u8],
) -> Result<SinkSummary> {
    let mut sink = create(path, &options, schema, metadata)?;
    let (encoder, chunk) = (sink.encoder(), sink.chunk_points());
    let mut batch = PointBatch::new(schema.clone(), chunk);
    for records in records.chunks(chunk * schema.stride) {
        batch.clear();
        batch.extend(records);
        if options.normals {
            batch.normals = Some((0..batch.len()).map(|i| [i as f32, 0.5, f32::NAN]).collect());
        }
        sink.append(encoder.encode(&batch)?)?;
    }
    sink.finish()
}

pub const LAS: LasOptions = LasOptions { compressed: false, normals: false };
pub const LAZ: LasOptions = LasOptions { compressed: true, normals: false };

/// One line of the scans' manifest.
pub struct Scan {
    pub path: PathBuf,
    pub name: String,
    pub points: Option<u64>,
}

/// The LAS and LAZ files of the manifest.
pub fn manifest(folder: &Path) -> Vec<Scan> {
    let text = std::fs::read_to_string(folder.join("MANIFEST.tsv")).expect("a manifest");
    text.lines()
        .skip(1)
        .map(|line| line.split('\t').collect::<Vec<_>>())
        .filter(|f| f[0].to_lowercase().ends_with(".las") || f[0].to_lowercase().ends_with(".laz"))
        .map(|f| Scan { path: folder.join(f[0]), name: f[0].to_owned(), points: f[6].parse().ok() })
        .collect()
}

/// Files of the corpus that are damaged: they must fail and say where.
pub const BROKEN: [&str; 7] = [
    "laszip/broken_coder.laz",
    "laszip/broken_type.laz",
    "pasture/10_points_format_9.laz",
    "pasture/10_points_format_10.laz",
    "pdal/las/bad_vlr_count.las",
    "pdal/las/garbage_nVariableLength.las",
    "pdal/las/permutations/1.2-no-points.las",
];
