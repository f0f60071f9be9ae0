//! The pipeline files that users copy, one a job: each opens with what it is for and the command
//! that runs it, and that command does what it says.

#![allow(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use std::fs;
use std::path::{Path, PathBuf};

use pointmill::stage::Role;
use pointmill::synth::{Scene, Synthetic};
use pointmill::{Graph, Overrides, PipelineText, Quiet, Registry, Set};

pub(super) fn pipelines() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines");
    let mut files: Vec<PathBuf> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// A small airborne scan in `folder`, as LAZ; and an area that cuts it.
pub(super) fn inputs(folder: &Path) -> (String, String) {
    let scan = folder.join("scan.laz");
    let source = Synthetic {
        scene: Scene::Als,
        points: 12_000,
        seed: 2,
        noise: None,
        ..Synthetic::default()
    };
    let graph = Graph::builder().source(source).write(&scan).build().unwrap();
    graph.plan(&Overrides::default()).unwrap().run(&Quiet).unwrap();
    let about = pointmill::io::describe(&scan, Registry::builtin().formats()).unwrap();
    let [lo, hi] = ["min", "max"].map(|end| {
        let at = |axis: usize| about[end][axis].as_f64().unwrap();
        [at(0), at(1)]
    });
    let [x, y] = [(lo[0] + hi[0]) / 2.0, (lo[1] + hi[1]) / 2.0];
    let area = folder.join("area.wkt");
    let [left, low, high] = [lo[0], lo[1], hi[1]];
    let wkt = format!("POLYGON(({left} {low}, {x} {low}, {x} {y}, {left} {high}, {left} {low}))");
    fs::write(&area, wkt).unwrap();
    (scan.display().to_string(), area.display().to_string())
}

/// The arguments that bring a pipeline to the files of the test.
pub(super) fn sets(text: &str, folder: &Path, scan: &str, area: &str) -> Vec<Set> {
    let out = |name: &str| folder.join(name).display().to_string();
    let has = |line: &str| text.lines().any(|l| l.starts_with(line));
    let mut sets = Vec::new();
    let extension =
        if text.contains("encoding =") || text.contains("colors =") { "ply" } else { "laz" };
    for (param, value) in [
        ("input", scan.to_owned()),
        ("area", area.to_owned()),
        ("folder", out("")),
        ("output", out(&format!("out.{extension}"))),
    ] {
        if has(&format!("{param} = {{")) {
            sets.push(Set::param(&format!("{param}={value}")).unwrap());
        }
    }
    if !text.contains("[params]") {
        let write = out(&format!("out.{extension}"));
        if text.contains("kind = \"read\"") {
            sets.push(Set::parse(&format!("read.path={scan}")).unwrap());
        }
        sets.push(Set::parse(&format!("write.path={write}")).unwrap());
        if has("report = ") {
            sets.push(Set::parse(&format!("run.report={}", out("report.json"))).unwrap());
        }
    }
    sets
}

#[test]
fn every_pipeline_says_what_it_is_for_and_how_it_is_run_and_runs() {
    let all = pipelines();
    assert!(all.len() >= 15, "{all:?}");
    for file in all {
        let name = file.file_name().unwrap().to_str().unwrap();
        let text = fs::read_to_string(&file).unwrap();
        let head: Vec<&str> = text.lines().take_while(|line| line.starts_with('#')).collect();
        assert!(head[0].len() > 30 && head[0].starts_with("# "), "{name}: {}", head[0]);
        let command = format!("#   pointmill run pipelines/{name}");
        assert!(head.iter().any(|line| line.starts_with(&command)), "{name}: no `{command}`");
        assert!(head.iter().any(|line| line.contains("Out come")), "{name}: what comes out?");
        let folder = tempfile::tempdir().unwrap();
        let (scan, area) = inputs(folder.path());
        let sets = sets(&text, folder.path(), &scan, &area);
        let graph = PipelineText::new(text, name).graph(&Registry::builtin(), &sets).unwrap();
        let outputs: Vec<PathBuf> = graph
            .stages
            .iter()
            .filter_map(|stage| match &stage.role {
                Role::Sink(sink) => Some(sink.path().to_owned()),
                _ => None,
            })
            .collect();
        let done = graph.plan(&Overrides::default()).unwrap().run(&Quiet);
        let done = done.unwrap_or_else(|error| panic!("{name}: {error}"));
        let result = &done.report.result;
        let written: Vec<&Path> =
            done.report.run.outputs.iter().map(|output| Path::new(&output.path)).collect();
        // An output of squares names none of its files.
        let is_pattern = |output: &PathBuf| output.to_string_lossy().contains("{x}");
        for output in outputs.iter().filter(|output| !is_pattern(output)) {
            assert!(written.contains(&&**output), "{name}: {}", output.display());
        }
        for (output, figures) in written.iter().zip(&done.report.run.outputs) {
            assert!(output.starts_with(folder.path()), "{name}: {}", output.display());
            assert!(output.is_file() && figures.points > 0, "{name}: {}", output.display());
        }
        assert!(result.ledger.kept > 0, "{name}");
    }
}

#[test]
fn jobs_do_what_their_first_lines_say() {
    let run = |job: &str| {
        let folder = tempfile::tempdir().unwrap();
        let (scan, area) = inputs(folder.path());
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("pipelines/{job}.toml"));
        let text = fs::read_to_string(file).unwrap();
        let sets = sets(&text, folder.path(), &scan, &area);
        let graph = PipelineText::new(text, job).graph(&Registry::builtin(), &sets).unwrap();
        let report = graph.plan(&Overrides::default()).unwrap().run(&Quiet).unwrap().report;
        (report, folder)
    };
    let (split, _) = run("split");
    let by_class: Vec<u64> = split.run.outputs.iter().map(|output| output.points).collect();
    let classes = |of: &[u8]| -> u64 {
        split.result.classes.iter().filter(|c| of.contains(&c.class)).map(|c| c.before).sum()
    };
    assert_eq!(by_class, [classes(&[2]), classes(&[3, 4, 5]), classes(&[6])]);
    let (ground, _) = run("ground");
    for class in &ground.result.classes {
        assert_eq!(class.before == class.after, class.class == 2, "{class:?}");
    }
    let (levels, _) = run("resolutions");
    let points: Vec<u64> = levels.run.outputs.iter().map(|output| output.points).collect();
    assert!(points[0] > 2 * points[1] && points[1] > 2 * points[2], "{points:?}");
    let (clean, _) = run("clean");
    let names: Vec<&str> = clean.result.stats.iter().map(|stats| stats.name.as_str()).collect();
    assert_eq!(names, ["cropped", "written"]);
    assert_eq!(clean.result.stats[1].points, clean.result.ledger.kept);
    assert!(clean.result.stats[0].points < 10_000, "half of the area");
    let (tiles, _) = run("tiles");
    assert!(!tiles.run.outputs.is_empty());
    assert_eq!(tiles.run.outputs.iter().map(|output| output.points).sum::<u64>(), 12_000);
    let (normals, _) = run("normals");
    assert_eq!(normals.result.ledger.kept, 12_000);
}
