//! From a pipeline text's tables to its stages in their roles, or to every mistake in them.

use std::path::Path;
use std::sync::Arc;

use super::draft::{Draft, StageDraft};
use super::elsewhere;
use super::keys;
use super::mistake::{Mistake, SourceText, advice};
use super::node::{KeyEntry, Node, NodeValue};
use super::outputs;
use super::place::PlacedWord;
use super::registry::{BuiltStage, Registry};
use super::tree;
use super::written::WrittenText;
use crate::graph::RunSettings;
use crate::graph::{Graph, GraphStage, LimitKeys, Limits};
use crate::report::AcceptTable;
use crate::stage::Role;

/// The graph that `draft` is, and what is wrong with it. It is read from `file` and `sources`.
pub(super) fn build(
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
    let accept = keys::read("[accept]", &draft.accept, &[]).unwrap_or_else(|wrong| {
        mistakes.extend(wrong);
        AcceptTable::default()
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
    let origin = origin.clone();
    (Graph { origin, settings, accept, stages, file, ..Graph::default() }, mistakes)
}

fn place(
    stage: &StageDraft,
    (kind, at): &PlacedWord,
    sources: &Arc<[SourceText]>,
    registry: &Registry,
) -> Result<GraphStage, Vec<Mistake>> {
    let SourceText { text, origin, .. } = &sources[0];
    let line = text.as_bytes()[..at.start.min(text.len())].iter().filter(|&&b| b == b'\n').count();
    let place = registry.place(origin, line + 1);
    let (limits, own) = match registry.is_limited(kind) {
        true => split_limits(&stage.keys),
        false => {
            (Node { value: NodeValue::Table(Vec::new()), ..stage.keys.clone() }, stage.keys.clone())
        }
    };
    let Some(built) = registry.build(kind, &own, &place) else {
        if let Some((told, note)) = elsewhere::told(kind, &own) {
            return Err(vec![Mistake::new(at.clone(), told).note(note)]);
        }
        let kinds = registry.kinds().map(|(kind, _)| kind);
        if kind.contains("${") {
            let told = "`kind` takes no parameter: write the kind itself";
            return Err(vec![Mistake::new(at.clone(), told).note(advice("", "stages", kinds))]);
        }
        let told = format!("there is no stage `{kind}`");
        return Err(vec![Mistake::word(at.clone(), told, kind, "stages", kinds)]);
    };
    let given = limits.entries();
    let read = keys::read::<LimitKeys>(kind, &limits, &[]);
    let BuiltStage { role, keys, given: all } = match (built, read.is_ok()) {
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
    let text = |part: &Option<PlacedWord>| part.as_ref().map(|(text, _)| text.clone());
    let mut placed = GraphStage {
        kind: kind.clone(),
        name: text(&stage.name),
        from: Vec::new(),
        line: Some(place.line()),
        written: Arc::new(WrittenText::new(sources, &stage.keys)),
        is_limited: registry.is_limited(kind),
        limits: Limits::default(),
        role,
        keys,
        given: all,
    };
    if !given.is_empty() {
        placed.limit(limits);
    }
    Ok(placed)
}

/// What a key that limits a stage is told where it cannot.
fn misplaced_limit(KeyEntry { key, at, .. }: &KeyEntry, role: &Role) -> Option<Mistake> {
    let which = match role {
        Role::TileOp(_) | Role::ScanOp(_) | Role::RoundOp(_) => return None,
        Role::Transform(_) if key != LimitKeys::SEES => return None,
        Role::Transform(_) => "that work on tiles: this one sees no neighbours",
        Role::Source(_) | Role::Sink(_) | Role::Merge => "between a source and a sink",
    };
    let help = match role {
        Role::Sink(_) => "to write some of the records alone, put a `filter` above it",
        Role::Source(_) | Role::Merge => "to go on with some of the records, put a `filter` below",
        _ => "",
    };
    Some(Mistake::new(at.clone(), format!("`{key}` is for stages {which}")).note(help))
}

/// The keys that limit a stage, and the stage's own.
fn split_limits(keys: &Node) -> (Node, Node) {
    let (limits, own) =
        keys.entries().iter().cloned().partition(|e| LimitKeys::KEYS.contains(&e.key.as_str()));
    let table = |entries| Node { place: keys.place.clone(), value: NodeValue::Table(entries) };
    (table(limits), table(own))
}
