//! What a pipeline is, however it was written: stages, and which takes from which. Knows neither
//! the language that it was written in, nor the inputs that it will be fitted to.
//!
//! A [`Graph`] is a tree of stages below one or several sources, which are one scan. It is checked
//! in one place, `tree.rs` ([`Graph::mistakes`]): the language tells what is found there with the
//! places in its text, the plan as an error.

mod drawn;
pub(crate) mod limits;
pub(crate) mod noted;
mod settings;
mod toml;
mod tree;
mod written;

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

pub use crate::quantity::parse_bytes;
use crate::report::AcceptTable;
use crate::stage::{Role, RoleName};
use crate::{Error, Result};

pub(crate) use limits::Limits;
pub use limits::{LimitKeys, Sees};
pub(crate) use settings::MOST_THREADS;
pub use settings::{
    Existing, Headers, MixedUnits, Nonfinite, Overrides, RunSettings, SimdSetting, SpillSetting,
    Treatment, ZScale,
};
pub(crate) use toml::literal;
pub use tree::GraphMistake;
pub(crate) use tree::{TreeStage, mistakes as tree_mistakes};
pub(crate) use written::Written;

/// A pipeline: stages, each of which takes from stages before it.
///
/// A text becomes one by [`Graph::parse`]; a program may also put it together itself:
///
/// ```
/// use pointmill::Graph;
/// use pointmill::graph::RunSettings;
/// use pointmill::ops::{Grid, Pick};
/// use pointmill::quantity::Length;
/// use pointmill::stage::Role;
/// use pointmill::synth::{Scene, Synthetic};
///
/// let mut graph = Graph::new(RunSettings::default());
/// let scan = Synthetic { scene: Scene::Plane, points: 1000, ..Synthetic::default() };
/// let scan = graph.add("synth", Role::Source(Box::new(scan)), &[]);
/// let side = Length::of(0.5).expect("a length above 0");
/// let grid = Role::TileOp(Box::new(Grid::new(side, Pick::Center)));
/// let grid = graph.add("grid", grid, &[scan]);
///
/// // It is checked when it is planned, or here: there is no sink yet.
/// let mistakes = graph.mistakes();
/// assert_eq!(mistakes[0].stage, grid);
/// assert_eq!(mistakes[0].told, "nothing takes these points: end with `write`");
/// ```
#[derive(Default)]
pub struct Graph {
    /// The file it came from, as the user named it; empty for a text that the user does not know.
    pub origin: String,
    /// What the run may use and where it leaves things.
    pub settings: RunSettings,
    /// What its result must be to be accepted.
    pub accept: AcceptTable,
    /// The stages; none takes from one behind it.
    pub stages: Vec<GraphStage>,
    /// The file that it was read from, which no output may replace.
    pub(crate) file: Option<PathBuf>,
    /// What outputs are to say of the run, if it is made again: what they said.
    pub(crate) note: Option<Arc<str>>,
    /// How it runs, where no text can say so.
    pub(crate) traits: RunTraits,
}

/// How a graph runs that the library makes for itself.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RunTraits {
    /// True if every tile is to see the whole scan, which changes no answer of a stage that looks
    /// no further than it says: whoever proves stages compares the two.
    pub whole_rims: bool,
    /// True if nobody reads what a report says of tiles and deviations, so that the last walk over
    /// the scan is left out.
    pub skips_survey: bool,
}

/// A stage and where it stands.
pub struct GraphStage {
    /// Its kind.
    pub kind: String,
    /// The name that it has in its text.
    pub name: Option<String>,
    /// The numbers of the stages that it takes from; none for a source.
    pub from: Vec<usize>,
    /// What it does.
    pub role: Role,
    /// Its keys with all defaults filled in, those that name files left out.
    pub keys: serde_json::Value,
    /// Its keys as a text gives them, those that name files included; None if no text can name the
    /// stage.
    pub(crate) given: Option<serde_json::Value>,
    /// Line of its `kind` in its text, from 1.
    pub line: Option<usize>,
    /// False if what it says itself decides about which records it is.
    pub(crate) is_limited: bool,
    /// The records that it is limited to.
    pub(crate) limits: Limits,
    /// How it is written.
    pub(crate) written: Arc<dyn Written>,
}

