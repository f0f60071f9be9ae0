//! What the tests of promises share: scans held as records, cut, shuffled and split into files, and
//! pipelines run in this process with what they say of themselves.
#![allow(dead_code, unused_imports, reason = "each test file uses a part of it")]
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic and tell why")]

#[allow(clippy::duplicate_mod, reason = "helpers are used apart, and by some together")]
pub mod real;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use pointmill::geom::lattice::Lattice;
use pointmill::geom::simd::Simd;
use pointmill::io::las::{self, LasOptions};
use pointmill::io::ply::{self, PlyOptions};
use pointmill::point::{Layout, Metadata, PointBatch, Position, Schema, Value};
use pointmill::report::{Report, result_bytes};
use pointmill::stage::{OpenSource, Sink, Source};
use pointmill::synth::{Scene, Synthetic};
use pointmill::{Error, ErrorKind, Result};
use pointmill::{Graph, Overrides, Quiet, Registry};
pub use real::scans;

/// A small generator (splitmix64), so that a failing case is the same everywhere.
pub struct Random(pub u64);

impl Random {
    pub fn number(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, end: usize) -> usize {
        (self.number() % end as u64) as usize
    }

    pub fn one_of<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }

    pub fn shuffle<T>(&mut self, list: &mut [T]) {
        for i in (1..list.len()).rev() {
            list.swap(i, self.below(i + 1));
        }
    }
}

/// The records of a scan and what its file says besides.
#[derive(Clone)]
pub struct Scan {
    pub schema: Arc<Schema>,
    pub metadata: Metadata,
    pub records: Vec<u8>,
}

impl Scan {
    /// A scan that is made up.
    pub fn synthetic(scene: Scene, points: u64, seed: u64) -> Scan {
        let source = Synthetic { scene, points, seed, noise: None }.open().unwrap();
        Scan::of(&*source, usize::MAX)
    }

    /// A copy whose records lie elsewhere in stored coordinates: `to` gets the number of each and where
    /// it lies.
    pub fn moved(&self, mut to: impl FnMut(usize, [i32; 3]) -> [i32; 3]) -> Scan {
        let mut scan = self.clone();
        for (i, record) in scan.records.chunks_exact_mut(scan.schema.stride).enumerate() {
            let mut stored = [0; 3];
            for (axis, bytes) in record[..12].as_chunks::<4>().0.iter().enumerate() {
                stored[axis] = i32::from_le_bytes(*bytes);
            }
            let stored = to(i, stored);
            for (bytes, v) in record[..12].as_chunks_mut::<4>().0.iter_mut().zip(stored) {
                *bytes = v.to_le_bytes();
            }
        }
        scan
    }

    /// At most the first `limit` records of a file.
    pub fn read(path: &Path, limit: usize) -> Scan {
        let paths = [path.to_owned()];
        let ply = path.extension().is_some_and(|e| e == "ply");
        let source = if ply { ply::open(&paths) } else { las::open(&paths) };
        Scan::of(&*source.unwrap(), limit)
    }

    fn of(source: &dyn Source, limit: usize) -> Scan {
        let schema = source.schema().clone();
        let mut records = Vec::new();
        let mut batch = PointBatch::new(schema.clone(), 8192);
        for i in 0..source.parts() {
            let mut part = source.part(i).unwrap();
            while records.len() / schema.stride < limit {
                part.read(&mut batch).unwrap();
                if batch.is_empty() {
                    break;
                }
                records.extend_from_slice(batch.records());
            }
        }
        records.truncate(limit.saturating_mul(schema.stride));
        Scan { schema, metadata: source.metadata().clone(), records }
    }

    pub fn points(&self) -> usize {
        self.records.len() / self.schema.stride
    }

    pub fn record(&self, i: usize) -> &[u8] {
        &self.records[i * self.schema.stride..(i + 1) * self.schema.stride]
    }

    /// The scan with the given records, in that order.
    pub fn pick(&self, order: &[usize]) -> Scan {
        let records = order.iter().flat_map(|&i| self.record(i)).copied().collect();
        Scan { records, ..self.clone() }
    }

    pub fn lattice(&self) -> Lattice {
        Lattice::of(&self.schema, None).unwrap()
    }

    /// The position of every record.
    pub fn positions(&self) -> Vec<Position> {
        let mut positions = Vec::new();
        self.lattice().place(
            &self.schema,
            &self.records,
            |_, p| positions.push(p),
            |i, why| panic!("record {i}: {why:?}"),
        );
        positions
    }

    /// The `points` records in the smallest square column around the record in the middle.
    pub fn crop(&self, points: usize) -> Scan {
        let positions = self.positions();
        let center = positions[positions.len() / 2];
        let mut order: Vec<usize> = (0..positions.len()).collect();
        let distance = |i: &usize| {
            let p = positions[*i];
            (p[0].abs_diff(center[0]).max(p[1].abs_diff(center[1])), *i)
        };
        order.sort_by_key(distance);
        order.truncate(points);
        order.sort_unstable();
        self.pick(&order)
    }

