//! Meshes in pipelines: the same bytes always, what is a corner, and what formats hold.

use std::fs;
use std::path::Path;

use super::file::{MeshRead, read_ascii_ply, read_obj, read_ply, read_stl};
use crate::support::case::{Case, execute};
use crate::support::scan::Scan;
use pointmill::report::Report;
use pointmill::synth::Scene;
use pointmill::{Overrides, Quiet};

/// Reads `in.laz` of the case, does `stages`; what the report says.
fn run(case: &Case, run: &str, stages: &str) -> Report {
    let text = format!(
        "[run]\nprovenance = false\n{run}\n[[stage]]\nkind = 'read'\npath = '{}'\n{stages}",
        case.path("in.laz").display()
    );
    let done = execute(&text, &Overrides::default(), &Quiet);
    done.unwrap_or_else(|error| panic!("{error}\n{text}")).report
}

fn mesh(path: &Path, keys: &str) -> String {
    format!("[[stage]]\nkind = 'mesh'\npath = '{}'\n{keys}\n", path.display())
}

fn counts(report: &Report) -> [u64; 3] {
    let count = |name: &str| report.result.counts.get(name).copied().unwrap_or(0);
    ["corners", "covered", "triangles"].map(count)
}

#[test]
fn bytes_do_not_depend_on_tiles_threads_and_memory() {
    let scan = Scan::synthetic(Scene::Als, 30_000, 5).with_copies(1);
    for (name, keys) in [
        ("m.ply", "max_radius = 4.0"),
        ("m.ply", "max_radius = 4.0\nencoding = 'ascii'\naxis = 'y'"),
        ("m.obj", "max_radius = 2.5"),
        ("m.stl", "max_radius = 4.0\noffset = [350000, 5600000, 0]"),
    ] {
        let mut first = None;
        for settings in [
            "",
            "threads = 1",
            "threads = 3\ntile_points = 500",
            "tile_points = 3000\nspill = 'always'",
            "memory = '400 MiB'",
        ] {
            let case = Case::new();
            scan.write(&case.path("in.laz"));
            let keys = mesh(&case.path(name), keys);
            let report = run(&case, settings, &keys);
            let found = (fs::read(case.path(name)).unwrap(), counts(&report));
            let first = first.get_or_insert_with(|| found.clone());
            assert!(*first == found, "{name} with {settings}: {:?} {:?}", first.1, found.1);
            assert!(found.1[2] > 30_000, "{:?}", found.1);
        }
    }
}

#[test]
fn formats_have_the_same_triangles() {
    let case = Case::new();
    Scan::synthetic(Scene::Als, 5_000, 2).write(&case.path("in.laz"));
    let keys = "max_radius = 9.0\n";
    let all = [
        ("b.ply", ""),
        ("a.ply", "encoding = 'ascii'"),
        ("m.obj", ""),
        ("m.stl", "offset = [350000, 5600000, 0]"),
    ];
    let stages: String =
        all.map(|(name, more)| mesh(&case.path(name), &format!("{keys}{more}"))).concat();
    let report = run(&case, "", &stages);
    let binary = read_ply(&case.path("b.ply"));
    assert_eq!(read_ascii_ply(&case.path("a.ply")), binary);
    assert_eq!(read_obj(&case.path("m.obj")), binary);
    let facets = read_stl(&case.path("m.stl"));
    assert_eq!(facets.len(), binary.faces.len());
    for ([normal, corners @ ..], face) in facets.iter().zip(&binary.faces) {
        for (corner, number) in corners.iter().zip(face) {
            let [x, y, z] = binary.vertices[*number];
            assert_eq!(*corner, [x - 350_000.0, y - 5_600_000.0, z].map(|v| v as f32));
        }
        let length: f32 = normal.iter().map(|v| v * v).sum();
        assert!((length - 1.0).abs() < 1e-5 && normal[2] >= 0.0, "{normal:?}");
    }
    let table = report.table(None).to_string();
    assert!(table.lines().any(|line| line.starts_with("mesh ")), "{table}");
    // Four meshes of one branch are counted together.
    assert_eq!(counts(&report)[2], 4 * binary.faces.len() as u64);
    // Pointmill reads its meshes as the points that they are.
    let read = Scan::read(&case.path("b.ply"), usize::MAX);
    assert_eq!(read.points(), 5_000);
}