impl Graph {
    /// A graph without stages.
    pub fn new(settings: RunSettings) -> Self {
        Graph { settings, ..Graph::default() }
    }

    /// Adds a stage that takes from those with the numbers `from`; returns its own.
    ///
    /// A role does not say what it was made of: reports and outputs name its settings as they stand
    /// in [`GraphStage::keys`], which is empty until it is set.
    pub fn add(&mut self, kind: &str, role: Role, from: &[usize]) -> usize {
        let written = Arc::new(written::Unwritten::new(kind, self.stages.len()));
        self.stages.push(GraphStage {
            kind: kind.to_owned(),
            name: None,
            from: from.to_vec(),
            role,
            keys: serde_json::json!({}),
            given: None,
            line: None,
            is_limited: true,
            limits: Limits::default(),
            written,
        });
        self.stages.len() - 1
    }

    /// The numbers of the stages that take from stage `number`, in order.
    pub fn takers(&self, number: usize) -> impl Iterator<Item = usize> + '_ {
        let takes = move |(_, stage): &(usize, &GraphStage)| stage.from.contains(&number);
        self.stages.iter().enumerate().filter(takes).map(|(taker, _)| taker)
    }

    /// Everything that is wrong with how the stages hang together.
    pub fn mistakes(&self) -> Vec<GraphMistake> {
        tree::mistakes(&self.stages.iter().map(TreeStage::from).collect::<Vec<_>>())
    }

    /// Fails with everything that is wrong with how the stages hang together, told where they are
    /// written.
    pub(crate) fn refuse_mistakes(&self) -> Result<()> {
        let told = |GraphMistake { stage, told, help, key }| {
            let written = &self.stages[stage].written;
            let error = match key {
                Some(key) => written.wrong_key(key, told),
                None => written.wrong(told),
            };
            match help {
                Some(help) => error.help(help),
                None => error,
            }
        };
        Error::all(self.mistakes().into_iter().map(told).collect())
    }

    /// The same graph without merges: who takes from one takes from what it takes from.
    pub(crate) fn without_merges(mut self) -> Graph {
        let is_merge = |stage: &GraphStage| matches!(stage.role, Role::Merge);
        let takes = tree::merged(self.stages.iter().map(|s| (Some(&s.from[..]), is_merge(s))));
        let mut number = 0;
        let mut numbers = Vec::new();
        for stage in &self.stages {
            numbers.push(number);
            number += usize::from(!is_merge(stage));
        }
        for (stage, takes) in self.stages.iter_mut().zip(takes) {
            stage.from = takes.into_iter().map(|from| numbers[from]).collect();
        }
        self.stages.retain(|stage| !is_merge(stage));
        self
    }

    /// The graph as JSON: for each stage its kind, name, keys, and the numbers of those it takes
    /// from.
    pub fn to_json(&self) -> serde_json::Value {
        let stage = |stage: &GraphStage| {
            serde_json::json!({
                "kind": stage.kind, "name": stage.name, "from": stage.from, "keys": stage.keys,
            })
        };
        self.stages.iter().map(stage).collect()
    }
}

impl<'a> From<&'a GraphStage> for TreeStage<'a> {
    fn from(stage: &'a GraphStage) -> Self {
        TreeStage {
            kind: &stage.kind,
            name: stage.name.as_deref(),
            role: Some(&stage.role),
            from: Some(&stage.from),
        }
    }
}

impl GraphStage {
    /// True if it may work on some records and let the others pass.
    pub(crate) fn can_be_limited(&self) -> bool {
        let works = matches!(self.role.name(), RoleName::Transform | RoleName::OnTiles);
        works && self.is_limited
    }

    /// Limits it to some records, and enters that among its keys.
    pub(crate) fn limit(&mut self, limits: LimitKeys) {
        let told = serde_json::to_value(&limits).unwrap_or_default();
        for keys in [Some(&mut self.keys), self.given.as_mut()].into_iter().flatten() {
            if let (Some(keys), Some(told)) = (keys.as_object_mut(), told.as_object()) {
                keys.extend(told.clone());
            }
        }
        self.limits = Limits::of(limits);
    }
}

impl fmt::Debug for Graph {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {:?}\n{self}", self.origin, self.settings)
    }
}
