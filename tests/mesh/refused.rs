//! What no mesh can be made of, told before or as soon as it is known.

use super::file::read_stl;
use crate::support::case::{Case, execute};
use crate::support::command::{mebibytes, pointmill};
use crate::support::scan::Scan;
use pointmill::synth::Scene;
use pointmill::{Error, ErrorKind, Overrides, Quiet};

fn outcome(case: &Case, run: &str, stages: &str) -> Result<(), Error> {
    let input = case.path("in.laz");
    let text =
        format!("[run]\n{run}\n[[stage]]\nkind = 'read'\npath = '{}'\n{stages}", input.display());
    execute(&text, &Overrides::default(), &Quiet).map(|_| ())
}

fn refused(case: &Case, run: &str, stages: &str) -> (ErrorKind, String) {
    let error = outcome(case, run, stages).expect_err(stages);
    (error.kind(), format!("{error} [{}]", error.remedy().unwrap_or_default()))
}

fn scan(points: u64) -> Case {
    let case = Case::new();
    Scan::synthetic(Scene::Als, points, 5).write(&case.path("in.laz"));
    case
}

fn mesh(case: &Case, name: &str, keys: &str) -> String {
    format!("[[stage]]\nkind = 'mesh'\npath = '{}'\n{keys}\n", case.path(name).display())
}

/// Runs a line with that much memory, in a process of its own: what a process holds already counts.
fn within(case: &Case, mebibytes: u64, line: &str) -> (i32, String) {
    let line = format!("read in.laz ! {line}");
    let memory = format!("{mebibytes}MiB");
    let arguments = ["run", &line, "--memory", &memory, "--quiet", "--report", "report.json"];
    let (code, _, told) = pointmill(case.at.path(), &arguments);
    if code == 0 {
        let peak = case.report()["run"]["peak_memory_bytes"].as_u64().unwrap();
        assert!(peak <= mebibytes << 20, "{line}: {peak} bytes in {memory}");
    }
    (code, told)
}

#[test]
fn a_memory_that_does_not_do_is_refused_with_the_one_that_does() {
    let case = scan(400_000);
    // Nothing is removed, so headers tell; else the points must be read. A radius that reaches over
    // nearly all points is no better than none.
    for line in
        ["mesh m.obj", "grid side=0.05 ! mesh m.obj", "grid side=0.05 ! mesh m.obj max_radius=9000"]
    {
        let (code, told) = within(&case, 84, line);
        assert_eq!(code, 1, "{told}");
        let enough = mebibytes(&told);
        assert!((85..400).contains(&enough), "{told}");
        let (code, told) = within(&case, enough, line);
        assert_eq!(code, 0, "{told}");
    }
    // A radius does, too.
    let (code, told) = within(&case, 84, "mesh m.obj max_radius=3");
    assert_eq!(code, 0, "{told}");
}

#[test]
fn a_mesh_without_a_triangle_is_told() {
    let case = scan(500);
    for (line, part) in [
        ("mesh m.ply max_radius=0.001", "no triangle has a circle within `mesh.max_radius"),
        ("crop box=[0,0,1e9,1e9] ! sample every=499 ! mesh m.ply", "all points lie on one line"),
    ] {
        let line = format!("read in.laz ! {line}");
        let (code, _, told) = pointmill(case.at.path(), &["run", &line]);
        assert_eq!(code, 0, "{told}");
        assert!(told.contains(part), "{told}");
    }
}

#[test]
fn a_stage_that_moves_points_cannot_stand_above() {
    let case = scan(500);
    for above in [
        "[[stage]]\nkind = 'smooth'\n",
        "[[stage]]\nkind = 'grid'\nside = 1\n[[stage]]\nkind = 'transform'\ntranslate = [1, 0, 0]\n",
    ] {
        let (kind, told) = refused(&case, "", &format!("{above}{}", mesh(&case, "m.ply", "")));
        assert_eq!(kind, ErrorKind::Pipeline, "{told}");
        assert!(told.contains("mov") && told.contains('['), "{told}");
    }
    let left = case.left();
    assert_eq!(left, ["in.laz"], "nothing is left");
}

#[test]
fn places_that_stl_would_round_are_refused_with_an_offset() {
    let case = scan(500);
    let (kind, told) = refused(&case, "", &mesh(&case, "m.stl", "max_radius = 50"));
    assert_eq!(kind, ErrorKind::Pipeline, "{told}");
    let (_, offset) = told.split_once("mesh.offset = ").unwrap_or_else(|| panic!("{told}"));
    let (offset, _) = offset.split_once('`').unwrap();
    let keys = format!("max_radius = 50\noffset = {offset}");
    outcome(&case, "", &mesh(&case, "m.stl", &keys)).unwrap();
    assert!(read_stl(&case.path("m.stl")).len() > 500);
}

#[test]
fn keys_are_held_against_the_format() {
    let case = scan(50);
    for (name, keys, told) in [
        ("m.obj", "encoding = 'ascii'", "`mesh.encoding` is for ply, the output is obj"),
        ("m.ply", "offset = [0, 0, 0]", "`mesh.offset` is for obj and stl, the output is ply"),
        ("m.ply", "drop = ['Foo']", "`mesh.drop`"),
        ("m.laz", "", "names no format of meshes"),
        ("m.ply", "max_radius = 0", "max_radius"),
        ("m.ply", "axis = 'w'", "axis"),
        ("m.ply", "dimensions = ['NormalX']", "NormalX"),
    ] {
        let (_, found) = refused(&case, "", &mesh(&case, name, keys));
        assert!(found.contains(told), "{found}");
    }
}
