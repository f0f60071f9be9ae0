//! Several branches over one decoded scan: each gives the bytes that a run of it alone gives, and
//! stages that stream may stand behind stages that work on tiles.

#![allow(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use std::collections::BTreeMap;
use std::path::Path;

use pointmill::point::{Edit, PointBatch, names};
use pointmill::report::{Tally, result_bytes};
use pointmill::stage::{Needs, Role, Transform};
use pointmill::{Done, Graph, Overrides, Quiet, Registry, Result};

const NORMALS: &str = "[[stage]]\nkind = 'normals'\n";
const REDUCE: &str = "[[stage]]\nkind = 'normals'\n[[stage]]\nkind = 'cells'\nmax_angle = '8deg'\n\
                      [[stage]]\nkind = 'median'\n";
const TREES: &str = "[[stage]]\nkind = 'filter'\nkeep_classes = [5]\n";
const GROUND: &str = "[[stage]]\nkind = 'filter'\nkeep_classes = [2]\n";

/// A chain from a scan of several classes to a file, in small tiles and through the spill.
fn chain(folder: &Path, stages: &str, output: &str) -> Graph {
    let text = format!(
        "[run]\nprovenance = false\ntile_points = 900\nspill = 'always'\nthreads = 2\nmemory = '800MiB'\nreport = '{}'\n\
         [[stage]]\nkind = 'synth'\nscene = 'als'\npoints = 20_000\n{stages}\
         [[stage]]\nkind = 'write'\npath = '{}'\n",
        folder.join(format!("{output}.json")).display(),
        folder.join(output).display(),
    );
    Graph::parse(&text, "test.toml", &Registry::builtin()).unwrap()
}

/// The first chain and all others as branches of it, which have its first `shared` stages in
/// common.
fn tree(shared: usize, chains: Vec<Graph>) -> Graph {
    let mut chains = chains.into_iter();
    let mut tree = chains.next().unwrap();
    for chain in chains {
        let begin = tree.stages.len() - shared;
        for mut stage in chain.stages.into_iter().skip(shared) {
            stage.from.iter_mut().filter(|from| **from >= shared).for_each(|from| *from += begin);
            tree.stages.push(stage);
        }
    }
    tree
}

fn run(graph: Graph) -> Result<Done> {
    graph.plan(&Overrides::default())?.run(&Quiet)
}

fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let name = |path: &Path| path.file_name().unwrap().to_str().unwrap().to_owned();
    let named = entries.map(|path| (name(&path), std::fs::read(&path).unwrap()));
    named.filter(|(name, _)| !name.ends_with(".json")).collect()
}

/// The `result` of every branch in a report, but the passes, which branches share.
fn results(report: &Path) -> Vec<serde_json::Value> {
    let bytes = std::fs::read(report).unwrap();
    let report: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
    let first: serde_json::Value = serde_json::from_slice(result_bytes(&bytes).unwrap()).unwrap();
    assert!(first == report["result"]);
    let mut results = vec![first];
    results.extend(report["further"].as_array().cloned().unwrap_or_default());
    results.iter_mut().for_each(|result| drop(result.as_object_mut().unwrap().remove("passes")));
    results
}

