//! Runs with one output for each input: tiles of a survey reduce without seams, to the points that
//! they reduce to as one file, whatever the order of the inputs and however the work is cut.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::support::case::execute;
use crate::support::command::PROGRAM;
use crate::support::folders::{assert_equal_files, convert_one};
use crate::support::random::Random;
use crate::support::scan::Scan;
use assert_cmd::Command;
use pointmill::Result;
use pointmill::report::result_bytes;
use pointmill::synth::Scene;
use pointmill::{Done, Overrides, Quiet};

const STAGES: &str = "[[stage]]\nkind = 'normals'\n[[stage]]\nkind = 'cells'\n\
                      [[stage]]\nkind = 'median'\n";

/// A scan cut into `side` × `side` files that share some records along their edges, each with an
/// offset, identifier and date of its own; and all of their records as one file.
fn survey(folder: &Path, scan: &Scan, side: usize) -> (Vec<PathBuf>, PathBuf) {
    let stored = |i: usize, axis: usize| {
        let bytes = scan.record(i)[4 * axis..][..4].try_into().unwrap();
        i64::from(i32::from_le_bytes(bytes))
    };
    let all: Vec<usize> = (0..scan.points()).collect();
    let bounds = [0, 1].map(|axis| {
        let of = || all.iter().map(|&i| stored(i, axis));
        (of().min().unwrap(), of().max().unwrap() + 1)
    });
    let tile = |i: usize, axis: usize, by: i64| {
        let (lo, hi) = bounds[axis];
        let at = (stored(i, axis) - lo + by).clamp(0, hi - lo - 1);
        (at * side as i64 / (hi - lo)) as usize
    };
    let mut of_tile = vec![Vec::new(); side * side];
    let mut together = Vec::new();
    for &i in &all {
        // One record in ten, if near an edge, is in the file beyond it too.
        let mut tiles = vec![tile(i, 0, 0) * side + tile(i, 1, 0)];
        if i % 10 == 0 {
            tiles.push(tile(i, 0, 200) * side + tile(i, 1, 0));
            tiles.dedup();
        }
        for t in tiles {
            of_tile[t].push(i);
            together.push(i);
        }
    }
    let mut paths = Vec::new();
    for (t, picked) in of_tile.iter().enumerate() {
        let mut one = scan.pick(picked);
        let mut schema = (*scan.schema).clone();
        for axis in 0..3 {
            let steps = [(t / side) as i64 * 1000, (t % side) as i64 * 777, t as i64][axis];
            schema.dimensions[axis].origin += steps as f64 * schema.dimensions[axis].scale;
            for record in one.records.chunks_exact_mut(schema.stride) {
                let field = &mut record[4 * axis..4 * axis + 4];
                let value = i64::from(i32::from_le_bytes((&*field).try_into().unwrap())) - steps;
                field.copy_from_slice(&i32::try_from(value).unwrap().to_le_bytes());
            }
        }
        one.schema = Arc::new(schema);
        let extension = if t % 2 == 0 { "laz" } else { "las" };
        let path = folder.join(format!("tile {:02} {:02}.{extension}", t / side, t % side));
        one.write(&path);
        let mut bytes = fs::read(&path).unwrap();
        bytes[8..24].copy_from_slice(&[(t % 256) as u8; 16]);
        bytes[90..94].copy_from_slice(&[(t % 250) as u8 + 1, 0, 0xe0, 0x07]);
        fs::write(&path, bytes).unwrap();
        paths.push(path);
    }
    let whole = folder.join("whole.las");
    scan.pick(&together).write(&whole);
    (paths, whole)
}

/// How a run is cut up.
#[derive(Clone, Copy)]
struct Cut {
    threads: usize,
    tile_points: usize,
    spill: &'static str,
}

const CUTS: [Cut; 3] = [
    Cut { threads: 1, tile_points: 60_000, spill: "auto" },
    Cut { threads: 3, tile_points: 1_500, spill: "always" },
    Cut { threads: 2, tile_points: 4_000, spill: "auto" },
];

