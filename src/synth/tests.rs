use super::synthetic::{MOST_POINTS, PART_POINTS};
use super::*;
use crate::io::las;
use crate::io::las::sink::{LasOptions, create};
use crate::point::{PointBatch, names};
use crate::stage::{OpenSource, Source};

fn synthetic(scene: Scene, points: u64) -> Synthetic {
    Synthetic { scene, points, seed: 7, noise: None, ..Synthetic::default() }
}

/// All records, part after part, by batches of `capacity`.
fn records(scan: &Synthetic, capacity: usize) -> Vec<u8> {
    let source = scan.open().unwrap();
    (0..source.parts()).flat_map(|part| records_of(&*source, part, capacity)).collect()
}

fn records_of(source: &dyn Source, part: usize, capacity: usize) -> Vec<u8> {
    let mut part = source.part(part).unwrap();
    let mut batch = PointBatch::new(source.schema().clone(), capacity);
    let mut all = Vec::new();
    loop {
        part.read(&mut batch).unwrap();
        if batch.is_empty() {
            return all;
        }
        all.extend_from_slice(batch.records());
    }
}

/// The values of a field over all records of a scan.
fn values(scan: &Synthetic, name: &str) -> Vec<f64> {
    let schema = scan.open().unwrap().schema().clone();
    let field = schema.find(name).unwrap();
    let bytes = records(scan, 1000);
    bytes.chunks_exact(schema.stride).map(|r| field.world(r, schema.endian)).collect()
}

fn positions(scan: &Synthetic) -> Vec<[f64; 3]> {
    let [x, y, z] = names::XYZ.map(|name| values(scan, name));
    (0..x.len()).map(|i| [x[i], y[i], z[i]]).collect()
}

fn range(values: &[f64]) -> f64 {
    values.iter().fold(f64::MIN, |a, &b| a.max(b)) - values.iter().fold(f64::MAX, |a, &b| a.min(b))
}

#[test]
fn batches_and_the_order_of_parts_change_no_byte() {
    for scene in Scene::ALL {
        let scan = synthetic(scene, 150_001);
        let whole = records(&scan, 1 << 20);
        assert_eq!(whole.len(), 150_001 * record::STRIDE);
        for capacity in [1, 7, 4096] {
            assert!(records(&scan, capacity) == whole, "{scene} by {capacity}");
        }
        let source = scan.open().unwrap();
        assert_eq!(source.parts(), 3);
        let mut parts = vec![Vec::new(); 3];
        for part in [2, 0, 1] {
            parts[part] = records_of(&*source, part, 999);
        }
        assert!(parts.concat() == whole, "{scene} by parts");
    }
}

#[test]
fn the_bytes_of_a_scan_are_these_on_every_machine() {
    let expected = [
        (Scene::Plane, 0x667c_3176_e004_fa44),
        (Scene::Part, 0xf6bc_252e_92a1_a60a),
        (Scene::Als, 0xa789_88e3_67b1_06a8),
        (Scene::Sphere, 0x4644_6370_670c_040e),
        (Scene::SquaresRandom, 0x6ec6_0273_16ac_8130),
        (Scene::SquaresUniform, 0xecd4_cb90_a473_5cba),
    ];
    for (scene, hash) in expected {
        // FNV-1a
        let found = records(&synthetic(scene, 70_000), 512)
            .iter()
            .fold(0xcbf2_9ce4_8422_2325u64, |h, &b| {
                (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3)
            });
        assert_eq!(found, hash, "{scene}: {found:#x}");
    }
}

#[test]
fn another_seed_is_another_scan() {
    for scene in Scene::ALL {
        let one = synthetic(scene, 1000);
        let other = Synthetic { seed: 8, ..one.clone() };
        assert!(records(&one, 100) != records(&other, 100), "{scene}");
    }
}

#[test]
fn scans_of_no_one_and_seven_points_work() {
    for scene in Scene::ALL {
        for points in [0, 1, 7] {
            let scan = synthetic(scene, points);
            assert_eq!(scan.open().unwrap().points(), points);
            assert_eq!(records(&scan, 3).len() as u64, points * record::STRIDE as u64);
            assert!(positions(&scan).as_flattened().iter().all(|v| v.is_finite()));
        }
    }
}

