//! What may take from what: the rules that every graph keeps, and graphs that are not whole yet as
//! far as they are known.

use std::collections::BTreeSet;

use crate::stage::{Order, Role};

/// What helps where branches are to become one again.
const MERGE_LATER: &str = "give each a `write` of its own, and read the files that they leave \
                           together: `read.path` takes a list";

/// What is wrong with the way in which the stages of a graph hang together.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct GraphMistake {
    /// The number of the stage.
    pub stage: usize,
    /// What is wrong.
    pub told: String,
    /// What would be right, where it is known.
    pub help: Option<String>,
    /// The key that it is about, where it is about one.
    pub key: Option<&'static str>,
}

impl GraphMistake {
    /// `told` of stage number `stage`.
    pub(crate) fn new(stage: usize, told: impl Into<String>) -> Self {
        GraphMistake { stage, told: told.into(), help: None, key: None }
    }

    /// The same about the value of `key`.
    pub(crate) fn of(self, key: &'static str) -> Self {
        GraphMistake { key: Some(key), ..self }
    }

    /// The same with what would be right.
    pub(crate) fn help(self, help: impl Into<String>) -> Self {
        GraphMistake { help: Some(help.into()), ..self }
    }
}

/// A stage and what it takes from, as far as they are known.
pub(crate) struct TreeStage<'a> {
    /// Its kind.
    pub kind: &'a str,
    /// Its name, if it has one.
    pub name: Option<&'a str>,
    /// What it does; None of a stage that is wrong in itself.
    pub role: Option<&'a Role>,
    /// The stages that it takes from; None if what it says of them is wrong.
    pub from: Option<&'a [usize]>,
}

/// Everything that is wrong with how these stages hang together, and that is certain whatever the
/// unknown ones turn out to be.
pub(crate) fn mistakes(stages: &[TreeStage<'_>]) -> Vec<GraphMistake> {
    let tree = StageTree { stages, takes: merged(stages.iter().map(|s| (s.from, s.is_merge()))) };
    let each = (0..stages.len())
        .flat_map(|n| [tree.wrong_from(n), tree.wrong_end(n), wrong_order(n, &stages[n])]);
    each.flatten().collect()
}

/// For each stage the ones that it takes from, through merges and in order, from what it names and
/// whether it is a merge itself.
pub(super) fn merged<'a>(
    stages: impl Iterator<Item = (Option<&'a [usize]>, bool)>,
) -> Vec<Vec<usize>> {
    let mut all: Vec<(BTreeSet<usize>, bool)> = Vec::new();
    for (from, is_merge) in stages {
        let mut takes = BTreeSet::new();
        for &from in from.unwrap_or_default() {
            match all.get(from) {
                Some((through, true)) => takes.extend(through),
                Some(_) => drop(takes.insert(from)),
                None => {} // it stands behind this one, which is told
            }
        }
        all.push((takes, is_merge));
    }
    all.into_iter().map(|(takes, _)| takes.into_iter().collect()).collect()
}

impl TreeStage<'_> {
    fn is_source(&self) -> bool {
        matches!(self.role, Some(Role::Source(_)))
    }

    fn is_sink(&self) -> bool {
        matches!(self.role, Some(Role::Sink(_)))
    }

    fn is_merge(&self) -> bool {
        matches!(self.role, Some(Role::Merge))
    }
}

struct StageTree<'a> {
    stages: &'a [TreeStage<'a>],
    /// For each stage what it takes from, through merges.
    takes: Vec<Vec<usize>>,
}

impl StageTree<'_> {
    /// What is wrong with what stage `n` takes from.
    fn wrong_from(&self, n: usize) -> Option<GraphMistake> {
        let stage = &self.stages[n];
        let (from, _) = stage.from.zip(stage.role)?;
        let told = |told: &str| Some(GraphMistake::new(n, told).of("from"));
        if from.iter().any(|from| *from >= n) {
            return told("a stage takes from stages before it");
        }
        match (stage.is_source(), from) {
            (true, []) => return None,
            (true, _) => return told("a source takes from no stage"),
            (false, []) => {
                let told = "the first stage must be a source, such as `read`";
                return Some(GraphMistake::new(n, told));
            }
            // What is wrong with the merge is told there.
            (false, [one]) if self.stages[*one].is_merge() => return None,
            _ => {}
        }
        if from.iter().any(|from| self.stages[*from].is_sink()) {
            return told("a sink gives no points that a stage could take");
        }
        let takes = &self.takes[n];
        let works = |n: &usize| self.stages[*n].role.is_some() && !self.stages[*n].is_source();
        if takes.len() > 1 && takes.iter().any(works) {
            return told("only sources can be merged").map(|mistake| mistake.help(MERGE_LATER));
        }
        let sources = || (0..self.stages.len()).filter(|n| self.stages[*n].is_source());
        let takes_source = takes.iter().any(|n| self.stages[*n].is_source());
        if takes_source && !sources().all(|source| takes.contains(&source)) {
            let mistake = told("the sources of a pipeline are one scan: take from all of them");
            return mistake
                .map(|mistake| mistake.help(self.all_of(&sources().collect::<Vec<_>>())));
        }
        None
    }

    /// What to write to take from these stages.
    fn all_of(&self, stages: &[usize]) -> String {
        let names: Option<Vec<&str>> = stages.iter().map(|n| self.stages[*n].name).collect();
        match names {
            Some(names) => format!("write `from = {names:?}`"),
            None => "give each source a `name`, and write `from` with the list of them".to_owned(),
        }
    }

    /// What is wrong if nothing takes from stage `n`.
    fn wrong_end(&self, n: usize) -> Option<GraphMistake> {
        let stage = &self.stages[n];
        // Who takes from one source and not from all is told, and not what is left over.
        let meant = |from: &usize| {
            *from == n
                || stage.is_source() && self.stages.get(*from).is_some_and(TreeStage::is_source)
        };
        let takes = |taker: &TreeStage<'_>| taker.from.is_none_or(|from| from.iter().any(meant));
        if stage.role.is_none() || stage.is_sink() || self.stages[n + 1..].iter().any(takes) {
            return None;
        }
        Some(match n + 1 == self.stages.len() {
            true => GraphMistake::new(n, "nothing takes these points: end with `write`")
                .help("or with `discard`, if the report is all that is wanted"),
            false => {
                let told = format!("no output takes what `{}` leaves", stage.kind);
                let help = "add a `write` behind it that has no `from`";
                GraphMistake::new(n, told).help(help)
            }
        })
    }
}

/// A folder of files that are to have the order of all inputs.
fn wrong_order(n: usize, stage: &TreeStage<'_>) -> Option<GraphMistake> {
    let Some(Role::Sink(sink)) = stage.role else { return None };
    (sink.is_folder() && sink.order() == Order::Input).then(|| {
        let told = "`write.order = \"input\"` is for one file of all inputs";
        let help = "give `write.path` instead of `write.folder`, or leave `write.order` out";
        GraphMistake::new(n, told).of("order").help(help)
    })
}
