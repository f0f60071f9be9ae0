//! The pages of docs/ and the data of `pointmill stages` that the code generates are those in the
//! repository, and the keys that docs/formats.md names are those that a real report and real
//! descriptions have.
//!
//! `POINTMILL_WRITE_DOCS=1 cargo test --test repository` writes the generated pages again.

mod formats;
mod keys;
mod source;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use formats::{agree, documented};
use keys::{Default, Key};
use pointmill::graph::RunSettings;
use pointmill::internals::LimitKeys;
use pointmill::io::{Read, Write};
use pointmill::ops::normals::Normals;
use pointmill::ops::{Cells, Filter, Grid, Median, Merge, Outliers};
use pointmill::stage::{Format, StageKind};
use pointmill::synth::Synth;
use pointmill::{Overrides, Quiet, Registry};
use serde_json::Value;

use crate::support::case::execute;
use crate::support::command::pointmill;
use source::{Enum, Field, enum_of, item_docs, struct_of};

pub const SAYS_SO: &str =
    "written by `POINTMILL_WRITE_DOCS=1 cargo test --test repository`; do not edit";

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn source(file: &str) -> String {
    fs::read_to_string(root().join(file)).unwrap_or_else(|e| panic!("{file}: {e}"))
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

/// A stage and where its documentation is.
struct Page {
    kind: &'static str,
    about: &'static str,
    file: &'static str,
    /// Names of the files that define the words which its keys take.
    words: &'static [&'static str],
    /// A further section: heading, file, function whose documentation it is.
    more: Option<(&'static str, &'static str, &'static str)>,
    /// The keys that must be given.
    required: &'static str,
    /// The stage's keys when just those are.
    keys: fn(&str) -> Option<Value>,
}

fn keys_of<K: StageKind>(text: &str) -> Option<Value> {
    toml::from_str::<K>(text).ok().map(|stage| serde_json::to_value(stage).unwrap())
}

fn page<K: StageKind>(file: &'static str, required: &'static str) -> Page {
    let (kind, about) = (K::KIND, K::ABOUT);
    Page { kind, about, file, words: &[], more: None, required, keys: keys_of::<K> }
}

const KINDS: &str = "src/io/ends/kinds.rs";

fn pages() -> Vec<Page> {
    let expand = ("What a path means", "src/io/ends/inputs.rs", "expand");
    vec![
        Page { more: Some(expand), ..page::<Read>(KINDS, "path = 'scan.laz'") },
        Page {
            words: &["src/synth/scene.rs"],
            ..page::<Synth>("src/synth/kind.rs", "scene = 'als'\npoints = 1000")
        },
        page::<Merge>("src/ops/merge.rs", ""),
        Page { words: &["src/point/selection.rs"], ..page::<Filter>("src/ops/filter.rs", "") },
        page::<Outliers>("src/ops/outliers.rs", ""),
        Page {
            words: &["src/ops/normals/estimate.rs", "src/ops/normals/orient.rs"],
            ..page::<Normals>("src/ops/normals.rs", "")
        },
        Page {
            words: &["src/ops/cells/settings.rs"],
            ..page::<Cells>("src/ops/cells/keys.rs", "")
        },
        page::<Median>("src/ops/median.rs", ""),
        page::<Grid>("src/ops/grid.rs", "side = 1.0"),
        Page { words: &["src/stage/format.rs"], ..page::<Write>(KINDS, "") },
    ]
}

fn title(kind: &str) -> String {
    kind.split('-').map(|word| word[..1].to_uppercase() + &word[1..]).collect()
}

/// What a value of a field may be, in words, and the words that it takes, if it takes words.
fn sort_of(subject: &str, field: &Field, files: &[String]) -> (String, Option<Enum>) {
    let inner = field.kind.strip_prefix("Option<").and_then(|t| t.strip_suffix('>'));
    let plain = inner.unwrap_or(&field.kind);
    let said = match (subject, field.name.as_str(), plain) {
        ("read", "path", _) => "text, or a list of texts",
        ("normals", "neighbors", _) => "a whole number, or `\"auto\"`",
        ("cells", "side", _) => "a length, `\"auto\"` or `\"spread\"`",
        ("cells", "max_angle", _) => "radians, text such as `\"6deg\"`, or `\"auto\"`",
        ("cells", "keep", _) => "a share such as `\"10%\"`, or a number such as `\"250k\"`",
        ("cells", "min_spacing", _) => "a length, `\"auto\"` or `\"none\"`",
        (_, _, "Length") => "a length: a number in the scan's unit, or such as `\"2m\"`",
        ("cells", "reference", _) => "`\"x\"`, `\"y\"`, `\"z\"`, or three numbers",
        ("write", "scale", _) => "a number, or three",
        ("run", "z_scale", _) => "a number, or `\"auto\"`",
        ("run", "memory", _) => "a size such as `\"2GiB\"`, or a number of bytes",
        (_, "mark", _) => "`\"key-point\"`, `\"withheld\"`, 7 or 18",
        (_, _, "usize" | "u64") => "a whole number",
        (_, _, "NonZeroUsize") => "a whole number from 1",
        (_, _, "f64") => "a number",
        (_, _, "[f64; 3]") => "three numbers",
        (_, _, "PathBuf") => "a path",
        (_, _, "Vec<u8>") => "a list of whole numbers to 255",
        ("cells", "by", _) => "a list, empty or of `\"Classification\"`",
        ("limits" | "filter", _, "Vec<Flag>") => {
            "a list of `\"withheld\"`, `\"overlap\"`, `\"synthetic\"`, `\"key-point\"`"
        }
        (_, _, "Vec<String>") => "a list of texts",
        (_, _, "FormatName") => {
            let registry = Registry::builtin();
            let word = |f: &Arc<dyn Format>| (f.name().to_owned(), f.about().to_owned());
            let words = registry.formats().iter().map(word).collect();
            return in_words(Enum { words, default: None });
        }
        (_, _, name) => {
            let words = files.iter().find_map(|text| enum_of(text, name)).unwrap_or_else(|| {
                panic!("{subject}.{}: say in tests/docs/mod.rs what a {name} is", field.name)
            });
            return in_words(words);
        }
    };
    (said.to_owned(), None)
}

fn in_words(words: Enum) -> (String, Option<Enum>) {
    let list: Vec<String> = words.words.iter().map(|(word, _)| format!("`\"{word}\"`")).collect();
    (list.join(", "), Some(words))
}

/// What is said of every field.
fn keys_said(
    subject: &str,
    fields: &[Field],
    files: &[String],
    default: impl Fn(&Field, Option<&Enum>) -> Default,
) -> Vec<Key> {
    let key = |field: &Field| {
        let (value, words) = sort_of(subject, field, files);
        let default = default(field, words.as_ref());
        let words = words.map_or(Vec::new(), |words| words.words);
        Key { name: field.name.clone(), value, default, docs: field.docs.clone(), words }
    };
    fields.iter().map(key).collect()
}

/// The keys that every stage on tiles takes besides its own.
fn limit_keys() -> Vec<Key> {
    let text = source("src/graph/limits.rs");
    let (_, fields) = struct_of(&text, "LimitKeys");
    let names: Vec<&str> = fields.iter().map(|field| field.name.as_str()).collect();
    assert_eq!(names, LimitKeys::KEYS);
    let defaults = serde_json::to_value(LimitKeys::default()).unwrap();
    let default = |field: &Field, _: Option<&Enum>| Default::Is(defaults[&field.name].clone());
    keys_said("limits", &fields, &[text, source("src/point/selection.rs")], default)
}

/// A stage's page, and what `pointmill stages` says of it.
fn stage_page(page: &Page) -> (String, Value) {
    let text = source(page.file);
    let (docs, fields) = struct_of(&text, &title(page.kind));
    let files: Vec<String> =
        [text].into_iter().chain(page.words.iter().map(|f| source(f))).collect();
    let given: toml::Table = toml::from_str(page.required).unwrap();
    let defaults = (page.keys)(page.required).expect("the required keys do");
    let keys = defaults.as_object().unwrap();
    let names: BTreeSet<&str> = fields.iter().map(|f| f.name.as_str()).collect();
    assert_eq!(names, keys.keys().map(String::as_str).collect(), "{}: fields and keys", page.kind);
    for key in given.keys() {
        let mut fewer = given.clone();
        fewer.remove(key);
        let without = (page.keys)(&toml::to_string(&fewer).unwrap());
        assert!(without.is_none(), "{}: `{key}` need not be given", page.kind);
    }
    let takes = |field: &Field, words: Option<&Enum>| {
        for (word, _) in words.iter().flat_map(|words| &words.words) {
            let mut set = given.clone();
            set.insert(field.name.clone(), word.clone().into());
            let taken = (page.keys)(&toml::to_string(&set).unwrap());
            assert!(taken.is_some(), "{}: {} = {word:?} is refused", page.kind, field.name);
        }
    };
    let default = |field: &Field, words: Option<&Enum>| {
        takes(field, words);
        match &keys[&field.name] {
            _ if given.contains_key(&field.name) => Default::MustBeGiven,
            Value::Null => Default::None,
            value => Default::Is(value.clone()),
        }
    };
    let said = keys_said(page.kind, &fields, &files, default);
    let on_tiles = !["read", "synth", "merge", "filter", "write"].contains(&page.kind);
    let mut out = format!("# {}\n\n<!-- {SAYS_SO} -->\n\n{}\n\n{docs}\n", page.kind, page.about);
    out += "\n## Keys\n\n";
    match said.is_empty() {
        true => out += "It has none.\n",
        false => out += &keys::markdown(&said),
    }
    if let Some((heading, file, function)) = page.more {
        let _ = write!(out, "\n## {heading}\n\n{}\n", item_docs(&source(file), "fn", function));
    }
    if on_tiles {
        out += "\nIt takes [the keys of all stages that work on tiles](README.md#limits) too.\n";
    }
    out += "\nEvery stage may also have a `name`, by which `--set` and `from` mean it.\n";
    let limits = if on_tiles { limit_keys() } else { Vec::new() };
    let all: Vec<Key> = said.into_iter().chain(limits).collect();
    (out, keys::described(page.kind, page.about, &all))
}

#[test]
fn every_stage_has_a_page_that_says_what_the_code_does() {
    let pages = pages();
    let kinds: BTreeSet<&str> = pages.iter().map(|page| page.kind).collect();
    let registry = Registry::builtin();
    assert_eq!(kinds, registry.kinds().map(|(kind, _)| kind).collect(), "a page for every stage");
    let mut index = format!("# Stages\n\n<!-- {SAYS_SO} -->\n\n| stage | |\n|---|---|\n");
    for page in &pages {
        let (text, _) = stage_page(page);
        assert!(text.len() > 400, "{}: {text}", page.kind);
        keep(&format!("docs/stages/{}.md", page.kind), &text);
        let _ = writeln!(index, "| [{0}]({0}.md) | {1} |", page.kind, page.about);
    }
    let (limits, _) = struct_of(&source("src/graph/limits.rs"), "LimitKeys");
    let _ = write!(index, "\n## Limits\n\n{limits}\n\n{}", keys::markdown(&limit_keys()));
    index += "\nWhat stands above all of them: [the `[run]` table](../run.md).\n";
    keep("docs/stages/README.md", &index);
    let stored = fs::read_dir(root().join("docs/stages")).unwrap().count();
    assert_eq!(stored, pages.len() + 1, "docs/stages has pages of no stage");
}

/// The page of the `[run]` table, and what `pointmill stages` says of it.
fn run_page() -> (String, Value) {
    let text = source("src/graph/settings.rs");
    let (docs, fields) = struct_of(&text, "RunSettings");
    assert!(fields.len() >= 8, "fields were not read");
    let default = |field: &Field, words: Option<&Enum>| match (words, &field.kind) {
        (Some(words), kind) if !kind.starts_with("Option<") => {
            let word = words.default.as_ref().expect("an enum of settings has a default");
            let set: RunSettings = toml::from_str(&format!("{} = '{word}'", field.name)).unwrap();
            assert_eq!(set, RunSettings::default(), "{} = {word}", field.name);
            Default::Is(word.as_str().into())
        }
        (words, kind) => {
            for (word, _) in words.iter().flat_map(|words| &words.words) {
                let set: Result<RunSettings, _> =
                    toml::from_str(&format!("{} = '{word}'", field.name));
                assert!(set.is_ok_and(|set| set != RunSettings::default()), "{word} does nothing");
            }
            assert!(kind.starts_with("Option<"), "{}: what is its default?", field.name);
            Default::None
        }
    };
    let said = keys_said("run", &fields, std::slice::from_ref(&text), default);
    let out = format!(
        "# The `[run]` table\n\n<!-- {SAYS_SO} -->\n\n{docs}\n\n{}\n## Sizes\n\n{}\n\n\
         ## The pipeline around it\n\n{}\n",
        keys::markdown(&said),
        item_docs(&source("src/graph/size.rs"), "fn", "parse_bytes"),
        item_docs(&source("src/language/pipeline.rs"), "struct", "PipelineText")
    );
    let (first, _) = docs.split_once(". ").unwrap();
    (out, keys::described("run", &format!("{first}."), &said))
}

#[test]
fn the_run_table_has_a_page_that_says_what_the_code_does() {
    keep("docs/run.md", &run_page().0);
}

#[test]
fn the_command_knows_what_the_pages_say() {
    let mut all = vec![run_page().1];
    all.extend(pages().iter().map(|page| stage_page(page).1));
    let text = serde_json::to_string_pretty(&Value::from(all)).unwrap();
    keep("src/cli/stages.json", &(text + "\n"));
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
    reduce(folder.path(), "reduced.ply");
    agree(
        &pointmill::io::describe(&folder.path().join("reduced.ply"), registry.formats()).unwrap(),
        "info: PLY",
    );
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
