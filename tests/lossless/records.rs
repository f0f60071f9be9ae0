//! Nothing lost: whole runs over every point format and over PLY, with what goes in and what comes
//! out compared as bytes.

use std::path::{Path, PathBuf};

use crate::support::las_file::{Beside, LasFile, STRIDES, extra_bytes};
use crate::support::random::Random;
use crate::support::records::{accounted, assert_contained, read};
use crate::support::setup::{Setup, convert, reduce};
use pointmill::point::{Endian, Schema};
use serde_json::json;

const SCALE: [f64; 3] = [0.01, 0.01, 0.001];
const OFFSET: [f64; 3] = [500_000.0, 4_100_000.0, -30.0];

/// Records on two slopes with a step between them: random attributes, every eighth record twice,
/// every eighth place shared by two records that differ, and some far from all others.
fn records(stride: usize, points: usize, random: &mut Random) -> Vec<u8> {
    let mut all: Vec<u8> = Vec::with_capacity(points * stride);
    for i in 0..points {
        let mut record = random.bytes(stride);
        let before = all.len().saturating_sub(stride);
        match random.below(8) {
            0 if i > 0 => record.copy_from_slice(&all[before..]),
            1 if i > 0 => record[..12].copy_from_slice(&all[before..before + 12]),
            _ => {
                let (x, y) = (random.below(6_000) as i32, random.below(6_000) as i32);
                let z = if x < 2_500 { x } else { 20_000 - y / 2 };
                let far = if random.below(200) == 0 { 1_000_000 } else { 1 };
                for (axis, stored) in [x, y, z].into_iter().enumerate() {
                    let stored = (stored * far.min(i32::MAX / 25_000)).to_le_bytes();
                    record[4 * axis..4 * axis + 4].copy_from_slice(&stored);
                }
            }
        }
        all.extend(record);
    }
    all
}

/// A made LAS file: its path, bytes of a record, its records.
struct Made {
    path: PathBuf,
    stride: usize,
    records: Vec<u8>,
}

fn vlrs() -> Vec<Beside> {
    let payload = b"kept as it is".to_vec();
    vec![
        Beside { user: "somebody", record: 7, payload },
        Beside { user: "somebody", record: 8, payload: Vec::new() },
    ]
}

/// A file of `format` with two records before the points and two behind them.
fn make(folder: &Path, format: u8, extra: bool, points: usize) -> Made {
    let mut vlrs = vlrs();
    let mut stride = STRIDES[usize::from(format)];
    if extra {
        let (described, bytes) = extra_bytes();
        vlrs.push(described);
        stride += bytes;
    }
    let mut random = Random(u64::from(format) * 2 + u64::from(extra));
    let payload = random.bytes(70_000); // more than a VLR holds
    let evlrs = [
        Beside { user: "somebody", record: 9, payload },
        Beside { user: "another", record: 1, payload: vec![1] },
    ];
    let records = records(stride, points, &mut random);
    let file = LasFile {
        format,
        stride,
        scale: SCALE,
        offset: OFFSET,
        vlrs: &vlrs,
        evlrs: &evlrs,
        records: &records,
    };
    let path = folder.join(format!("{format}-{extra}.las"));
    std::fs::write(&path, file.bytes()).unwrap();
    Made { path, stride, records }
}

fn kept_records_are_those_of_the_input(format: u8, extra: bool) {
    let folder = tempfile::tempdir().unwrap();
    let made = make(folder.path(), format, extra, 3_000);
    let setup = Setup::new(&[("run.tile_points", json!(300)), ("run.spill", json!("always"))]);
    let mut outputs = Vec::new();
    for name in ["out.las", "out.laz"] {
        let output = folder.path().join(name);
        let done = reduce(std::slice::from_ref(&made.path), &output, &setup).unwrap();
        let kept = accounted(name, &done, &output, 3_000);
        assert_contained(name, &kept, &made.records, made.stride);
        let ledger = &done.report.result.ledger;
        assert!((10..3_000).contains(&ledger.kept), "{ledger:?}");
        assert!(ledger.removed.iter().any(|r| r.records > 0), "{ledger:?}");
        let asked = |line: &&String| line.contains(" are left out, ");
        let told: Vec<_> = done.report.run.warnings.iter().filter(|line| !asked(line)).collect();
        assert!(told.is_empty(), "{told:?}");
        let mut records: Vec<Vec<u8>> =
            kept.chunks_exact(made.stride).map(<[u8]>::to_vec).collect();
        records.sort_unstable();
        outputs.push(records);
    }
    // Where records have a time, the chunks of LAZ are in order of it.
    assert!(outputs[0] == outputs[1], "LAS and LAZ keep the same records");
}

