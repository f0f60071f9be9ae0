//! What `crop` cuts out of files: boxes and polygons, inside and outside.

use std::fs;

use crate::support::case::Case;
use crate::support::random::Random;
use crate::support::runs::{Settings, run};
use crate::support::scan::Scan;
use pointmill::synth::Scene;
use pointmill::{Graph, Overrides, Registry};

/// Points on whole numbers, a hundred to a side, tagged by their number.
fn lattice() -> Vec<([f64; 3], u32)> {
    let at = |n: u32| [f64::from(n % 100), f64::from(n / 100), f64::from(n % 7)];
    (0..10_000).map(|n| (at(n), n)).collect()
}

fn kept(stages: &str) -> Vec<[f64; 3]> {
    let case = Case::new();
    case.ply(&lattice());
    case.run("", stages, "").unwrap();
    case.written().into_iter().map(|(p, _)| p).collect()
}

fn expected(is_in: impl Fn([f64; 3]) -> bool) -> Vec<[f64; 3]> {
    lattice().into_iter().map(|(p, _)| p).filter(|p| is_in(*p)).collect()
}

#[test]
fn boxes_have_their_borders_and_count_heights_where_they_are_given() {
    let flat = |[x, y, _]: [f64; 3]| (10.0..=20.0).contains(&x) && (5.0..=5.0).contains(&y);
    let stage = |keys: &str| format!("[[stage]]\nkind = 'crop'\n{keys}\n");
    assert_eq!(kept(&stage("box = [10, 5, 20, 5]")), expected(flat));
    assert_eq!(kept(&stage("box = [10, 5, 20, 5]\nkeep = 'outside'")), expected(|p| !flat(p)));
    assert_eq!(
        kept(&stage("box = [10, 5, 2, 20, 5, 4]")),
        expected(|p| flat(p) && (2.0..=4.0).contains(&p[2]))
    );
    // Those of some kind alone: the others pass.
    assert_eq!(
        kept(&stage("box = [10, 5, 20, 5]\nwhere = 'X < 50'")),
        expected(|p| flat(p) || p[0] >= 50.0)
    );
}

#[test]
fn polygons_come_from_texts_and_files_and_have_holes() {
    let is_in = |[x, y, _]: [f64; 3]| {
        // A triangle whose border is on whole numbers, without the inside of a square.
        let triangle = x >= 0.0 && y >= 0.0 && 2.0 * x + y <= 60.0;
        triangle && !(x > 5.0 && x < 9.0 && y > 5.0 && y < 9.0)
    };
    let folder = tempfile::tempdir().unwrap();
    let wkt = "POLYGON((0 0, 30 0, 0 60, 0 0), (5 5, 9 5, 9 9, 5 9, 5 5))";
    let json = "{\"type\": \"Polygon\", \"coordinates\": [[[0, 0], [30, 0], [0, 60], [0, 0]], \
                [[5, 5], [9, 5], [9, 9], [5, 9], [5, 5]]]}";
    for (name, text) in [("area.wkt", wkt), ("area.geojson", json)] {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        for keys in [format!("polygon = '{text}'"), format!("file = {path:?}")] {
            let stage = format!("[[stage]]\nkind = 'crop'\n{keys}\n");
            let inside = kept(&stage);
            assert_eq!(inside, expected(is_in), "{keys}");
            assert!(inside.len() > 500);
            let outside = kept(&format!("{stage}keep = 'outside'\n"));
            assert_eq!(outside, expected(|p| !is_in(p)), "{keys}");
        }
    }
}

