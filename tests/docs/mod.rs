//! The pages of docs/ that the code generates are those in the repository, and the keys that
//! docs/formats.md names are those that a real report and real descriptions have.
//!
//! `POINTMILL_WRITE_DOCS=1 cargo test --test repository` writes the generated pages again.

mod dimensions;
pub mod examples;
mod formats;
mod keys;
mod rules;
mod schema;
mod worked;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use formats::{agree, documented};
use pointmill::graph::RunSettings;
use pointmill::internals::LimitKeys;
use pointmill::{Overrides, Quiet, Registry, TableDescription, WordDescription};
use serde_json::Value;

use crate::support::case::execute;
use crate::support::command::pointmill;

pub const SAYS_SO: &str =
    "written by `POINTMILL_WRITE_DOCS=1 cargo test --test repository`; do not edit";

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Compares the file with the one in the repository, or writes it.
pub fn keep(page: &str, text: &str) {
    let path = root().join(page);
    if std::env::var_os("POINTMILL_WRITE_DOCS").is_some() {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, text).unwrap();
        return;
    }
    let kept = fs::read_to_string(&path).unwrap_or_default();
    assert!(kept == text, "{page} is not what the code says: it is {SAYS_SO}");
}

/// What the page of the `[run]` table says of editors.
const EDITORS: &str = "\
## Editors

An editor that has the schema of pipeline files completes their keys, shows what these are, and marks
mistakes as they are typed. [`pipeline.schema.json`](pipeline.schema.json) is that of this version;
`pointmill schema > pipeline.schema.json` writes it, and a program with stages of its own writes one
that has them. Editors that use Taplo (Even Better TOML in Visual Studio Code, among others) take it
from the first line of a pipeline file, as a path from the file's folder or as an address:

```toml
#:schema ./pipeline.schema.json
```

It knows kinds, keys and values. What hangs together with other keys, with files or with what a scan
has, `pointmill check` tells.
";

fn page(table: &TableDescription, title: &str) -> String {
    let about = match table.docs.starts_with(&table.about) {
        true => String::new(),
        false => format!("{}\n\n", table.about),
    };
    let docs = table.docs.replace("\n# ", "\n## ");
    format!("# {title}\n\n<!-- {SAYS_SO} -->\n\n{about}{docs}\n")
}

fn stage_page(table: &TableDescription) -> String {
    let mut out = page(table, &table.name) + "\n## Keys\n\n";
    match table.keys.is_empty() {
        true => out += "It has none.\n",
        false => out += &keys::markdown(&table.keys),
    }
    match table.limits.iter().any(|key| key.name == LimitKeys::SEES) {
        _ if table.limits.is_empty() => {}
        true => out += "\nIt takes [the keys that limit a stage](README.md#limits) too.\n",
        false => {
            out += "\nIt takes [the keys that limit a stage](README.md#limits) but `sees` too.\n";
        }
    }
    if let Some(main) = table.main {
        out += &format!(
            "\nIn a pipeline of one line the word right behind `{}` is its `{main}`.\n",
            table.name
        );
    }
    out += "\nEvery stage may also have a `name`, by which `--set` and `from` mean it.\n";
    out + &worked::section(&table.name)
}

#[test]
fn every_stage_has_a_page_that_says_what_the_code_does() {
    let registry = Registry::builtin();
    let mut tables: Vec<TableDescription> =
        registry.kinds().filter_map(|(kind, _)| registry.describe(kind)).collect();
    tables.sort_by_key(|table| table.role.map(|role| role as u8));
    let mut index = format!("# Stages\n\n<!-- {SAYS_SO} -->\n\n| stage | |\n|---|---|\n");
    for table in &tables {
        let (kind, text) = (&table.name, stage_page(table));
        let said = table.keys.iter().all(|key| !key.docs.is_empty()) && !table.docs.is_empty();
        assert!(said, "{kind}: {text}");
        keep(&format!("docs/stages/{kind}.md"), &text);
        let _ = writeln!(index, "| [{kind}]({kind}.md) | {} |", table.about);
    }
    let limits = registry.describe_limits();
    let names: Vec<&str> = limits.keys.iter().map(|key| key.name.as_str()).collect();
    assert_eq!(names, LimitKeys::KEYS);
    let keys = keys::markdown(&limits.keys);
    let _ = write!(index, "\n## Limits\n\n{}\n\n{keys}", limits.docs);
    index += "\nWhat stands above all of them: [the `[run]` table](../run.md); what is around them: \
              [the pipeline language](../pipeline.md).\n";
    keep("docs/stages/README.md", &index);
    let stored = fs::read_dir(root().join("docs/stages")).unwrap().count();
    assert_eq!(stored, tables.len() + 1, "docs/stages has pages of no stage");
}