    /// The same on a grid of so many stored steps, so that distances tie.
    pub fn snapped(&self, steps: i32) -> Scan {
        let mut scan = self.clone();
        for record in scan.records.chunks_exact_mut(self.schema.stride) {
            for stored in record[..12].as_chunks_mut::<4>().0 {
                let value = i32::from_le_bytes(*stored);
                *stored = (value.div_euclid(steps) * steps).to_le_bytes();
            }
        }
        scan
    }

    /// The same with copies: whole records, records that share no more than their position, and one
    /// position a thousand times.
    pub fn with_copies(&self, seed: u64) -> Scan {
        let mut random = Random(seed);
        let mut scan = self.clone();
        let (points, stride) = (self.points(), self.schema.stride);
        let favourite = random.below(points);
        for i in 0..points / 10 + 1000 {
            let of = if i < 1000 { favourite } else { random.below(points) };
            let at = scan.records.len();
            scan.records.extend_from_slice(self.record(of));
            if i % 2 == 0 {
                let last = scan.records[at..].last_mut().unwrap();
                *last = last.wrapping_add(random.below(3) as u8);
            }
            assert_eq!(scan.records.len(), at + stride);
        }
        scan
    }

    /// The same with copies, and one point far from all others.
    pub fn with_copies_and_an_outlier(&self, seed: u64) -> Scan {
        let mut scan = self.with_copies(seed);
        let at = scan.records.len();
        scan.records.extend_from_slice(self.record(0));
        let schema = self.schema.clone();
        for axis in schema.coordinates().unwrap() {
            let far = if axis.scalar.is_float() {
                Value::Double(1e6)
            } else {
                Value::Signed(2_000_000_011)
            };
            assert!(axis.put(&mut scan.records[at..], schema.endian, far));
        }
        scan
    }

    /// The same (of point format 6 to 10) with classes and flags at random, so that copies of one
    /// record differ in them: every seventh record has another class, and each flag is set on about
    /// one record of twenty.
    pub fn with_classes_and_flags(&self, seed: u64) -> Scan {
        /// Where the flags and the class of a record are (LAS 1.4 R15, table 16).
        const FLAGS: usize = 15;
        const CLASS: usize = 16;
        let mut random = Random(seed);
        let mut scan = self.clone();
        for record in scan.records.chunks_exact_mut(self.schema.stride) {
            let flag = |set: bool, bit: u8| if set { 1 << bit } else { 0 };
            let flags = (0..4).fold(0, |all, bit| all | flag(random.below(20) == 0, bit));
            record[FLAGS] = record[FLAGS] & 0xf0 | flags;
            if random.below(7) == 0 {
                record[CLASS] = random.one_of(&[1, 2, 5, 6]);
            }
        }
        scan
    }

    /// Writes it as it is, in the format that the extension names.
    pub fn write(&self, path: &Path) {
        let extension = path.extension().unwrap().to_str().unwrap();
        let mut sink: Box<dyn Sink> = if extension == "ply" {
            let options = PlyOptions::default();
            ply::create(path, &options, &self.schema, &self.metadata).unwrap()
        } else {
            let options = LasOptions { compressed: extension == "laz", normals: false };
            las::create(path, &options, &self.schema, &self.metadata).unwrap()
        };
        let (encoder, chunk) = (sink.encoder(), sink.chunk_points());
        let mut batch = PointBatch::new(self.schema.clone(), chunk);
        for records in self.records.chunks(chunk * self.schema.stride) {
            batch.clear();
            batch.extend(records);
            sink.append(encoder.encode(&batch).unwrap()).unwrap();
        }
        sink.finish().unwrap();
    }

    /// Writes it into `files` files of `folder`, cut at random (some may be empty): LAS and LAZ by
    /// turns, or PLY. They are given in the scan's order.
    pub fn write_split(&self, folder: &Path, files: usize, random: &mut Random) -> Vec<PathBuf> {
        let mut cuts: Vec<usize> = (1..files).map(|_| random.below(self.points() + 1)).collect();
        cuts.extend([0, self.points()]);
        cuts.sort_unstable();
        let extensions =
            if self.schema.layout == Layout::plain("PLY") { ["ply"; 2] } else { ["las", "laz"] };
        cuts.windows(2)
            .enumerate()
            .map(|(i, cut)| {
                let path = folder.join(format!("{i}.{}", random.one_of(&extensions)));
                self.pick(&(cut[0]..cut[1]).collect::<Vec<_>>()).write(&path);
                path
            })
            .collect()
    }
}

/// How much memory a run is given.
#[derive(Debug, Clone, Copy)]
pub enum Memory {
    /// What the refusal of less names, and so many mebibytes more.
    Least(u64),
    /// One gibibyte beyond that.
    Ample,
}

/// The `[run]` settings that must not matter.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    pub tile_points: Option<usize>,
    pub memory: Memory,
    pub threads: usize,
    pub spill: &'static str,
    pub simd: &'static str,
}

/// What `simd` under `[run]` can be on this processor.
pub fn instruction_sets() -> Vec<&'static str> {
    Simd::all().map(|simd| simd.level().name()).collect()
}

