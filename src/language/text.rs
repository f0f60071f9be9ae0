//! From a pipeline file's text to its stages in their roles, or to every mistake in it.

use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use super::draft;
use super::draft::{Draft, StageDraft};
use super::foreign;
use super::keys;
use super::mistake;
use super::mistake::{Mistake, SourceText};
use super::node::{KeyEntry, Node, NodeValue};
use super::place::TextPlace;
use super::registry::Registry;
use super::set::Set;
use super::written::WrittenText;
use crate::error::shown;
use crate::graph::RunSettings;
use crate::graph::{Graph, GraphMistake, GraphStage, LimitKeys};
use crate::host::{Files, Use};
use crate::io::{open_plain, sniff};
use crate::stage::Role;
use crate::stage::StagePlace;
use crate::{Error, Result};

/// Bytes of the longest pipeline file: whoever names a scan in its place waits for no gigabytes.
const LONGEST: u64 = 16 << 20;

impl Graph {
    /// Reads a pipeline; `origin` is the name of its file for errors, empty for a text that the
    /// user does not know: then errors name what is wrong without a place in it.
    ///
    /// Files that stages name are looked up, not opened.
    ///
    /// # Errors
    ///
    /// All mistakes of the text at once, each with its line and column.
    pub fn parse(text: &str, origin: &str, registry: &Registry) -> Result<Graph> {
        Graph::parse_with(text, origin, registry, &[])
    }

    /// Reads a pipeline in which the values of `sets`, in their order, take the place of the
    /// text's.
    ///
    /// # Errors
    ///
    /// As [`parse`](Graph::parse), those of `sets` included.
    pub fn parse_with(
        text: &str,
        origin: &str,
        registry: &Registry,
        sets: &[Set],
    ) -> Result<Graph> {
        Graph::parse_of(None, text, origin, registry, sets)
    }

    /// Reads the text of the file at `path`, or one that is of no file.
    fn parse_of(
        path: Option<&Path>,
        text: &str,
        origin: &str,
        registry: &Registry,
        sets: &[Set],
    ) -> Result<Graph> {
        let file = SourceText { origin: origin.to_owned(), text: text.to_owned(), setting: None };
        let sources: Arc<[SourceText]> =
            std::iter::once(file).chain(sets.iter().map(Set::source)).collect();
        let told = |mistakes| mistake::tell(mistakes, &sources);
        let entries = foreign::parse(text).map_err(told)?;
        let mut draft = draft::read(entries, text.len(), registry);
        for (i, set) in sets.iter().enumerate() {
            draft.apply(set, i + 1, registry);
        }
        let (pipeline, mistakes) = build(draft, path, &sources, registry);
        if mistakes.is_empty() { Ok(pipeline) } else { Err(told(mistakes)) }
    }

    /// Reads the pipeline file at `path`, as [`parse_with`](Graph::parse_with).
    ///
    /// # Errors
    ///
    /// As [`parse`](Graph::parse), and a file that cannot be read or that is no pipeline.
    pub fn read(path: &Path, registry: &Registry, sets: &[Set]) -> Result<Graph> {
        let (mut file, about) = open_plain(path)?;
        let failed = |e| Error::io(path, "read the pipeline", e);
        let mut bytes = Vec::new();
        file.by_ref().take(sniff::BYTES as u64).read_to_end(&mut bytes).map_err(failed)?;
        if registry.formats().sniffed(&bytes).is_some() {
            let name = shown(path);
            return Err(sniff::not("a pipeline file", path, &bytes, registry.formats())
                .help(format!("a scan is reduced by `pointmill reduce {name} -o OUT`")));
        }
        if about.len() > LONGEST {
            let told = format!(
                "this is no pipeline: it has {} bytes, and {LONGEST} are read",
                about.len()
            );
            return Err(Error::pipeline(told).at(path));
        }
        file.take(LONGEST).read_to_end(&mut bytes).map_err(failed)?;
        let text = String::from_utf8(bytes).map_err(|e| {
            let valid = e.utf8_error().valid_up_to() as u64;
            Error::pipeline("the pipeline is not UTF-8 text").at(path).at_byte(valid)
        })?;
        let origin = shown(path).to_string();
        Graph::parse_of(Some(path), &text, &origin, registry, sets)
    }
}

