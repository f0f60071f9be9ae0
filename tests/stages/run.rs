//! Whole runs of the stages that remove by distance, mark, and repeat: against brute force, and
//! against the same done in several runs.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use crate::support::case::{Case, REDUCE, execute};
use crate::support::random::Random;
use crate::support::tiles::{far2, sorted};
use pointmill::internals::morton_cmp;
use pointmill::point::Position;
use pointmill::{Graph, Overrides, Quiet, Registry, Set};
use serde_json::Value;

/// Small tiles on a lattice of whole numbers.
const TILES: &str = "provenance = false\nlattice = 1.0\ntile_points = 40\nthreads = 2";

/// A rough sheet of 2,500 positions, and some far above and below it.
fn scene() -> Vec<Position> {
    let mut random = Random(11);
    let sheet: Vec<Position> = (0..2500)
        .map(|i| {
            [
                i % 50 * 10 + random.coordinate(9),
                i / 50 * 10 + random.coordinate(9),
                random.coordinate(6),
            ]
        })
        .collect();
    let planted = [400, -300, 900, 60, 45, 38, -34].into_iter().enumerate();
    sorted(sheet.into_iter().chain(planted.map(|(i, z)| [i as i64 * 71 - 60, 255, z])))
}

/// A case with the scene as input, some positions with copies.
fn case(scan: &[Position]) -> Case {
    let case = Case::new();
    let records = scan.iter().enumerate().flat_map(|(i, p)| {
        let copies = 1 + u32::from(i % 50 == 0);
        (0..copies).map(move |c| (p.map(|v| v as f64), i as u32 * 10 + c))
    });
    // In no order that the scan would have by itself.
    let mut records: Vec<_> = records.collect();
    records.reverse();
    case.ply(&records);
    case
}

/// The distinct positions that were written, and how many records.
fn written(case: &Case) -> (Vec<Position>, usize) {
    let records = case.written();
    let positions = records.iter().map(|(p, _)| p.map(|v| v as i64));
    (sorted(positions), records.len())
}

fn assert_many_tiles(report: &Value) {
    let tiles = report["run"]["work"]["tiles"].as_u64().unwrap();
    assert!(tiles >= 30, "{tiles} tiles prove little");
}

#[test]
fn statistical_outliers_of_a_run_are_those_of_brute_force() {
    let scan = scene();
    let figures: Vec<f64> = scan
        .iter()
        .map(|p| {
            let mut near: Vec<i128> =
                scan.iter().filter(|q| *q != p).map(|q| far2(*p, *q)).collect();
            near.sort_unstable();
            near[..8].iter().map(|d2| (*d2 as f64).sqrt()).sum::<f64>() / 8.0
        })
        .collect();
    let n = scan.len() as f64;
    let mean = figures.iter().sum::<f64>() / n;
    let sigma = (figures.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / n).sqrt();
    let threshold = mean + 1.5 * sigma;
    assert!(figures.iter().all(|f| (f - threshold).abs() > 1e-3), "too near to tell");
    let stay = scan.iter().zip(&figures).filter(|(_, f)| **f <= threshold);
    let expected: Vec<Position> = stay.map(|(p, _)| *p).collect();
    assert!(expected.len() < scan.len() - 3 && expected.len() > scan.len() - 200);

    let case = case(&scan);
    let stage = "[[stage]]\nkind = 'outliers'\nneighbors = 8\nmultiplier = 1.5\n";
    case.run(TILES, stage, "").unwrap();
    let (kept, records) = written(&case);
    assert_eq!(kept, expected);
    let report = case.report();
    assert_many_tiles(&report);
    let ledger = &report["result"]["ledger"];
    assert_eq!(ledger["kept"], records);
    let reason = &ledger["removed"][0];
    assert_eq!((&reason["stage"], &reason["reason"]), (&"outliers".into(), &"outlier".into()));
    let named = |name: &str| {
        let all = report["result"]["decisions"].as_array().unwrap();
        all.iter().find(|d| d["name"] == name).unwrap()["value"].as_f64().unwrap()
    };
    for (name, expected) in [("mean_distance", mean), ("sigma", sigma), ("threshold", threshold)] {
        assert!((named(name) - expected).abs() < 1e-3, "{name}: {} and {expected}", named(name));
    }
}