/// Runs the chains in one graph and one by one: the same bytes of all outputs and of the `result`
/// of each of those that end branches, from one decode. Others are outputs of stages that others
/// share.
fn compare(shared: usize, ends: &[(&str, &str)], others: &[(&str, &str)]) -> Done {
    let chains = &[ends, others].concat()[..];
    let (together, alone) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let of = |folder: &Path| -> Vec<Graph> {
        chains.iter().map(|(stages, output)| chain(folder, stages, output)).collect()
    };
    let done = run(tree(shared, of(together.path()))).unwrap();
    let mut expected = Vec::new();
    for (graph, (_, output)) in of(alone.path()).into_iter().zip(chains) {
        run(graph).unwrap();
        if expected.len() == ends.len() {
            continue;
        }
        expected.extend(results(&alone.path().join(format!("{output}.json"))));
    }
    let (many, each) = (files(together.path()), files(alone.path()));
    assert_eq!(many.keys().collect::<Vec<_>>(), each.keys().collect::<Vec<_>>());
    for (name, bytes) in &each {
        assert!(many[name] == *bytes, "{name} differs");
    }
    let report = together.path().join(format!("{}.json", chains[0].1));
    let found = results(&report);
    match others {
        [] => assert!(found == expected, "the results differ"),
        // What outputs are named for differs.
        _ => assert_eq!(found.len(), expected.len()),
    }
    let phases = |name: &str| done.report.run.phases.iter().filter(|p| p.name == name).count();
    assert!(phases("decode") <= 1, "{:?}", done.report.run.phases);
    done
}

#[test]
fn three_branches_from_one_decode_give_the_bytes_of_three_runs() {
    let gathered = "[[stage]]\nkind = 'normals'\nneighbors = 12\n[[stage]]\nkind = 'cells'\n\
                    keep = '10%'\n[[stage]]\nkind = 'median'\n";
    let done = compare(
        1,
        &[
            (REDUCE, "a.laz"),
            ("[[stage]]\nkind = 'grid'\nside = 2.0\n", "b.las"),
            (gathered, "c.ply"),
        ],
        &[],
    );
    let work = &done.report.run.work;
    assert!(work["tiles"] >= 3 * 30 && work["unproven"] > 0, "{work:?}");
    assert!(done.report.run.spill_bytes > 0);
    assert_eq!(done.report.further.len(), 2);
    assert!(done.to_string().matches("in, ").count() == 3, "{done}");
}

#[test]
fn branches_share_the_columns_of_the_stages_above_them() {
    let twice = "[[stage]]\nkind = 'normals'\n[[stage]]\nkind = 'cells'\nside = 4.0\n\
                 max_angle = 0.4\n[[stage]]\nkind = 'median'\n\
                 [[stage]]\nkind = 'grid'\nside = 3.0\n";
    compare(2, &[(REDUCE, "a.laz"), (twice, "b.laz")], &[]);
    compare(2, &[(REDUCE, "a.ply"), (twice, "b.ply")], &[(NORMALS, "c.ply")]);
}

#[test]
fn branches_that_stream_keep_the_order_of_the_input() {
    compare(1, &[(TREES, "trees.ply"), (GROUND, "ground.ply")], &[("", "all.ply")]);
}

#[test]
fn a_branch_that_streams_first_sees_what_a_run_of_it_alone_would_see() {
    let ground = format!("{GROUND}{REDUCE}");
    // Alone, points of other classes are gone before the decode is over: that they are no
    // neighbours either shows in every normal.
    let (together, alone) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let of = |folder: &Path| {
        vec![chain(folder, REDUCE, "all.ply"), chain(folder, &ground, "ground.ply")]
    };
    run(tree(1, of(together.path()))).unwrap();
    of(alone.path()).into_iter().for_each(|graph| drop(run(graph).unwrap()));
    assert_eq!(files(together.path()), files(alone.path()));
}

#[test]
fn what_streams_behind_tiles_removes_what_it_would_of_the_file_between() {
    let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let thin = "[[stage]]\nkind = 'grid'\nside = 1.5\n";
    let thinner = "[[stage]]\nkind = 'grid'\nside = 6.0\n";
    run(chain(one.path(), &format!("{thin}{TREES}{thinner}"), "out.ply")).unwrap();
    run(chain(two.path(), thin, "between.las")).unwrap();
    let again = format!(
        "[run]\nprovenance = false\n[[stage]]\nkind = 'read'\npath = '{}'\n{TREES}{thinner}[[stage]]\nkind = 'write'\npath = '{}'\n",
        two.path().join("between.las").display(),
        two.path().join("out.ply").display()
    );
    run(Graph::parse(&again, "test.toml", &Registry::builtin()).unwrap()).unwrap();
    let read = |folder: &Path| std::fs::read(folder.join("out.ply")).unwrap();
    assert_eq!(read(one.path()), read(two.path()));
    assert!(read(one.path()).len() > 2_000);
}

