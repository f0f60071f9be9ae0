//! Nothing lost where there is next to nothing, all in one place, or a number beyond all bounds.

use std::path::{Path, PathBuf};

use crate::support::assert_holds;
use crate::support::random::Random;
use crate::support::records::{accounted, assert_contained, read, read_some};
use crate::support::setup::{Setup, convert, reduce};
use pointmill::ErrorKind;
use serde_json::json;

/// A text PLY of double coordinates and a number for each vertex.
fn points_file(path: &Path, points: &[[f64; 3]]) -> PathBuf {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\n\
         property double z\nproperty int number\nend_header\n",
        points.len()
    );
    for (i, [x, y, z]) in points.iter().enumerate() {
        text += &format!("{x:?} {y:?} {z:?} {i}\n").to_lowercase();
    }
    std::fs::write(path, text).unwrap();
    path.to_owned()
}

/// Reduces and converts points; both must balance and keep vertices of the input. The vertices that
/// the reduction kept.
fn both(points: &[[f64; 3]]) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let input = points_file(&folder.path().join("in.ply"), points);
    let output = folder.path().join("out.ply");
    let (schema, all) = read(&input);
    let count = points.len() as u64;
    let done = convert(std::slice::from_ref(&input), &output, &Setup::new(&[])).unwrap();
    assert!(accounted("converted", &done, &output, count) == all);
    let mut kept = Vec::new();
    for (threads, spill) in [(1, "auto"), (2, "always")] {
        let setup = Setup::new(&[("run.spill", json!(spill))]).threads(threads);
        let done = reduce(std::slice::from_ref(&input), &output, &setup).unwrap();
        let now = accounted("reduced", &done, &output, count);
        assert_contained("reduced", &now, &all, schema.stride);
        assert!(threads == 1 || now == kept, "threads and spill change what is kept");
        kept = now;
    }
    assert_holds(folder.path(), &["in.ply", "out.ply"]);
    kept
}

const STRIDE: usize = 28;

#[test]
fn no_point_one_and_two_points_are_scans() {
    assert_eq!(both(&[]).len(), 0);
    assert_eq!(both(&[[1.5, -2.0, 3.0]]).len(), STRIDE);
    assert_eq!(both(&[[0.0; 3], [1.0, 2.0, 3.0]]).len() % STRIDE, 0);
    assert!(!both(&[[0.0; 3], [1.0, 2.0, 3.0]]).is_empty());
    assert!(!both(&[[0.0, -0.0, 0.0], [-0.0, 0.0, 0.0]]).is_empty());
}

#[test]
fn points_in_one_place_are_one_position() {
    let kept = both(&vec![[12.25, -3.5, 1e6]; 5_000]);
    assert!(!kept.is_empty());
}

#[test]
fn points_on_a_line_and_on_an_axis_are_scans() {
    let line = |f: fn(f64) -> [f64; 3]| (0..3_000).map(|i| f(f64::from(i))).collect::<Vec<_>>();
    for points in [
        line(|t| [t, 0.0, 0.0]),
        line(|t| [0.0, 0.0, -t / 64.0]),
        line(|t| [t, 2.0 * t, 3.0 * t]),
        line(|t| [t / 3.0, t / 7.0, t / 11.0]),
        line(|t| [(t / 10.0).floor(), 0.0, 0.0]), // ten of each
    ] {
        assert!(!both(&points).is_empty());
    }
}

#[test]
fn a_scan_a_billion_wide_is_reduced() {
    let mut random = Random(5);
    let mut points: Vec<[f64; 3]> = Vec::new();
    for corner in [[1e9, 1e9, 1e9], [-1e9, 1e9, 0.0], [4.294e9, -4.294e9, 4.294e9]] {
        for _ in 0..400 {
            let near = |c: f64, random: &mut Random| c + random.below(1_000) as f64 / 8.0;
            points.push(corner.map(|c| near(c, &mut random)));
        }
    }
    assert!(!both(&points).is_empty());
}

