//! COPC in several files: each is the octree that its points alone would become.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use las::CopcReader;
use pointmill::synth::Scene;

use super::copc::levels;
use crate::support::command::{done, pointmill};
use crate::support::runs::{Memory, Settings, run};
use crate::support::scan::Scan;

/// What of a COPC file depends on its points: scales, box and counts of its header, its cube,
/// spacing and times, and the chunks of its nodes. Not what it says of its pipeline, and where in
/// the file its parts are.
fn of_points(path: &Path) -> (Vec<u8>, BTreeMap<[i32; 4], Vec<u8>>) {
    assert!(!levels(path).is_empty());
    let bytes = std::fs::read(path).unwrap();
    let info = 375 + 54;
    let figures = [
        &bytes[104..131],
        &bytes[131..227],
        &bytes[247..375],
        &bytes[info..info + 40],
        &bytes[info + 56..info + 72],
    ];
    let reader = CopcReader::from_path(path).unwrap();
    let nodes = reader.hierarchy_entries().map(|entry| {
        let (key, start) = (&entry.key, entry.offset as usize);
        let chunk = bytes[start..start + entry.byte_size as usize].to_vec();
        ([key.l, key.x, key.y, key.z], chunk)
    });
    (figures.concat(), nodes.collect())
}

/// The files of points in a folder, by name.
fn files(folder: &Path) -> BTreeMap<String, PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let points = entries.filter(|path| path.extension().is_some_and(|is| is == "laz"));
    points.map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), path)).collect()
}

/// Holds each of the COPC files against what the points of the LAZ file of its name become alone.
fn are_of_their_points(copc: &BTreeMap<String, PathBuf>, laz: &BTreeMap<String, PathBuf>) -> usize {
    let mut deepest = 0;
    assert_eq!(copc.len(), laz.len());
    for ((name, copc), (of, laz)) in copc.iter().zip(laz) {
        assert_eq!(name.strip_suffix(".copc.laz"), of.strip_suffix(".laz"));
        let folder = tempfile::tempdir().unwrap();
        let alone = folder.path().join("alone.copc.laz");
        let [from, to] = [laz, &alone].map(|path| path.to_str().unwrap());
        done(folder.path(), &["convert", from, "-o", to, "--quiet", "--no-provenance"]);
        let (copc, alone) = (of_points(copc), of_points(&alone));
        assert!(copc == alone, "{name} depends on points of other files");
        deepest = deepest.max(copc.1.keys().map(|[level, ..]| *level as usize).max().unwrap());
    }
    deepest
}

#[test]
fn files_of_a_split_are_what_their_points_alone_become_in_every_kind_of_run() {
    let at = tempfile::tempdir().unwrap();
    let input = at.path().join("in.laz");
    Scan::synthetic(Scene::Als, 220_000, 3).with_copies(2).write(&input);
    let thin = "[[stage]]\nkind = 'grid'\nside = 0.2\n";
    for (stages, pattern, keys, count) in [
        ("", "{x}_{y}", "side = 150", 2..16),
        ("", "{value}", "by = 'Classification'", 2..9),
        ("", "{number}", "points = 90_000", 3..4),
        (thin, "{x}_{y}", "side = 150", 2..16),
    ] {
        let split = |extension: &str, keys: &str, settings: Settings| {
            let folder = tempfile::tempdir_in(at.path()).unwrap().keep();
            let write = format!("{pattern}.{extension}\n{keys}");
            let ran = run(&folder, std::slice::from_ref(&input), stages, &write, settings).unwrap();
            (files(&folder), ran.spilled)
        };
        let copc = split("copc.laz", keys, Settings::PLAIN).0;
        for settings in [
            Settings { tile_points: Some(5_000), threads: 3, spill: "always", ..Settings::PLAIN },
            Settings { memory: Memory::Least(0), threads: 2, ..Settings::PLAIN },
        ] {
            let (others, spilled) = split("copc.laz", keys, settings);
            assert!(spilled > 0 || settings.spill == "auto");
            assert_eq!(copc.keys().collect::<Vec<_>>(), others.keys().collect::<Vec<_>>());
            let same = |(a, b)| std::fs::read(a).unwrap() == std::fs::read(b).unwrap();
            assert!(copc.values().zip(others.values()).all(same), "{keys} {settings:?}");
        }
        let laz = split("laz", &format!("{keys}\norder = 'canonical'"), Settings::PLAIN).0;
        assert!(count.contains(&copc.len()), "{keys}: {copc:?}");
        assert!(are_of_their_points(&copc, &laz) > 0, "{keys}: no file has two levels");
    }
}