#[test]
fn the_largest_scan_opens_at_once_and_fits_its_coordinates() {
    for scene in Scene::ALL {
        let source = synthetic(scene, MOST_POINTS).open().unwrap();
        assert_eq!(source.points(), MOST_POINTS);
        assert_eq!(source.parts() as u64, MOST_POINTS.div_ceil(PART_POINTS));
        let schema = source.schema();
        for part in [0, source.parts() / 2, source.parts() - 1] {
            let bytes = records_of(&*source, part, 1 << 16);
            for name in names::XYZ {
                let field = schema.find(name).unwrap();
                for record in bytes.chunks_exact(schema.stride) {
                    let stored = field.get(record, schema.endian).as_f64();
                    assert!(stored.abs() < 2.1e9, "{scene} {name} {stored}");
                }
            }
        }
    }
}

#[test]
fn too_many_points_and_impossible_noise_are_refused() {
    assert!(synthetic(Scene::Plane, MOST_POINTS + 1).open().is_err());
    for noise in [-0.1, f64::NAN, f64::INFINITY, 1000.1] {
        let scan = Synthetic { noise: Some(noise), ..synthetic(Scene::Part, 10) };
        assert_eq!(scan.open().err().unwrap().kind(), crate::ErrorKind::Pipeline, "{noise}");
    }
}

#[test]
fn a_scene_is_known_by_its_name() {
    for scene in Scene::ALL {
        assert_eq!(scene.to_string().parse::<Scene>().unwrap(), scene);
        let quoted = format!("\"{scene}\"");
        assert_eq!(serde_json::from_str::<Scene>(&quoted).unwrap(), scene);
    }
    let error = "Plane".parse::<Scene>().unwrap_err();
    assert_eq!(
        error.remedy(),
        Some("the scenes are plane, part, sphere, squares-random, squares-uniform, als")
    );
}

#[test]
fn points_of_the_plane_are_as_far_from_it_as_the_noise() {
    let scan = Synthetic { noise: Some(0.05), ..synthetic(Scene::Plane, 40_000) };
    let points = positions(&scan);
    let square: f64 = points.iter().map(|&p| Scene::Plane.truth(p).unwrap().distance.powi(2)).sum();
    let rms = (square / points.len() as f64).sqrt();
    assert!((rms - 0.05).abs() < 0.001, "{rms}");
    let [x, y] = [0, 1].map(|axis| range(&points.iter().map(|p| p[axis]).collect::<Vec<_>>()));
    let density = 40_000.0 / (x * y);
    assert!((density / 400.0 - 1.0).abs() < 0.2, "{density}");
}

#[test]
fn points_of_the_part_are_on_its_surface() {
    let exact = Synthetic { noise: Some(0.0), ..synthetic(Scene::Part, 50_000) };
    for p in positions(&exact) {
        assert!(Scene::Part.truth(p).unwrap().distance < 2e-5, "{p:?}");
    }
    let noisy = synthetic(Scene::Part, 50_000);
    let points = positions(&noisy);
    let mean = points.iter().map(|&p| Scene::Part.truth(p).unwrap().distance).sum::<f64>()
        / points.len() as f64;
    // The mean of |N(0, σ)| is 0.798 σ; a little less, since edges are near two faces.
    assert!((0.7..0.82).contains(&(mean / 0.02)), "{mean}");
    for p in points {
        assert!(Scene::Part.truth(p).unwrap().distance < 6.0 * 0.02, "{p:?}");
    }
}

#[test]
fn the_part_is_seen_evenly_from_all_sides() {
    let scan = synthetic(Scene::Part, 200_000);
    let mut counts = [0u32; 11];
    values(&scan, names::USER_DATA).iter().for_each(|&face| counts[face as usize] += 1);
    // Sides of 120 × 30 and 80 × 30, holes of 12 π × 30: their counts are as their areas.
    let area = 120.0 * 30.0;
    let density = f64::from(counts[4]) / area;
    for (face, area) in [(2, 2400.0), (3, 2400.0), (5, area), (7, 1130.97), (10, 1130.97)] {
        let found = f64::from(counts[face]) / area;
        assert!((found / density - 1.0).abs() < 0.06, "face {face}: {found} and {density}");
    }
    let dome = f64::from(counts[6]) / (2.0 * std::f64::consts::PI * 26.0 * 16.0);
    assert!((dome / density - 1.0).abs() < 0.06, "{dome} and {density}");
}

