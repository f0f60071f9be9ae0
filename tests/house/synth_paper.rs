//! The paper's experiment, done again: its tables beside ours in docs/paper.md, and what the
//! uniform pattern does to neighbourhoods.
//!
//! `POINTMILL_WRITE_DOCS=1 cargo test --test repository` writes the table again.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use pointmill::point::{PointBatch, names};
use pointmill::stage::OpenSource;
use pointmill::synth::{Scene, Synthetic};
use pointmill::{Overrides, Quiet};
use serde_json::Value;

use crate::support::case::execute;

const SAYS_SO: &str =
    "written by `POINTMILL_WRITE_DOCS=1 cargo test --test repository`; do not edit";
const END: &str = "<!-- end of the table -->";

/// A row of the paper's tables I and III.
struct Printed {
    scene: Scene,
    points: u64,
    kept: &'static str,
    rms: &'static str,
}

/// The tables as printed.
fn printed() -> [Printed; 6] {
    let row = |scene, points, kept, rms| Printed { scene, points, kept, rms };
    use Scene::{SquaresRandom, SquaresUniform};
    [
        row(SquaresRandom, 500, "430", "0.761 → 0.521"),
        row(SquaresRandom, 2100, "1820", "0.896 → 0.630"),
        row(SquaresRandom, 5500, "5012", "1.89 → 0.932"),
        row(SquaresUniform, 500, "492 (text: 429)", "0.855 → 0.567"),
        row(SquaresUniform, 2100, "2062", "0.923 → 0.698"),
        row(SquaresUniform, 5500, "5446", "1.982 → 0.997"),
    ]
}

/// What a reduction of degree 1 left.
struct Reduced {
    kept: u64,
    /// Of the plane fitted to all points, before and after.
    rms: [f64; 2],
    /// RMS of the distances of removed points to the plane of the one that stands for them.
    deviation: f64,
    no_normal: u64,
}

fn reduce(folder: &Path, scene: Scene, points: u64, noise: f64, neighbors: u64) -> Reduced {
    let report = folder.join("report.json");
    let text = format!(
        "[run]\nreport = '{}'\nmemory = '256MiB'\nthreads = 1\n\
         [[stage]]\nkind = 'synth'\nscene = '{scene}'\npoints = {points}\nnoise = {noise:?}\n\
         [[stage]]\nkind = 'normals'\nneighbors = {neighbors}\n\
         [[stage]]\nkind = 'cells'\n[[stage]]\nkind = 'median'\n\
         [[stage]]\nkind = 'write'\npath = '{}'\n",
        report.display(),
        folder.join("reduced.las").display()
    );
    execute(&text, &Overrides::default(), &Quiet).unwrap();
    let report: Value = serde_json::from_slice(&fs::read(report).unwrap()).unwrap();
    let result = &report["result"];
    assert_eq!(result["ledger"]["read"], points);
    let number = |path: &str| result.pointer(path).and_then(Value::as_f64).unwrap();
    let count = |path: &str| result.pointer(path).and_then(Value::as_u64).unwrap();
    Reduced {
        kept: count("/ledger/kept"),
        rms: ["before", "after"].map(|when| number(&format!("/totals/scan_plane/{when}/rms"))),
        deviation: number("/totals/deviation/rms"),
        no_normal: count("/counts/no_normal"),
    }
}

fn table(folder: &Path) -> String {
    let mut out = format!(
        "<!-- {SAYS_SO} -->\n\n\
         | pattern | points | paper: after | RMS | noise 0.1: after | RMS | deviation \
         | noise 1: after | RMS | deviation |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n"
    );
    for Printed { scene, points, kept, rms } in printed() {
        let pattern = scene.name().trim_start_matches("squares-");
        let _ = write!(out, "| {pattern} | {points} | {kept} | {rms} |");
        for noise in [0.1, 1.0] {
            let Reduced { kept, rms: [before, after], deviation, .. } =
                reduce(folder, scene, points, noise, 10);
            assert!(kept > 10 && kept < points, "{scene} {points} {noise}: {kept}");
            let _ = write!(out, " {kept} | {before:.3} → {after:.3} | {deviation:.2} |");
        }
        out.push('\n');
    }
    out.push('\n');
    out
}

fn page() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("docs/paper.md")
}

#[test]
fn the_paper_page_has_the_table_that_the_experiment_gives() {
    let folder = tempfile::tempdir().unwrap();
    let table = table(folder.path());
    let page = fs::read_to_string(self::page()).unwrap();
    let start = page.find("<!-- written by").expect("the page says where the table begins");
    let end = start + page[start..].find(END).expect("the page says where the table ends");
    if std::env::var_os("POINTMILL_WRITE_DOCS").is_some() {
        fs::write(self::page(), format!("{}{table}{}", &page[..start], &page[end..])).unwrap();
        return;
    }
    let found = &page[start..end];
    assert!(found == table, "docs/paper.md has\n{found}and the experiment gives\n{table}{SAYS_SO}");
}

/// World coordinates of the points of a scan.
fn positions(scan: &Synthetic) -> Vec<[f64; 3]> {
    let source = scan.open().unwrap();
    let schema = source.schema().clone();
    let mut batch = PointBatch::new(schema.clone(), scan.points as usize);
    source.part(0).unwrap().read(&mut batch).unwrap();
    assert_eq!(batch.len() as u64, scan.points);
    let axes = names::XYZ.map(|name| schema.find(name).unwrap());
    batch.iter().map(|record| axes.map(|axis| axis.world(record, schema.endian))).collect()
}

/// Share of the points whose `k` nearest others all lie in their own row.
fn in_one_row(points: &[[f64; 3]], k: usize) -> f64 {
    let square = |a: [f64; 3], b: [f64; 3]| {
        (0..3).map(|axis| (a[axis] - b[axis]) * (a[axis] - b[axis])).sum::<f64>()
    };
    let alone = |&&p: &&[f64; 3]| {
        let mut others: Vec<[f64; 3]> = points.iter().copied().filter(|&q| q != p).collect();
        others.select_nth_unstable_by(k - 1, |a, b| square(p, *a).total_cmp(&square(p, *b)));
        others[..k].iter().all(|q| q[1] == p[1])
    };
    points.iter().filter(alone).count() as f64 / points.len() as f64
}

#[test]
fn ten_neighbours_of_many_uniform_squares_lie_in_one_row_and_forty_do_not() {
    let scan =
        |scene| Synthetic { scene, points: 5500, seed: 0, noise: None, ..Synthetic::default() };
    let uniform = positions(&scan(Scene::SquaresUniform));
    assert!(in_one_row(&uniform, 10) > 0.99);
    assert_eq!(in_one_row(&uniform, 40), 0.0);
    assert_eq!(in_one_row(&positions(&scan(Scene::SquaresRandom)), 10), 0.0);
}

#[test]
fn a_row_has_no_normal_without_noise_and_a_wrong_one_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let uniform = |noise, k| reduce(folder.path(), Scene::SquaresUniform, 5500, noise, k);
    let exact = uniform(0.0, 10);
    assert!(exact.no_normal > 4000 && exact.kept > exact.no_normal, "{}", exact.no_normal);
    let [noisy, wide] = [uniform(0.1, 10), uniform(0.1, 40)];
    assert!(noisy.no_normal == 0 && wide.no_normal == 0);
    // More than the dome is high, against a few times the noise.
    assert!(
        noisy.deviation > 6.0 && wide.deviation < 0.4,
        "{} {}",
        noisy.deviation,
        wide.deviation
    );
}