impl Settings {
    /// Everything in memory, by one thread, in as few tiles as can be.
    pub const PLAIN: Settings = Settings {
        tile_points: None,
        memory: Memory::Ample,
        threads: 1,
        spill: "auto",
        simd: "auto",
    };

    fn text(&self, memory: u64, report: &Path) -> String {
        let Settings { threads, spill, simd, .. } = self;
        let tile_points =
            self.tile_points.map_or(String::new(), |points| format!("tile_points = {points}\n"));
        format!(
            "[run]\nmemory = {memory}\nthreads = {threads}\nspill = {spill:?}\nsimd = {simd:?}\n\
             report = {report:?}\n{tile_points}"
        )
    }
}

/// What a run left.
pub struct Ran {
    pub output: PathBuf,
    /// The bytes of the report's `result`.
    pub result: Vec<u8>,
    /// Counts of how the work was cut up.
    pub work: BTreeMap<String, u64>,
    pub spilled: u64,
    /// The whole report, but for its tiles.
    pub report: Report,
}

impl Ran {
    pub fn count(&self, what: &str) -> u64 {
        self.work.get(what).copied().unwrap_or(0)
    }

    pub fn bytes(&self) -> Vec<u8> {
        std::fs::read(&self.output).unwrap()
    }
}

/// Runs `read` of `inputs`, then `stages`, then `write` of a file in `folder` with the extension and
/// keys of `write` (as in `"laz"` or `"ply\nencoding = \"ascii\""`).
pub fn run(
    folder: &Path,
    inputs: &[PathBuf],
    stages: &str,
    write: &str,
    settings: Settings,
) -> Result<Ran> {
    run_with(folder, inputs, stages, write, settings, "")
}

/// The same with more keys under `[run]`; `{folder}` in `stages` becomes the folder.
pub fn run_with(
    folder: &Path,
    inputs: &[PathBuf],
    stages: &str,
    write: &str,
    settings: Settings,
    keys_of_run: &str,
) -> Result<Ran> {
    let stages = stages.replace("{folder}", folder.to_str().unwrap());
    let (extension, keys) = write.split_once('\n').unwrap_or((write, ""));
    let output = folder.join(format!("out.{extension}"));
    let report = folder.join("report.json");
    let text = |memory| {
        format!(
            "{}\n{keys_of_run}\n[[stage]]\nkind = \"read\"\npath = {inputs:?}\n{stages}\n\
             [[stage]]\nkind = \"write\"\npath = {output:?}\n{keys}\n",
            settings.text(memory, &report)
        )
    };
    let go = |memory| {
        let pipeline = Graph::parse(&text(memory), "test.toml", &Registry::builtin())?;
        pipeline.plan(&Overrides::default())?.run(&Quiet)
    };
    let more = match settings.memory {
        Memory::Least(more) => more << 20,
        Memory::Ample => 1 << 30,
    };
    // What this process holds already counts against the budget, and other tests change it.
    let mut memory = 1 << 20;
    let done = loop {
        match go(memory) {
            Err(error) if error.kind() == ErrorKind::Memory => {
                let least = remedy(&error);
                assert!(least + more > memory, "{error:?} does not do");
                memory = least + more;
            }
            done => break done?,
        }
    };
    let report = std::fs::read(&report).unwrap();
    Ok(Ran {
        output,
        result: result_bytes(&report).unwrap().to_vec(),
        work: done.report.run.work.clone(),
        spilled: done.report.run.spill_bytes,
        report: done.report,
    })
}

/// The budget in bytes that a refusal names.
pub fn remedy(error: &Error) -> u64 {
    let help = error.remedy().unwrap_or_else(|| panic!("{error:?} names no remedy"));
    let digits = help.find(|c: char| c.is_ascii_digit()).unwrap();
    let (number, rest) =
        help[digits..].split_at(help[digits..].find(|c: char| !c.is_ascii_digit()).unwrap());
    assert!(rest.starts_with("MiB"), "{help}");
    number.parse::<u64>().unwrap() << 20
}

/// A scan beside its reduction must have had this, or a test of it may pass empty.
pub fn assert_not_empty(ran: &Ran, cells_cross: bool, what: &str) {
    assert!(ran.count("tiles") >= 30, "{what}: {} tiles", ran.count("tiles"));
    assert!(ran.count("tile_levels") >= 2, "{what}: {} levels", ran.count("tile_levels"));
    assert!(ran.count("rim_positions") > 0, "{what}: no rim");
    assert!(ran.count("unproven") > 0, "{what}: nobody unproven");
    assert!(ran.count("tied") > 0, "{what}: no ties");
    assert!(ran.count("runs") > 1, "{what}: {} runs", ran.count("runs"));
    assert!(ran.spilled > 0, "{what}: nothing spilled");
    assert!(!cells_cross || ran.count("crossing_cells") > 0, "{what}: no cell crosses a face");
}

/// Names where two files first differ.
pub fn assert_same(a: &[u8], b: &[u8], what: &str) {
    if a != b {
        let at = a.iter().zip(b).position(|(x, y)| x != y).unwrap_or(a.len().min(b.len()));
        panic!("{what}: {} and {} bytes differ at byte {at}", a.len(), b.len());
    }
}