#[test]
fn an_area_beside_the_scan_is_told() {
    let case = Case::new();
    case.ply(&lattice());
    let told = |keys: &str| {
        let done = case.run("", &format!("[[stage]]\nkind = 'crop'\n{keys}\n"), "").unwrap();
        done.report.run.warnings.join("\n")
    };
    let square = "[[[-9, 48], [-8, 48], [-8, 49], [-9, 48]]]";
    let json = format!("polygon = '{{\"type\": \"Polygon\", \"coordinates\": {square}}}'");
    let nothing = told(&json);
    assert!(nothing.contains("no point is left of 10,000"), "{nothing}");
    assert!(nothing.contains("`crop.polygon` is x from -9 to -8, y from 48 to 49"), "{nothing}");
    assert!(nothing.contains("degrees of WGS 84"), "{nothing}");
    let all = told(&format!("{json}\nkeep = 'outside'"));
    assert!(all.contains("every point is outside of the area of `crop.polygon`"), "{all}");
    let all = told("box = [-1, -1, 200, 200]");
    assert!(all.contains("every point is inside of the area of `crop.box`, x from -1 to 200"));
    let crossing = told("polygon = 'POLYGON((0 0, 40 40, 40 0, 0 40))'");
    assert!(crossing.contains("crosses itself near (0, 0)"), "{crossing}");
}

#[test]
fn what_is_inside_and_what_is_outside_are_the_scan() {
    let scan = Scan::synthetic(Scene::Als, 30_000, 4);
    let folder = tempfile::tempdir().unwrap();
    let files = scan.write_split(folder.path(), 2, &mut Random(3));
    let positions = scan.positions();
    let axes = scan.schema.coordinates().unwrap();
    let world = |i: usize, axis: usize| axes[axis].world(scan.record(i), scan.schema.endian);
    // Its corners are points of the scan, which are on the border.
    let corners: Vec<usize> = [0, positions.len() / 3, positions.len() / 2].to_vec();
    let ring: Vec<String> =
        corners.iter().map(|&i| format!("{} {}", world(i, 0), world(i, 1))).collect();
    let keys = format!("polygon = 'POLYGON(({}))'", ring.join(", "));
    let mut sides = Vec::new();
    for keep in ["inside", "outside"] {
        let stage = format!("[[stage]]\nkind = 'crop'\n{keys}\nkeep = '{keep}'\n");
        let settings = Settings { threads: 2, ..Settings::PLAIN };
        let ran = run(folder.path(), &files, &stage, "las", settings).unwrap();
        sides.push(Scan::read(&ran.output, usize::MAX));
    }
    let records = |scan: &Scan| -> Vec<Vec<u8>> {
        scan.records.chunks_exact(scan.schema.stride).map(<[u8]>::to_vec).collect()
    };
    let inside = records(&sides[0]);
    assert!(corners.iter().all(|&i| inside.iter().any(|record| record == scan.record(i))));
    let mut all = [inside, records(&sides[1])].concat();
    let mut expected = records(&scan);
    all.sort_unstable();
    expected.sort_unstable();
    assert!(all == expected && sides.iter().all(|side| side.points() > 100));
}

#[test]
fn an_area_outside_of_the_box_of_the_header_is_told_before_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.las");
    Scan::synthetic(Scene::Als, 500, 1).write(&input);
    let warned = |keys: &str| {
        let text = format!(
            "[[stage]]\nkind = 'read'\npath = '{}'\n[[stage]]\nkind = 'crop'\n{keys}\n\
             [[stage]]\nkind = 'discard'\n",
            input.display()
        );
        let graph = Graph::parse(&text, "test.toml", &Registry::builtin()).unwrap();
        graph.plan(&Overrides::default()).unwrap().warnings().join("\n")
    };
    let degrees = warned("polygon = 'POLYGON((7 50, 8 50, 8 51))'");
    assert!(degrees.contains("no point will be left: the area of `crop.polygon`"), "{degrees}");
    assert!(degrees.contains("by its header has x from 3500"), "{degrees}");
    assert_eq!(warned("box = [0, 0, 100, 100]\nkeep = 'outside'"), "");
    assert_eq!(warned("box = [350000, 5600000, 350010, 5600010]"), "");
}
