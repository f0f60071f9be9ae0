//! `compare --normals`: the angle between the normals of points and of the nearest of another scan;
//! and rules on it and on depth images.

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use serde_json::Value;

use crate::support::command::{done, fails, pointmill};

/// A point and its normal.
type Oriented = ([f64; 3], [f64; 3]);

/// A PLY text of points with normals.
fn write(at: &Path, name: &str, points: &[Oriented]) {
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {}\n", points.len());
    for axis in ["x", "y", "z", "nx", "ny", "nz"] {
        writeln!(text, "property double {axis}").unwrap();
    }
    text += "end_header\n";
    for (p, n) in points {
        let row: Vec<String> = p.iter().chain(n).map(f64::to_string).collect();
        writeln!(text, "{}", row.join(" ")).unwrap();
    }
    fs::write(at.join(name), text).unwrap();
}

/// What is said of two scans as JSON.
fn normals(at: &Path, first: &str, second: &str, more: &[&str]) -> Value {
    let all = [&["compare", first, second, "--normals", "--json"], more].concat();
    let (code, told, error) = pointmill(at, &all);
    assert_eq!(code, 0, "{error}");
    let told: Value = serde_json::from_str(&told).unwrap();
    assert_eq!((&told["distances"], &told["depth"]), (&Value::Null, &Value::Null));
    told["normals"].clone()
}

/// Numbers below 1 that look random.
fn random(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
    (*seed >> 33) as f64 / (1u64 << 31) as f64
}

/// Points of a scan with normals of any length and side; one in 50 has none.
fn made(seed: u64, count: usize) -> Vec<Oriented> {
    let mut seed = seed;
    let mut next = || 2.0 * random(&mut seed) - 1.0;
    let mut all = Vec::new();
    for n in 0..count {
        let position = [100.0 * next(), 100.0 * next(), 4.0 * next()];
        let side = if next() < 0.0 { -1.0 } else { 1.0 };
        let normal = [next() / 4.0, next() / 4.0, 1.0 + next() / 4.0].map(|v| v * side);
        all.push((position, if n % 50 == 7 { [0.0; 3] } else { normal }));
    }
    all
}

/// Angles in degrees with the nearest, each with its point; how many are opposed or have none.
fn by_kiddo(from: &[Oriented], to: &[Oriented]) -> (Vec<(f64, [f64; 3])>, [u64; 2]) {
    let places: Vec<[f64; 3]> = to.iter().map(|(p, _)| *p).collect();
    let tree = ImmutableKdTree::<f64, 3>::new_from_slice(&places);
    let (mut angles, mut opposed, mut without) = (Vec::new(), 0, 0);
    for (p, n) in from {
        let (_, m) = to[tree.nearest_one::<SquaredEuclidean>(p).item as usize];
        let dot = |a: &[f64; 3], b: &[f64; 3]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let lengths = (dot(n, n) * dot(&m, &m)).sqrt();
        if lengths == 0.0 {
            without += 1;
            continue;
        }
        opposed += u64::from(dot(n, &m) < 0.0);
        angles.push(((dot(n, &m).abs() / lengths).min(1.0).acos() * 180.0 / PI, *p));
    }
    angles.sort_by(|a, b| a.0.total_cmp(&b.0));
    (angles, [opposed, without])
}

#[test]
fn angles_are_those_with_the_nearest_of_another_search() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scans = [made(1, 30_000), made(2, 7_000)];
    write(at, "a.ply", &scans[0]);
    write(at, "b.ply", &scans[1]);
    let all = normals(at, "a.ply", "b.ply", &[]);
    let few = ["--threads", "1", "--memory", "80MiB"];
    assert_eq!(normals(at, "a.ply", "b.ply", &few), all);
    for (direction, from, to) in [("first_to_second", 0, 1), ("second_to_first", 1, 0)] {
        let (angles, [opposed, without]) = by_kiddo(&scans[from], &scans[to]);
        let told = &all[direction];
        assert_eq!((&told["opposed"], &told["without"]), (&opposed.into(), &without.into()));
        assert!(opposed > 1000 && without > 100, "{told:#}");
        let figures = &told["angles_deg"];
        assert_eq!(figures["points"], angles.len());
        let count = angles.len() as f64;
        let mean = angles.iter().map(|(angle, _)| angle).sum::<f64>() / count;
        let squares = angles.iter().map(|(angle, _)| angle * angle).sum::<f64>();
        let (max, place) = angles.last().unwrap();
        let p95 = angles[(angles.len() * 95).div_ceil(100) - 1].0;
        let expected =
            [("mean", mean), ("rms", (squares / count).sqrt()), ("p95", p95), ("max", *max)];
        for (name, expected) in expected {
            let found = figures[name].as_f64().unwrap();
            let slack = if name == "p95" { 1.011 } else { 1.0 + 1e-5 };
            let is_right = found >= expected * (1.0 - 1e-5) && found <= expected * slack;
            assert!(is_right, "{direction} {name}: {found} {expected}");
        }
        let found: Vec<f64> = serde_json::from_value(figures["at"].clone()).unwrap();
        assert!(found.iter().zip(place).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?} {place:?}");
    }
}