#[test]
fn outliers_before_a_reduction_are_as_if_they_were_never_there() {
    let scan = scene();
    let stage = "[[stage]]\nkind = 'outliers'\nmultiplier = 1.0\n";
    let reduce = REDUCE.replace("kind = 'cells'", "kind = 'cells'\nside = 64.0");
    let together = case(&scan);
    together.run(TILES, &format!("{stage}{reduce}"), "").unwrap();
    let apart = case(&scan);
    apart.run(TILES, stage, "").unwrap();
    let between = fs::read(apart.path("out.ply")).unwrap();
    assert!(between.len() < fs::read(apart.path("in.ply")).unwrap().len());
    fs::write(apart.path("in.ply"), between).unwrap();
    apart.run(TILES, &reduce, "").unwrap();
    assert_many_tiles(&together.report());
    assert_eq!(together.written(), apart.written());
}

#[test]
fn radius_outliers_of_a_run_are_those_of_brute_force() {
    let scan = scene();
    let near = |p: &Position| scan.iter().filter(|q| *q != p && far2(*p, **q) <= 15 * 15).count();
    let expected: Vec<Position> = scan.iter().filter(|p| near(p) >= 5).copied().collect();
    assert!(expected.len() < scan.len() - 20 && expected.len() > scan.len() / 2);
    let case = case(&scan);
    let stage = "[[stage]]\nkind = 'outliers'\nmethod = 'radius'\nradius = 15\nmin_neighbors = 5\n";
    case.run(TILES, stage, "").unwrap();
    assert_eq!(written(&case).0, expected);
    assert_many_tiles(&case.report());
}

#[test]
fn a_grid_of_a_run_is_that_of_brute_force() {
    let scan = scene();
    for side in [13, 32] {
        let mut cubes: BTreeMap<Position, Vec<Position>> = BTreeMap::new();
        for p in &scan {
            cubes.entry(p.map(|v| v.div_euclid(side) * side)).or_default().push(*p);
        }
        let middle = |of: &[Position], axis: usize| {
            let mut values: Vec<i64> = of.iter().map(|p| p[axis]).collect();
            values.sort_unstable();
            values[(values.len() - 1) / 2]
        };
        for pick in ["center", "median", "first"] {
            let expected = sorted(cubes.iter().map(|(corner, of)| {
                let far = |p: &Position| match pick {
                    "first" => 0,
                    "center" => far2(p.map(|v| 2 * v), corner.map(|v| 2 * v + side)),
                    _ => far2(*p, [0, 1, 2].map(|axis| middle(of, axis))),
                };
                *of.iter().min_by(|a, b| far(a).cmp(&far(b)).then(morton_cmp(a, b))).unwrap()
            }));
            let case = case(&scan);
            let stage = format!("[[stage]]\nkind = 'grid'\nside = {side}.0\npick = '{pick}'\n");
            // Tiles are four cubes wide at least: fewer of them than elsewhere.
            case.run(&TILES.replace("lattice", "spill = 'always'\nlattice"), &stage, "").unwrap();
            let (kept, records) = written(&case);
            assert_eq!(kept, expected, "{side} {pick}");
            assert_eq!(records, kept.len(), "one record a cube");
            let report = case.report();
            assert_eq!(report["result"]["counts"]["grid_cubes"], kept.len());
            assert!(report["run"]["work"]["tiles"].as_u64().unwrap() >= 4);
        }
    }
}

