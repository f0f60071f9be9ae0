//! LAS files in and out, and those of the folder of real scans.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pointmill::Result;
use pointmill::internals::las::{LasOptions, create};
use pointmill::io::las::open;
use pointmill::point::{ComputedDimension, Metadata, NORMAL, Schema, names};
use pointmill::stage::{SinkSummary, Source};

use super::records;

/// Opens files and reads all their records.
pub fn read_files(paths: &[PathBuf]) -> Result<(Box<dyn Source>, Vec<u8>)> {
    let source = open(paths)?;
    let records = records::read_source(&*source, usize::MAX)?;
    Ok((source, records))
}

/// Writes records with a header of `metadata`; normals, if there are to be some, are made up.
pub fn write(
    path: &Path,
    options: LasOptions,
    schema: &Arc<Schema>,
    metadata: &Metadata,
    records: &[u8],
) -> Result<SinkSummary> {
    let sink = create(path, &options, schema, metadata)?;
    let normals = |i: usize| [i as f32, 0.5, f32::NAN];
    let are_asked = !options.computed.is_empty();
    let normals = are_asked.then_some(&normals as &dyn Fn(usize) -> [f32; 3]);
    records::write_with(sink, schema, records, normals)
}

pub const LAS: LasOptions = LasOptions { compressed: false, computed: Vec::new() };
pub const LAZ: LasOptions = LasOptions { compressed: true, computed: Vec::new() };

/// The three dimensions of a normal.
pub fn normals() -> Vec<ComputedDimension> {
    names::NORMAL.map(|name| NORMAL.kind().part(name).unwrap()).to_vec()
}

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