fn build(
    mut draft: Draft,
    file: Option<&Path>,
    sources: &Arc<[SourceText]>,
    registry: &Registry,
) -> (Graph, Vec<Mistake>) {
    let origin = &sources[0].origin;
    let mut mistakes = std::mem::take(&mut draft.mistakes);
    let settings = keys::read("[run]", &draft.run, &[]).unwrap_or_else(|wrong| {
        mistakes.extend(wrong);
        RunSettings::default()
    });
    check_names(&draft.stages, registry, &mut mistakes);
    let mut stages = Vec::new();
    for stage in &draft.stages {
        match place(stage, sources, registry) {
            Ok(placed) => stages.push(placed),
            Err(wrong) => mistakes.extend(wrong),
        }
    }
    let is_whole = mistakes.is_empty();
    if is_whole {
        connect(&draft.stages, &mut stages, &mut mistakes);
    }
    let is_connected = is_whole && mistakes.is_empty();
    if is_whole {
        check_files(file, &draft, &stages, &settings, &mut mistakes);
    }
    let file = file.map(Path::to_owned);
    let graph = Graph { origin: origin.clone(), settings, stages, file };
    if is_connected {
        mistakes.extend(graph.mistakes().into_iter().map(|GraphMistake { stage, told, help }| {
            let place = draft.stages[stage].kind.1.clone();
            Mistake::new(place, told).note(help.unwrap_or_default())
        }));
    }
    (graph, mistakes)
}

fn place(
    stage: &StageDraft,
    sources: &Arc<[SourceText]>,
    registry: &Registry,
) -> Result<GraphStage, Vec<Mistake>> {
    let (kind, at) = &stage.kind;
    let SourceText { text, origin, .. } = &sources[0];
    let line = text.as_bytes()[..at.start.min(text.len())].iter().filter(|&&b| b == b'\n').count();
    let place = StagePlace::new(origin.as_str(), line + 1).knowing(registry.formats());
    let (limits, keys) = match registry.is_limited(kind) {
        true => split_limits(&stage.keys),
        false => {
            (Node { value: NodeValue::Table(Vec::new()), ..stage.keys.clone() }, stage.keys.clone())
        }
    };
    let Some(built) = registry.build(kind, &keys, &place) else {
        let kinds = registry.kinds().map(|(kind, _)| kind);
        let told = format!("there is no stage `{kind}`");
        return Err(vec![Mistake::word(at.clone(), told, kind, "stages", kinds)]);
    };
    let given = limits.entries();
    let read = keys::read::<LimitKeys>(kind, &limits, &[]);
    let (role, mut canonical) = match (built, read.is_ok()) {
        (Ok(built), true) => built,
        (built, _) => {
            return Err(built.err().into_iter().chain(read.err()).flatten().collect());
        }
    };
    let limits = read?;
    let wrong: Vec<_> = given.iter().filter_map(|entry| misplaced_limit(entry, &role)).collect();
    if !wrong.is_empty() {
        return Err(wrong);
    }
    if let (false, Some(keys)) = (given.is_empty(), canonical.as_object_mut()) {
        let told = serde_json::to_value(&limits).unwrap_or_default();
        keys.extend(told.as_object().cloned().unwrap_or_default());
    }
    let text = |part: &Option<(String, TextPlace)>| part.as_ref().map(|(text, _)| text.clone());
    Ok(GraphStage {
        kind: kind.clone(),
        name: text(&stage.name),
        from: Vec::new(),
        line: Some(place.line()),
        written: Arc::new(WrittenText::new(sources, &stage.keys)),
        limits: limits.limits(),
        role,
        keys: canonical,
    })
}

/// What a key that limits a stage is told where it cannot.
fn misplaced_limit(KeyEntry { key, at, .. }: &KeyEntry, role: &Role) -> Option<Mistake> {
    let which = match role {
        Role::TileOp(_) | Role::ScanOp(_) => return None,
        Role::Transform(_) if key != LimitKeys::SEES => return None,
        Role::Transform(_) => "that work on tiles: this one sees no neighbours",
        Role::Source(_) | Role::Sink(_) => "between a source and a sink",
    };
    Some(Mistake::new(at.clone(), format!("`{key}` is for stages {which}")))
}