/// Sets the class of every record it sees, and removes those of one.
struct Reclass;

impl Transform for Reclass {
    fn needs(&self) -> Needs {
        Needs::none().changes([names::CLASSIFICATION])
    }

    fn apply(&self, batch: &mut PointBatch, _tally: &mut Tally) -> Result<()> {
        let schema = batch.schema().clone();
        let class = schema.find(names::CLASSIFICATION).unwrap().clone();
        batch.retain(|_, record| class.get(record, schema.endian).as_f64() != 6.0);
        for record in batch.records_mut().chunks_exact_mut(schema.stride) {
            assert!(Edit::HighNoise.write(&class, &schema, record));
        }
        Ok(())
    }
}

#[test]
fn what_streams_behind_tiles_changes_what_is_written_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let mut graph = chain(folder.path(), REDUCE, "a.las");
    let sink = graph.stages.pop().unwrap();
    let last = graph.stages.len() - 1;
    let changed = graph.add("reclass", Role::Transform(Box::new(Reclass)), &[last]);
    graph.stages.push(sink);
    graph.stages[changed + 1].from = vec![changed];
    let done = run(graph).unwrap();
    let classes: Vec<u8> = done.report.result.classes.iter().map(|c| c.class).collect();
    assert_eq!(classes, [2, 5, 6]);
    let kept = done.report.result.ledger.kept;
    assert!(kept > 500, "{kept}");
    let removed = &done.report.result.ledger.removed;
    assert!(removed.iter().any(|r| r.stage == "reclass" && r.records > 0), "{removed:?}");
    let written =
        pointmill::io::describe(&folder.path().join("a.las"), Registry::builtin().formats())
            .unwrap();
    assert_eq!(written["points"], kept);
    let source = pointmill::io::las::open(&[folder.path().join("a.las")]).unwrap();
    let mut batch = PointBatch::new(source.schema().clone(), kept as usize);
    source.part(0).unwrap().read(&mut batch).unwrap();
    let class = source.schema().find(names::CLASSIFICATION).unwrap();
    assert!(batch.iter().all(|r| class.get(r, source.schema().endian).as_f64() == 18.0));
}

#[test]
fn a_tile_stage_that_reads_what_a_stage_above_changes_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let outliers =
        "[[stage]]\nkind = 'cells'\nby = ['Classification']\n[[stage]]\nkind = 'median'\n";
    let mut graph = chain(folder.path(), &format!("{REDUCE}{NORMALS}{outliers}"), "a.las");
    let changed = graph.stages.len();
    graph.add("reclass", Role::Transform(Box::new(Reclass)), &[3]);
    let stage = graph.stages.remove(changed);
    graph.stages.insert(4, stage);
    for stage in &mut graph.stages[5..] {
        stage.from.iter_mut().for_each(|from| *from += 1);
    }
    let told = run(graph).unwrap_err();
    assert!(told.to_string().contains("`reclass` changes it"), "{told:?}");
}

/// Outputs of different pipelines are compared.
const PLAIN: &str = "[run]\nprovenance = false\n";

