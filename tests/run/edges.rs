//! Runs at the edge of what can be: nothing to do, far away, too heavy, one place, odd coordinates.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use pointmill::io::las;
use pointmill::{Error, ErrorKind};
use pointmill::{Graph, Overrides, Quiet, Registry};
use serde_json::Value;

use crate::support::case::{Case, REDUCE, execute};
use crate::support::command::{mebibytes, pointmill_told};

#[test]
fn scans_of_no_point_or_few_reduce_to_themselves() {
    for n in 0..6 {
        for threads in [1, 4] {
            let case = Case::new();
            let points: Vec<_> = (0..n).map(|i| ([f64::from(i), 0.5, -1.0], i)).collect::<Vec<_>>();
            let points: Vec<_> = points.into_iter().map(|(p, i)| (p, i as u32)).collect();
            case.ply(&points);
            case.run(&format!("threads = {threads}"), REDUCE, "").unwrap();
            let mut written = case.written();
            written.sort_by_key(|(_, tag)| *tag);
            assert_eq!(written, points, "points on a line have no normal: all stay");
            assert_eq!(case.report()["result"]["ledger"]["kept"], n);
            case.run(&format!("threads = {threads}"), "", "").unwrap();
            assert_eq!(case.written(), points, "a stream of {n}");
            assert_eq!(case.left(), ["in.ply", "out.ply", "report.json"]);
        }
    }
}

#[test]
fn unequal_coordinates_that_share_a_position_are_counted() {
    let case = Case::new();
    // Three positions: one of equal copies, one of coordinates that differ by less than a step of
    // 2^-30, one alone.
    let points = [
        ([0.5, 0.0, 0.0], 1),
        ([0.5, 0.0, 0.0], 2),
        ([2.0, 1.0, 0.0], 3),
        ([2.0 + 1e-12, 1.0, 0.0], 4),
        ([9.0, 9.0, 9.0], 5),
    ];
    case.ply(&points);
    case.run("", REDUCE, "").unwrap();
    let counts = &case.report()["result"]["counts"];
    assert_eq!(
        (counts["positions"].as_u64(), counts["unequal_coordinates"].as_u64()),
        (Some(3), Some(1))
    );
}

#[test]
fn the_far_ends_of_the_lattice_are_places_like_any_other() {
    // Patches at the corners of ±(2^32 − 2) world units, nearly 2^62 steps away, and around 0.
    let far = 4_294_967_294.0f64;
    let mut points = Vec::new();
    for corner in 0..8u32 {
        let base = [0, 1, 2].map(|axis| if corner >> axis & 1 == 1 { far } else { -far });
        for i in 0..40u32 {
            let offset = [i % 7, i / 7 % 7, (i * i) % 3].map(|v| f64::from(v) / 4.0);
            let p = std::array::from_fn(|axis| base[axis] - offset[axis] * base[axis].signum());
            points.push((p, points.len() as u32));
        }
    }
    for i in 0..60u32 {
        let p = [i % 8, i / 8, i % 3].map(|v| f64::from(v) / 8.0 - 0.5);
        points.push((p, points.len() as u32));
    }
    let mut answers = BTreeSet::new();
    for (threads, tile, spill) in [(1, 100_000, "auto"), (3, 4, "always"), (2, 1, "auto")] {
        let case = Case::new();
        case.ply(&points);
        let run = format!("threads = {threads}\ntile_points = {tile}\nspill = '{spill}'");
        case.run(&run, &REDUCE.replace("'cells'", "'cells'\nside = 1.5"), "").unwrap();
        let report = fs::read(case.path("report.json")).unwrap();
        let result = pointmill::report::result_bytes(&report).unwrap().to_vec();
        if tile < 100 {
            assert!(case.report()["run"]["work"]["tiles"].as_u64().unwrap() >= 9);
        }
        answers.insert((fs::read(case.path("out.ply")).unwrap(), result));
    }
    assert_eq!(answers.len(), 1);
}

#[test]
fn a_position_with_very_many_records_keeps_them_all_in_order() {
    let case = Case::new();
    let n = 200_000u32;
    let mut points: Vec<_> =
        (0..n).map(|i| ([1.0, 2.0, 3.0], i.wrapping_mul(2_654_435_761))).collect();
    points.extend((0..500).map(|i| ([f64::from(i), -1.0, 0.0], i)));
    case.ply(&points);
    case.run("threads = 2\nmemory = '512MiB'\ntile_points = 5000", "", "order = 'canonical'")
        .unwrap();
    let written = case.written();
    assert_eq!(written.len(), points.len());
    let copies: Vec<_> =
        written.iter().filter(|(p, _)| p[1] == 2.0).map(|(_, tag)| tag.to_le_bytes()).collect();
    assert_eq!(copies.len(), n as usize);
    assert!(copies.is_sorted(), "equal positions are in the order of their bytes");
    assert_eq!(case.report()["result"]["ledger"]["kept"], n + 500);
}

