//! Where `transform` puts the points of files, and what their records say then.

use crate::support::case::{Case, execute};
use crate::support::random::Random;
use crate::support::runs::{Settings, run};
use crate::support::scan::Scan;
use pointmill::synth::Scene;
use pointmill::{Overrides, Quiet};

fn stage(keys: &str) -> String {
    format!("[[stage]]\nkind = 'transform'\n{keys}\n")
}

fn origins(scan: &Scan) -> [f64; 3] {
    scan.schema.coordinates().unwrap().map(|axis| axis.origin)
}

fn world(scan: &Scan) -> Vec<[f64; 3]> {
    let axes = scan.schema.coordinates().unwrap();
    let records = scan.records.chunks_exact(scan.schema.stride);
    records.map(|record| axes.map(|axis| axis.world(record, scan.schema.endian))).collect()
}

#[test]
fn a_translation_moves_the_offset_and_no_byte_of_a_record() {
    let scan = Scan::synthetic(Scene::Als, 20_000, 2);
    for write in ["las", "laz"] {
        let folder = tempfile::tempdir().unwrap();
        let files = scan.write_split(folder.path(), 2, &mut Random(1));
        let keys = "translate = [1000, -0.25, 12.5]";
        let ran = run(folder.path(), &files, &stage(keys), write, Settings::PLAIN).unwrap();
        let written = Scan::read(&ran.output, usize::MAX);
        assert!(written.records == scan.records);
        let [x, y, z] = origins(&scan);
        assert_eq!(origins(&written), [x + 1000.0, y - 0.25, z + 12.5]);
        let told = ran.report.run.warnings.join("\n");
        assert!(!told.contains("rounds"), "{told}");
    }
}

#[test]
fn stages_below_see_points_where_they_have_gone() {
    let case = Case::new();
    let at = |n: u32| [f64::from(n % 100), f64::from(n / 100), f64::from(n % 7)];
    let points: Vec<_> = (0..10_000).map(|n| (at(n), n)).collect();
    case.ply(&points);
    let crop = |keys: &str| format!("[[stage]]\nkind = 'crop'\nbox = {keys}\n");
    let turn = stage("rotate = {axis = 'z', angle = '90 deg'}\ntranslate = [500, 0, 0]");
    // What is at (x, y) is at (500 - y, x) then.
    let stages = format!("{}{turn}{}", crop("[10, 0, 20, 99]"), crop("[490, 0, 500, 99]"));
    for tiled in ["", "[[stage]]\nkind = 'grid'\nside = 0.5\n"] {
        case.run("", &format!("{stages}{tiled}"), "").unwrap();
        let mut written = case.written();
        written.sort_by_key(|(_, tag)| *tag);
        let is_in = |p: &[f64; 3]| (10.0..=20.0).contains(&p[0]) && p[1] <= 10.0;
        let kept = points.iter().filter(|(p, _)| is_in(p));
        let expected: Vec<_> = kept.map(|([x, y, z], tag)| ([500.0 - y, *x, *z], *tag)).collect();
        assert_eq!(written, expected);
        assert_eq!(written.len(), 121);
    }
}