#[test]
fn several_sources_are_one_scan() {
    let at = tempfile::tempdir().unwrap();
    let path = |name: &str| at.path().join(name).display().to_string();
    let graph = chain(at.path(), "", "all.las");
    run(graph).unwrap();
    run(chain(at.path(), TREES, "a.las")).unwrap();
    run(chain(at.path(), GROUND, "b.laz")).unwrap();
    let parse = |text: &str| Graph::parse(text, "test.toml", &Registry::builtin()).unwrap();
    let read = |name: &str| format!("[[stage]]\nkind = 'read'\npath = '{}'\n", path(name));
    let write = |name: &str| format!("[[stage]]\nkind = 'write'\npath = '{}'\n", path(name));
    let both = format!(
        "{PLAIN}[[stage]]\nkind = 'read'\npath = ['{}', '{}']\n",
        path("a.las"),
        path("b.laz")
    );
    run(parse(&format!("{both}{REDUCE}{}", write("one.ply")))).unwrap();
    let merged = |first: &str, second: &str, output: &str| {
        let mut graph = parse(&format!("{PLAIN}{}{REDUCE}{}", read(first), write(output)));
        let other = parse(&format!("{}{}", second, write("none.ply"))).stages.remove(0);
        graph.stages.insert(1, other);
        for stage in &mut graph.stages[2..] {
            stage.from.iter_mut().for_each(|from| *from += 1);
        }
        graph.stages[2].from = vec![0, 1];
        graph
    };
    run(merged("a.las", &read("b.laz"), "two.ply")).unwrap();
    let bytes = |name: &str| std::fs::read(path(name)).unwrap();
    assert!(bytes("one.ply") == bytes("two.ply"));
    let told = |graph: Graph| run(graph).unwrap_err().to_string();
    let synth = "[[stage]]\nkind = 'synth'\nscene = 'part'\npoints = 9\n";
    assert!(told(merged("a.las", synth, "x.ply")).contains("all read files"));
    assert!(told(merged("a.las", &read("a.las"), "x.ply")).contains("another source reads"));
    let mut one = merged("a.las", &read("b.laz"), "x.ply");
    one.stages[2].from = vec![0];
    assert!(one.mistakes().iter().any(|wrong| wrong.told.contains("take from all of them")));
}

#[test]
fn graphs_that_hang_together_wrongly_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let told = |change: &dyn Fn(&mut Graph)| {
        let mut graph = chain(folder.path(), NORMALS, "a.las");
        change(&mut graph);
        let mistakes = graph.mistakes();
        let error = graph.plan(&Overrides::default()).err().unwrap().to_string();
        assert!(error.contains(&mistakes[0].told), "{error}");
        mistakes.into_iter().map(|wrong| (wrong.stage, wrong.told)).collect::<Vec<_>>()
    };
    let only = |stage, told: &str| vec![(stage, told.to_owned())];
    let unused = "no output takes what `normals` leaves";
    assert_eq!(told(&|graph| graph.stages[2].from = vec![0]), only(1, unused));
    let ahead = told(&|graph| graph.stages[1].from = vec![2]);
    assert!(ahead.contains(&(1, "a stage takes from stages before it".to_owned())), "{ahead:?}");
    let nowhere = told(&|graph| graph.stages[2].from = vec![1, 99]);
    assert_eq!(nowhere, only(2, "a stage takes from stages before it"));
    let rootless = told(&|graph| graph.stages[1].from.clear());
    assert!(rootless.iter().any(|(at, told)| *at == 1 && told.contains("must be a source")));
    let merge = told(&|graph| {
        graph.stages[1].role = Role::Merge;
        graph.stages[1].from = vec![99];
        graph.stages[2].from = vec![0, 1];
    });
    assert_eq!(merge, only(1, "a stage takes from stages before it"));
    let cut = told(&|graph| drop(graph.stages.pop()));
    assert_eq!(cut, only(1, "nothing takes these points: end with `write`"));
    let mut graph = chain(folder.path(), NORMALS, "a.las");
    assert_eq!(graph.mistakes(), []);
    assert!(graph.to_string().lines().any(|line| line.starts_with("write")), "{graph}");
    assert_eq!(graph.to_json()[2]["from"], serde_json::json!([1]));
    graph.stages.clear();
    assert!(graph.plan(&Overrides::default()).is_err());
}
