//! Which stage of a pipeline text takes from which, by the names that they have there.

use super::draft::StageDraft;
use super::mistake::{Mistake, advice};
use super::place::PlacedWord;
use super::registry::Registry;
use crate::graph::{GraphMistake, GraphStage, TreeStage, tree_mistakes};
use crate::stage::Role;

/// Names are words of their own: no two alike, none that already means something.
pub(super) fn check_names(stages: &[StageDraft], registry: &Registry, mistakes: &mut Vec<Mistake>) {
    for (i, stage) in stages.iter().enumerate() {
        let Some((name, at)) = &stage.name else { continue };
        let taken = |s: &StageDraft| s.name.as_ref().is_some_and(|(other, _)| other == name);
        let word = |c: char| c.is_alphanumeric() || c == '-' || c == '_';
        let wrong = if name.is_empty() || !name.chars().all(word) {
            "a name is made of letters, digits, - and _".to_owned()
        } else if ["run", "accept", "params"].contains(&name.as_str())
            || registry.has(name) && stage.kind.is_some()
        {
            // A stage without a kind is told that its name may be meant for one.
            let means = if registry.has(name) { "a kind of stage" } else { "a table of the file" };
            format!("`{name}` is {means} already: give the stage a name of its own")
        } else if stages[..i].iter().any(taken) {
            "another stage above has this name".to_owned()
        } else {
            continue;
        };
        mistakes.push(Mistake::new(at.clone(), wrong));
    }
}

/// Fills in which stages each takes from, and tells what is wrong with the tree that they are:
/// also of stages beside some that are wrong in themselves, which are None.
pub(super) fn connect(
    drafts: &[StageDraft],
    stages: &mut [Option<GraphStage>],
    mistakes: &mut Vec<Mistake>,
) {
    let from = taken(drafts, stages, mistakes);
    let tree: Vec<TreeStage<'_>> = drafts
        .iter()
        .zip(stages.iter())
        .zip(&from)
        .map(|((draft, stage), from)| TreeStage {
            kind: draft.kind.as_ref().map_or("", |(kind, _)| kind),
            name: draft.name.as_ref().map(|(name, _)| &**name),
            role: stage.as_ref().map(|stage| &stage.role),
            from: from.as_deref(),
        })
        .collect();
    mistakes.extend(tree_mistakes(&tree).into_iter().map(|wrong| told(wrong, drafts)));
    for (stage, from) in stages.iter_mut().zip(from) {
        if let Some(stage) = stage {
            stage.from = from.unwrap_or_default();
        }
    }
}

/// A mistake of the tree at the place of what it is about.
fn told(wrong: GraphMistake, drafts: &[StageDraft]) -> Mistake {
    let GraphMistake { stage, told, help, key } = wrong;
    let StageDraft { from, keys, .. } = &drafts[stage];
    let place = match key {
        Some("from") => from.as_ref().and_then(|from| from.first()).map(|(_, place)| place),
        Some(key) => keys.at(key),
        None => None,
    };
    Mistake::new(place.unwrap_or(&keys.place).clone(), told).note(help.unwrap_or_default())
}

/// For each stage the ones that it takes from: those that it names, or the last above that gives
/// points; None where it names what there is not, which is told.
fn taken(
    drafts: &[StageDraft],
    stages: &[Option<GraphStage>],
    mistakes: &mut Vec<Mistake>,
) -> Vec<Option<Vec<usize>>> {
    let role = |n: usize| stages[n].as_ref().map(|stage| &stage.role);
    let mut all = Vec::new();
    let mut above: Option<usize> = None;
    for (n, draft) in drafts.iter().enumerate() {
        all.push(match &draft.from {
            Some(names) => {
                let found = names.iter().map(|name| find(name, n, drafts, stages));
                let (right, wrong): (Vec<_>, Vec<_>) = found.partition(Result::is_ok);
                mistakes.extend(wrong.into_iter().filter_map(Result::err));
                mistakes.extend(twice(names));
                (right.len() == names.len()).then(|| right.into_iter().flatten().collect())
            }
            None if matches!(role(n), Some(Role::Source(_))) => Some(Vec::new()),
            None => Some(above.into_iter().collect()),
        });
        if !matches!(role(n), Some(Role::Sink(_))) {
            above = Some(n);
        }
    }
    all
}

/// The stage above number `n` that has this name and gives points.
fn find(
    (name, at): &PlacedWord,
    n: usize,
    drafts: &[StageDraft],
    stages: &[Option<GraphStage>],
) -> Result<usize, Mistake> {
    let named = |draft: &StageDraft| draft.name.as_ref().is_some_and(|(own, _)| own == name);
    let gives =
        |n: &usize| stages[*n].as_ref().is_none_or(|stage| !matches!(stage.role, Role::Sink(_)));
    if let Some(found) = (0..n).find(|&n| named(&drafts[n]) && gives(&n)) {
        return Ok(found);
    }
    let is_kind = |draft: &StageDraft| draft.kind.as_ref().is_some_and(|(kind, _)| kind == name);
    let note = if named(&drafts[n]) {
        "a stage cannot take from itself".to_owned()
    } else if drafts[n..].iter().any(named) {
        format!("put the stage `{name}` above this one")
    } else if drafts[..n].iter().any(is_kind) {
        format!("`from` means the `name` of a stage: give the `{name}` that is meant a name")
    } else {
        let all = (0..n).filter(gives).filter_map(|n| drafts[n].name.as_ref());
        advice(name, "names", all.map(|(name, _)| name))
    };
    let told = format!("no earlier stage that gives points is named `{name}`");
    Err(Mistake::new(at.clone(), told).note(note))
}

/// A name that stands twice in a list.
fn twice(names: &[PlacedWord]) -> Option<Mistake> {
    let again = |n: &usize| names[..*n].iter().any(|(other, _)| *other == names[*n].0);
    let (name, at) = &names[(0..names.len()).find(again)?];
    Some(Mistake::new(at.clone(), format!("`{name}` is named twice")))
}