#[test]
fn the_memory_that_a_heavy_cell_is_said_to_need_does() {
    let at = tempfile::tempdir().unwrap();
    let (out, file) = (at.path().join("out.las"), at.path().join("heavy.toml"));
    let text = format!(
        "[run]\nthreads = 1\n[[stage]]\nkind = 'synth'\nscene = 'plane'\npoints = 100000\n\
         [[stage]]\nkind = 'normals'\nmethod = 'pca'\n[[stage]]\nkind = 'cells'\nside = 1e6\n\
         max_angle = 3.1\n[[stage]]\nkind = 'median'\n[[stage]]\nkind = 'write'\npath = '{}'\n",
        out.display()
    );
    fs::write(&file, text).unwrap();
    // What is resident before the run counts: each run is a process of its own.
    let run = format!("run {}", file.display());
    let with = |budget: u64| pointmill_told(at.path(), &format!("{run} --memory {budget}MiB"));
    let (_, small) = with(1);
    let (code, heavy) = with(mebibytes(&small) + 2);
    assert_eq!(code, 1, "{heavy}");
    assert!(heavy.contains("the cube from"), "{heavy}");
    assert!(!out.exists());
    let (code, told) = with(mebibytes(&heavy));
    assert_eq!(code, 0, "{told}");
    assert!(out.exists());
}

#[test]
fn a_stream_of_any_length_needs_no_memory_for_an_index() {
    let at = tempfile::tempdir().unwrap();
    let text = format!(
        "[run]\nthreads = 2\nmemory = '512MiB'\n[[stage]]\nkind = 'synth'\nscene = 'als'\n\
         points = 4000000000\n[[stage]]\nkind = 'write'\npath = '{}'\n",
        at.path().join("out.laz").display()
    );
    let pipeline = Graph::parse(&text, "test.toml", &Registry::builtin()).unwrap();
    let plan = pipeline.plan(&Overrides::default()).unwrap();
    assert!(plan.to_string().contains("memory   512 MiB"));
}

#[test]
fn points_that_are_not_finite_can_be_dropped_and_finite_ones_never_are() {
    let case = Case::new();
    let good = [([0.0; 3], 0), ([1.0; 3], 1)];
    case.ply(&[good[0], ([f64::NAN, 0.0, 0.0], 7), good[1], ([0.0, f64::INFINITY, 0.0], 8)]);
    for write in ["", "order = 'canonical'"] {
        case.run("nonfinite = 'drop'", "", write).unwrap();
        assert_eq!(case.written(), good);
        let removed = &case.report()["result"]["ledger"]["removed"][0];
        assert_eq!((&removed["reason"], &removed["records"]), (&"not finite".into(), &2.into()));
    }
    let error = case.run("", "", "order = 'canonical'").unwrap_err();
    assert!(
        error.to_string().contains("in.ply: the point [NaN, 0.0, 0.0] is not finite"),
        "{error}"
    );
    assert!(error.remedy().unwrap().contains("drop"));
    case.ply(&[good[0], ([1e305, 0.0, 0.0], 1)]);
    let error = case.run("nonfinite = 'drop'", "", "order = 'canonical'").unwrap_err();
    assert!(error.to_string().contains("beyond the lattice"), "{error}");
    assert!(error.remedy().unwrap().contains("lattice"));
    case.run("nonfinite = 'drop'", "", "").unwrap();
    assert_eq!(case.written().len(), 2, "a stream needs no lattice for a finite point");
}

#[test]
fn a_lattice_step_that_is_asked_for_is_the_one_that_decides() {
    let case = Case::new();
    case.ply(&[
        ([0.4, 0.0, 0.0], 3),
        ([0.2, 0.0, 0.0], 2),
        ([0.6, 0.0, 0.0], 0),
        ([-0.4, 0.0, 0.0], 1),
    ]);
    case.run("lattice = 1.0", "", "order = 'canonical'").unwrap();
    let result = case.report()["result"].clone();
    assert_eq!(result["lattice"]["step"], 1.0);
    assert_eq!(result["counts"]["positions"], 2);
    let tags: Vec<u32> = case.written().iter().map(|(_, tag)| *tag).collect();
    assert_eq!(tags.last(), Some(&0), "0.6 is at 1, all others at 0, in the order of their bytes");
}

