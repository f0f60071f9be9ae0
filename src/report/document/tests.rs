//! The report as a file and as a table.

use std::collections::BTreeMap;
use std::io::{BufReader, ErrorKind};
use std::path::Path;

use serde_json::{Value, json};

use super::super::{
    BaselineFigures, ClassFigures, DeviationFigures, DeviationTotals, Ledger, Machine, Pair,
    PlaneFigures, Tally, TileFigures, Totals,
};
use super::*;

fn plane(rms: f64) -> Pair<Option<PlaneFigures>> {
    Pair { before: Some(PlaneFigures { rms, mean: rms / 2.0 }), after: None }
}

fn tile(x: f64) -> TileFigures {
    let deviation = DeviationFigures { points: 9, rms: 0.1, max: 0.30000000000000004, at: [x; 3] };
    TileFigures {
        corner: [x, -0.1, 1e22],
        points: Pair { before: 10, after: 1 },
        plane: plane(0.01),
        deviation: Some(deviation),
    }
}

fn report(tiles: u64) -> Report {
    let mut tally = Tally::default();
    tally.remove("median", "represented", 1_187_655);
    let totals = Totals {
        tiles,
        points: Pair { before: 2_000_000, after: 812_345 },
        tile_plane: plane(0.0123),
        scan_plane: Pair { after: plane(4.5).before, ..plane(4.0) },
        deviation: Some(DeviationTotals {
            points: 1_187_655,
            rms: 0.004,
            p50: 0.003,
            p95: 0.009,
            p99: 0.02,
            max: 0.08,
            at: [1.5, 2.5, 3.25],
        }),
        baseline: Some(BaselineFigures {
            side: 0.25,
            points: 9_000,
            rms: 0.005,
            p50: 0.004,
            p95: 0.0123,
            p99: 0.02,
        }),
    };
    let result = Outcome {
        pipeline: json!({"stage": [{"kind": "read", "path": ["line\n,\n\"run\": "]}]}),
        lattice: Some(LatticeFigures { step: 0.001, shift: [0.0, 0.0, 0.0005] }),
        ledger: Ledger::new(2_000_000, 812_345, &tally),
        decisions: vec![Decision {
            stage: "cells".into(),
            name: "side".into(),
            value: json!(0.128),
        }],
        counts: BTreeMap::from([("cells".into(), 812_300), ("coincident".into(), 4)]),
        tile_side: Some(4.096),
        totals: Some(totals),
        stats: Vec::new(),
        deviations: vec![DeviationBin { to: 0.125, points: 1_187_655 }],
        accept: None,
        passes: Vec::new(),
        classes: vec![
            ClassFigures { class: 2, before: 1_500_000, after: 75_000 },
            ClassFigures { class: 5, before: 499_000, after: 49_900 },
            ClassFigures { class: 65, before: 1_000, after: 1_000 },
        ],
    };
    Report { result, further: Vec::new(), run: run_figures() }
}

fn run_figures() -> RunFigures {
    RunFigures {
        version: "0.1.0".into(),
        inputs: vec![FileFigures::of("a.laz".as_ref(), 2_000_000, Some(12))],
        machine: Machine { system: "linux x86_64".into(), processor: None, cores: 2 },
        threads: 2,
        memory_bytes: 256 << 20,
        peak_memory_bytes: Some(231 << 20),
        spill_bytes: 3 << 29,
        seconds: 12.34,
        phases: vec![
            Phase { name: "decode".into(), seconds: 4.1 },
            Phase { name: "mill".into(), seconds: 8.2 },
        ],
        ..RunFigures::default()
    }
}

fn lines(tiles: &[TileFigures]) -> Vec<u8> {
    let mut lines = Vec::new();
    tiles.iter().for_each(|tile| tile.write_line(&mut lines).unwrap());
    lines
}

fn written(report: &Report, lines: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    report.write(&mut out, [lines]).unwrap();
    out
}