fn comes_back_from_laz(format: u8, extra: bool) {
    let folder = tempfile::tempdir().unwrap();
    let made = make(folder.path(), format, extra, 3_000);
    let [packed, back] = ["packed.laz", "back.las"].map(|name| folder.path().join(name));
    for (from, to) in [(&made.path, &packed), (&packed, &back)] {
        let done = convert(std::slice::from_ref(from), to, &Setup::new(&[])).unwrap();
        accounted("convert", &done, to, 3_000);
        assert_eq!(done.report.result.ledger.removed_records(), 0);
    }
    let [old, new] = [&made.path, &back].map(|path| std::fs::read(path).unwrap());
    assert_eq!(old.len(), new.len());
    assert!(old[375..] == new[375..], "VLRs, records and EVLRs are the same bytes");
    assert!(old[..6] == new[..6] && old[8..58] == new[8..58], "the header up to the software");
    assert!(new[58..90].starts_with(b"pointmill ") && old[90..107] == new[90..107]);
    // Without a system, point formats 6 to 10 say WKT; the made-up file does not.
    let bit = if format < 6 { 0 } else { 16 };
    assert_eq!(new[6..8], [old[6] | bit, old[7]]);
    assert!(old[131..179] == new[131..179] && old[227..247] == new[227..247]);
    assert_eq!(old[247..255], new[247..255], "the count of points");
}

/// Every field of LAS, by its name and world value, survives PLY.
fn comes_back_from_ply(format: u8, extra: bool) {
    let folder = tempfile::tempdir().unwrap();
    let mut made = make(folder.path(), format, extra, 2_000);
    let (schema, _) = read(&made.path);
    if let Some(offset) = schema.find("WavePacketByteOffset") {
        // Real offsets into a file; PLY has no 64-bit integers.
        let mut bytes = std::fs::read(&made.path).unwrap();
        let start = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
        let end = start + made.records.len();
        for record in bytes[start..end].chunks_exact_mut(made.stride) {
            record[offset.offset + 6..offset.offset + 8].fill(0);
        }
        made.records = bytes[start..end].to_vec();
        std::fs::write(&made.path, bytes).unwrap();
    }
    for encoding in ["binary", "ascii"] {
        let [ply, back] = ["there.ply", "back.las"].map(|name| folder.path().join(name));
        let there = Setup::new(&[("write.encoding", json!(encoding))]);
        convert(std::slice::from_ref(&made.path), &ply, &there).unwrap();
        let home = Setup::new(&[("write.scale", json!(SCALE)), ("write.offset", json!(OFFSET))]);
        let done = convert(std::slice::from_ref(&ply), &back, &home).unwrap();
        accounted("back", &done, &back, 2_000);
        let (schema_back, records_back) = read(&back);
        assert_fields((&schema, &made.records), (&schema_back, &records_back));
    }
}

fn assert_fields((from, old): (&Schema, &[u8]), (to, new): (&Schema, &[u8])) {
    assert_eq!(from.layout, to.layout, "the point format");
    assert_eq!(from.dimensions.len(), to.dimensions.len());
    for dimension in &from.dimensions {
        let same =
            to.find(&dimension.name).unwrap_or_else(|| panic!("{} got lost", dimension.name));
        let records = old.chunks_exact(from.stride).zip(new.chunks_exact(to.stride));
        for (i, (a, b)) in records.enumerate() {
            let (a, b) = (dimension.world(a, Endian::Little), same.world(b, Endian::Little));
            let equal = a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
            assert!(equal, "{} of record {i}: {a} became {b}", dimension.name);
        }
    }
}

