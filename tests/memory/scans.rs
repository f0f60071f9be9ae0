//! Real scans through the whole pipeline: what can be read is reduced and read back, what is broken
//! is told; nothing panics, hangs, or allocates by a number that a file claims.

use std::collections::{BTreeMap, VecDeque};
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};

use crate::support::allocator;
use crate::support::records::{accounted, assert_contained, open, read_some, sink, write};
use crate::support::setup::{Setup, convert, reduce};
use serde_json::json;

/// The budget of every run, and more than any of its allocations. What the test itself holds of a
/// scan counts in it.
const MEMORY: u64 = 512 << 20;
/// Scans above are cut to their first points.
const MOST: usize = 300_000;
/// Scans up to this are reduced in two ways that must agree.
const TWICE: usize = 20_000;
/// No scan takes longer, by far.
const PATIENCE: Duration = Duration::from_secs(180);

/// Files that must be refused: damaged ones, and PLY files without vertices of x, y and z.
const REFUSED: [&str; 17] = [
    "laszip/broken_coder.laz",
    "laszip/broken_type.laz",
    "pasture/10_points_format_10.laz",
    "pasture/10_points_format_9.laz",
    "pdal/las/bad_vlr_count.las",
    "pdal/las/garbage_nVariableLength.las",
    "pdal/las/permutations/1.2-no-points.las",
    "pdal/ply/no_vertex.ply",
    "pdal/ply/sized_dims.ply",
    "pdal/ply/unsized_dims.ply",
    "ply-rs-bw/all_atomic_types_ok_ascii.ply",
    "ply-rs-bw/exponent_values_ok_ascii.ply",
    "ply-rs-bw/header_min_ok_ascii.ply",
    "ply-rs-bw/leading_spaces_ok_ascii.ply",
    "ply-rs-bw/single_elements_err_ascii.ply",
    "ply-rs-bw/single_elements_ok_ascii.ply",
    "trimesh/emptyIO/ply_empty_header.ply",
];

/// Files whose x and y are degrees, or metres under heights in feet: stages that measure refuse
/// them until they are told what to do.
const MIXED: [&str; 6] = [
    "laspy/simple.copc.laz",
    "laspy/simple1_4.las",
    "laspy/simple_with_page.copc.laz",
    "pdal/las/epsg_4326.las",
    "pdal/las/no-points.las",
    "pdal/las/test_epsg_4047.las",
];

/// Formats that a scan is read from and written to; of others `tests/formats` reads every scan.
const FORMATS: [&str; 3] = ["las", "laz", "ply"];

/// A file of the folder and what its manifest says.
#[derive(Debug, Clone)]
struct Scan {
    path: PathBuf,
    name: String,
    /// Points, where the reader behind the manifest could count them.
    points: Option<u64>,
}

/// The LAS, LAZ and PLY files in the folder of real scans.
fn scans() -> Vec<Scan> {
    let folder = crate::support::scans();
    let manifest = std::fs::read_to_string(folder.join("MANIFEST.tsv")).expect("a manifest");
    let mut rows = manifest.lines().map(|line| line.split('\t').collect::<Vec<_>>());
    let head = rows.next().unwrap();
    let column = |name: &str| head.iter().position(|c| *c == name).unwrap();
    let (path, points, notes) = (column("path"), column("points"), column("good_for"));
    let told: BTreeMap<&str, Option<u64>> = rows
        .clone()
        .map(|row| (row[path], row[points].parse().ok().filter(|_| !row[notes].contains("broken"))))
        .collect();
    let mut files = Vec::new();
    walk(&folder, &mut files);
    let scan = |file: PathBuf| {
        let name = file.strip_prefix(&folder).unwrap().to_str().unwrap().to_owned();
        let points = told.get(name.as_str()).copied().flatten();
        Scan { path: file, name, points }
    };
    let scans: Vec<Scan> = files.into_iter().map(scan).collect();
    let known = scans.iter().filter(|scan| scan.points.is_some()).count();
    assert!(known > 140, "the manifest tells the points of {known} scans");
    scans
}

