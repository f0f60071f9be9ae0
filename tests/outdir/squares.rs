//! Runs whose output is a file for each square of the plane: together they are the one file that
//! there would be without squares, cut at its borders.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::{files, run};
use crate::support::case::Case;
use crate::support::scan::Scan;
use pointmill::synth::Scene;
use pointmill::{Graph, Overrides, Quiet, Registry};

/// The records of a file by the square that each lies in, named as its file is to be.
fn cut(file: &Path, side: f64, extension: &str) -> BTreeMap<String, Vec<u8>> {
    let scan = Scan::read(file, usize::MAX);
    let [x, y, _] = scan.schema.coordinates().unwrap();
    let mut squares: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    for i in 0..scan.points() {
        let record = scan.record(i);
        let corner =
            [x, y].map(|axis| (axis.world(record, scan.schema.endian) / side).floor() * side);
        let name = format!("t_{}_{}.{extension}", corner[0], corner[1]);
        squares.entry(name).or_default().extend_from_slice(record);
    }
    squares
}

#[test]
fn squares_are_one_file_cut_at_their_borders_in_every_kind_of_run() {
    let normals = "[[stage]]\nkind = 'normals'\nneighbors = 8\n";
    let thin = "[[stage]]\nkind = 'grid'\nside = 2\n";
    for (stages, keys, extension) in [
        ("", "", "laz"),
        ("", "", "las"),
        ("", "order = 'canonical'", "ply"),
        (thin, "", "laz"),
        (thin, "order = 'input'", "ply"),
        (normals, "dimensions = ['NormalX', 'NormalZ']", "las"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let scan = Scan::synthetic(Scene::Als, 30_000, 5);
        scan.write(&at("in.laz"));
        let write = |path: PathBuf, keys: &str| format!("path = '{}'\n{keys}", path.display());
        run("", &at("in.laz"), stages, &write(at(&format!("whole.{extension}")), keys)).unwrap();
        let side = 32.0;
        let expected = cut(&at(&format!("whole.{extension}")), side, extension);
        assert!(expected.len() > 8, "{}", expected.len());
        let mut bytes: Vec<BTreeMap<String, Vec<u8>>> = Vec::new();
        for (n, settings) in ["threads = 1", "threads = 3\nspill = 'always'\ntile_points = 2000"]
            .into_iter()
            .enumerate()
        {
            let tiles = at(&format!("tiles{n}"));
            fs::create_dir(&tiles).unwrap();
            let pattern = tiles.join(format!("t_{{x}}_{{y}}.{extension}"));
            let keys = format!("side = 32\n{keys}");
            let report = run(settings, &at("in.laz"), stages, &write(pattern, &keys)).unwrap();
            let written = files(&tiles);
            assert_eq!(
                written.keys().collect::<Vec<_>>(),
                expected.keys().collect::<Vec<_>>(),
                "{stages}{keys}"
            );
            for (name, path) in &written {
                let records = Scan::read(path, usize::MAX).records;
                let mut both = [records, expected[name].clone()];
                // By time within chunks, which are those of a square.
                if extension == "laz" && !stages.is_empty() {
                    let stride = scan.schema.stride;
                    both = both.map(|records| {
                        let mut each: Vec<&[u8]> = records.chunks_exact(stride).collect();
                        each.sort_unstable();
                        each.concat()
                    });
                }
                assert!(both[0] == both[1], "{name} {stages}{keys}");
            }
            let outputs = &report.run.outputs;
            assert_eq!(outputs.len(), written.len());
            let total: u64 = outputs.iter().map(|output| output.points).sum();
            assert_eq!(total, report.result.ledger.kept);
            assert!(outputs.iter().all(|output| Path::new(&output.path).is_file()));
            let read = |(name, path): (String, PathBuf)| (name, fs::read(path).unwrap());
            bytes.push(written.into_iter().map(read).collect());
        }
        assert!(bytes[0] == bytes[1], "the files depend on threads, spill or tiles");
    }
}

#[test]
fn points_on_borders_are_in_the_square_of_larger_coordinates() {
    let case = Case::new();
    let xs = [-0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.6, 0.7];
    let points: Vec<_> = (0..).zip(xs).map(|(n, x)| ([x, 0.05, 1.0], n)).collect();
    case.ply(&points);
    let pattern = case.path("{y}{x}.ply");
    let write = format!("path = '{}'\nside = 0.1", pattern.display());
    run("", &case.path("in.ply"), "", &write).unwrap();
    let written = files(case.at.path());
    let names: Vec<&str> = written.keys().map(String::as_str).filter(|n| *n != "in.ply").collect();
    let corners = ["-0.1", "-0.2", "0.0", "0.1", "0.2", "0.3", "0.6", "0.7"];
    assert_eq!(names, corners.map(|x| format!("0.0{x}.ply")));
}

#[test]
fn more_records_than_wait_in_memory_come_back_in_their_order() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let scan = Scan::synthetic(Scene::Als, 700_000, 3);
    scan.write(&at("in.las"));
    let write = |name: &str, keys: &str| format!("path = '{}'\n{keys}", at(name).display());
    let report = run("", &at("in.las"), "", &write("t_{x}_{y}.las", "side = 100")).unwrap();
    assert!(report.run.spill_bytes > 10 << 20, "{}", report.run.spill_bytes);
    let expected = cut(&at("in.las"), 100.0, "las");
    for (name, records) in &expected {
        assert!(Scan::read(&at(name), usize::MAX).records == *records, "{name}");
    }
    assert_eq!(files(folder.path()).len(), expected.len() + 1);
}

