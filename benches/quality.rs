//! How true reductions are at an equal number of points: the published method, what `reduce` chooses by
//! itself, and a voxel grid. This is the table of docs/paper.md; `graded` beside other tools, and
//! docs/quality.md, are `bench/quality`.
//!
//! `POINTMILL_SCANS=folder cargo bench --bench quality` takes made scenes and real scans;
//! without the variable, the made ones; `cargo bench --bench quality -- SCAN.laz:10` that scan at 10 %.
//!
//! Judged apart from pointmill's own report: *error* is the distance of points of the scan to the
//! least-squares plane of their 8 nearest kept points (its noise included, which is equal for all), *gap*
//! the distance to the nearest kept point. Lengths are in the scan's unit.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints and may fail")]

use std::collections::HashSet;
use std::fmt::Write as _;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::Command;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use pointmill::internals::plane::smallest;
use pointmill::io::{las, ply};
use pointmill::point::PointBatch;
use serde_json::Value;

type Point = [f64; 3];

/// Kept points that a plane is fitted to.
const PLANE: usize = 8;
/// Points of a scan that are judged, about.
const JUDGED: usize = 50_000;

/// Real scans below `POINTMILL_SCANS`, each with percents to keep.
const REAL: [(&str, &[f64]); 4] = [
    ("cgal-data/points_3/building.ply", &[10.0]),
    ("big/huayllapata_1.06M.laz", &[10.0]),
    ("big/nc_grass_als.laz", &[5.0, 10.0]),
    ("big/marblemm_city_10M.laz", &[10.0]),
];

fn pointmill(arguments: &[&str]) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pointmill"));
    let outcome = command.args(arguments).arg("--quiet").output().unwrap();
    let told = String::from_utf8_lossy(&outcome.stderr);
    assert!(outcome.status.success(), "{arguments:?}: {told}");
}

/// A small generator (splitmix64).
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.uniform()
    }

    /// Nearly normal, of standard deviation 1.
    fn noise(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// Two roofs of 10 × 5 that meet in a ridge along x, noise 0.01.
fn gable(random: &mut Random) -> Point {
    let (along, across) = (random.between(0.0, 10.0), random.between(-5.0, 5.0));
    [along, across, 4.0 - 0.7 * across.abs() + 0.01 * random.noise()]
}

/// Two plates of 100 × 60 at a right angle with a fillet of radius 5 between, noise 0.02.
fn bracket(random: &mut Random) -> Point {
    let (radius, plate) = (5.0, 55.0);
    let arc = std::f64::consts::FRAC_PI_2 * radius;
    let (x, at) = (random.between(0.0, 100.0), random.between(0.0, 2.0 * plate + arc));
    let up = 0.02 * random.noise();
    if at < plate {
        [x, 60.0 - at, up]
    } else if at < plate + arc {
        let (sine, cosine) = ((at - plate) / radius).sin_cos();
        [x, radius - (radius - up) * sine, radius - (radius - up) * cosine]
    } else {
        [x, up, radius + at - plate - arc]
    }
}

fn write_ply(path: &Path, points: &[Point]) {
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double \
         y\nproperty double z\nend_header\n",
        points.len()
    )
    .into_bytes();
    points.iter().flatten().for_each(|v| bytes.extend(v.to_le_bytes()));
    std::fs::write(path, bytes).unwrap();
}

fn read(path: &Path) -> Vec<Point> {
    let paths = [path.to_owned()];
    let is_ply = path.extension().is_some_and(|e| e == "ply");
    let source = if is_ply { ply::open(&paths) } else { las::open(&paths) }.unwrap();
    let schema = source.schema().clone();
    let axes = schema.coordinates().unwrap();
    let mut batch = PointBatch::new(schema.clone(), 8192);
    let mut points = Vec::new();
    for i in 0..source.parts() {
        let mut part = source.part(i).unwrap();
        loop {
            part.read(&mut batch).unwrap();
            if batch.is_empty() {
                break;
            }
            let each = batch.records().chunks_exact(schema.stride);
            points.extend(each.map(|record| axes.map(|axis| axis.world(record, schema.endian))));
        }
    }
    points
}

/// The side of a grid with `count` occupied cubes, nearly.
fn grid_side(points: &[Point], count: usize) -> f64 {
    let cubes = |side: f64| {
        let cube = |p: &Point| p.map(|v| (v / side).floor() as i64);
        points.iter().map(cube).collect::<HashSet<[i64; 3]>>().len()
    };
    let (mut least, mut most) = (1e-4, 100.0);
    for _ in 0..20 {
        let middle = f64::sqrt(least * most);
        if cubes(middle) > count { least = middle } else { most = middle }
    }
    most
}

/// The root of the mean square, the 95th percentile and the largest of figures.
fn figures(mut all: Vec<f64>) -> [f64; 3] {
    all.sort_by(f64::total_cmp);
    let mean = all.iter().map(|v| v * v).sum::<f64>() / all.len() as f64;
    [mean.sqrt(), all[all.len() * 95 / 100], all[all.len() - 1]]
}

