//! Pipeline texts of any shape: each output has the bytes that its chain alone would give, and what
//! hangs together wrongly is told with the other mistakes.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use pointmill::{Done, Graph, Overrides, Quiet, Registry, Result};

fn stage(kind: &str, keys: &str) -> String {
    format!("[[stage]]\nkind = '{kind}'\n{keys}\n")
}

fn write(folder: &Path, name: &str, keys: &str) -> String {
    stage("write", &format!("path = '{}'\n{keys}", folder.join(name).display()))
}

/// A scan of several classes, in small tiles and through the spill.
fn synth(name: &str) -> String {
    let run = "[run]\ntile_points = 900\nspill = 'always'\nthreads = 2\nmemory = '800MiB'\n";
    format!("{run}{}", stage("synth", &format!("{name}\nscene = 'als'\npoints = 20_000")))
}

fn parse(text: &str) -> Result<Graph> {
    Graph::parse(text, "p.toml", &Registry::builtin())
}

fn run(text: &str) -> Done {
    let mut graph = parse(text).unwrap();
    // A branch says of which tree it is one.
    graph.settings.provenance = Some(false);
    graph.plan(&Overrides::default()).unwrap().run(&Quiet).unwrap()
}

fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let named = |path: &Path| path.file_name().unwrap().to_str().unwrap().to_owned();
    entries.map(|path| (named(&path), fs::read(&path).unwrap())).collect()
}

/// Runs `tree`, and each of `chains` alone: the same files. Both are texts for outputs in a folder.
fn compare(tree: impl Fn(&Path) -> String, chains: &[&dyn Fn(&Path) -> String]) -> Done {
    let (together, alone) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let done = run(&tree(together.path()));
    chains.iter().for_each(|chain| drop(run(&chain(alone.path()))));
    let (many, each) = (files(together.path()), files(alone.path()));
    assert_eq!(many.keys().collect::<Vec<_>>(), each.keys().collect::<Vec<_>>());
    for (name, bytes) in &each {
        assert!(many[name] == *bytes, "{name} differs");
        assert!(bytes.len() > 2_000, "{name} has {} bytes", bytes.len());
    }
    let decodes = done.report.run.phases.iter().filter(|phase| phase.name == "decode").count();
    assert!(decodes <= 1, "{:?}", done.report.run.phases);
    done
}

#[test]
fn three_resolutions_come_from_one_read() {
    let grid = |side: &str, from: &str| stage("grid", &format!("side = {side}\n{from}"));
    let tree = |at: &Path| {
        let mut text = synth("name = 'scan'");
        for (side, name) in [("0.8", "fine.laz"), ("3.0", "middle.las"), ("9.0", "coarse.ply")] {
            text += &grid(side, "from = 'scan'");
            text += &write(at, name, "");
        }
        text
    };
    let fine = |at: &Path| synth("") + &grid("0.8", "") + &write(at, "fine.laz", "");
    let middle = |at: &Path| synth("") + &grid("3.0", "") + &write(at, "middle.las", "");
    let coarse = |at: &Path| synth("") + &grid("9.0", "") + &write(at, "coarse.ply", "");
    let done = compare(tree, &[&fine, &middle, &coarse]);
    assert_eq!(done.report.further.len(), 2);
}

#[test]
fn the_ground_goes_one_way_and_the_rest_another() {
    let ground = |from: &str| stage("filter", &format!("keep_classes = [2]\n{from}"));
    let rest = |from: &str| stage("filter", &format!("drop_classes = [2]\n{from}"));
    // What is "auto" is settled by all that is read, which a branch has in common with others.
    let cells = stage("cells", "keep = '40%'\nside = 4.0");
    let thin = stage("normals", "") + &cells + &stage("median", "");
    let tree = |at: &Path| {
        let text = synth("name = 'all'") + &ground("") + &write(at, "ground.ply", "");
        text + &rest("from = 'all'") + &thin + &write(at, "rest.laz", "")
    };
    // Beside a branch on tiles nothing keeps the order of the input.
    let canonical = "order = 'canonical'";
    let alone = |at: &Path| synth("") + &ground("") + &write(at, "ground.ply", canonical);
    let others = |at: &Path| synth("") + &rest("") + &thin + &write(at, "rest.laz", "");
    compare(tree, &[&alone, &others]);
}

