//! `graph`, `new` and `schema`: drawings of pipelines, files for jobs, and what editors know.

use std::fs;
use std::path::Path;

use pointmill::{Graph, Registry};
use serde_json::Value;

use crate::support::command::{done, fails, scans};

const TREE: &str = "[params]\nside = 0.5\n\
    [[stage]]\nkind = 'read'\npath = 'no-such.laz'\nname = 'scan'\n\
    [[stage]]\nkind = 'grid'\nside = '${side}'\n\
    [[stage]]\nkind = 'write'\npath = 'thin.laz'\n\
    [[stage]]\nkind = 'write'\npath = 'all.ply'\nfrom = 'scan'\n";

#[test]
fn a_graph_is_drawn_without_its_inputs_and_the_same_every_time() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    fs::write(at.join("p.toml"), TREE).unwrap();
    let text = "read (scan)  path = \"no-such.laz\"\n\
                ├─ grid  side = 0.5\n\
                │  write  path = \"thin.laz\"\n\
                └─ write  path = \"all.ply\"\n";
    assert_eq!(done(at, &["graph", "p.toml"]), text);
    assert_eq!(done(at, &["graph", "p.toml", "--as", "text"]), text);
    let set = done(at, &["graph", "p.toml", "--set", "grid.pick=first", "--param", "side=2"]);
    assert!(set.contains("grid  side = 2  pick = \"first\"\n"), "{set}");
    for (form, begins) in [("mermaid", "flowchart TD\n"), ("dot", "digraph pipeline {\n")] {
        let drawn = done(at, &["graph", "p.toml", "--as", form]);
        assert!(drawn.starts_with(begins) && drawn.contains("s0 -"), "{drawn}");
        assert_eq!(drawn, done(at, &["graph", "p.toml", "--as", form]));
    }
    fails(at, &["graph", "p.toml", "--as", "svg"], 2, &["text", "mermaid", "dot"]);
    fails(at, &["graph", "q.toml"], 1, &["q.toml"]);
    // Neither patterns that mean no file yet, nor areas, need to be there.
    let later = "crop file=area.wkt ! write out.laz";
    let line = format!("read 'survey/*.laz' ! {later}");
    assert!(done(at, &["graph", &line]).contains("crop"));
    assert!(done(at, &["explain", &line]).contains("path = [\"survey/*.laz\"]"));
    fails(at, &["check", &line], 1, &["no file matches `survey/*.laz`"]);
    fails(at, &["check", &format!("synth scene=plane points=10 ! {later}")], 1, &["area.wkt"]);
}

#[test]
fn new_lists_jobs_and_writes_files_that_are_right_and_replaces_none() {
    let at = scans(&[]);
    let at = at.path();
    let listed = done(at, &["new"]);
    let jobs: Vec<&str> =
        listed.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert!(jobs.contains(&"reduce") && jobs.contains(&"grid"), "{listed}");
    fs::create_dir(at.join("survey")).unwrap();
    for job in jobs {
        let told = done(at, &["new", job]);
        let name = format!("{job}.toml");
        assert!(told.starts_with(&name), "{told}");
        let text = fs::read_to_string(at.join(&name)).unwrap();
        assert!(
            text.starts_with("# ") && text.contains(&format!("pointmill run {name}")),
            "{text}"
        );
        fails(at, &["new", job], 1, &[&name, "this file exists", "-o"]);
        assert_eq!(fs::read_to_string(at.join(&name)).unwrap(), text);
    }
    done(at, &["new", "demo", "-o", "mine.toml"]);
    assert!(Graph::read(&at.join("mine.toml"), &Registry::builtin(), &[]).is_ok());
    fails(at, &["new", "reduse"], 2, &["there is no job `reduse`", "did you mean `reduce`?"]);
    fails(at, &["new", "demo", "-o", "none/a.toml"], 1, &["none/a.toml"]);
    fails(at, &["new", "-o", "a.toml"], 2, &["JOB"]);
}

#[test]
fn schema_prints_what_is_in_docs() {
    let at = tempfile::tempdir().unwrap();
    let printed: Value = serde_json::from_str(&done(at.path(), &["schema"])).unwrap();
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/pipeline.schema.json");
    let kept: Value = serde_json::from_str(&fs::read_to_string(kept).unwrap()).unwrap();
    assert_eq!(printed, kept);
}