#[test]
fn the_run_table_has_a_page_that_says_what_the_code_does() {
    let run = Registry::builtin().describe_run();
    for key in &run.keys {
        for WordDescription { word, .. } in &key.words {
            let set: RunSettings = toml::from_str(&format!("{} = '{word}'", key.name)).unwrap();
            let is_default = key.default.as_ref().is_some_and(|default| default == word);
            assert_eq!(set == RunSettings::default(), is_default, "{} = {word}", key.name);
        }
    }
    let text = page(&run, "The `[run]` table") + "\n## Keys\n\n" + &keys::markdown(&run.keys);
    let text = format!(
        "{text}\nThe pipeline around it has [a page of its own](pipeline.md).\n\n{EDITORS}"
    );
    keep("docs/run.md", &text);
}

#[test]
fn the_accept_table_has_a_page_that_says_what_the_code_does() {
    let accept = Registry::builtin().describe_accept();
    let keys = keys::markdown(&accept.keys);
    let text = page(&accept, "The `[accept]` table") + "\n## Keys\n\n" + &keys;
    keep(
        "docs/accept.md",
        &format!("{text}\nSee [what is accepted](pipeline.md#what-is-accepted).\n"),
    );
}

fn help(command: Option<&str>) -> String {
    let arguments: Vec<&str> = ["help"].into_iter().chain(command).collect();
    let (code, text, _) = pointmill(root().as_path(), &arguments);
    assert_eq!(code, 0);
    text.lines().map(str::trim_end).collect::<Vec<_>>().join("\n").trim_end().to_owned()
}

#[test]
fn the_command_line_has_a_page_that_says_what_help_says() {
    let top = help(None);
    let commands: Vec<&str> = top
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| line.starts_with("  "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|command| *command != "help")
        .collect();
    assert!(commands.len() >= 6, "{commands:?}");
    let mut out = format!("# The command line\n\n<!-- {SAYS_SO} -->\n\n```\n{top}\n```\n");
    for command in commands {
        let _ = write!(out, "\n## {command}\n\n```\n{}\n```\n", help(Some(command)));
    }
    keep("docs/cli.md", &out);
}

/// Reduces a made-up scan to `output` with a report, which is returned.
fn reduce(folder: &Path, output: &str) -> Value {
    let at = |name: &str| folder.join(name).display().to_string();
    let text = format!(
        "[run]\nreport = '{}'\nmemory = '256MiB'\nthreads = 2\n\
         [[stage]]\nkind = 'read'\npath = '{}'\n[[stage]]\nkind = 'normals'\n\
         [[stage]]\nkind = 'cells'\n[[stage]]\nkind = 'median'\n\
         [[stage]]\nkind = 'write'\npath = '{}'\ndimensions = ['NormalX', 'NormalY', 'NormalZ']\n",
        at("report.json"),
        at("scan.laz"),
        at(output)
    );
    execute(&text, &Overrides::default(), &Quiet).unwrap();
    serde_json::from_slice(&fs::read(folder.join("report.json")).unwrap()).unwrap()
}