#[test]
fn several_outputs_end_a_branch_and_stand_on_the_way() {
    let normals = |keys: &str| stage("normals", keys);
    let cells = stage("cells", "max_angle = '8deg'") + &stage("median", "");
    let outliers = |from: &str| stage("outliers", from) + &stage("grid", "side = 2.0");
    let with = "dimensions = ['NormalX', 'NormalY', 'NormalZ']";
    let ascii = "encoding = 'ascii'";
    let tree = |at: &Path| {
        let text = synth("name = 'scan'") + &normals("") + &write(at, "normals.ply", with);
        let text = text + &cells + &write(at, "text.ply", ascii) + &write(at, "a.ply", "");
        text + &outliers("from = 'scan'") + &write(at, "b.las", "") + &write(at, "b.ply", "")
    };
    let first = |at: &Path| synth("") + &normals("") + &write(at, "normals.ply", with);
    let text = |at: &Path| synth("") + &normals("") + &cells + &write(at, "text.ply", ascii);
    let ply = |at: &Path| synth("") + &normals("") + &cells + &write(at, "a.ply", "");
    let other = |at: &Path| {
        let text = synth("") + &outliers("") + &write(at, "b.las", "");
        text + &write(at, "b.ply", "")
    };
    compare(tree, &[&first, &text, &ply, &other]);
}

/// The ground and the trees of a scan in two files.
fn two_inputs() -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    for (class, name) in [("2", "a.las"), ("5", "b.laz")] {
        let filter = stage("filter", &format!("keep_classes = [{class}]"));
        run(&(synth("") + &filter + &write(at.path(), name, "")));
    }
    at
}

#[test]
fn two_inputs_that_two_stages_read_are_one_scan() {
    let inputs = two_inputs();
    let path = |name: &str| inputs.path().join(name).display().to_string();
    let read = |name: &str, file: &str| {
        stage("read", &format!("name = '{name}'\npath = '{}'", path(file)))
    };
    let both = stage("read", &format!("path = ['{}', '{}']", path("a.las"), path("b.laz")));
    let thin = stage("cells", "max_angle = '8deg'") + &stage("median", "");
    let one = |at: &Path| {
        both.clone() + &stage("normals", "") + &thin + &write(at, "out.ply", "order = 'input'")
    };
    let sources = read("a", "a.las") + &read("b", "b.laz");
    let merges = [
        stage("normals", "from = ['a', 'b']"),
        stage("normals", "from = ['b', 'a']"),
        stage("merge", "from = ['a', 'b']") + &stage("normals", ""),
        stage("merge", "name = 'both'\nfrom = ['b', 'a']")
            + &stage("merge", "")
            + &stage("normals", "from = 'both'"),
    ];
    for merge in &merges[..3] {
        let tree =
            |at: &Path| sources.clone() + merge + &thin + &write(at, "out.ply", "order = 'input'");
        compare(tree, &[&one]);
    }
    // A merge that nothing takes from is a mistake like any other stage's.
    let unused =
        parse(&(sources.clone() + &merges[3] + &thin + &write(inputs.path(), "x.ply", "")));
    let told = unused.unwrap_err().to_string();
    assert!(told.contains("no output takes what `merge` leaves"), "{told}");
    // Branches take from a merge as from any stage. (LAS names the stages, and so the sources.)
    let tree = |at: &Path| {
        let merge = stage("merge", "name = 'both'\nfrom = ['a', 'b']");
        let text = sources.clone() + &merge + &stage("normals", "") + &thin;
        let text = text + &write(at, "out.ply", "order = 'input'");
        text + &stage("grid", "side = 2.0\nfrom = 'both'") + &write(at, "grid.ply", "")
    };
    let grid = |at: &Path| both.clone() + &stage("grid", "side = 2.0") + &write(at, "grid.ply", "");
    compare(tree, &[&one, &grid]);
}

/// What is told of a text; the stages of all are at fixed lines.
fn told(text: &str) -> String {
    parse(text).map(|_| ()).unwrap_err().to_string()
}

const A: &str = "[[stage]]\nkind = 'synth'\nname = 'a'\nscene = 'part'\npoints = 9\n";
const B: &str = "[[stage]]\nkind = 'synth'\nname = 'b'\nscene = 'part'\npoints = 9\n";
const OUT: &str = "[[stage]]\nkind = 'write'\npath = 'never-written.laz'\n";