macro_rules! matrix {
    ($($name:ident $format:literal)*) => { $(mod $name {
        use super::*;
        #[test]
        fn kept_records_are_bytes_of_the_input() {
            kept_records_are_those_of_the_input($format, false);
        }
        #[test]
        fn kept_records_with_extra_bytes_are_bytes_of_the_input() {
            kept_records_are_those_of_the_input($format, true);
        }
        #[test]
        fn laz_returns_records_and_what_is_beside_them() {
            comes_back_from_laz($format, false);
            comes_back_from_laz($format, true);
        }
        #[test]
        fn ply_returns_every_field() {
            comes_back_from_ply($format, false);
            comes_back_from_ply($format, true);
        }
    })* };
}

matrix! {
    format_0 0 format_1 1 format_2 2 format_3 3 format_4 4 format_5 5
    format_6 6 format_7 7 format_8 8 format_9 9 format_10 10
}

/// A PLY vertex in every type there is, in both byte orders.
const VERTEX: &str = "property double x\nproperty float y\nproperty double z\nproperty char a\n\
    property uchar red\nproperty short s\nproperty ushort intensity\nproperty int i\n\
    property uint u\nproperty float f\nproperty double d\n";
const VERTEX_SIZES: [usize; 11] = [8, 4, 8, 1, 1, 2, 2, 4, 4, 4, 8];

/// A binary PLY file of `points` vertices with coordinates between 0 and 100, duplicates among
/// them; and its vertices.
fn vertices(path: &Path, endian: Endian, points: usize, seed: u64) -> Vec<u8> {
    let stride: usize = VERTEX_SIZES.iter().sum();
    let mut random = Random(seed);
    let mut all: Vec<u8> = Vec::new();
    for i in 0..points {
        let mut vertex = Vec::new();
        let (x, y) = (random.below(100_000) as f64 / 1e3, random.below(1_000) as f32 / 8.0);
        let z = if x < 50.0 { 1.0 } else { x / 3.0 };
        for (n, size) in VERTEX_SIZES.into_iter().enumerate() {
            let mut number = match n {
                0 => x.to_le_bytes().to_vec(),
                1 => y.to_le_bytes().to_vec(),
                2 => z.to_le_bytes().to_vec(),
                9 => (random.number() as f32 / 3.0).to_le_bytes().to_vec(),
                10 => (random.number() as f64 / 3.0).to_le_bytes().to_vec(),
                _ => random.bytes(size),
            };
            if endian == Endian::Big {
                number.reverse();
            }
            vertex.extend(number);
        }
        if i > 0 && random.below(8) == 0 {
            vertex = all[all.len() - stride..].to_vec();
        }
        all.extend(vertex);
    }
    let order = if endian == Endian::Big { "big" } else { "little" };
    let mut bytes = format!(
        "ply\nformat binary_{order}_endian 1.0\ncomment one line of text\nelement vertex {points}\n\
         {VERTEX}end_header\n"
    )
    .into_bytes();
    bytes.extend(&all);
    std::fs::write(path, bytes).unwrap();
    all
}

#[test]
fn ply_keeps_the_bytes_of_its_vertices() {
    let folder = tempfile::tempdir().unwrap();
    let [input, output] = ["in.ply", "out.ply"].map(|name| folder.path().join(name));
    for endian in [Endian::Little, Endian::Big] {
        let all = vertices(&input, endian, 4_000, 1);
        let stride = all.len() / 4_000;
        let done = convert(std::slice::from_ref(&input), &output, &Setup::new(&[])).unwrap();
        assert!(accounted("converted", &done, &output, 4_000) == all);
        let bytes = std::fs::read(&output).unwrap();
        assert!(bytes.ends_with(&all), "the file holds the vertices as they were");
        let setup = Setup::new(&[("run.tile_points", json!(300))]);
        let done = reduce(std::slice::from_ref(&input), &output, &setup).unwrap();
        let kept = accounted("reduced", &done, &output, 4_000);
        assert!((10 * stride..all.len()).contains(&kept.len()));
        assert_contained("reduced", &kept, &all, stride);
    }
}