#[test]
fn a_report_is_json_with_result_before_run_and_tiles_in_order() {
    let lines = lines(&[tile(1.0), tile(2.0), tile(3.0)]);
    let text = written(&report(3), &lines);
    let value: Value = serde_json::from_slice(&text).unwrap();
    assert_eq!(value["result"]["ledger"]["removed"][0]["records"], 1_187_655);
    assert_eq!(value["result"]["totals"]["deviation"]["p95"], 0.009);
    assert_eq!(value["result"]["lattice"], json!({"step": 0.001, "shift": [0.0, 0.0, 0.0005]}));
    assert_eq!(value["run"]["peak_memory_bytes"], 231u64 << 20);
    let tiles = value["result"]["tiles"].as_array().unwrap();
    assert_eq!(tiles.len(), 3);
    for (i, tile) in tiles.iter().enumerate() {
        assert_eq!(tile["corner"], json!([i as f64 + 1.0, -0.1, 1e22]));
        assert_eq!(tile["plane"]["after"], Value::Null);
    }
    let text = String::from_utf8(text).unwrap();
    let keys = [
        "pipeline",
        "lattice",
        "ledger",
        "decisions",
        "counts",
        "totals",
        "classes",
        "tile_side",
        "tiles",
    ];
    let places: Vec<usize> =
        keys.iter().map(|key| text.find(&format!("\n\"{key}\": ")).unwrap()).collect();
    assert!(places.is_sorted(), "{places:?}");
    assert!(text.contains("0.30000000000000004"), "shortest form that reads back");
}

#[test]
fn result_is_the_same_bytes_whatever_the_run_and_the_buffers() {
    let lines = lines(&[tile(1.0), tile(2.0)]);
    let one = report(2);
    let mut other = report(2);
    other.run =
        RunFigures { threads: 64, warnings: vec!["odd header".into()], ..Default::default() };
    let (a, b) = (written(&one, &lines), written(&other, &lines));
    assert_ne!(a, b);
    let result = result_bytes(&a).unwrap();
    assert_eq!(Some(result), result_bytes(&b));
    let mut slow = BufReader::with_capacity(7, &lines[..]);
    let mut alone = Vec::new();
    one.result.write(&mut alone, &mut slow).unwrap();
    assert_eq!(alone, result);
    let value: Value = serde_json::from_slice(result).unwrap();
    assert_eq!(value["tiles"].as_array().unwrap().len(), 2);
    assert_eq!(result_bytes(b"{}"), None);
}

#[test]
fn a_lost_tile_is_an_error() {
    let lines = lines(&[tile(1.0)]);
    let error = report(2).write(&mut Vec::new(), [&lines[..]]).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::InvalidData);
    assert_eq!(error.to_string(), "1 report tiles instead of 2");
}

#[test]
fn a_streamed_run_has_no_tiles_and_no_totals() {
    let mut streamed = report(0);
    streamed.result.totals = None;
    streamed.result.lattice = None;
    streamed.result.tile_side = None;
    let value: Value = serde_json::from_slice(&written(&streamed, b"")).unwrap();
    assert_eq!(value["result"]["tiles"], json!([]));
    assert_eq!(value["result"]["totals"], Value::Null);
    assert_eq!(value["result"]["lattice"], Value::Null);
    let table = streamed.table(None).to_string();
    assert!(table.starts_with("points     2,000,000 in, 812,345 out (40.6 %)\n"), "{table}");
    assert!(!table.contains("plane") && !table.contains("report"), "{table}");
}

#[test]
fn the_table_says_in_a_few_lines_what_matters() {
    let table = report(1).table(Some(Path::new("reduced.json"))).to_string();
    let expected = "\
points     2,000,000 in, 812,345 out (40.6 %)
classes    2 ground           1,500,000 → 75,000 (5.0 %)
           5 high vegetation  499,000 → 49,900 (10.0 %)
           65                 1,000 → 1,000 (100.0 %)
cells      812,300
deviation  RMS 0.00400, 95 % ≤ 0.00900, max 0.0800 at (1.5, 2.5, 3.25)
baseline   RMS 0.00500, 95 % ≤ 0.0123: a voxel grid of as many points, cubes of 0.250
plane RMS  in tiles 0.0123
           whole scan 4.00 → 4.50
           (points stay where the surface bends: those lie farther from one plane)
memory     231 MiB at most, budget 256 MiB
time       12.3 s: decode 4.1, mill 8.2
spill      1.5 GiB
report     reduced.json
";
    assert_eq!(table, expected);
}

#[test]
fn lines_become_an_array_whatever_the_buffer() {
    let lines = b"{\"a\":1}\n{\"b\":[2,3]}\n\n{}\n";
    for capacity in 1..30 {
        let mut out = Vec::new();
        let n = copy_lines(&mut out, &mut BufReader::with_capacity(capacity, &lines[..]));
        assert_eq!(n.unwrap(), 3);
        assert_eq!(out, b"[\n{\"a\":1},\n{\"b\":[2,3]},\n{}\n]");
    }
    let mut out = Vec::new();
    assert_eq!(copy_lines(&mut out, &mut &b""[..]).unwrap(), 0);
    assert_eq!(out, b"[]");
}
