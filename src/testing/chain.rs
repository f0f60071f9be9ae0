//! The stage that is proven and those that it stands between, made anew for every run.

use std::sync::Arc;

use super::setup::Setup;
use super::watched::watched;
use super::witness::Witness;
use crate::graph::{Graph, RunSettings};
use crate::language::Registry;
use crate::point::{ColumnKind, Mark, names};
use crate::report::Tally;
use crate::stage::{CreateSink, Needs, OpenSource, Role, RoleName, StageKind, StagePlace, TileOp};
use crate::tile::Tile;
use crate::{Error, Result};

type MakeRole = dyn Fn() -> Result<Role> + Send + Sync;

/// A stage that can be made again and again.
#[derive(Clone)]
pub(super) struct StageMaker {
    pub kind: String,
    /// The role that its kind names, if it is of one.
    pub says: Option<RoleName>,
    make: Arc<MakeRole>,
}

impl StageMaker {
    /// A stage of a kind, made from its keys as a text would give them.
    pub fn of<K: StageKind>(stage: &K) -> StageMaker {
        let keys = serde_json::to_value(stage).map(|mut keys| {
            if let Some(keys) = keys.as_object_mut() {
                keys.retain(|_, value| !value.is_null());
            }
            keys
        });
        let keys = keys.map_err(|e| e.to_string());
        let make = move || {
            let wrong = |e: String| Error::pipeline(format!("the keys of `{}`: {e}", K::KIND));
            let keys = keys.clone().map_err(wrong)?;
            let stage: K = serde_json::from_value(keys).map_err(|e| wrong(e.to_string()))?;
            stage.build(&StagePlace::new("", 0).knowing(Registry::builtin().formats()))
        };
        StageMaker { kind: K::KIND.to_owned(), says: Some(K::ROLE), make: Arc::new(make) }
    }

    /// A stage that is of no kind.
    pub fn of_role(kind: &str, make: impl Fn() -> Role + Send + Sync + 'static) -> StageMaker {
        StageMaker { kind: kind.to_owned(), says: None, make: Arc::new(move || Ok(make())) }
    }

    pub fn make(&self) -> Result<Role> {
        (self.make)()
    }
}

/// A stage and those above and below it.
#[derive(Clone)]
pub(super) struct Chain {
    pub above: Vec<StageMaker>,
    pub proven: StageMaker,
    pub below: Vec<StageMaker>,
}

/// What the stages of a chain say, for a check.
pub(super) struct DeclaredNeeds {
    /// Dimensions that they look at or change, and those with the names of columns that they read:
    /// all others may hold anything.
    pub looked_at: Vec<String>,
    /// Dimensions that they change.
    pub changed: Vec<String>,
    /// Columns that the stage computes, and those below.
    pub columns: Vec<ColumnKind>,
    pub record_numbers: bool,
    pub whole_records: bool,
    /// True if all of them stream.
    pub streams: bool,
}

impl Chain {
    fn stages(&self) -> impl Iterator<Item = &StageMaker> {
        self.above.iter().chain([&self.proven]).chain(&self.below)
    }

    /// What the stages say before they know a scan.
    pub fn declared(&self) -> Result<DeclaredNeeds> {
        let mut declared = DeclaredNeeds {
            looked_at: Vec::new(),
            changed: Vec::new(),
            columns: Vec::new(),
            record_numbers: false,
            whole_records: false,
            streams: true,
        };
        let mut computed: Vec<&str> = Vec::new();
        for (number, stage) in self.stages().enumerate() {
            let role = stage.make()?;
            declared.streams &= role.name() == RoleName::Transform;
            let names = match &role {
                Role::Transform(stage) => {
                    let all = stage.expressions();
                    all.iter().flat_map(|(_, e)| e.names()).map(str::to_owned).collect()
                }
                _ => Vec::new(),
            };
            for needs in needs(&role) {
                declared.enter(&needs);
                computed.extend(needs.writes.iter().flat_map(|kind| kind.parts().to_vec()));
                computed.extend(needs.writes.iter().map(ColumnKind::name));
                if number >= self.above.len() {
                    declared.columns.extend(needs.writes);
                }
            }
            declared.looked_at.extend(names);
        }
        declared.looked_at.retain(|name| !computed.contains(&name.as_str()));
        declared.looked_at.sort();
        declared.looked_at.dedup();
        let mut known = Vec::new();
        declared.columns.retain(|kind| {
            !known.contains(kind) && {
                known.push(*kind);
                true
            }
        });
        Ok(declared)
    }

    /// A graph from `source` through the stages to `sink`, in which `witness` looks at the stage
    /// that is proven.
    pub fn graph(
        &self,
        (setup, settings): (&Setup, RunSettings),
        source: impl OpenSource + 'static,
        sink: impl CreateSink + 'static,
        witness: &Arc<Witness>,
    ) -> Result<Graph> {
        let mut graph = Graph::new(settings);
        graph.traits.whole_rims = setup.whole_rims;
        let mut last = graph.add("points", Role::Source(Box::new(source)), &[]);
        if setup.behind_tiles {
            last = graph.add("nothing", Role::TileOp(Box::new(Idle)), &[last]);
        }
        for (number, stage) in self.stages().enumerate() {
            let mut role = stage.make()?;
            if number == self.above.len() {
                role = watched(&stage.kind, role, witness);
            }
            last = graph.add(&stage.kind, role, &[last]);
        }
        graph.add("collected", Role::Sink(Box::new(sink)), &[last]);
        Ok(graph)
    }
}

impl DeclaredNeeds {
    fn enter(&mut self, needs: &Needs) {
        let mark = needs.mark.map(Mark::dimension).map(str::to_owned);
        self.looked_at.extend(needs.dimensions.iter().chain(&needs.if_there).cloned());
        self.looked_at.extend(needs.reads.iter().map(|kind| kind.name().to_owned()));
        let moved = names::XYZ.iter().chain([&names::SYNTHETIC]).filter(|_| needs.moves);
        let moved: Vec<String> = moved.map(|name| (*name).to_owned()).collect();
        let changed = || needs.changes.iter().chain(&mark).chain(&moved).cloned();
        self.looked_at.extend(changed());
        self.changed.extend(changed());
        self.record_numbers |= needs.record_numbers;
        self.whole_records |= needs.whole_records;
    }
}

/// What a stage needs, in each of its phases.
fn needs(role: &Role) -> Vec<Needs> {
    match role {
        Role::Transform(stage) => vec![stage.needs()],
        Role::TileOp(stage) => vec![stage.needs()],
        Role::ScanOp(stage) => vec![stage.gather_needs(), stage.needs()],
        Role::RoundOp(stage) => vec![stage.needs()],
        Role::Source(_) | Role::Sink(_) | Role::Merge => Vec::new(),
    }
}

/// Works on tiles and does nothing: what streams below it streams behind tiles.
struct Idle;

impl TileOp for Idle {
    fn needs(&self) -> Needs {
        Needs::none()
    }

    fn run(&self, _: &mut Tile, _: &mut Tally) -> Result<()> {
        Ok(())
    }
}