#[test]
fn inputs_in_a_folder_become_copc_each_with_its_own_offset() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "als", "-n", "150000", "-o", "a.laz", "--quiet"]);
    std::fs::create_dir(at.join("in")).unwrap();
    for (part, name, offset) in [
        ("X < 350160", "west", "[350000, 5600000, 0]"),
        ("X >= 350160", "east", "[350123.5, 5599000.25, -7]"),
    ] {
        let text =
            format!("read a.laz ! filter where=\"{part}\" ! write in/{name}.laz offset={offset}");
        done(at, &["run", &text, "--quiet"]);
    }
    let to = |keys: &str, more: &[&str]| {
        let run = ["run", keys, "--quiet", "--no-provenance"];
        done(at, &[&run[..], more].concat());
    };
    to("read in ! write folder=one format=copc", &["--threads", "1"]);
    to("read in ! write folder=three format=copc", &["--threads", "3"]);
    let (one, three) = (files(&at.join("one")), files(&at.join("three")));
    assert_eq!(one.keys().collect::<Vec<_>>(), ["east.copc.laz", "west.copc.laz"]);
    let same = |(a, b)| std::fs::read(a).unwrap() == std::fs::read(b).unwrap();
    assert!(one.values().zip(three.values()).all(same), "threads matter");
    assert!(are_of_their_points(&one, &files(&at.join("in"))) > 0);
    // COPC in a folder stays COPC where that is asked for, and an input without a point left too.
    to("read one ! filter where=\"ReturnNumber > 9\" ! write folder=none format=copc", &[]);
    to("read one ! write folder=laz", &[]);
    let none = files(&at.join("none"));
    assert_eq!(none.keys().collect::<Vec<_>>(), one.keys().collect::<Vec<_>>());
    assert!(none.values().all(|path| levels(path) == [0]));
    assert_eq!(files(&at.join("laz")).keys().collect::<Vec<_>>(), ["east.laz", "west.laz"]);
}

#[test]
fn what_arranging_holds_is_planned_for_the_files_that_are_open_at_once() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    std::fs::create_dir(at.join("in")).unwrap();
    for seed in ["1", "2"] {
        let path = format!("in/{seed}.laz");
        done(at, &["synth", "als", "-n", "3000", "--seed", seed, "-o", &path, "--quiet"]);
    }
    // What the refusal of a budget that is too small says of it.
    let arranging = |write: &str, threads: &str| {
        let text = format!("read in ! {write}");
        let run = ["run", &text, "--memory", "1MiB", "--threads", threads];
        let (_, _, told) = pointmill(at, &run);
        let (before, _) = told.split_once(" MiB for the arranging of points").expect(&told);
        let figure = before.rsplit([' ', '(']).next().and_then(|n| n.parse::<f64>().ok());
        figure.expect(&told)
    };
    let one = arranging("write one.copc.laz", "1");
    let [folder, number] = ["write folder=out format=copc", "write {number}.copc.laz points=3000"];
    for (write, threads, files) in
        [(folder, "1", 1.0), (folder, "2", 2.0), (folder, "8", 2.0), (number, "3", 2.0)]
    {
        let planned = arranging(write, threads);
        assert!((planned / one - files).abs() < 0.1, "{write}, {threads}: {planned}, {one}");
    }
    let normals = "normals ! write one.copc.laz dimensions=[NormalX,NormalY,NormalZ]";
    let with_normals = arranging(normals, "1");
    assert!(with_normals > 1.2 * one, "dimensions are left out: {with_normals}, {one}");
}