#[test]
fn ply_text_returns_every_value() {
    let folder = tempfile::tempdir().unwrap();
    let [input, text, back, again] =
        ["in.ply", "text.ply", "back.ply", "again.ply"].map(|name| folder.path().join(name));
    let all = vertices(&input, Endian::Little, 2_000, 2);
    let encoding = |how: &str| Setup::new(&[("write.encoding", json!(how))]);
    convert(std::slice::from_ref(&input), &text, &encoding("ascii")).unwrap();
    convert(std::slice::from_ref(&text), &back, &encoding("binary")).unwrap();
    assert!(read(&back).1 == all);
    assert!(std::fs::read(&back).unwrap().ends_with(&all));
    convert(std::slice::from_ref(&back), &again, &encoding("ascii")).unwrap();
    assert!(std::fs::read(&text).unwrap() == std::fs::read(&again).unwrap());
    // Reducing text keeps lines of it.
    let done = reduce(std::slice::from_ref(&text), &again, &Setup::new(&[])).unwrap();
    let kept = accounted("reduced text", &done, &again, 2_000);
    assert_contained("reduced text", &kept, &all, all.len() / 2_000);
    let lines = |path: &Path| -> Vec<String> {
        let text = std::fs::read_to_string(path).unwrap();
        text.split_once("end_header\n").unwrap().1.lines().map(str::to_owned).collect()
    };
    let (old, new) = (lines(&text), lines(&again));
    assert!(!new.is_empty() && new.iter().all(|line| old.contains(line)));
}

#[test]
fn several_inputs_become_one_with_all_their_records() {
    let folder = tempfile::tempdir().unwrap();
    let inputs = [1_000, 1, 2_000].map(|points| {
        let at = folder.path().join(points.to_string());
        std::fs::create_dir(&at).unwrap();
        make(&at, 6, true, points)
    });
    let paths: Vec<PathBuf> = inputs.iter().map(|made| made.path.clone()).collect();
    let all: Vec<u8> = inputs.iter().flat_map(|made| made.records.clone()).collect();
    let output = folder.path().join("out.laz");
    let done = convert(&paths, &output, &Setup::new(&[])).unwrap();
    assert!(accounted("converted", &done, &output, 3_001) == all);
    let done = reduce(&paths, &output, &Setup::new(&[])).unwrap();
    let kept = accounted("reduced", &done, &output, 3_001);
    assert_contained("reduced", &kept, &all, inputs[0].stride);
    assert_eq!(done.report.run.inputs.len(), 3);

    let plys = [1, 2].map(|seed| folder.path().join(format!("{seed}.ply")));
    let all: Vec<u8> =
        plys.iter().zip(1..).flat_map(|(p, seed)| vertices(p, Endian::Big, 900, seed)).collect();
    let output = folder.path().join("out.ply");
    let done = convert(&plys, &output, &Setup::new(&[])).unwrap();
    assert!(accounted("converted", &done, &output, 1_800) == all);
    let done = reduce(&plys, &output, &Setup::new(&[])).unwrap();
    assert_contained("reduced", &accounted("", &done, &output, 1_800), &all, all.len() / 1_800);
}

#[test]
fn las_without_points_and_with_one_are_scans() {
    let folder = tempfile::tempdir().unwrap();
    for (format, points) in [(0, 0), (0, 1), (6, 0), (6, 1), (10, 2)] {
        let made = make(folder.path(), format, true, points);
        for name in ["out.las", "out.laz"] {
            let output = folder.path().join(name);
            for run in [reduce, convert] {
                let setup = Setup::new(&[("run.withheld", json!("keep"))]);
                let done = run(std::slice::from_ref(&made.path), &output, &setup).unwrap();
                let kept = accounted(name, &done, &output, points as u64);
                assert_contained(name, &kept, &made.records, made.stride);
                assert_eq!(kept.is_empty(), points == 0);
            }
        }
    }
}