#[test]
fn a_point_beyond_the_lattice_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.ply");
    for far in [4_294_967_296.0, -4_294_967_296.0, 1e300, -1e300, f64::MAX] {
        let input = points_file(&folder.path().join("in.ply"), &[[0.0; 3], [1.0, far, 2.0]]);
        for nonfinite in ["refuse", "drop"] {
            let setup = Setup::new(&[("run.nonfinite", json!(nonfinite))]);
            let error = reduce(std::slice::from_ref(&input), &output, &setup).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Data, "{error:?}");
            assert_eq!(error.path(), Some(input.as_path()));
            let told = error.to_string();
            assert!(told.contains(&format!("[1.0, {far:?}, 2.0]")), "{told}");
            assert!(told.contains("beyond the lattice"), "{told}");
            assert!(error.remedy().is_some_and(|help| help.contains("lattice")));
        }
        assert_holds(folder.path(), &["in.ply"]);
    }
    // A coarser lattice holds it.
    let input = points_file(&folder.path().join("in.ply"), &[[0.0; 3], [1.0, 4.3e9, 2.0]]);
    let setup = Setup::new(&[("run.lattice", json!(0.001))]);
    let done = reduce(std::slice::from_ref(&input), &output, &setup).unwrap();
    accounted("coarse", &done, &output, 2);
}

#[test]
fn what_is_not_finite_is_refused_and_named_or_dropped_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.ply");
    let (nan, inf) = (f64::NAN, f64::INFINITY);
    let bad = [[nan, 1.0, 2.0], [1.0, inf, 2.0], [1.0, 2.0, -inf], [nan, nan, nan]];
    let good: Vec<[f64; 3]> =
        (0..500).map(|i| [f64::from(i % 25), f64::from(i / 25), f64::from(i % 7)]).collect();
    for point in &bad {
        let input = points_file(&folder.path().join("in.ply"), &[&good[..], &[*point]].concat());
        let refused = reduce(std::slice::from_ref(&input), &output, &Setup::new(&[])).unwrap_err();
        assert_eq!((refused.kind(), refused.path()), (ErrorKind::Data, Some(input.as_path())));
        assert!(refused.to_string().contains(&format!("{point:?} is not finite")), "{refused}");
        assert!(refused.remedy().is_some_and(|help| help.contains("nonfinite = \"drop\"")));
        assert_holds(folder.path(), &["in.ply"]);
    }
    let input = points_file(&folder.path().join("in.ply"), &[&bad[..], &good[..]].concat());
    let all = read(&input).1;
    let drop = Setup::new(&[("run.nonfinite", json!("drop"))]);
    let converted = convert(std::slice::from_ref(&input), &output, &drop).unwrap();
    let kept = accounted("converted", &converted, &output, 504);
    assert!(kept == all[4 * STRIDE..], "the others, in their order");
    let reduced = reduce(std::slice::from_ref(&input), &output, &drop).unwrap();
    let kept = accounted("reduced", &reduced, &output, 504);
    assert_contained("reduced", &kept, &all[4 * STRIDE..], STRIDE);
    for done in [&converted, &reduced] {
        let removed = &done.report.result.ledger.removed;
        let entry = removed.iter().find(|r| r.stage == "read").expect("an entry of the source");
        assert_eq!((entry.reason.as_str(), entry.records), ("not finite", 4));
    }
    // Nothing but points that are not finite.
    let input = points_file(&folder.path().join("in.ply"), &bad);
    let done = reduce(std::slice::from_ref(&input), &output, &drop).unwrap();
    assert_eq!(accounted("none left", &done, &output, 4).len(), 0);
    // A conversion copies them: no position is asked for.
    let done = convert(std::slice::from_ref(&input), &output, &Setup::new(&[])).unwrap();
    assert!(accounted("copied", &done, &output, 4) == read_some(&[input], 10).unwrap().1);
}