/// A made-up airborne scan, and what `stages` make of it: `out` beside it.
fn las(folder: &Path, stages: &str, from: &str, out: &str) -> Value {
    let input = folder.join(from);
    if !input.exists() {
        let text = format!(
            "[[stage]]\nkind = 'synth'\nscene = 'als'\npoints = 8000\n\
             [[stage]]\nkind = 'write'\norder = 'canonical'\npath = '{}'\n",
            input.display()
        );
        execute(&text, &Overrides::default(), &Quiet).unwrap();
    }
    let report = folder.join("report.json");
    let text = format!(
        "[run]\nreport = '{}'\ntile_points = 100\nthreads = 2\n\
         [[stage]]\nkind = 'read'\npath = '{}'\n{stages}[[stage]]\nkind = 'write'\npath = '{}'\n",
        report.display(),
        input.display(),
        folder.join(out).display()
    );
    execute(&text, &Overrides::default(), &Quiet).unwrap();
    serde_json::from_slice(&fs::read(report).unwrap()).unwrap()
}

/// The records of a LAS file of point format 6 (LAS 1.4 R15, tables 3 and 15).
fn records(path: &Path) -> Vec<Vec<u8>> {
    let bytes = fs::read(path).unwrap();
    let whole = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!(bytes[104], 6);
    let stride = usize::from(u16::from_le_bytes(bytes[105..107].try_into().unwrap()));
    let count = u64::from_le_bytes(bytes[247..255].try_into().unwrap()) as usize;
    bytes[whole(96)..].chunks_exact(stride).take(count).map(<[u8]>::to_vec).collect()
}

const FLAGS: usize = 15;
const CLASS: usize = 16;
const KEY_POINT: u8 = 2;
const WITHHELD: u8 = 4;

#[test]
fn a_median_that_marks_sets_the_key_point_flag_of_what_it_would_keep() {
    let folder = tempfile::tempdir().unwrap();
    for passes in [1, 2] {
        let stages = REDUCE.replace("kind = 'cells'", "kind = 'cells'\nside = 1.0");
        let stages = format!("{stages}passes = {passes}\n");
        las(folder.path(), &stages, "in.las", "reduced.las");
        let stages = format!("{stages}mark = 'key-point'\n");
        let report = las(folder.path(), &stages, "in.las", "out.las");
        let read = |name: &str| records(&folder.path().join(name));
        let (input, reduced, marked) = (read("in.las"), read("reduced.las"), read("out.las"));
        let mut plain = marked.clone();
        plain.iter_mut().for_each(|r| r[FLAGS] &= !KEY_POINT);
        assert_eq!(plain, input, "every record is there, in canonical order");
        let key_points = marked.iter().zip(&plain).filter(|(r, _)| r[FLAGS] & KEY_POINT != 0);
        let key_points: Vec<&Vec<u8>> = key_points.map(|(_, plain)| plain).collect();
        assert_eq!(key_points, reduced.iter().collect::<Vec<_>>(), "{passes}");
        assert!(!reduced.is_empty() && reduced.len() < input.len());
        assert_many_tiles(&report);
        assert_eq!(report["result"]["ledger"]["kept"], input.len());
        assert_eq!(report["result"]["counts"]["median_marked"], input.len() - reduced.len());
        assert_eq!(report["result"]["counts"]["key_points"], reduced.len());
    }
}

#[test]
fn outliers_that_are_marked_have_the_flag_or_the_class() {
    let folder = tempfile::tempdir().unwrap();
    let stage = "[[stage]]\nkind = 'outliers'\nmultiplier = 1.0\n";
    las(folder.path(), stage, "in.las", "kept.las");
    let kept = records(&folder.path().join("kept.las"));
    type IsMarked = fn(&[u8]) -> bool;
    let is_marked: [(&str, IsMarked); 3] = [
        ("'withheld'", |r| r[FLAGS] & WITHHELD != 0),
        ("7", |r| r[CLASS] == 7),
        ("18", |r| r[CLASS] == 18),
    ];
    for (mark, is_marked) in is_marked {
        let stage = format!("{stage}mark = {mark}\n");
        let report = las(folder.path(), &stage, "in.las", "out.las");
        let all = records(&folder.path().join("out.las"));
        assert_eq!(all.len(), records(&folder.path().join("in.las")).len());
        let rest: Vec<Vec<u8>> = all.iter().filter(|r| !is_marked(r)).cloned().collect();
        assert_eq!(rest, kept, "{mark}");
        assert!(kept.len() < all.len());
        assert_eq!(report["result"]["counts"]["outliers_marked"], all.len() - kept.len());
        assert_many_tiles(&report);
    }
}