/// The keys that limit a stage, and the stage's own.
fn split_limits(keys: &Node) -> (Node, Node) {
    let (limits, own) =
        keys.entries().iter().cloned().partition(|e| LimitKeys::KEYS.contains(&e.key.as_str()));
    let table = |entries| Node { place: keys.place.clone(), value: NodeValue::Table(entries) };
    (table(limits), table(own))
}

/// Names are words of their own: no two alike, none that already means something.
fn check_names(stages: &[StageDraft], registry: &Registry, mistakes: &mut Vec<Mistake>) {
    for (i, stage) in stages.iter().enumerate() {
        let Some((name, at)) = &stage.name else { continue };
        let taken = |s: &StageDraft| s.name.as_ref().is_some_and(|(other, _)| other == name);
        let word = |c: char| c.is_alphanumeric() || c == '-' || c == '_';
        let wrong = if name.is_empty() || !name.chars().all(word) {
            "a name is made of letters, digits, - and _"
        } else if name == "run" || registry.has(name) {
            "the name means something else already"
        } else if stages[..i].iter().any(taken) {
            "another stage above has this name"
        } else {
            continue;
        };
        mistakes.push(Mistake::new(at.clone(), wrong));
    }
}

/// Fills in which stages each takes from: those that it names, or the last above that gives points.
///
/// A `from` names an earlier stage that gives points. Only a sink may take from another than the
/// one above.
fn connect(drafts: &[StageDraft], stages: &mut [GraphStage], mistakes: &mut Vec<Mistake>) {
    let is_sink = |stage: &GraphStage| matches!(stage.role, Role::Sink(_));
    let mut above: Option<usize> = None;
    for i in 0..stages.len() {
        let mut takes = above;
        if matches!(stages[i].role, Role::Source(_)) {
            takes = None;
            if i > 0 {
                let told = "a second source is not possible yet";
                mistakes.push(Mistake::new(drafts[i].kind.1.clone(), told));
            }
        }
        if let Some((from, at)) = &drafts[i].from {
            let earlier = || (0..i).filter(|&e| !is_sink(&stages[e]) && stages[e].name.is_some());
            let named = earlier().find(|&e| stages[e].name.as_ref() == Some(from));
            if named.is_none() {
                let told = format!("no earlier stage that gives points is named `{from}`");
                let names = earlier().filter_map(|e| stages[e].name.clone());
                mistakes.push(Mistake::word(at.clone(), told, from, "names", names));
            } else if !is_sink(&stages[i]) && named != above {
                let told = "only a sink can take from another stage than the one above";
                mistakes.push(Mistake::new(at.clone(), told));
            }
            takes = named;
        }
        stages[i].from = takes.into_iter().collect();
        if !is_sink(&stages[i]) {
            above = Some(i);
        }
    }
}

/// No file is written twice, and none over an input or over the pipeline, which is read from
/// `file`.
fn check_files(
    file: Option<&Path>,
    draft: &Draft,
    stages: &[GraphStage],
    settings: &RunSettings,
    mistakes: &mut Vec<Mistake>,
) {
    let mut files = Files::default();
    file.iter().for_each(|path| files.read(path, Use::Pipeline));
    let mut outputs: Vec<(&Path, &TextPlace)> = Vec::new();
    for (draft, stage) in draft.stages.iter().zip(stages) {
        match &stage.role {
            Role::Source(source) => {
                source.paths().iter().for_each(|path| files.read(path, Use::Input));
            }
            Role::Sink(sink) if sink.is_file() => {
                let key = |key| draft.keys.at(key);
                let at = key("path").or(key("folder")).unwrap_or(&draft.kind.1);
                outputs.push((sink.path(), at));
            }
            _ => {}
        }
    }
    if let Some(report) = &settings.report {
        outputs.push((report, draft.run.at("report").unwrap_or(&draft.run.place)));
    }
    for (path, at) in outputs {
        if let Err(clash) = files.write(path) {
            mistakes.push(Mistake::new(at.clone(), format!("{} {clash}", shown(path))));
        }
    }
}