fn walk(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            walk(&path, files);
        } else if FORMATS.iter().any(|own| path.extension().is_some_and(|e| e == *own)) {
            files.push(path);
        }
    }
}

/// Does `work` for every scan, two at a time, and tells the first that panics or takes too long.
fn for_each(scans: Vec<Scan>, work: fn(&Scan) -> String) -> Vec<String> {
    let total = scans.len();
    let queue = Arc::new(Mutex::new(VecDeque::from(scans)));
    let (sender, results) = mpsc::channel();
    for _ in 0..2 {
        let (queue, sender) = (queue.clone(), sender.clone());
        std::thread::spawn(move || {
            loop {
                let Some(scan) = queue.lock().unwrap().pop_front() else { break };
                let _ = sender.send((scan.name.clone(), None));
                let begun = Instant::now();
                let done = catch_unwind(|| work(&scan)).map_err(drop);
                if sender.send((scan.name, Some((done, begun.elapsed())))).is_err() {
                    break;
                }
            }
        });
    }
    let (mut running, mut done, mut slowest) = (Vec::new(), Vec::new(), Vec::new());
    while done.len() < total {
        let Ok((name, outcome)) = results.recv_timeout(PATIENCE) else {
            panic!("no end after {PATIENCE:?}: {running:?}");
        };
        match outcome {
            None => running.push(name),
            Some((Err(()), _)) => panic!("{name} failed, as told above"),
            Some((Ok(told), took)) => {
                running.retain(|n| *n != name);
                slowest.push((took, name));
                done.push(told);
            }
        }
    }
    slowest.sort();
    slowest.iter().rev().take(5).for_each(|(took, name)| println!("{name}: {took:.1?}"));
    done
}

/// The scan itself, or a file of its first points where it has more than [`MOST`].
fn cropped(scan: &Scan, folder: &Path) -> PathBuf {
    let paths = [scan.path.clone()];
    let source = open(&paths).unwrap_or_else(|e| panic!("{e:?}"));
    if source.points() <= MOST as u64 {
        return scan.path.clone();
    }
    let (schema, records) = read_some(&paths, MOST).unwrap_or_else(|e| panic!("{e:?}"));
    let path = folder.join("cropped").with_extension(scan.path.extension().unwrap());
    let sink = sink(&path, &schema, source.metadata()).unwrap();
    assert_eq!(write(sink, &schema, &records).unwrap().points, MOST as u64);
    path
}