#[test]
fn two_passes_are_two_runs_with_a_file_between() {
    let folder = tempfile::tempdir().unwrap();
    let stages = REDUCE.replace("kind = 'cells'", "kind = 'cells'\nside = 2.0");
    let report = las(folder.path(), &format!("{stages}passes = 2\n"), "in.las", "twice.las");
    las(folder.path(), &stages, "in.las", "once.las");
    las(folder.path(), &stages, "once.las", "again.las");
    // What the files say of the pipelines that made them differs.
    let read = |name: &str| records(&folder.path().join(name));
    assert!(read("twice.las") == read("again.las"), "other records");
    assert!(read("twice.las").len() < read("once.las").len());
    assert_many_tiles(&report);
}

#[test]
fn normals_of_a_run_point_up_or_to_the_viewpoint() {
    let folder = tempfile::tempdir().unwrap();
    let write = "[[stage]]\nkind = 'write'\ndimensions = ['NormalX', 'NormalY', 'NormalZ']";
    for (keys, above) in [
        ("orient = 'up'", true),
        ("orient = 'viewpoint'\nviewpoint = [0, 0, 1e7]", true),
        ("orient = 'viewpoint'\nviewpoint = [0, 0, -1e7]", false),
    ] {
        let out = folder.path().join("out.ply");
        let text = format!(
            "[[stage]]\nkind = 'synth'\nscene = 'als'\npoints = 3000\n\
             [[stage]]\nkind = 'normals'\n{keys}\n{write}\npath = '{}'\nencoding = 'ascii'\n",
            out.display()
        );
        execute(&text, &Overrides::default(), &Quiet).unwrap();
        let text = fs::read_to_string(out).unwrap();
        let (head, body) = text.split_once("end_header\n").unwrap();
        let properties: Vec<&str> = head.lines().filter(|l| l.starts_with("property")).collect();
        let nz = properties.iter().position(|l| l.ends_with(" nz")).unwrap();
        let heights: Vec<f64> =
            body.lines().map(|line| line.split(' ').nth(nz).unwrap().parse().unwrap()).collect();
        assert_eq!(heights.len(), 3000);
        // Nearly upright walls may lean the other way, as seen from a point.
        let right = heights.iter().filter(|z| if above { **z >= 0.0 } else { **z <= 0.0 }).count();
        assert!(right >= if keys.ends_with("'up'") { 3000 } else { 2900 }, "{keys}: {right}");
        assert!(heights.iter().any(|z| z.abs() < 0.9), "not all is flat");
    }
}

#[test]
fn the_pipelines_that_users_copy_run() {
    let folder = tempfile::tempdir().unwrap();
    las(folder.path(), "", "in.las", "copy.las");
    let copies = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines");
    for name in ["outliers", "grid", "classes", "mark", "reduce"] {
        let out = folder.path().join(format!("{name}.laz"));
        let sets = [
            Set::argument(
                "IN",
                "read.path",
                folder.path().join("in.las").display().to_string().into(),
            ),
            Set::argument("OUT", "write.path", out.display().to_string().into()),
        ];
        let registry = Registry::builtin();
        let pipeline = Graph::read(&copies.join(format!("{name}.toml")), &registry, &sets).unwrap();
        let done = pipeline.plan(&Overrides::default()).unwrap().run(&Quiet).unwrap();
        let ledger = &done.report.result.ledger;
        assert_eq!(ledger.read, 8000);
        assert_eq!(ledger.kept < 8000, name != "mark", "{name}: {}", ledger.kept);
        assert!(out.exists());
    }
}
