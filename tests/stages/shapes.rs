//! Normals by neighbours within a length, and what is told of their neighbourhoods, beside brute
//! force by another road.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use crate::support::runs::{Memory, Settings, run};
use crate::support::scan::Scan;
use pointmill::internals::morton_cmp;
use pointmill::point::{Position, distance2};
use pointmill::synth::Scene;

/// The nearest of all, in Morton order of equal ones, no farther than `within`.
fn nearest(all: &[Position], p: Position, k: usize, within: u128) -> Vec<Position> {
    let mut others: Vec<Position> = all.iter().copied().filter(|q| *q != p).collect();
    others.sort_by(|a, b| distance2(*a, p).cmp(&distance2(*b, p)).then(morton_cmp(a, b)));
    others.truncate(k);
    others.retain(|q| distance2(*q, p) <= within);
    others
}

/// Eigenvalues of the covariance of p and its neighbours, ascending, with the first eigenvector.
fn spread(p: Position, neighbors: &[Position]) -> ([f64; 3], Vector3<f64>) {
    let offset = |q: &Position| Vector3::from_fn(|axis, _| (q[axis] - p[axis]) as f64);
    let all: Vec<Vector3<f64>> = neighbors.iter().map(offset).chain([Vector3::zeros()]).collect();
    let count = all.len() as f64;
    let mean = all.iter().sum::<Vector3<f64>>() / count;
    let products = all.iter().map(|o| (o - mean) * (o - mean).transpose());
    let eigen = SymmetricEigen::new(products.sum::<Matrix3<f64>>() / count);
    let least = eigen.eigenvalues.imin();
    let mut values: [f64; 3] = eigen.eigenvalues.into();
    values.sort_by(f64::total_cmp);
    (values, eigen.eigenvectors.column(least).into_owned())
}

#[test]
fn normals_within_a_length_and_their_figures_are_those_of_brute_force() {
    let scan = Scan::synthetic(Scene::Part, 1500, 3);
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("scan.las");
    scan.write(&input);
    let step = scan.lattice().step;
    let stage = "[[stage]]\nkind = \"normals\"\nneighbors = 14\nmethod = \"pca\"\n\
        within = 6.5\ncurvature = true\nresidual = true\n";
    let write =
        "las\ndimensions = [\"NormalX\", \"NormalY\", \"NormalZ\", \"Curvature\", \"Residual\"]";
    let inputs = [input];
    let whole = run(folder.path(), &inputs, stage, write, Settings::PLAIN).unwrap();
    let bytes = whole.bytes();
    let cut = Settings {
        tile_points: Some(120),
        memory: Memory::Least(0),
        threads: 2,
        spill: "always",
        ..Settings::PLAIN
    };
    let cut = run(folder.path(), &inputs, stage, write, cut).unwrap();
    assert!(cut.count("tiles") > 5 && cut.bytes() == bytes, "tiles change nothing");
    let written = Scan::read(&cut.output, usize::MAX);
    let positions = written.positions();
    let mut all = positions.clone();
    all.sort_unstable();
    all.dedup();
    let within = (6.5 / step).powi(2) as u128;
    let (mut fewer, mut with) = (0, 0);
    for (i, &p) in positions.iter().enumerate() {
        let value = |name: &str| {
            let dimension = written.schema.find(name).unwrap();
            dimension.get(written.record(i), written.schema.endian).as_f64()
        };
        let neighbors = nearest(&all, p, 14, within);
        fewer += usize::from(neighbors.len() < 14);
        let (values, normal) = spread(p, &neighbors);
        if neighbors.len() < 2 || values[1] < 1e-6 * values[2] {
            assert!(value("NormalX").is_nan() == value("Curvature").is_nan());
            continue;
        }
        with += 1;
        let near = |found: f64, expected: f64, size: f64| {
            assert!((found - expected).abs() < 1e-5 * size, "{p:?}: {found}, not {expected}");
        };
        near(value("Curvature"), values[0] / values.iter().sum::<f64>(), 1.0);
        near(value("Residual"), values[0].max(0.0).sqrt() * step, values[2].sqrt() * step);
        if values[1] > 1.5 * values[0] {
            let found = Vector3::new(value("NormalX"), value("NormalY"), value("NormalZ"));
            near(found.dot(&normal).abs(), 1.0, 1.0);
        }
    }
    assert!(fewer > 50 && with > 1000, "{fewer} have fewer neighbours, {with} a normal");
}