#[test]
fn what_cannot_be_merged_is_told_with_what_would_do() {
    for (text, expected, help) in [
        (
            format!("{A}{B}[[stage]]\nkind = 'normals'\nfrom = 'b'\n{OUT}"),
            "p.toml:13:8: the sources of a pipeline are one scan: take from all of them",
            "write `from = [\"a\", \"b\"]`",
        ),
        (
            format!("{A}{B}{OUT}"),
            "p.toml:12:8: the sources of a pipeline are one scan",
            "write `from = [\"a\", \"b\"]`",
        ),
        (
            format!("{A}{}{OUT}", B.replace("name = 'b'\n", "")),
            "p.toml:11:8: the sources of a pipeline are one scan",
            "give each source a `name`",
        ),
        (
            format!(
                "{A}[[stage]]\nkind = 'grid'\nname = 'g'\nside = 1.0\n[[stage]]\nkind = 'merge'\n\
                 from = ['a', 'g']\n{OUT}"
            ),
            "p.toml:12:9: only sources can be merged",
            "`read.path` takes a list",
        ),
        (
            format!(
                "{A}{OUT}name = 'end'\n[[stage]]\nkind = 'write'\npath = 'b.las'\nfrom = 'end'\n"
            ),
            "p.toml:13:8: no earlier stage that gives points is named `end`",
            "names: a",
        ),
        (
            format!("{A}{B}[[stage]]\nkind = 'write'\nfrom = ['a', 'a', 'b']\npath = 'b.las'\n"),
            "p.toml:13:14: `a` is named twice",
            "",
        ),
        (
            format!("{A}{OUT}from = []\n"),
            "p.toml:9:8: `from` takes the name of a stage, or a list of names",
            "",
        ),
        (
            format!("{A}[[stage]]\nkind = 'normals'\n{OUT}from = 'normals'\n"),
            "p.toml:11:8: no earlier stage that gives points is named `normals`",
            "`from` means the `name` of a stage",
        ),
        (
            format!(
                "{A}{OUT}from = 'b'\n{B}from = 'a'\n[[stage]]\nkind = 'write'\npath = 'b.las'\n"
            ),
            "p.toml:9:8: no earlier stage that gives points is named `b`",
            "put the stage `b` above this one",
        ),
        (
            format!("{A}{B}from = 'a'\n{OUT}from = ['a', 'b']"),
            "p.toml:11:8: a source takes from no stage",
            "",
        ),
    ] {
        let told = told(&text);
        assert!(told.contains(expected) && told.contains(help), "{expected}\n{help}\n{told}");
    }
}

#[test]
fn a_wrong_stage_or_name_hides_no_other_mistake() {
    // A key, a kind, two names, an end, and two outputs of one name.
    let text = format!(
        "{}[[stage]]\nkind = 'nromals'\n[[stage]]\nkind = 'grid'\nname = 'a'\nside = 2.0\n\
         [[stage]]\nkind = 'write'\nfrom = 'c'\npath = 'x.laz'\n\
         [[stage]]\nkind = 'write'\npath = 'x.laz'\n[[stage]]\nkind = 'median'\n",
        A.replace("points = 9", "pionts = 9")
    );
    let all = told(&text);
    for expected in [
        "6 mistakes\n",
        "p.toml:5:1: `synth` has no key `pionts`",
        "p.toml:7:8: there is no stage `nromals`",
        "p.toml:10:8: another stage above has this name",
        "p.toml:14:8: no earlier stage that gives points is named `c`",
        "p.toml:18:8: x.laz is written twice",
        "p.toml:20:8: nothing takes these points: end with `write`",
    ] {
        assert!(all.contains(expected), "{expected}\n{all}");
    }
    // What an unknown stage might be is no mistake: a source, what takes the points, or an output.
    for text in [
        format!("[[stage]]\nkind = 'raed'\npath = 'x.las'\n[[stage]]\nkind = 'normals'\n{OUT}"),
        format!("[[stage]]\npath = 'x.las'\n[[stage]]\nkind = 'normals'\n{OUT}"),
        format!("{A}[[stage]]\nkind = 'normals'\n{}", OUT.replace("path", "paht").trim_end()),
        format!("{A}[[stage]]\nkind = 'normals'\n[[stage]]\nkind = 'wriet'\n"),
        format!("{A}[[stage]]\nkind = 'normals'\nname = 'less'\n{OUT}from = 'lest'\n"),
    ] {
        let told = told(&text);
        assert!(told.starts_with("p.toml:") || told.starts_with("2 mistakes"), "{told}");
        let tree = ["nothing takes", "no output takes", "must be a source", "one scan"];
        assert!(!tree.iter().any(|mistake| told.contains(mistake)), "{told}");
    }
}