fn run(inputs: &[PathBuf], write: &str, report: &Path, cut: Cut) -> Result<Done> {
    let Cut { threads, tile_points, spill } = cut;
    let text = format!(
        "[run]\nprovenance = false\nthreads = {threads}\ntile_points = {tile_points}\n\
         spill = {spill:?}\nreport = {report:?}\n\
         [[stage]]\nkind = 'read'\npath = {inputs:?}\n{STAGES}[[stage]]\nkind = 'write'\n{write}\n"
    );
    execute(&text, &Overrides::default(), &Quiet)
}

fn count(records: &Scan) -> BTreeMap<Vec<u8>, usize> {
    let mut counts = BTreeMap::new();
    for i in 0..records.points() {
        *counts.entry(records.record(i).to_vec()).or_default() += 1;
    }
    counts
}

/// The names of what is in a folder, sorted.
fn names(folder: &Path) -> Vec<String> {
    let name = |e: std::io::Result<fs::DirEntry>| e.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<String> = fs::read_dir(folder).unwrap().map(name).collect();
    names.sort();
    names
}

/// Each output holds records of its input alone, under its header.
fn assert_own(inputs: &[PathBuf], folder: &Path) {
    for input in inputs {
        let output = folder.join(input.file_name().unwrap());
        let (before, after) = (Scan::read(input, usize::MAX), Scan::read(&output, usize::MAX));
        assert_eq!(before.schema, after.schema, "{}", output.display());
        let there = count(&before);
        for (record, n) in count(&after) {
            let known = there.get(&record).copied().unwrap_or(0);
            assert!(n <= known, "{}: a record that its input lacks", output.display());
        }
        let (one, two) = (fs::read(input).unwrap(), fs::read(&output).unwrap());
        // But for what made the file, and the record that names the stages.
        for (from, to) in [(0, 26), (58, 96), (104, 107), (131, 179)] {
            assert_eq!(one[from..to], two[from..to], "header of {}", output.display());
        }
        assert!(two[26..58].starts_with(b"EXTRACTION\0") && two[100] == one[100] + 1);
    }
}

#[test]
fn tiles_of_a_survey_reduce_to_the_points_of_the_one_file() {
    let at = tempfile::tempdir().unwrap();
    let scan = Scan::synthetic(Scene::Als, 40_000, 7);
    let (mut tiles, whole) = survey(at.path(), &scan, 5);
    let report = at.path().join("report.json");
    let one = at.path().join("one.las");
    run(&[whole], &format!("path = {one:?}"), &report, CUTS[0]).unwrap();
    let result = result_bytes(&fs::read(&report).unwrap()).unwrap().to_vec();
    let mut first: Option<PathBuf> = None;
    let mut random = Random(5);
    for (n, cut) in CUTS.into_iter().enumerate() {
        let folder = at.path().join(format!("out {n}"));
        let done = run(&tiles, &format!("folder = {folder:?}"), &report, cut).unwrap();
        assert!(n == 0 || done.report.run.work["tiles"] >= 30, "{:?}", done.report.run.work);
        assert_eq!(done.report.run.outputs.len(), tiles.len());
        assert_eq!(names(&folder).len(), tiles.len(), "{:?}", names(&folder));
        assert_own(&tiles, &folder);
        let ran = fs::read(&report).unwrap();
        assert!(result_bytes(&ran).unwrap() == result, "the result depends on the outputs");
        match &first {
            None => {
                // Together, at the offset of the one file, they are its reduction.
                let outputs: Vec<PathBuf> =
                    names(&folder).iter().map(|name| folder.join(name)).collect();
                let joined = at.path().join("joined.las");
                convert_one(&outputs, &joined, "");
                let (one, joined) = (Scan::read(&one, usize::MAX), Scan::read(&joined, usize::MAX));
                assert!(one.points() > 1_000 && one.points() < scan.points() / 2);
                assert_eq!(one.schema, joined.schema);
                assert!(count(&one) == count(&joined), "the points are not those of one file");
                first = Some(folder);
            }
            Some(first) => {
                for name in names(first) {
                    assert_equal_files(&first.join(&name), &folder.join(&name));
                }
            }
        }
        random.shuffle(&mut tiles);
    }
}