/// Distance to the least-squares plane of points.
fn off_plane(p: &Point, of: &[Point]) -> f64 {
    let count = of.len() as f64;
    let mean: Point = std::array::from_fn(|axis| of.iter().map(|q| q[axis]).sum::<f64>() / count);
    let mut matrix = [0.0; 6];
    for q in of {
        let [x, y, z]: Point = std::array::from_fn(|axis| q[axis] - mean[axis]);
        for (entry, product) in matrix.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
            *entry += product;
        }
    }
    let (_, normal) = smallest(matrix);
    (0..3).map(|axis| (p[axis] - mean[axis]) * normal[axis]).sum::<f64>().abs()
}

/// One line of the table: how true the points in `output` are to those of `scan`.
fn judge(method: &str, scan: &[Point], output: &Path, report: &Path) -> String {
    let kept = read(output);
    let tree: ImmutableKdTree<f64, 3> = ImmutableKdTree::new_from_slice(&kept);
    let (mut errors, mut gaps) = (Vec::new(), Vec::new());
    for p in scan.iter().step_by((scan.len() / JUDGED).max(1)) {
        let near = tree.nearest_n::<SquaredEuclidean>(p, NonZeroUsize::new(PLANE).unwrap());
        gaps.push(near[0].distance.sqrt());
        let near: Vec<Point> = near.iter().map(|n| kept[n.item as usize]).collect();
        errors.push(off_plane(p, &near));
    }
    let report: Value = serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap();
    let told = |at: &str| report["result"]["totals"].pointer(at).and_then(Value::as_f64);
    let short = |v: Option<f64>| v.map_or("–".to_owned(), |v| format!("{v:.4}"));
    let mut line = format!("| {method} | {} |", kept.len());
    let [gap, ..] = figures(gaps);
    for figure in figures(errors).into_iter().chain([gap]) {
        let _ = write!(line, " {figure:.4} |");
    }
    let deviation = ["rms", "p95", "max"].map(|name| told(&format!("/deviation/{name}")));
    let baseline = told("/baseline/rms");
    for figure in deviation.into_iter().chain([baseline]) {
        let _ = write!(line, " {} |", short(figure));
    }
    line
}

/// Reduces a scan to `percent` in three ways and prints a line for each.
fn compare(scan: &Path, percent: f64, folder: &Path) {
    let points = read(scan);
    let keep = (points.len() as f64 * percent / 100.0).round() as usize;
    let extension = scan.extension().unwrap().to_str().unwrap();
    let at = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let (output, report) = (at(&format!("out.{extension}")), at("out.json"));
    let name = scan.file_stem().unwrap().to_str().unwrap();
    println!("| **{name}**, {percent} % of {} | | | | | | | | | |", points.len());
    let (count, input) = (keep.to_string(), scan.to_str().unwrap());
    let reduce = ["reduce", input, "-o", &output, "--report", &report, "--keep", &count];
    for (method, more) in [("paper", &["--preset", "paper"][..]), ("reduce", &[])] {
        pointmill(&[&reduce, more].concat());
        println!("{}", judge(method, &points, output.as_ref(), report.as_ref()));
    }
    let side = grid_side(&points, keep);
    let pipeline = at("grid.toml");
    let text = format!(
        "[run]\nreport = {report:?}\n[[stage]]\nkind = 'read'\npath = {input:?}\n[[stage]]\nkind = \
         'normals'\n[[stage]]\nkind = 'grid'\nside = {side}\n[[stage]]\nkind = 'write'\npath = \
         {output:?}\n"
    );
    std::fs::write(&pipeline, text).unwrap();
    pointmill(&["run", &pipeline]);
    println!("{}", judge("grid", &points, output.as_ref(), report.as_ref()));
}

fn main() {
    // `cargo bench` passes `--bench` on.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut scans: Vec<(PathBuf, f64)> = Vec::new();
    for argument in &arguments {
        let (path, percent) = argument.rsplit_once(':').expect("SCAN:PERCENT");
        scans.push((path.into(), percent.parse().unwrap()));
    }
    if arguments.is_empty() {
        let mut random = Random(1);
        let roof: Vec<Point> = (0..200_000).map(|_| gable(&mut random)).collect();
        write_ply(&at("gable along x.ply"), &roof);
        let turned: Vec<Point> = roof.iter().map(|&[x, y, z]| [y, x, z]).collect();
        write_ply(&at("gable along y.ply"), &turned);
        let part: Vec<Point> = (0..200_000).map(|_| bracket(&mut random)).collect();
        write_ply(&at("bracket.ply"), &part);
        for (scene, points) in [("part", "300k"), ("als", "1M")] {
            let scan = at(&format!("{scene}.laz"));
            pointmill(&["synth", scene, "-n", points, "-o", scan.to_str().unwrap()]);
        }
        let made = [
            ("gable along x.ply", 2.0),
            ("gable along y.ply", 2.0),
            ("bracket.ply", 5.0),
            ("part.laz", 5.0),
            ("als.laz", 5.0),
            ("als.laz", 10.0),
        ];
        scans.extend(made.map(|(name, percent)| (at(name), percent)));
        if let Some(real) = std::env::var_os("POINTMILL_SCANS").map(PathBuf::from) {
            let each =
                REAL.iter().flat_map(|(name, percents)| percents.iter().map(|p| (*name, *p)));
            scans.extend(each.map(|(name, percent)| (real.join(name), percent)));
        }
    }
    println!(
        "| | points | error RMS | 95 % | max | gap RMS | deviation RMS | 95 % | max | baseline RMS |"
    );
    println!("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|");
    scans.iter().for_each(|(scan, percent)| compare(scan, *percent, folder.path()));
}