#[test]
fn a_turn_of_las_is_within_half_a_step_told_and_found_by_tiles() {
    let scan = Scan::synthetic(Scene::Als, 20_000, 6);
    let folder = tempfile::tempdir().unwrap();
    let files = scan.write_split(folder.path(), 2, &mut Random(4));
    let turn = stage("rotate = {axis = 'z', angle = '30 deg'}");
    let settings = Settings { threads: 2, ..Settings::PLAIN };
    let ran = run(folder.path(), &files, &turn, "las", settings).unwrap();
    let written = Scan::read(&ran.output, usize::MAX);
    let steps = written.schema.coordinates().unwrap().map(|axis| axis.scale);
    let (sine, cosine) = 30f64.to_radians().sin_cos();
    for ([x, y, z], to) in world(&scan).into_iter().zip(world(&written)) {
        let expected = [x * cosine - y * sine, x * sine + y * cosine, z];
        for axis in 0..3 {
            assert!((to[axis] - expected[axis]).abs() < steps[axis] * 0.500_1, "{to:?}");
        }
    }
    let told = ran.report.run.warnings.join("\n");
    assert!(told.contains("`transform` rounds coordinates: X by "), "{told}");
    assert!(!told.contains("Z by"), "{told}");
    // Cubes of the turned scan are those of a file that has it.
    let turned = folder.path().join("turned.las");
    std::fs::rename(&ran.output, &turned).unwrap();
    let grid = "[[stage]]\nkind = 'grid'\nside = 1.5\n";
    let settings = Settings { tile_points: Some(500), ..settings };
    let at_once = run(folder.path(), &files, &format!("{turn}{grid}"), "las", settings).unwrap();
    let at_once = Scan::read(&at_once.output, usize::MAX);
    let then = run(folder.path(), &[turned], grid, "las", settings).unwrap();
    let then = Scan::read(&then.output, usize::MAX);
    assert!(at_once.records == then.records && at_once.points() < 15_000);
}

#[test]
fn outputs_of_each_input_have_what_the_output_of_all_has() {
    let scan = Scan::synthetic(Scene::Als, 10_000, 9);
    let folder = tempfile::tempdir().unwrap();
    let half = scan.points() / 2;
    let first = scan.pick(&(0..half).collect::<Vec<_>>());
    // The same places, told from another offset.
    let mut second = scan.pick(&(half..scan.points()).collect::<Vec<_>>());
    second = second.moved(|_, [x, y, z]| [x - 7000, y + 3000, z]);
    let mut schema = (*second.schema).clone();
    for (axis, steps) in schema.dimensions.iter_mut().zip([7000.0, -3000.0, 0.0]) {
        axis.origin += steps * axis.scale;
    }
    second.schema = schema.into();
    let files = [folder.path().join("a.las"), folder.path().join("b.laz")];
    first.write(&files[0]);
    second.write(&files[1]);
    assert_ne!(origins(&Scan::read(&files[0], 1)), origins(&Scan::read(&files[1], 1)));
    for keys in ["translate = [10, 20, 30]", "rotate = {axis = 'z', angle = 1}"] {
        let (all, each) = (folder.path().join("all.las"), folder.path().join("each"));
        let text = format!(
            "[[stage]]\nkind = 'read'\npath = {files:?}\n{}[[stage]]\nkind = 'write'\n\
             path = {all:?}\n[[stage]]\nkind = 'write'\nfolder = {each:?}\n",
            stage(keys)
        );
        execute(&text, &Overrides::default(), &Quiet).unwrap();
        let mut expected = world(&Scan::read(&all, usize::MAX));
        let mut found = world(&Scan::read(&each.join("a.las"), usize::MAX));
        assert_eq!(found.len(), half);
        found.extend(world(&Scan::read(&each.join("b.laz"), usize::MAX)));
        expected.sort_by(|a, b| a.partial_cmp(b).unwrap());
        found.sort_by(|a, b| a.partial_cmp(b).unwrap());
        assert_eq!(found, expected, "{keys}");
        std::fs::remove_dir_all(&each).unwrap();
        std::fs::remove_file(&all).unwrap();
    }
}

#[test]
fn points_are_not_moved_behind_stages_that_looked_at_them() {
    let case = Case::new();
    case.ply(&[([0.0; 3], 0), ([1.0; 3], 1)]);
    let grid = "[[stage]]\nkind = 'grid'\nside = 0.5\n";
    let error = case.run("", &format!("{grid}{}", stage("scale = 2")), "").unwrap_err();
    assert!(error.to_string().contains("`transform` moves points, and stands behind stages"));
    assert!(error.remedy().unwrap().contains("put it above"), "{error:?}");
}