#[test]
fn normals_of_the_part_point_out_of_it() {
    let scan = Synthetic { noise: Some(0.0), ..synthetic(Scene::Part, 5_000) };
    for p in positions(&scan) {
        let truth = Scene::Part.truth(p).unwrap();
        let length: f64 = truth.normal.iter().map(|v| v * v).sum::<f64>().sqrt();
        assert!((length - 1.0).abs() < 1e-9);
        // A step outward leaves the surface by the length of the step, unless an edge is near.
        let out = std::array::from_fn(|axis| p[axis] + 0.01 * truth.normal[axis]);
        assert!(Scene::Part.truth(out).unwrap().distance <= 0.01 + 2e-5);
    }
    let up = Scene::Part.truth([40.0, 0.0, 30.01]).unwrap();
    assert_eq!(up.normal, [0.0, 0.0, 1.0]);
    let into_hole = Scene::Part.truth([45.0 + 5.9, 25.0, 15.0]).unwrap();
    assert_eq!(into_hole.normal, [-1.0, 0.0, 0.0]);
}

#[test]
fn points_of_the_sphere_are_off_it_along_its_normals_alone() {
    let exact = Synthetic { noise: Some(0.0), ..synthetic(Scene::Sphere, 50_000) };
    let noisy = Synthetic { noise: Some(0.5), ..exact.clone() };
    let mut square = 0.0;
    for (p, q) in positions(&exact).into_iter().zip(positions(&noisy)) {
        let [on, off] = [p, q].map(|p| Scene::Sphere.truth(p).unwrap());
        assert!(on.distance < 1e-5, "{p:?}");
        let apart = (0..3).map(|axis| (on.normal[axis] - off.normal[axis]).abs()).sum::<f64>();
        assert!(apart < 1e-6, "{p:?} and {q:?} have one normal");
        square += off.distance * off.distance;
    }
    let rms = (square / 50_000.0f64).sqrt();
    assert!((rms - 0.5).abs() < 0.01, "{rms}");
    assert_eq!(Scene::Sphere.truth([0.0; 3]).unwrap().distance, 50.0);
}

#[test]
fn the_sphere_is_even_by_area() {
    let scan = synthetic(Scene::Sphere, 80_000);
    let mut octants = [0u32; 8];
    values(&scan, names::USER_DATA).iter().for_each(|&octant| octants[octant as usize] += 1);
    assert!(octants.iter().all(|&n| n.abs_diff(10_000) < 500), "{octants:?}");
    // Slices of equal height have equal areas, along every axis.
    for name in names::XYZ {
        let mut slices = [0u32; 10];
        for v in values(&scan, name) {
            slices[((v / 50.0 + 1.0) * 5.0).clamp(0.0, 9.0) as usize] += 1;
        }
        assert!(slices.iter().all(|&n| n.abs_diff(8_000) < 450), "{name}: {slices:?}");
    }
}

#[test]
fn points_of_squares_are_off_the_relief_in_depth_alone() {
    for scene in [Scene::SquaresRandom, Scene::SquaresUniform] {
        let exact = Synthetic { noise: Some(0.0), ..synthetic(scene, 20_000) };
        let noisy = Synthetic { noise: Some(0.3), ..exact.clone() };
        let faces = values(&exact, names::USER_DATA);
        let (mut square, mut seen) = (0.0, [0u32; 3]);
        for ((p, q), face) in positions(&exact).into_iter().zip(positions(&noisy)).zip(faces) {
            assert!(scene.truth(p).unwrap().distance < 1e-4, "{scene} {p:?}");
            assert_eq!(p[..2], q[..2], "{scene}");
            square += (p[2] - q[2]) * (p[2] - q[2]);
            seen[face as usize] += 1;
            let up = scene.truth(p).unwrap().normal[2];
            // The normals of the plane, of the slope, and of the dome down to its foot.
            let least = [1.0, 0.9922, 72.0 / 78.0][face as usize];
            assert!(up > least - 1e-4, "{scene} {p:?} on face {face}: {up}");
        }
        let rms = (square / 20_000.0f64).sqrt();
        assert!((rms - 0.3).abs() < 0.006, "{scene}: {rms}");
        // A third behind the edge; the dome's foot is 2827 of 19,200 square millimetres.
        assert!((6_200..7_200).contains(&seen[1]), "{scene}: {seen:?}");
        assert!((2_600..3_300).contains(&seen[2]), "{scene}: {seen:?}");
    }
}

#[test]
fn random_squares_cover_the_window() {
    let scan = synthetic(Scene::SquaresRandom, 5_500);
    let [x, y] = [names::XYZ[0], names::XYZ[1]].map(|name| values(&scan, name));
    // Centres of whole squares: 30 pixels, 3 mm, off the window's sides.
    assert!(x.iter().all(|v| (3.0..=117.0).contains(v)) && range(&x) > 113.5);
    assert!(y.iter().all(|v| (3.0..=157.0).contains(v)) && range(&y) > 153.5);
    let mut fields = [0u32; 100];
    for (x, y) in x.iter().zip(&y) {
        let [column, row] =
            [(x - 3.0) / 11.4, (y - 3.0) / 15.4].map(|v| v.clamp(0.0, 9.0) as usize);
        fields[10 * row + column] += 1;
    }
    assert!(fields.iter().all(|&n| (25..90).contains(&n)), "{fields:?}");
}