#[test]
fn a_mesh_stands_before_and_behind_a_reduction() {
    let case = Case::new();
    Scan::synthetic(Scene::Als, 20_000, 4).write(&case.path("in.laz"));
    let keys = "max_radius = 20.0\ndrop = ['GpsTime']";
    let thin = "[[stage]]\nkind = 'grid'\nside = 3.0\n";
    let before = mesh(&case.path("before.obj"), "max_radius = 20.0");
    let behind = mesh(&case.path("behind.ply"), &format!("{keys}\nencoding = 'ascii'"));
    run(&case, "tile_points = 2000", &format!("{before}{thin}{behind}"));
    let [before, behind] =
        [read_obj(&case.path("before.obj")), read_ascii_ply(&case.path("behind.ply"))];
    assert_eq!(before.vertices.len(), 20_000);
    assert!(behind.vertices.len() < 19_000 && behind.faces.len() > 1000);
    // The same as of a file of what is left.
    let write =
        |name: &str| format!("[[stage]]\nkind = 'write'\npath = '{}'\n", case.path(name).display());
    run(&case, "", &format!("{thin}{}", write("thin.laz")));
    let again = Case::new();
    fs::copy(case.path("thin.laz"), again.path("in.laz")).unwrap();
    run(&again, "", &mesh(&again.path("behind.ply"), &format!("{keys}\nencoding = 'ascii'")));
    assert_eq!(read_ascii_ply(&again.path("behind.ply")), behind);
}

#[test]
fn what_is_set_aside_is_written_and_no_corner() {
    let case = Case::new();
    let scan = Scan::synthetic(Scene::Als, 4_000, 7).with_copies_and_an_outlier(3);
    scan.write(&case.path("in.laz"));
    let outliers = |keys: &str| format!("[[stage]]\nkind = 'outliers'\n{keys}\n");
    let keys = "max_radius = 9.0";
    let marked = mesh(&case.path("marked.obj"), keys);
    let marking = run(&case, "", &format!("{}{marked}", outliers("mark = 7")));
    let removed = mesh(&case.path("removed.obj"), keys);
    run(&case, "", &format!("{}{removed}", outliers("")));
    assert!(marking.result.counts["outliers_marked"] > 0);
    let [marked, removed] = ["marked.obj", "removed.obj"].map(|name| read_obj(&case.path(name)));
    assert_eq!(marked.vertices.len(), scan.points());
    assert!(removed.vertices.len() < scan.points());
    let places = |mesh: &MeshRead| -> Vec<[[f64; 3]; 3]> {
        mesh.faces.iter().map(|face| face.map(|n| mesh.vertices[n])).collect()
    };
    assert_eq!(places(&marked), places(&removed));
}

#[test]
fn normals_go_along_and_colours_are_fitted_before_the_faces() {
    let case = Case::new();
    Scan::synthetic(Scene::Als, 3_000, 9).write(&case.path("in.laz"));
    let keys =
        "max_radius = 9.0\ndimensions = ['NormalX', 'NormalY', 'NormalZ']\nencoding = 'ascii'";
    let stages = format!("[[stage]]\nkind = 'normals'\n{}", mesh(&case.path("m.ply"), keys));
    run(&case, "", &stages);
    let text = fs::read_to_string(case.path("m.ply")).unwrap();
    assert!(text.contains("property float nx\n") || text.contains("property double nx\n"));
    assert!(read_ascii_ply(&case.path("m.ply")).faces.len() > 3_000);
    // Colours that are narrowed, and those that are widened, when much is written.
    let of = |i: usize| (i % 256) as u16 * if i < 100_000 { 257 } else { 256 };
    for (late, scalar) in [(None, "uchar"), (Some(12_345), "ushort")] {
        let mut colors: Vec<u16> = (0..200_000).map(of).collect();
        late.iter().for_each(|&color| colors[199_000] = color);
        let scan = Scan::colored(&colors);
        let scan = scan.moved(|i, _| [i as i32 % 500, i as i32 / 500 * 3, 0]);
        scan.write(&case.path("in.laz"));
        let meshes = ["auto.ply", "wide.ply"].map(|name| case.path(name));
        let keys = ["", "colors = '16bit'"].map(|more| format!("max_radius = 0.03\n{more}"));
        run(&case, "", &format!("{}{}", mesh(&meshes[0], &keys[0]), mesh(&meshes[1], &keys[1])));
        let bytes = fs::read(&meshes[0]).unwrap();
        let red = format!("property {scalar} red\n");
        assert!(String::from_utf8_lossy(&bytes[..2000]).contains(&red), "{scalar}");
        let [auto, wide] = meshes.map(|path| read_ply(&path));
        assert!(auto == wide && auto.faces.len() > 300_000, "{}", auto.faces.len());
    }
}