#[test]
fn every_report_tile_is_surveyed_once_however_uneven_the_scan() {
    let case = Case::new();
    let mut points = Vec::new();
    for x in 0..60 {
        for y in 0..60 {
            for z in 0..50 {
                points.push(([f64::from(x) - 7.0, f64::from(y), f64::from(z) - 31.0], 0));
            }
        }
    }
    // Far apart, each alone in its tile: they make the tiles large, and the block falls into few.
    for i in 0..30u32 {
        points.push(([f64::from(i) * 4096.0 + 3.0, -5000.0 - f64::from(i * i), 0.0], i));
    }
    case.ply(&points);
    let mut results = BTreeSet::new();
    for threads in [1, 4] {
        case.run(&format!("lattice = 1.0\nthreads = {threads}"), "", "order = 'canonical'")
            .unwrap();
        let result = case.report()["result"].clone();
        let side = result["tile_side"].as_f64().unwrap();
        let cubes: BTreeSet<[i64; 3]> =
            points.iter().map(|(p, _)| p.map(|v| (v / side).floor() as i64)).collect();
        let tiles = result["tiles"].as_array().unwrap();
        assert_eq!(tiles.len(), cubes.len());
        let before: u64 = tiles.iter().map(|t| t["points"]["before"].as_u64().unwrap()).sum();
        assert_eq!(before, points.len() as u64);
        results.insert(result.to_string());
    }
    assert_eq!(results.len(), 1);
}

#[test]
fn the_report_says_how_many_points_each_input_has() {
    let at = tempfile::tempdir().unwrap();
    for (name, points) in [("a.laz", 1200), ("b.laz", 345)] {
        let text = format!(
            "[[stage]]\nkind = 'synth'\nscene = 'plane'\npoints = {points}\nseed = {points}\n\
             [[stage]]\nkind = 'write'\npath = '{}'\n",
            at.path().join(name).display()
        );
        execute(&text, &Overrides::default(), &Quiet).unwrap();
    }
    let (out, report) = (at.path().join("out.las"), at.path().join("report.json"));
    let text = format!(
        "[[stage]]\nkind = 'read'\npath = '{}'\n[[stage]]\nkind = 'write'\npath = '{}'\n",
        at.path().join("*.laz").display(),
        out.display()
    );
    let overrides = Overrides { report: Some(report.clone()), ..Overrides::default() };
    execute(&text, &overrides, &Quiet).unwrap();
    let report: Value = serde_json::from_slice(&fs::read(report).unwrap()).unwrap();
    let points = |which: &str| -> Vec<u64> {
        let files = report["run"][which].as_array().unwrap();
        files.iter().map(|file| file["points"].as_u64().unwrap()).collect()
    };
    assert_eq!((points("inputs"), points("outputs")), (vec![1200, 345], vec![1545]));
}

#[test]
fn offsets_move_no_point_and_scales_tell_what_they_round() {
    let at = tempfile::tempdir().unwrap();
    let path = |name: &str| at.path().join(name).display().to_string();
    let write = |source: &str, keys: &str, name: &str| {
        let text = format!(
            "[run]\nprovenance = false\nreport = '{}'\n[[stage]]\n{source}\n[[stage]]\nkind = 'write'\npath = '{}'\n{keys}\n",
            path("report.json"),
            path(name)
        );
        execute(&text, &Overrides::default(), &Quiet)?;
        let report = fs::read(path("report.json")).unwrap();
        let report: Value = serde_json::from_slice(&report).unwrap();
        Ok::<Value, Error>(report["run"]["warnings"].clone())
    };
    let none: Value = Vec::<Value>::new().into();
    let synth = "kind = 'synth'\nscene = 'als'\npoints = 3000";
    assert_eq!(write(synth, "", "a.las").unwrap(), none);
    let read = format!("kind = 'read'\npath = '{}'", path("a.las"));
    let moved = write(&read, "offset = [349123.0, 5600000.5, 1.0]", "b.las").unwrap();
    assert_eq!(moved, none, "an offset of whole steps rounds nothing");
    let back = format!("kind = 'read'\npath = '{}'", path("b.las"));
    let schema = las::open(&[path("a.las").into()]).unwrap().schema().clone();
    let offset = schema.coordinates().unwrap().map(|d| d.origin);
    write(&back, &format!("offset = {offset:?}"), "c.las").unwrap();
    // But for the system identifier, which says that something was moved.
    let bytes = |name: &str| {
        let mut bytes = fs::read(path(name)).unwrap();
        bytes[26..58].fill(0);
        bytes
    };
    assert_eq!(bytes("a.las"), bytes("c.las"));
    let told = write(&read, "scale = 0.5", "d.las").unwrap();
    assert!(told[0].as_str().unwrap().contains("were rounded"), "{told}");
    for wrong in ["offset = [nan, 0.0, 0.0]", "offset = [0.0, 0.0, inf]", "scale = 0.0"] {
        let error = write(&read, wrong, "e.las").unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Pipeline, "{wrong}: {error}");
    }
    assert!(
        write(&read, "drop = ['Intensity']", "e.las").unwrap_err().to_string().contains("drop")
    );
    assert!(!Path::new(&path("e.las")).exists());
}
