//! What the tests of whole runs share: pipelines run in process, files read back, records compared
//! as multisets, and LAS files laid out by hand after the specification.
#![allow(dead_code, reason = "each test file uses a part of it")]
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic and tell why")]

pub mod command;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pointmill::Result;
use pointmill::point::{PointBatch, Schema};
use pointmill::stage::Source;
use pointmill::{Done, Graph, Overrides, Quiet, Registry, Set};
use serde_json::{Value, json};

/// The pipelines that users copy.
pub const REDUCE: &str = include_str!("../../pipelines/reduce.toml");
pub const CONVERT: &str = include_str!("../../pipelines/convert.toml");

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

/// How a run of a test is set up: values in the place of the pipeline's, memory and threads.
#[derive(Clone)]
pub struct Setup {
    pub sets: Vec<(&'static str, Value)>,
    pub threads: usize,
    pub memory: u64,
}

impl Setup {
    /// Two threads, half a GiB.
    pub fn new(sets: &[(&'static str, Value)]) -> Setup {
        Setup { sets: sets.to_vec(), threads: 2, memory: 512 << 20 }
    }

    pub fn threads(self, threads: usize) -> Setup {
        Setup { threads, ..self }
    }

    pub fn memory(self, memory: u64) -> Setup {
        Setup { memory, ..self }
    }
}

/// Runs `text` with other files: parse, plan, run.
pub fn run(text: &str, inputs: &[PathBuf], output: &Path, setup: &Setup) -> Result<Done> {
    let files = [("read.path", json!(inputs)), ("write.path", json!(output))];
    let set = |(address, value): &(&str, Value)| Set::argument("test", address, value.clone());
    let sets: Vec<Set> = files.iter().chain(&setup.sets).map(set).collect();
    let pipeline = Graph::parse_with(text, "test.toml", &Registry::builtin(), &sets)?;
    let overrides = Overrides {
        memory: Some(setup.memory),
        threads: std::num::NonZeroUsize::new(setup.threads),
        ..Overrides::default()
    };
    pipeline.plan(&overrides)?.run(&Quiet)
}

/// A run of `pipelines/reduce.toml`.
pub fn reduce(inputs: &[PathBuf], output: &Path, setup: &Setup) -> Result<Done> {
    run(REDUCE, inputs, output, setup)
}

/// A run of `pipelines/convert.toml`.
pub fn convert(inputs: &[PathBuf], output: &Path, setup: &Setup) -> Result<Done> {
    run(CONVERT, inputs, output, setup)
}

/// Opens files of one kind, by their extension.
pub fn open(paths: &[PathBuf]) -> Result<Box<dyn Source>> {
    Registry::builtin().formats().of(&paths[0]).expect("a known extension").open(paths)
}

/// Schema and records of files, at most `limit` records.
pub fn read_some(paths: &[PathBuf], limit: usize) -> Result<(Arc<Schema>, Vec<u8>)> {
    let source = open(paths)?;
    let schema = source.schema().clone();
    let mut batch = PointBatch::new(schema.clone(), 7_001);
    let mut records = Vec::new();
    for i in 0..source.parts() {
        let mut part = source.part(i)?;
        loop {
            batch.clear();
            part.read(&mut batch)?;
            if batch.is_empty() || records.len() >= limit.saturating_mul(schema.stride) {
                break;
            }
            records.extend_from_slice(batch.records());
        }
    }
    records.truncate(limit.saturating_mul(schema.stride));
    Ok((schema, records))
}

/// Schema and records of a file.
pub fn read(path: &Path) -> (Arc<Schema>, Vec<u8>) {
    read_some(&[path.to_owned()], usize::MAX).unwrap_or_else(|e| panic!("{e:?}"))
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

/// Asserts that a folder holds `names` and nothing else.
pub fn assert_holds(folder: &Path, names: &[&str]) {
    let name = |e: std::io::Result<std::fs::DirEntry>| e.unwrap().file_name();
    let mut there: Vec<_> = std::fs::read_dir(folder).unwrap().map(name).collect();
    there.sort();
    let mut names: Vec<std::ffi::OsString> = names.iter().map(Into::into).collect();
    names.sort();
    assert_eq!(there, names, "in {}", folder.display());
}

/// A record beside the points of a LAS file.
#[derive(Clone)]
pub struct Beside {
    pub user: &'static str,
    pub record: u16,
    pub payload: Vec<u8>,
}

/// A LAS 1.4 file, laid out by hand (LAS 1.4 R15, tables 3, 4, 5 and 24).
pub struct LasFile<'a> {
    pub format: u8,
    pub stride: usize,
    pub scale: [f64; 3],
    pub offset: [f64; 3],
    pub vlrs: &'a [Beside],
    pub evlrs: &'a [Beside],
    pub records: &'a [u8],
}

impl LasFile<'_> {
    pub fn bytes(&self) -> Vec<u8> {
        let vlrs: Vec<u8> = self.vlrs.iter().flat_map(|v| beside(v, false)).collect();
        let points = (self.records.len() / self.stride) as u64;
        let start = 375 + vlrs.len();
        let mut header = vec![0u8; 375];
        let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
        put(0, b"LASF");
        put(4, &7u16.to_le_bytes());
        put(6, &(if self.format >= 6 { 16u16 } else { 0 }).to_le_bytes());
        put(8, &[9; 16]);
        put(24, &[1, 4]);
        put(26, b"a scanner");
        put(58, b"a program 1.0");
        put(90, &200u16.to_le_bytes());
        put(92, &2020u16.to_le_bytes());
        put(94, &375u16.to_le_bytes());
        put(96, &(start as u32).to_le_bytes());
        put(100, &(self.vlrs.len() as u32).to_le_bytes());
        put(104, &[self.format]);
        put(105, &(self.stride as u16).to_le_bytes());
        if self.format < 6 {
            put(107, &(points as u32).to_le_bytes());
        }
        for axis in 0..3 {
            put(131 + 8 * axis, &self.scale[axis].to_le_bytes());
            put(155 + 8 * axis, &self.offset[axis].to_le_bytes());
            let [lo, hi] = self.bounds(axis);
            put(179 + 16 * axis, &hi.to_le_bytes());
            put(187 + 16 * axis, &lo.to_le_bytes());
        }
        let end = (start + self.records.len()) as u64;
        put(235, &(if self.evlrs.is_empty() { 0 } else { end }).to_le_bytes());
        put(243, &(self.evlrs.len() as u32).to_le_bytes());
        put(247, &points.to_le_bytes());
        let evlrs: Vec<u8> = self.evlrs.iter().flat_map(|v| beside(v, true)).collect();
        [&header, &vlrs, self.records, &evlrs].into_iter().flatten().copied().collect()
    }
}

impl LasFile<'_> {
    /// The least and the largest coordinate of the points; 0 without points.
    fn bounds(&self, axis: usize) -> [f64; 2] {
        let stored = self
            .records
            .chunks_exact(self.stride)
            .map(|record| i32::from_le_bytes(record[4 * axis..4 * axis + 4].try_into().unwrap()));
        let world = |v: i32| f64::from(v) * self.scale[axis] + self.offset[axis];
        let (lo, hi) = (stored.clone().map(world), stored.map(world));
        [lo.reduce(f64::min).unwrap_or(0.0), hi.reduce(f64::max).unwrap_or(0.0)]
    }
}

fn beside(of: &Beside, extended: bool) -> Vec<u8> {
    let mut bytes = vec![0u8; 2 + 16];
    bytes[2..2 + of.user.len()].copy_from_slice(of.user.as_bytes());
    bytes.extend(of.record.to_le_bytes());
    match extended {
        true => bytes.extend((of.payload.len() as u64).to_le_bytes()),
        false => bytes.extend((of.payload.len() as u16).to_le_bytes()),
    }
    let mut description = [0u8; 32];
    description[..9].copy_from_slice(b"of a test");
    bytes.extend(description);
    bytes.extend(&of.payload);
    bytes
}

/// Bytes of a record of each point format (LAS 1.4 R15, tables 7 to 17).
pub const STRIDES: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// Descriptors of extra bytes (LAS 1.4 R15, table 24) and how many bytes they describe: two
/// numbers, one of them scaled, and three bytes without a meaning.
pub fn extra_bytes() -> (Beside, usize) {
    let mut payload = Vec::new();
    for (kind, options, name, scale) in [
        (3u8, 0u8, "height", 0.0f64),
        (9, 0, "amplitude", 0.0),
        (6, 8, "width", 0.001),
        (0, 3, "raw", 0.0),
    ] {
        let mut descriptor = [0u8; 192];
        descriptor[2] = kind;
        descriptor[3] = options;
        descriptor[4..4 + name.len()].copy_from_slice(name.as_bytes());
        descriptor[112..120].copy_from_slice(&scale.to_le_bytes());
        payload.extend(descriptor);
    }
    (Beside { user: "LASF_Spec", record: 4, payload }, 2 + 4 + 4 + 3)
}