#[test]
fn uniform_squares_are_60_pixels_apart_in_runs_2_pixels_apart() {
    let scan = synthetic(Scene::SquaresUniform, 2_100);
    let [x, y] = [names::XYZ[0], names::XYZ[1]].map(|name| values(&scan, name));
    let pixels = |v: f64| (v * 10.0).round() as i64;
    for i in 0..2_100 {
        let (run, square) = (i / 520, i % 520);
        let column = (pixels(x[i]) - 30 - 2 * (run as i64 + 1)).rem_euclid(1200);
        assert_eq!(column, 60 * (square as i64 % 20), "point {i}");
        assert_eq!(1570 - pixels(y[i]), 60 * (square as i64 / 20), "point {i}");
    }
    let runs = values(&scan, names::POINT_SOURCE_ID);
    for run in 1..=5 {
        let of_run = runs.iter().filter(|&&r| r == f64::from(run)).count();
        assert_eq!(of_run, if run < 5 { 520 } else { 20 });
    }
}

#[test]
fn an_airborne_scan_has_ground_roofs_trees_and_overlapping_strips() {
    let scan = synthetic(Scene::Als, 300_000);
    let classes = values(&scan, names::CLASSIFICATION);
    let share = |class: f64| classes.iter().filter(|&&c| c == class).count() as f64 / 300_000.0;
    assert!((0.4..0.85).contains(&share(2.0)), "ground {}", share(2.0));
    assert!((0.05..0.3).contains(&share(5.0)), "trees {}", share(5.0));
    assert!((0.05..0.3).contains(&share(6.0)), "roofs {}", share(6.0));
    let [x, y] = [names::XYZ[0], names::XYZ[1]].map(|name| values(&scan, name));
    let density = 300_000.0 / (range(&x) * range(&y));
    assert!((density / 10.0 - 1.0).abs() < 0.2, "{density} points a square metre");
    let strips = values(&scan, names::POINT_SOURCE_ID);
    let [mut end, mut start] = [f64::MIN, f64::MAX];
    for (strip, y) in strips.iter().zip(&y) {
        match strip {
            1.0 => end = end.max(*y),
            2.0 => start = start.min(*y),
            _ => {}
        }
    }
    assert!(end - start > 5.0, "strips 1 and 2 share {} m", end - start);
    assert!(strips.windows(2).all(|w| w[0] <= w[1]) && strips.last() == Some(&4.0));
}

#[test]
fn second_returns_follow_their_first_at_the_same_time() {
    let scan = synthetic(Scene::Als, 100_000);
    let [number, of] = [names::RETURN_NUMBER, names::NUMBER_OF_RETURNS].map(|n| values(&scan, n));
    let time = values(&scan, names::GPS_TIME);
    let z = values(&scan, names::XYZ[2]);
    let mut seconds = 0;
    for i in 1..number.len() {
        assert!(number[i] <= of[i]);
        if number[i] == 2.0 {
            seconds += 1;
            assert_eq!((number[i - 1], of[i - 1], time[i - 1]), (1.0, 2.0, time[i]));
            assert!(z[i] < z[i - 1], "the second return is below the first");
        } else {
            assert!(time[i] > time[i - 1]);
        }
    }
    assert!(seconds > 3000, "{seconds}");
}

#[test]
fn a_written_scan_reads_back_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    for scene in Scene::ALL {
        let scan = synthetic(scene, 12_345);
        let source = scan.open().unwrap();
        let path = folder.path().join(format!("{scene}.las"));
        let options = LasOptions::default();
        let mut sink = create(&path, &options, source.schema(), source.metadata()).unwrap();
        let mut batch = PointBatch::new(source.schema().clone(), 12_345);
        source.part(0).unwrap().read(&mut batch).unwrap();
        sink.append(sink.encoder().encode(&batch).unwrap()).unwrap();
        assert_eq!(sink.finish().unwrap().points, 12_345);
        let read = las::open(&[path]).unwrap();
        assert_eq!(read.schema(), source.schema());
        let back: Vec<u8> =
            (0..read.parts()).flat_map(|part| records_of(&*read, part, 1000)).collect();
        assert!(back == batch.records(), "{scene}");
    }
}
