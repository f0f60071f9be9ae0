//! From a pipeline file's text to its stages in their roles, or to every mistake in it.

use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use super::draft;
use super::draft::{Draft, StageDraft, Word};
use super::foreign;
use super::keys;
use super::mistake;
use super::mistake::{Mistake, SourceText};
use super::node::{KeyEntry, Node, NodeValue};
use super::outputs;
use super::place::TextPlace;
use super::registry::Registry;
use super::set::Set;
use super::tree;
use super::written::WrittenText;
use crate::error::shown;
use crate::graph::RunSettings;
use crate::graph::{Graph, GraphStage, LimitKeys};
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
    let placed = draft.stages.iter().map(|stage| {
        let kind = stage.kind.as_ref()?;
        place(stage, kind, sources, registry).map_err(|wrong| mistakes.extend(wrong)).ok()
    });
    let mut placed: Vec<Option<GraphStage>> = placed.collect();
    tree::check_names(&draft.stages, registry, &mut mistakes);
    tree::connect(&draft.stages, &mut placed, &mut mistakes);
    outputs::check(file, &draft, &placed, &settings, &mut mistakes);
    let file = file.map(Path::to_owned);
    let stages = placed.into_iter().flatten().collect();
    (Graph { origin: origin.clone(), settings, stages, file }, mistakes)
}

fn place(
    stage: &StageDraft,
    (kind, at): &Word,
    sources: &Arc<[SourceText]>,
    registry: &Registry,
) -> Result<GraphStage, Vec<Mistake>> {
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
        Role::Source(_) | Role::Sink(_) | Role::Merge => "between a source and a sink",
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
