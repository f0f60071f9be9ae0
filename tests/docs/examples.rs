//! What the pages show: pipelines can be planned, commands run, and tables have what the code has.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use pointmill::{Graph, Registry};

use super::root;
use crate::support::command::{done, pointmill};

/// The blocks of a page in this language, without their fences.
fn blocks<'a>(page: &'a str, language: &str) -> Vec<&'a str> {
    let fenced = page.split("\n```").skip(1).step_by(2);
    let own = |block: &'a str| block.strip_prefix(language)?.strip_prefix('\n');
    fenced.filter_map(own).collect()
}

fn page(name: &str) -> String {
    fs::read_to_string(root().join("docs").join(name)).unwrap()
}

/// A folder with the inputs that the pages name.
fn survey() -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    let als = ["synth", "als", "-n", "5000", "-o"];
    for name in ["scan.laz", "more.laz", "a.laz", "b.laz", "scan.las", "scan.ply"] {
        done(at.path(), &[&als[..], &[name]].concat());
    }
    done(at.path(), &["convert", "a.laz", "-o", "city.copc.laz", "--quiet"]);
    fs::create_dir(at.path().join("survey")).unwrap();
    for (name, seed) in [("survey/1.laz", "1"), ("survey/2.laz", "2")] {
        done(at.path(), &[&als[..], &[name, "--seed", seed]].concat());
    }
    let area = "POLYGON((350000 5600000, 350020 5600000, 350010 5600020))";
    fs::write(at.path().join("area.wkt"), area).unwrap();
    fs::copy(root().join("tests/wrong/inputs/thin.toml"), at.path().join("thin.toml")).unwrap();
    at
}

/// Checks a pipeline as a user does.
fn check(at: &Path, pipeline: &str, is_file: bool) {
    let mut arguments = vec!["check", pipeline];
    let needs_scan = is_file && fs::read_to_string(at.join(pipeline)).unwrap().contains("scan = {");
    if needs_scan {
        arguments.extend(["--param", "scan=scan.laz"]);
    }
    let (code, _, stderr) = pointmill(at, &arguments);
    assert_eq!(code, 0, "{pipeline}: {stderr}");
}

/// Runs each line of the `sh` blocks of a page that is a command of ours; how many there were.
fn run_commands(at: &Path, page: &str) -> usize {
    let lines = blocks(page, "sh").into_iter().flat_map(str::lines);
    let ours: Vec<&str> = lines.filter_map(|line| line.strip_prefix("pointmill ")).collect();
    for command in &ours {
        let words = shell_words(command);
        let (code, _, stderr) = pointmill(at, &words);
        assert_eq!(code, 0, "pointmill {command}\n{stderr}");
    }
    ours.len()
}

/// The words of a command; what stands between single quotes is one of them.
pub fn shell_words(command: &str) -> Vec<&str> {
    let parts = command.split('\'').enumerate();
    let words = |(n, part)| match n % 2 {
        0 => str::split_whitespace(part).collect(),
        _ => vec![part],
    };
    parts.flat_map(words).collect()
}

#[test]
fn every_pipeline_of_the_page_of_the_language_can_be_run() {
    let (at, page) = (survey(), page("pipeline.md"));
    let at = at.path();
    let mut count = 0;
    for (language, name) in [("toml", "p.toml"), ("json", "p.json")] {
        for block in blocks(&page, language) {
            fs::write(at.join(name), block).unwrap();
            check(at, name, true);
            count += 1;
        }
    }
    for block in blocks(&page, "line") {
        check(at, block.trim(), false);
        count += 1;
    }
    assert!(count >= 8, "{count} pipelines");
    assert_eq!(run_commands(at, &page), 1);
}

#[test]
fn commands_beside_those_of_other_programs_run() {
    let (at, page) = (survey(), page("coming-from.md"));
    assert!(run_commands(at.path(), &page) >= 15);
    let pipelines = blocks(&page, "toml");
    assert!(!pipelines.is_empty());
    for block in pipelines {
        fs::write(at.path().join("p.toml"), block).unwrap();
        check(at.path(), "p.toml", true);
    }
}

/// The words in backticks in column `column` of rows that begin with `begin`.
fn quoted(page: &str, begin: &str, column: usize) -> BTreeSet<String> {
    let rows = page.lines().filter(|line| line.starts_with(begin));
    let cells = rows.filter_map(|row| row.split('|').nth(column));
    cells.flat_map(|cell| cell.split('`').skip(1).step_by(2).map(str::to_owned)).collect()
}