/// Reduces and converts a scan; a line about it.
fn reduces_and_reads_back(scan: &Scan) -> String {
    let folder = tempfile::tempdir().unwrap();
    let input = [cropped(scan, folder.path())];
    let (schema, all) = read_some(&input, usize::MAX).unwrap();
    let points = all.len() / schema.stride;
    if let Some(told) = scan.points {
        assert_eq!(points as u64, told.min(MOST as u64), "{}: points of the manifest", scan.name);
    }
    let output = folder.path().join("out").with_extension(scan.path.extension().unwrap());
    // A crop loses no reference system.
    let units = if MIXED.contains(&scan.name.as_str()) { "ignore" } else { "refuse" };
    let spilled = Setup::new(&[
        ("run.units", json!(units)),
        ("run.spill", json!("always")),
        ("run.tile_points", json!(if points <= TWICE { 500 } else { 10_000 })),
    ]);
    let done = reduce(&input, &output, &spilled.threads(1).memory(MEMORY))
        .unwrap_or_else(|e| panic!("{}: {e:?}", scan.name));
    let kept = accounted(&scan.name, &done, &output, points as u64);
    assert_eq!(kept.is_empty(), points == 0, "{}", scan.name);
    let (schema_out, _) = read_some(std::slice::from_ref(&output), 1).unwrap();
    assert_eq!(schema_out, schema, "{}", scan.name);
    assert_contained(&scan.name, &kept, &all, schema.stride);
    if points <= TWICE {
        let bytes = std::fs::read(&output).unwrap();
        let plain = Setup::new(&[("run.units", json!(units))]).memory(MEMORY);
        let done = reduce(&input, &output, &plain).unwrap();
        accounted(&scan.name, &done, &output, points as u64);
        let same = std::fs::read(&output).unwrap() == bytes;
        assert!(same, "{}: tiles, threads or spill changed the output", scan.name);
        let done = convert(&input, &output, &Setup::new(&[]).memory(MEMORY)).unwrap();
        let copied = accounted(&scan.name, &done, &output, points as u64);
        assert!(copied == all, "{}: a copy differs", scan.name);
    }
    format!("{}: {points} -> {}", scan.name, kept.len() / schema.stride)
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn every_readable_scan_is_reduced_to_records_of_its_own() {
    let _alone = allocator::alone();
    let scans = scans();
    let readable: Vec<Scan> =
        scans.into_iter().filter(|scan| !REFUSED.contains(&scan.name.as_str())).collect();
    assert!(readable.len() > 150, "only {} scans", readable.len());
    for_each(readable, reduces_and_reads_back).iter().for_each(|line| println!("{line}"));
    let largest = allocator::largest();
    println!("the largest allocation: {largest} bytes");
}

/// Reduces and converts what cannot be read; a line about it.
fn is_refused(scan: &Scan) -> String {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out").with_extension(scan.path.extension().unwrap());
    let mut told = Vec::new();
    for run in [reduce, convert] {
        let outcome =
            run(std::slice::from_ref(&scan.path), &output, &Setup::new(&[]).memory(MEMORY));
        let error = outcome.expect_err(&scan.name);
        assert_eq!(error.path(), Some(scan.path.as_path()), "{error:?}");
        assert_eq!(error.kind(), pointmill::ErrorKind::Data, "{error:?}");
        crate::support::assert_holds(folder.path(), &[]);
        told.push(error.to_string());
    }
    told.remove(0)
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn every_broken_scan_is_refused_with_its_path() {
    let _alone = allocator::alone();
    let scans = scans();
    let broken: Vec<Scan> =
        scans.into_iter().filter(|scan| REFUSED.contains(&scan.name.as_str())).collect();
    assert_eq!(broken.len(), REFUSED.len());
    for_each(broken, is_refused).iter().for_each(|line| println!("{line}"));
    let largest = allocator::largest();
    assert!((largest as u64) < MEMORY, "an allocation of {largest} bytes");
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn every_scan_of_mixed_units_is_refused_until_it_is_told_how_to_measure() {
    let _alone = allocator::alone();
    let scans = scans();
    let mixed: Vec<Scan> =
        scans.into_iter().filter(|scan| MIXED.contains(&scan.name.as_str())).collect();
    assert_eq!(mixed.len(), MIXED.len());
    let folder = tempfile::tempdir().unwrap();
    let mut feet = 0;
    for scan in mixed {
        let input = std::slice::from_ref(&scan.path);
        let output = folder.path().join("out").with_extension(scan.path.extension().unwrap());
        let run = |sets: &[(&'static str, serde_json::Value)]| {
            reduce(input, &output, &Setup::new(sets).memory(MEMORY))
        };
        let error = run(&[]).expect_err(&scan.name);
        assert_eq!(error.path(), Some(scan.path.as_path()), "{error:?}");
        assert!(error.to_string().contains("x and y are in "), "{error:?}");
        assert!(error.remedy().unwrap().contains("z_scale"), "{error:?}");
        crate::support::assert_holds(folder.path(), &[]);
        let auto = run(&[("run.z_scale", json!("auto"))]);
        assert_eq!(auto.is_ok(), error.to_string().contains("feet"), "{}: {auto:?}", scan.name);
        feet += usize::from(auto.is_ok());
        run(&[("run.z_scale", json!(1.0))]).expect(&scan.name);
        convert(input, &output, &Setup::new(&[]).memory(MEMORY)).expect(&scan.name);
        std::fs::remove_file(&output).unwrap();
    }
    assert_eq!(feet, 2, "metres under feet can be measured");
}
