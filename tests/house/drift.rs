//! Sentences of the documentation that the code can contradict are held against it.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use pointmill::Registry;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn page(name: &str) -> String {
    fs::read_to_string(root().join(name)).unwrap()
}

/// The kinds of stages, their keys, and the words that these can be given.
fn vocabulary() -> BTreeSet<String> {
    let registry = Registry::builtin();
    let kinds = registry.kinds().filter_map(|(kind, _)| registry.describe(kind));
    let mut words = BTreeSet::new();
    for described in kinds.chain([registry.describe_run()]) {
        for key in described.all_keys() {
            words.insert(key.name.clone());
            words.extend(key.words.iter().map(|word| word.word.clone()));
        }
        words.insert(described.name);
    }
    assert!(words.len() > 50, "{words:?}");
    words
}

#[test]
fn what_the_method_lacks_is_not_there() {
    /// Words of the vocabulary that mean something else in these lines: a "sliding median" is no
    /// stage `median`, and the others are English.
    const ENGLISH: [&str; 5] = ["median", "normals", "with", "distance", "in"];
    let text = page("docs/paper.md");
    let section = text.split("## Not there yet").nth(1).unwrap();
    let lacking: Vec<&str> = section.lines().filter(|line| line.starts_with("- ")).collect();
    assert!(lacking.len() >= 2, "{section}");
    let words = vocabulary();
    for line in lacking {
        for word in line.split(|c: char| !c.is_alphanumeric() && c != '-' && c != '_') {
            let exists = words.contains(word) && !ENGLISH.contains(&word);
            assert!(!exists, "docs/paper.md says that `{word}` is not there: {line}");
        }
    }
}

/// All files and folders below `folder`, and itself.
fn below(folder: &Path, into: &mut Vec<String>) {
    into.push(folder.to_str().unwrap().to_owned());
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => below(&path, into),
            false => into.push(path.to_str().unwrap().to_owned()),
        }
    }
}

#[test]
fn the_files_that_pages_name_exist() {
    let mut there = Vec::new();
    for folder in ["src", "tests", "examples"] {
        below(&root().join(folder), &mut there);
    }
    let mut named = 0;
    for name in ["docs/architecture.md", "docs/paper.md", "CONTRIBUTING.md"] {
        let text = page(name);
        for part in text.split('`').skip(1).step_by(2) {
            let is_source = part.ends_with(".rs") && !part.contains([' ', '*', '{']);
            let is_folder = part.ends_with('/') && part.starts_with("src/");
            if !is_source && !is_folder {
                continue;
            }
            // Pages leave out the folders that their sentence is about.
            let inside = format!("/{}", part.trim_end_matches('/'));
            let found = there.iter().any(|path| path.ends_with(&inside));
            assert!(found, "{name} names {part}, which does not exist");
            named += 1;
        }
    }
    assert!(named > 30, "{named} files are named");
}

#[test]
fn the_tests_that_pages_tell_to_run_exist() {
    let mut told = 0;
    for name in ["docs/reliability.md", "docs/paper.md", "CONTRIBUTING.md"] {
        let text = page(name);
        let commands = text.split('`').skip(1).step_by(2).flat_map(str::lines);
        for command in commands.filter(|part| part.contains("cargo test")) {
            let words: Vec<&str> = command.split(' ').collect();
            let behind = |option: &str| {
                let at = words.iter().enumerate().filter(move |(_, word)| **word == option);
                at.filter_map(|(at, _)| words.get(at + 1).copied()).collect::<Vec<_>>()
            };
            let targets = behind("--test");
            for target in &targets {
                let file = root().join("tests").join(format!("{target}.rs"));
                assert!(file.exists(), "{name}: there is no test {target}");
                told += 1;
            }
            for module in words.iter().filter_map(|word| word.strip_suffix("::")) {
                let path = root().join("tests").join(module.replace("::", "/"));
                let is_there = path.with_extension("rs").exists() || path.join("mod.rs").exists();
                assert!(is_there, "{name}: there is no {module}");
            }
        }
    }
    assert!(told > 20, "{told} are told");
}

#[test]
fn the_tour_names_every_stage_that_works_on_tiles() {
    let tour = page("src/lib.rs");
    let line = tour.split("[`ops`]: ").nth(1).unwrap().split("//! -").next().unwrap();
    let modules = page("docs/architecture.md");
    let ops = modules.lines().find(|line| line.contains("├── ops ")).unwrap();
    for (kind, _) in Registry::builtin().kinds() {
        let ends = ["discard", "mesh", "read", "synth", "write"].contains(&kind);
        assert_eq!(line.contains(&format!("`{kind}`")), !ends, "src/lib.rs: {kind}");
        assert_eq!(ops.contains(kind), !ends, "docs/architecture.md: {kind}");
    }
}

#[test]
fn a_path_in_a_message_is_shown_and_not_displayed() {
    /// Documents that say paths as they are, and whose writers escape them: the report and the
    /// events.
    const DOCUMENTS: [(&str, usize); 2] = [("src/report/document.rs", 1), ("src/cli/events.rs", 3)];
    let mut files = Vec::new();
    below(&root().join("src"), &mut files);
    let mut allowed = 0;
    for file in files.iter().filter(|file| file.ends_with(".rs") && !file.ends_with("tests.rs")) {
        let name = file.strip_prefix(root().to_str().unwrap()).unwrap().trim_start_matches('/');
        let text = fs::read_to_string(file).unwrap();
        let code = text.split("#[cfg(test)]\nmod tests").next().unwrap();
        let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
        let found = lines.filter(|line| line.contains(".display()")).count();
        let document = DOCUMENTS.iter().find(|(of, _)| *of == name);
        assert_eq!(found, document.map_or(0, |(_, of)| *of), "{name}: use `error::shown`");
        allowed += found;
    }
    assert_eq!((allowed, files.len() > 150), (4, true));
}