#[test]
fn patterns_that_cannot_be_are_refused_before_the_run() {
    let case = Case::new();
    case.ply(&[([0.0, 0.0, 0.0], 1), ([1e6, 1e6, 0.0], 2)]);
    let input = case.path("in.ply");
    let path = |name: &str| format!("path = '{}'", case.path(name).display());
    let told = |settings: &str, write: String| run(settings, &input, "", &write).unwrap_err();
    for (write, says, help) in [
        (path("{x}_{y}.ply"), "nothing says into which files", "side = \"500 m\""),
        (format!("{}\nside = 5", path("out.ply")), "names no file for each", "{x}_{y}.ply"),
        (format!("{}\nside = 5", path("{x}.ply")), "names no file for each", "{x}_{y}.ply"),
        (format!("{}\nside = 5", path("{x}/{x}_{y}.ply")), "names no file", "{x}_{y}.ply"),
        (format!("{}\nside = '5 m'", path("{x}_{y}.ply")), "does not say what", "write.side = 5"),
        (
            format!("folder = '{}'\nside = 5", case.at.path().display()),
            "`write.folder` has a file for each input",
            "instead of the folder",
        ),
        (format!("{}\nside = 1e-300", path("{x}_{y}.ply")), "lies in no square", "write.side"),
    ] {
        let error = told("", write.clone());
        assert!(error.to_string().contains(says), "{write}: {error}");
        let all = format!("{error} {}", error.remedy().unwrap_or_default());
        assert!(all.contains(help), "{write}: {all}");
    }
    assert_eq!(files(case.at.path()).len(), 1, "nothing is left behind");
    // Files that are there already.
    let write = format!("{}\nside = 5e5", path("{x}_{y}.ply"));
    run("", &input, "", &write).unwrap();
    assert_eq!(files(case.at.path()).len(), 3);
    let error = told("existing = 'refuse'", write.clone());
    assert!(error.to_string().contains("this file exists"), "{error}");
    run("", &input, "", &write).unwrap();
    // An input that could be the file of a square.
    let named = case.path("3_4.ply");
    fs::copy(&input, &named).unwrap();
    let error = run("", &named, "", &write).unwrap_err();
    assert!(error.to_string().contains("could have the name of the input"), "{error}");
}

#[test]
fn more_squares_than_there_may_be_end_the_run_and_leave_nothing() {
    let case = Case::new();
    let points: Vec<_> = (0..20_000).map(|n| ([f64::from(n) * 2.0, 0.0, 0.0], n as u32)).collect();
    case.ply(&points);
    let write = format!("path = '{}'\nside = 1", case.path("{x}_{y}.ply").display());
    let error = run("", &case.path("in.ply"), "", &write).unwrap_err();
    assert!(error.to_string().contains("more than 16384 squares of 1"), "{error}");
    assert_eq!(files(case.at.path()).len(), 1);
}

#[test]
fn the_folder_of_squares_is_made_and_a_box_of_too_many_is_told_before_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let scan = Scan::synthetic(Scene::Als, 2_000, 1);
    scan.write(&folder.path().join("in.las"));
    let text = |folder: &str, side: &str| {
        format!(
            "[[stage]]\nkind = 'read'\npath = '{folder}/in.las'\n[[stage]]\nkind = 'write'\n\
             path = '{folder}/new/{{x}}_{{y}}.las'\nside = {side}\n"
        )
    };
    let at = folder.path().to_str().unwrap();
    let plan = |side: &str| {
        let graph = Graph::parse(&text(at, side), "test.toml", &Registry::builtin()).unwrap();
        graph.plan(&Overrides::default()).unwrap()
    };
    let warned = plan("0.01").warnings().join("\n");
    assert!(warned.contains("squares of `write.side = 0.01`; the run fails"), "{warned}");
    assert_eq!(plan("10").warnings(), [""; 0]);
    assert!(!folder.path().join("new").exists(), "a plan makes no folder");
    plan("10").run(&Quiet).unwrap();
    assert!(files(&folder.path().join("new")).len() > 4);
}

#[test]
fn many_files_have_one_line_for_their_folder() {
    let case = Case::new();
    let points: Vec<_> = (0..30).map(|n| ([f64::from(n), 0.5, 0.0], n as u32)).collect();
    case.ply(&points);
    let lines = |side: u32| {
        let folder = case.path(&format!("of {side}"));
        fs::create_dir(&folder).unwrap();
        let write = format!("path = '{}'\nside = {side}", folder.join("{x}_{y}.ply").display());
        let report = run("", &case.path("in.ply"), "", &write).unwrap();
        let told = report.table(None).to_string();
        told.lines().filter(|line| line.starts_with("output")).map(str::to_owned).collect()
    };
    let few: Vec<String> = lines(10);
    assert_eq!(few.len(), 3, "{few:?}");
    let many: Vec<String> = lines(1);
    assert!(many.len() == 1 && many[0].contains(" 30 files in "), "{many:?}");
}
