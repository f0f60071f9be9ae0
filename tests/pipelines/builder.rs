//! Graphs that are put together in code, and graphs as the texts that would make them.

#![allow(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use std::fs;
use std::path::Path;

use pointmill::graph::{LimitKeys, RunSettings};
use pointmill::ops::normals::Normals;
use pointmill::ops::{Cells, Filter, Grid, Median, Pick, Stats, Tap};
use pointmill::point::names;
use pointmill::quantity::Length;
use pointmill::stage::Needs;
use pointmill::synth::{Scene, Synthetic};
use pointmill::{Graph, GraphBuilder, Overrides, Quiet, Registry, Set};

use crate::support::records::read;

fn grid(side: f64) -> Grid {
    Grid::new(Length::of(side).unwrap(), Pick::Center)
}

fn scan(folder: &Path) -> String {
    let scan = folder.join("in.las");
    let source = Synthetic {
        scene: Scene::Als,
        points: 20_000,
        seed: 1,
        noise: None,
        ..Synthetic::default()
    };
    run(Graph::builder().source(source).write(&scan));
    scan.display().to_string()
}

fn run(builder: GraphBuilder) -> pointmill::Done {
    builder.build().unwrap().plan(&Overrides::default()).unwrap().run(&Quiet).unwrap()
}

/// A graph and the one that its own text makes are alike.
fn assert_round_trip(graph: &Graph, what: &str) {
    let text = graph.to_toml().unwrap();
    let again = Graph::parse(&text, "again.toml", &Registry::builtin()).unwrap();
    let names_aside = |graph: &Graph| {
        let mut json = graph.to_json();
        json.as_array_mut().unwrap().iter_mut().for_each(|stage| {
            stage.as_object_mut().unwrap().remove("name");
        });
        json
    };
    assert_eq!(names_aside(&again), names_aside(graph), "{what}:\n{text}");
    assert_eq!(again.settings, graph.settings, "{what}:\n{text}");
    assert_eq!(again.to_toml().unwrap(), text, "{what}");
}

#[test]
fn a_graph_in_code_is_the_graph_of_its_text() {
    let folder = tempfile::tempdir().unwrap();
    let input = scan(folder.path());
    let out = |name: &str| folder.path().join(name);
    let settings = RunSettings { threads: std::num::NonZero::new(1), ..RunSettings::default() };
    let built = |to: &str| {
        Graph::builder()
            .settings(settings.clone())
            .read(&input)
            .stage(Filter { drop_classes: vec![7], ..Filter::default() })
            .stage(Normals::default())
            .named("with-normals")
            .stage(Cells::default())
            .only("Classification == 2 or NormalZ > 0.5")
            .stage(Median::default())
            .write(out(to))
            .from(["with-normals"])
            .stage(grid(2.0))
            .limited(LimitKeys { classes: vec![2, 5], ..LimitKeys::default() })
            .stage(Stats { dimensions: vec!["Z".into()], by_class: true })
            .write(out("thin.ply"))
            .build()
            .unwrap()
    };
    assert_round_trip(&built("a.las"), "the builder");
    let text = built("b.las").to_toml().unwrap();
    built("a.las").plan(&Overrides::default()).unwrap().run(&Quiet).unwrap();
    let thin = fs::read(out("thin.ply")).unwrap();
    let graph = Graph::parse(&text, "b.toml", &Registry::builtin()).unwrap();
    graph.plan(&Overrides::default()).unwrap().run(&Quiet).unwrap();
    assert!(fs::read(out("a.las")).unwrap() == fs::read(out("b.las")).unwrap());
    assert!(fs::read(out("thin.ply")).unwrap() == thin);
}

#[test]
fn every_pipeline_of_the_repository_comes_back_as_its_text() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines");
    let folder = tempfile::tempdir().unwrap();
    let there = [Set::argument("--input", "read.path", scan(folder.path()).into())];
    let area = folder.path().join("area.wkt");
    fs::write(&area, "POLYGON((0 0, 9 0, 9 9, 0 0))").unwrap();
    let mut count = 0;
    for file in fs::read_dir(root).unwrap() {
        let path = file.unwrap().path();
        let text = fs::read_to_string(&path).unwrap();
        // The files that they read are not there.
        let reads = text.contains("kind = \"read\"");
        let mut sets = if reads { there.to_vec() } else { Vec::new() };
        if text.contains("kind = \"crop\"") {
            sets.push(Set::argument("--area", "crop.file", area.display().to_string().into()));
        }
        let graph = Graph::read(&path, &Registry::builtin(), &sets).unwrap();
        assert_round_trip(&graph, &path.display().to_string());
        count += 1;
    }
    assert!(count >= 7);
}

#[test]
fn closures_are_stages_that_no_text_can_name() {
    let folder = tempfile::tempdir().unwrap();
    let (input, out) = (scan(folder.path()), folder.path().join("out.las"));
    let builder = || {
        Graph::builder()
            .read(&input)
            .keep(|record, schema| record[0] % 2 == 0 && schema.find(names::INTENSITY).is_some())
            .transform("dim", Needs::none().changes([names::INTENSITY]), |batch| {
                let schema = batch.schema().clone();
                let field = schema.find(names::INTENSITY).expect("LAS has it");
                let at = field.offset..field.offset + 2;
                let records = batch.records_mut().chunks_exact_mut(schema.stride);
                records.for_each(|record| record[at.clone()].fill(0));
                Ok(())
            })
            .only("Classification == 2")
            .stage(Tap {})
            .write(&out)
    };
    let done = run(builder());
    let ledger = &done.report.result.ledger;
    assert!(ledger.kept > 5000 && ledger.kept < 15_000);
    assert_eq!(ledger.removed[0].stage, "keep");
    assert_eq!(done.report.result.stats[0].points, ledger.kept);
    let (schema, records) = read(&out);
    let value = |name: &str, record: &[u8]| schema.find(name).unwrap().world(record, schema.endian);
    for record in records.chunks_exact(schema.stride) {
        let is_ground = value(names::CLASSIFICATION, record) == 2.0;
        assert_eq!(value(names::INTENSITY, record) == 0.0, is_ground);
        assert_eq!(record[0] % 2, 0);
    }
    let error = builder().build().unwrap().to_toml().unwrap_err();
    assert_eq!(error.to_string(), "stage 2 (`keep`) is of the program: no text can name it");
}

#[test]
fn everything_that_is_wrong_is_told_at_once() {
    let wrong = Graph::builder()
        .only("Z > 1")
        .named("nobody")
        .read("in.las")
        .only("Z > 1")
        .stage(grid(1.0))
        .only("Z >")
        .named("a")
        .from(["b"])
        .stage(grid(1.0))
        .named("a")
        .build()
        .err()
        .unwrap()
        .to_string();
    for part in [
        "6 mistakes",
        "there is no stage to be limited",
        "there is no stage to be named",
        "`read` cannot be limited",
        "the expression ends too early",
        "no stage above is named `b`",
        "two stages are named `a`",
    ] {
        assert!(wrong.contains(part), "{part}\n{wrong}");
    }
    // As in a text: what a filter keeps, its own condition says.
    let filter = Filter { keep_classes: vec![2], ..Filter::default() };
    let limited = Graph::builder().read("in.las").stage(filter).only("Z > 2").write("out.las");
    let limited = limited.build().err().unwrap().to_string();
    assert!(limited.contains("a stage `filter` cannot be limited"), "{limited}");
    let ends = Graph::builder().read("in.las").stage(grid(1.0)).build().err().unwrap();
    assert!(ends.to_string().contains("nothing takes these points"), "{ends}");
}