/// A square grid of points; the normals are tilted by so many degrees, to one side and the other.
fn grid(degrees: f64, height: f64) -> Vec<Oriented> {
    let (sin, cos) = (degrees * PI / 180.0).sin_cos();
    let point = |n: usize| {
        let side = if n.is_multiple_of(2) { 1.0 } else { -1.0 };
        let place = [(n % 40) as f64, (n / 40) as f64, height];
        (place, [sin, 0.0, cos].map(|v| v * side))
    };
    (0..1600).map(point).collect()
}

#[test]
fn normals_of_any_format_are_compared_and_sides_counted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(at, "flat.ply", &grid(0.0, 0.0));
    write(at, "tilted.ply", &grid(10.0, 0.25));
    let one_side: Vec<Oriented> =
        grid(10.0, 0.25).iter().map(|(p, _)| (*p, [0.0, 0.0, 2.0])).collect();
    write(at, "up.ply", &one_side);
    for name in ["tilted.las", "tilted.pcd", "tilted.e57", "tilted.csv"] {
        let scale: &[&str] = if name.ends_with("las") { &["--scale", "0.01"] } else { &[] };
        let to = [&["convert", "tilted.ply", "-o", name, "--quiet"], scale].concat();
        done(at, &to);
    }
    for name in ["tilted.ply", "tilted.las", "tilted.pcd", "tilted.e57", "tilted.csv"] {
        let all = normals(at, "flat.ply", name, &[]);
        for direction in ["first_to_second", "second_to_first"] {
            let figures = &all[direction]["angles_deg"];
            let is_ten = |key: &str| (figures[key].as_f64().unwrap() - 10.0).abs() < 1e-4;
            assert!(is_ten("mean") && is_ten("rms") && is_ten("max"), "{name}: {all:#}");
            assert_eq!((&all[direction]["opposed"], &figures["points"]), (&0.into(), &1600.into()));
        }
    }
    let up = normals(at, "flat.ply", "up.ply", &[]);
    assert_eq!(up["first_to_second"]["opposed"], 800);
    assert_eq!(up["first_to_second"]["angles_deg"]["max"], 0.0);
    let said = done(at, &["compare", "flat.ply", "tilted.ply", "--normals"]);
    let line = "\nnormals    of 1,600 points of the first and the nearest of the second\n  \
                angles   mean 10.0°";
    assert!(said.contains(line) && said.contains("  sides    0 point to the other side"), "{said}");
}

#[test]
fn rules_are_on_angles_and_on_depth_images() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(at, "flat.ply", &grid(0.0, 0.0));
    write(at, "tilted.ply", &grid(10.0, 0.25));
    let judged = |rules: &str, code: i32| -> String {
        let all = ["compare", "flat.ply", "tilted.ply", "--accept", rules];
        let (found, said, error) = pointmill(at, &all);
        assert_eq!(found, code, "{said}{error}");
        said
    };
    let said = judged("normals.p95 <= 10.1deg, normals.max < 0.2, depth.rms <= 0.25", 0);
    assert!(said.contains("PASS  normals.p95 <= 10.1deg, and it is 10.0 deg"), "{said}");
    assert!(said.contains("PASS  depth.rms <= 0.25, and it is 0.250"), "{said}");
    let said = judged("normals.mean <= 9deg, depth.ssd <= 99, depth.ssd <= 101", 3);
    assert!(said.contains("FAIL  normals.mean <= 9deg, and it is 10.0 deg"), "{said}");
    assert!(
        said.contains("FAIL  depth.ssd <= 99, and it is 100") && said.contains("PASS"),
        "{said}"
    );
    done(at, &["convert", "flat.ply", "-o", "none.ply", "--drop", "NormalX", "--quiet"]);
    let told = ["none.ply: the scan has no normals (NormalX, NormalY and NormalZ)", "dimensions="];
    fails(at, &["compare", "flat.ply", "none.ply", "--normals"], 1, &told);
    let rule = ["compare", "flat.ply", "flat.ply", "--accept", "normals.p95 <= 5mm"];
    fails(at, &rule, 2, &["`normals.p95` is bounded by an angle above 0", "5deg"]);
}