#[test]
fn an_input_of_which_nothing_is_kept_has_an_empty_output() {
    let at = tempfile::tempdir().unwrap();
    let scan = Scan::synthetic(Scene::Als, 2_000, 3);
    let [a, b, c] = ["a.laz", "b.las", "c.laz"].map(|name| at.path().join(name));
    scan.write(&a);
    // All of it coincides with what is in a, which comes first.
    scan.pick(&[5, 6, 7]).write(&b);
    scan.pick(&[]).write(&c);
    let folder = at.path().join("out");
    let inputs = [c, b, a];
    let stages_keep_one = CUTS[0];
    let report = at.path().join("report.json");
    run(&inputs, &format!("folder = {folder:?}"), &report, stages_keep_one).unwrap();
    assert_eq!(names(&folder), ["a.laz", "b.las", "c.laz"]);
    assert_eq!(Scan::read(&folder.join("b.las"), 9).points(), 0);
    assert_eq!(Scan::read(&folder.join("c.laz"), 9).points(), 0);
    assert!(Scan::read(&folder.join("a.laz"), 9).points() > 0);
}

#[test]
fn a_thousand_tiles_reduce_with_few_files_open() {
    let at = tempfile::tempdir().unwrap();
    let scan = Scan::synthetic(Scene::Als, 10_000, 11);
    let (tiles, whole) = survey(at.path(), &scan, 32);
    assert_eq!(tiles.len(), 1_024);
    let one = at.path().join("one.las");
    run(&[whole], &format!("path = {one:?}"), &at.path().join("r.json"), CUTS[0]).unwrap();
    // The shell bounds the open files of what it becomes.
    let pattern = at.path().join("tile*");
    let folder = at.path().join("out");
    let ran = Command::new("sh")
        .arg("-c")
        .arg(
            "ulimit -n 64 && exec \"$0\" reduce \"$1\" --outdir \"$2\" --preset paper --threads 3 --memory 256MiB",
        )
        .args([PROGRAM.as_ref(), pattern.as_os_str(), folder.as_os_str()])
        .output()
        .unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    assert_eq!(names(&folder).len(), tiles.len());
    assert_own(&tiles, &folder);
    let joined = at.path().join("joined.las");
    let outputs: Vec<PathBuf> = names(&folder).iter().map(|name| folder.join(name)).collect();
    convert_one(&outputs, &joined, "");
    let (one, joined) = (Scan::read(&one, usize::MAX), Scan::read(&joined, usize::MAX));
    assert!(one.points() > 500);
    assert!(count(&one) == count(&joined), "the points are not those of one file");
}

#[test]
fn a_run_that_fails_leaves_no_output() {
    let at = tempfile::tempdir().unwrap();
    let scan = Scan::synthetic(Scene::Als, 3_000, 3);
    let (tiles, _) = survey(at.path(), &scan, 2);
    let mut bytes = fs::read(&tiles[1]).unwrap();
    assert!(tiles[1].extension().unwrap() == "las");
    let folder = at.path().join("out");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("mine.txt"), "stays").unwrap();
    // A point beyond what the common offset leaves room for: only reading finds it.
    let start = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
    bytes[start + 4..start + 8].copy_from_slice(&i32::MAX.to_le_bytes());
    fs::write(&tiles[1], bytes).unwrap();
    let report = at.path().join("report.json");
    run(&tiles, &format!("folder = {folder:?}"), &report, CUTS[1]).unwrap_err();
    assert_eq!(names(&folder), ["mine.txt"]);
    assert!(!report.exists());
}