#[test]
fn the_formats_that_are_documented_are_those_that_are_written() {
    let folder = tempfile::tempdir().unwrap();
    let (scan, registry) = (folder.path().join("scan.laz"), Registry::builtin());
    let text = format!(
        "[[stage]]\nkind = 'synth'\nscene = 'als'\npoints = 20000\n\
         [[stage]]\nkind = 'write'\npath = '{}'\n",
        scan.display()
    );
    execute(&text, &Overrides::default(), &Quiet).unwrap();

    let report = reduce(folder.path(), "reduced.laz");
    agree(&report, "report.json");
    for (section, counts) in [("Counts", "/result/counts"), ("Work", "/run/work")] {
        let there: BTreeSet<String> =
            report.pointer(counts).unwrap().as_object().unwrap().keys().cloned().collect();
        let named = documented(section);
        let all: BTreeSet<String> = named.iter().map(|(key, _)| key.clone()).collect();
        let must = named.into_iter().filter(|(_, not_always)| !not_always).map(|(key, _)| key);
        assert!(there.is_subset(&all), "{section}: {there:?}");
        assert!(must.collect::<BTreeSet<_>>().is_subset(&there), "{section}: {there:?}");
    }
    agree(
        &pointmill::io::describe(&folder.path().join("reduced.laz"), registry.formats()).unwrap(),
        "info: LAS and LAZ",
    );
    for (command, pointer) in [(&["info", "--deep"][..], "/0/deep"), (&["validate"], "/0")] {
        let arguments = [command, &["--json", "scan.laz"]].concat();
        let (code, printed, told) = pointmill(folder.path(), &arguments);
        assert_eq!(code, 0, "{told}");
        let printed: Value = serde_json::from_str(&printed).unwrap();
        agree(printed.pointer(pointer).unwrap(), &command.join(" "));
    }
    let text = "[params]\nout = 'o.laz'\n[[stage]]\nkind = 'read'\npath = 'scan.laz'\n\
                [[stage]]\nkind = 'drop'\nclasses = [7]\n[[stage]]\nkind = 'grid'\nside = 2\n\
                [[stage]]\nkind = 'filter'\nwhere = 'Intensity > 40'\n\
                [[stage]]\nkind = 'write'\npath = '${out}'\n";
    fs::write(folder.path().join("p.toml"), text).unwrap();
    for command in ["plan", "explain"] {
        let (code, printed, told) = pointmill(folder.path(), &[command, "p.toml", "--json"]);
        assert_eq!(code, 0, "{told}");
        agree(&serde_json::from_str(&printed).unwrap(), command);
    }
    let all = ["compare", "scan.laz", "reduced.laz", "--distances", "--depth", "--json"];
    let all = [&all[..], &["--accept", "subset, max <= 100"]].concat();
    let (code, printed, told) = pointmill(folder.path(), &all);
    assert_eq!(code, 0, "{told}");
    agree(&serde_json::from_str(&printed).unwrap(), "compare");
    for (output, section) in [
        ("reduced.ply", "info: PLY"),
        ("reduced.pcd", "info: PCD"),
        ("reduced.e57", "info: E57"),
        ("reduced.csv", "info: texts"),
    ] {
        reduce(folder.path(), output);
        let output = folder.path().join(output);
        agree(&pointmill::io::describe(&output, registry.formats()).unwrap(), section);
    }
    let obj = folder.path().join("a.obj");
    fs::write(&obj, "v 1 2 3\n").unwrap();
    let described = pointmill::io::describe(&obj, registry.formats()).unwrap();
    agree(&described, "info: OBJ, OFF and STL");
}

/// Where the links of a page lead, anchors and web addresses left out.
fn links(text: &str) -> Vec<&str> {
    let targets = text.split("](").skip(1).filter_map(|behind| behind.split(')').next());
    let files = targets.map(|link| link.split('#').next().unwrap_or(link));
    files.filter(|link| !link.is_empty() && !link.contains("://")).collect()
}

#[test]
fn links_lead_to_files() {
    let mut pages: Vec<PathBuf> = ["README.md", "CONTRIBUTING.md"].map(|p| root().join(p)).into();
    for folder in ["docs", "docs/stages"] {
        let files = fs::read_dir(root().join(folder)).unwrap().map(|entry| entry.unwrap().path());
        pages.extend(files.filter(|path| path.extension().is_some_and(|e| e == "md")));
    }
    let mut count = 0;
    for page in &pages {
        for link in links(&fs::read_to_string(page).unwrap()) {
            let to = page.parent().unwrap().join(link);
            assert!(to.exists(), "{}: there is no {link}", page.display());
            count += 1;
        }
    }
    assert!(count >= 20, "{count} links in {} pages: were they read?", pages.len());
}
