//! Normals that look to where the sensor was, or as their neighbours do.

use std::fs;
use std::path::Path;

use crate::support::runs::{Memory, Settings, run};
use crate::support::scan::Scan;
use pointmill::point::names;
use pointmill::synth::Scene;

const NORMALS: [&str; 3] = ["NormalX", "NormalY", "NormalZ"];

/// The scan behind `normals` and a stage `orient` with these keys, in tiles and whole, which are the
/// same; and how many normals were turned and of how many nothing told a side.
fn oriented(folder: &Path, scan: &Scan, keys: &str) -> (Scan, u64, u64) {
    let input = folder.join("scan.las");
    scan.write(&input);
    let stages = format!("[[stage]]\nkind = \"normals\"\n[[stage]]\nkind = \"orient\"\n{keys}\n");
    let write = "las\ndimensions = [\"NormalX\", \"NormalY\", \"NormalZ\"]";
    let inputs = [input];
    let whole = run(folder, &inputs, &stages, write, Settings::PLAIN).unwrap();
    let bytes = whole.bytes();
    let settings = Settings {
        tile_points: Some(300),
        memory: Memory::Least(0),
        threads: 2,
        spill: "always",
        ..Settings::PLAIN
    };
    let cut = run(folder, &inputs, &stages, write, settings).unwrap();
    assert!(cut.count("tiles") > 5 && cut.bytes() == bytes, "tiles change nothing");
    let result: serde_json::Value = serde_json::from_slice(&cut.result).unwrap();
    let count = |name: &str| result["counts"][name].as_u64().unwrap();
    (Scan::read(&cut.output, usize::MAX), count("orient_turned"), count("orient_unknown"))
}

fn values<const N: usize>(scan: &Scan, i: usize, of: [&str; N]) -> [f64; N] {
    of.map(|name| {
        let dimension = scan.schema.find(name).unwrap();
        dimension.world(scan.record(i), scan.schema.endian)
    })
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| a[axis] * b[axis]).sum()
}

#[test]
fn normals_look_to_where_a_trajectory_was_at_their_time() {
    let folder = tempfile::tempdir().unwrap();
    let scan = Scan::synthetic(Scene::Part, 4000, 2);
    let times: Vec<f64> = (0..scan.points()).map(|i| values(&scan, i, ["GpsTime"])[0]).collect();
    let (first, last) =
        times.iter().fold((f64::MAX, f64::MIN), |(lo, hi), t| (lo.min(*t), hi.max(*t)));
    // It flies from one side of the part to the other, and is there for all but the first times.
    let begin = first + (last - first) / 10.0;
    let flown = |t: f64| {
        let part = (t - begin) / (last - begin);
        [-500.0 + 1000.0 * part, 30.0, 80.0 - 160.0 * part]
    };
    let line = |t: f64| {
        let [x, y, z] = flown(t);
        format!("{t:?},{x:?},{y:?},{z:?}\n")
    };
    let file = folder.path().join("flight.csv");
    fs::write(&file, format!("time,x,y,z\n{}{}", line(last), line(begin))).unwrap();
    let keys = format!("by = \"trajectory\"\nfile = {file:?}");
    let (written, changed, unknown) = oriented(folder.path(), &scan, &keys);
    let (mut seen, mut before) = (0, 0);
    for i in 0..written.points() {
        let [time] = values(&written, i, [names::GPS_TIME]);
        let (p, n) = (values(&written, i, names::XYZ), values(&written, i, NORMALS));
        if n[0].is_nan() {
            continue;
        } else if time < begin {
            before += 1;
            continue;
        }
        let sensor = flown(time);
        let sight = [0, 1, 2].map(|axis| sensor[axis] - p[axis]);
        assert!(dot(n, sight) >= -1e-4 * dot(sight, sight).sqrt(), "point {i} looks away");
        seen += 1;
    }
    assert!(seen > 3000 && before > 200 && changed > 500, "{seen}, {before}, {changed}");
    assert_eq!(unknown, before);
}

#[test]
fn normals_look_to_where_the_scan_angle_says() {
    let folder = tempfile::tempdir().unwrap();
    let scan = Scan::synthetic(Scene::Als, 6000, 4);
    let (written, changed, unknown) = oriented(folder.path(), &scan, "by = \"scan-angle\"");
    let (mut flat, mut steep) = (0, 0);
    for i in 0..written.points() {
        let n = values(&written, i, NORMALS);
        let [angle] = values(&written, i, [names::SCAN_ANGLE]);
        assert!(angle.abs() <= 90.0);
        if n[2].abs() > 0.8 {
            // A sensor above sees what is flat from above.
            assert!(n[2] > 0.0, "point {i}");
            flat += 1;
        } else {
            steep += 1;
        }
    }
    assert!(flat > 3000 && steep > 100 && changed > 0, "{flat}, {steep}, {changed}");
    assert_eq!(unknown, 0);
}

#[test]
fn normals_of_a_closed_surface_look_outwards_by_propagation() {
    let folder = tempfile::tempdir().unwrap();
    let scan = Scan::synthetic(Scene::Sphere, 6000, 1);
    let keys = "by = \"propagation\"\nneighbors = 8";
    let (written, changed, _) = oriented(folder.path(), &scan, keys);
    for i in 0..written.points() {
        let (p, n) = (values(&written, i, names::XYZ), values(&written, i, NORMALS));
        assert!(dot(p, n) > 0.0, "point {i} looks inwards");
    }
    assert!(changed > 2000 && changed < 4000, "{changed}");
}

#[test]
fn what_propagation_holds_is_refused_with_the_memory_that_does() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("scan.las");
    Scan::synthetic(Scene::Sphere, 20_000, 1).write(&input);
    let run = |memory: u64, orient: &str| {
        let text = format!(
            "[run]\nmemory = {memory}\nthreads = 1\n[[stage]]\nkind = \"read\"\npath = {input:?}\n\
             [[stage]]\nkind = \"normals\"\n{orient}[[stage]]\nkind = \"discard\"\n"
        );
        crate::support::case::execute(&text, &Default::default(), &pointmill::Quiet)
    };
    let propagate = "[[stage]]\nkind = \"orient\"\nby = \"propagation\"\nneighbors = 64\n";
    let told = run(1 << 20, propagate).unwrap_err();
    // 20,000 positions of 71 bytes and 64 edges of 12.
    let held = "16.0 MiB for the stages that need the whole scan";
    assert!(told.to_string().contains(held), "{told}");
    let plain = run(1 << 20, "").unwrap_err();
    assert!(!plain.to_string().contains("the whole scan"), "{plain}");
    // Other tests change what the program holds.
    let enough = crate::support::runs::remedy(&told) + (200 << 20);
    run(enough, propagate).unwrap();
}