#[test]
fn higher_degrees_follow_what_bends_and_say_where_they_cannot() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("ball.las");
    // A spiral from pole to pole, with the same area for each point.
    let ball = Scan::synthetic(Scene::Part, 4000, 1).moved(|i, _| {
        let (turn, z) = (2.399_963 * i as f64, 1.0 - (2.0 * i as f64 + 1.0) / 4000.0);
        let across = (1.0 - z * z).sqrt();
        [across * turn.cos(), across * turn.sin(), z].map(|c| (c * 500_000.0).round() as i32)
    });
    ball.write(&input);
    let write = "las\ndimensions = [\"NormalX\", \"NormalY\", \"NormalZ\", \"Residual\"]";
    let mut errors = Vec::new();
    for method in ["pca", "varady", "delaunay", "quadric", "cubic"] {
        let stage = format!(
            "[[stage]]\nkind = \"normals\"\nneighbors = 20\nmethod = \"{method}\"\nresidual = true\n"
        );
        let ran = run(folder.path(), std::slice::from_ref(&input), &stage, write, Settings::PLAIN)
            .unwrap();
        let written = Scan::read(&ran.output, usize::MAX);
        let value = |i: usize, name: &str| {
            let dimension = written.schema.find(name).unwrap();
            dimension.get(written.record(i), written.schema.endian).as_f64()
        };
        let center = [0, 1, 2].map(|axis| {
            let along: Vec<f64> =
                (0..written.points()).map(|i| value(i, ["X", "Y", "Z"][axis])).collect();
            (along.iter().copied().fold(f64::MAX, f64::min)
                + along.iter().copied().fold(f64::MIN, f64::max))
                / 2.0
        });
        let (mut squares, mut residuals) = (0.0, 0.0);
        for i in 0..written.points() {
            let away = Vector3::from_fn(|axis, _| value(i, ["X", "Y", "Z"][axis]) - center[axis]);
            let normal =
                Vector3::new(value(i, "NormalX"), value(i, "NormalY"), value(i, "NormalZ"));
            squares += normal.cross(&away.normalize()).norm_squared();
            residuals += value(i, "Residual").powi(2);
        }
        let rms = |sum: f64| (sum / written.points() as f64).sqrt();
        errors.push((method, rms(squares), rms(residuals)));
    }
    let of = |name: &str| errors.iter().find(|e| e.0 == name).unwrap();
    assert!(of("quadric").1 < of("pca").1 / 2.0, "{errors:?}");
    assert!(of("cubic").1 < of("pca").1 / 2.0, "{errors:?}");
    assert!(of("quadric").2 < of("varady").2 / 5.0, "{errors:?}");
    assert!(of("cubic").2 < of("quadric").2, "{errors:?}");
    assert!(of("delaunay").1 < 0.1, "{errors:?}");
    // On scan lines ten neighbours are in a row, which determines nothing across it; only the few
    // heights that there are do, where they span a plane with the row.
    let lines: Vec<[i32; 3]> = (0..900).map(|i| [10 * (i % 60), 5_000 * (i / 60), i % 7]).collect();
    let rows = ball.pick(&(0..900).collect::<Vec<_>>()).moved(|i, _| lines[i]);
    let input = folder.path().join("rows.las");
    rows.write(&input);
    let stage = "[[stage]]\nkind = \"normals\"\nmethod = \"quadric\"\n";
    let ran = run(folder.path(), &[input], stage, "las", Settings::PLAIN).unwrap();
    let counts = &ran.report.result.counts;
    let ill = counts.get("fallback_ill_conditioned").copied().unwrap_or(0);
    assert!((400..900).contains(&ill), "{counts:?}");
}

#[test]
fn too_few_neighbors_for_a_degree_are_refused_with_the_number_that_does() {
    for (method, neighbors, fewest) in [("quadric", 4, "5"), ("cubic", 8, "9")] {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join("scan.las");
        Scan::synthetic(Scene::Part, 50, 3).write(&input);
        let stage = format!(
            "[[stage]]\nkind = \"normals\"\nneighbors = {neighbors}\nmethod = \"{method}\"\n"
        );
        let error = run(folder.path(), &[input], &stage, "las", Settings::PLAIN).err().unwrap();
        let told = error.to_string();
        assert!(told.contains(method) && told.contains(&format!("{fewest} neighbours")), "{told}");
    }
}