/// What a wrong pipeline is told, between two texts.
fn told(stage: &str, before: &str, after: &str) -> BTreeSet<String> {
    let text = format!(
        "[[stage]]\nkind = 'synth'\nscene = 'als'\npoints = 9\n[[stage]]\n{stage}\n\
         [[stage]]\nkind = 'write'\npath = 'out.laz'\n"
    );
    let read = Graph::parse(&text, "p.toml", &Registry::builtin());
    let error = match read.and_then(|graph| graph.plan(&pointmill::Overrides::default())) {
        Ok(_) => panic!("{stage} is right"),
        Err(error) => error,
    };
    let error = format!("{error}\n{}\n", error.remedy().unwrap_or_default());
    let list = error.split_once(before).expect(before).1.split_once(after).expect(after).0;
    list.replace(" or ", ", ").split(", ").map(str::to_owned).collect()
}

#[test]
fn tables_of_the_language_have_the_units_functions_and_dimensions_of_the_code() {
    let page = page("pipeline.md");
    let lengths = told("kind = 'grid'\nside = '1 x'", "(", ")");
    let lengths: BTreeSet<String> =
        lengths.into_iter().filter(|unit| !unit.contains(' ')).collect();
    assert_eq!(quoted(&page, "| length |", 2), lengths);
    let sizes = "kind = 'tap'\n[run]\nmemory = '1 x'";
    assert_eq!(quoted(&page, "| size |", 2), told(sizes, "(units: ", ")"));
    for unit in quoted(&page, "| angle |", 2) {
        let text = format!("1 {unit}");
        assert!(
            serde_json::from_value::<pointmill::quantity::Angle>(text.into()).is_ok(),
            "{unit}"
        );
    }
    for unit in quoted(&page, "| count |", 2) {
        assert!(pointmill::quantity::parse_count(&format!("1{unit}")).is_ok(), "{unit}");
    }
    let calls = quoted(&page, "| `", 1).into_iter();
    let functions: BTreeSet<String> =
        calls.filter_map(|call| Some(call.split_once("(x")?.0.to_owned())).collect();
    let unknown = |of: &str| format!("kind = 'filter'\nwhere = '{of} > 1'");
    assert_eq!(functions, told(&unknown("none(X)"), "functions: ", "\n"));
    let known = told(&unknown("QQQQQQ"), "dimensions: ", "\n");
    let known: BTreeSet<String> = known
        .iter()
        .filter_map(|part| part.split_once(" ("))
        .map(|(name, _)| name.into())
        .collect();
    let begins = |name: &String| name.starts_with(|c: char| c.is_ascii_uppercase());
    let named: BTreeSet<String> = quoted(&page, "| `", 1).into_iter().filter(begins).collect();
    assert_eq!(named, known);
}

/// The lines of a text without what they are indented by.
fn lines(text: &str) -> String {
    text.lines().map(|line| line.trim_start().to_owned() + "\n").collect()
}

#[test]
fn code_of_the_page_of_embedding_is_taken_from_the_examples() {
    let page = page("embedding.md");
    let files = fs::read_dir(root().join("examples")).unwrap().map(|file| file.unwrap().path());
    let examples: Vec<(String, String)> = files
        .map(|file| (file.file_stem().unwrap().to_str().unwrap().to_owned(), file))
        .map(|(name, file)| (name, lines(&fs::read_to_string(file).unwrap())))
        .collect();
    let quoted = blocks(&page, "rust");
    assert!(quoted.len() >= 5, "{} quotations", quoted.len());
    for block in quoted {
        let block = lines(block);
        let is_there = examples.iter().any(|(_, text)| text.contains(&block));
        assert!(is_there, "no example has\n{block}");
    }
    for (name, text) in examples.iter().filter(|(name, _)| name.as_str() >= "03") {
        assert!(text.starts_with("//! Reach for this when "), "{name}");
        let is_listed = page.contains(&format!("../examples/{name}.rs"));
        assert!(is_listed || name == "07_picture", "{name} is not on the page");
    }
    let manifest = fs::read_to_string(root().join("Cargo.toml")).unwrap();
    let oldest = manifest.split("rust-version = \"").nth(1).unwrap().split('"').next().unwrap();
    assert!(
        page.contains(&format!("The oldest Rust that it builds with is {oldest}.")),
        "{oldest}"
    );
}
