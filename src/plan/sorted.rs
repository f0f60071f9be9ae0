//! The stages of a graph by role, and the tree that they are: what the decode does for all
//! branches, and what stands behind it.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::engine::moved::Moved;
use crate::engine::pass::{Op, StageOp, StreamOp};
use crate::graph::{Graph, GraphStage, Limits, Written};
use crate::point::ColumnKind;
use crate::stage::{CreateSink, OpenSource, Role};
use crate::{Error, ErrorKind, Result};

/// What a stage behind the decode is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StageWork {
    /// This tile stage.
    Op(usize),
    /// This stage that streams.
    Filter(usize),
    /// This sink.
    Sink(usize),
    /// A source, or a stage that streams and belongs to the decode.
    Decode,
}

/// The stages of a graph by role.
pub(super) struct Sorted {
    pub source: (String, Box<dyn OpenSource>),
    /// The stages that the decode applies to all records.
    pub transforms: Vec<StreamOp>,
    pub ops: Vec<StageOp>,
    pub filters: Vec<StreamOp>,
    pub sinks: Vec<Box<dyn CreateSink>>,
    /// For each sink, how it is written.
    pub endings: Vec<Arc<dyn Written>>,
    /// What each stage of the graph is.
    pub works: Vec<StageWork>,
    /// For each stage of the graph, those that take from it, in order.
    pub takers: Vec<Vec<usize>>,
    /// The last stage of the decode.
    pub root: usize,
    /// For each stage of the graph, how reports and outputs name it.
    names: Vec<serde_json::Value>,
}

impl Sorted {
    /// Sorts a graph, or says the first thing that is wrong with it.
    pub fn new(graph: Graph) -> Result<Sorted> {
        graph.refuse_mistakes()?;
        let graph = graph.without_merges();
        let takers: Vec<Vec<usize>> =
            (0..graph.stages.len()).map(|n| graph.takers(n).collect()).collect();
        let (decoded, root) = decoded(&graph.stages, &takers)?;
        let name =
            |stage: &GraphStage| serde_json::json!({ "kind": stage.kind, "keys": stage.keys });
        let names = graph.stages.iter().map(name).collect();
        let columns = columns_above(&graph.stages);
        let endings = endings(&graph.stages);
        let mut labels = labels(&graph.stages).into_iter();
        let mut source: Option<(String, Box<dyn OpenSource>)> = None;
        let mut works = Vec::new();
        let (mut transforms, mut filters) = (Vec::new(), Vec::new());
        let (mut ops, mut sinks) = (Vec::new(), Vec::new());
        for ((n, stage), above) in graph.stages.into_iter().enumerate().zip(columns) {
            let GraphStage { kind, written, limits, role, .. } = stage;
            let label = labels.next().unwrap_or_default();
            works.push(match &role {
                Role::Source(_) => StageWork::Decode,
                Role::Transform(_) if decoded.contains(&n) => StageWork::Decode,
                Role::Transform(_) => StageWork::Filter(filters.len()),
                Role::TileOp(_) | Role::ScanOp(_) | Role::RoundOp(_) => StageWork::Op(ops.len()),
                Role::Sink(_) => StageWork::Sink(sinks.len()),
                Role::Merge => return Err(Error::internal("a merge is left in the graph")),
            });
            match role {
                Role::Source(open) => source = Some(merged(source, kind, open, &*written)?),
                Role::Transform(transform) => {
                    let all = if decoded.contains(&n) { &mut transforms } else { &mut filters };
                    all.push(StreamOp {
                        kind,
                        label,
                        written,
                        transform,
                        choice: limits.choice,
                        above,
                        of_tiles: false,
                    });
                }
                Role::Sink(sink) => sinks.push(sink),
                Role::Merge => {}
                Role::TileOp(_) | Role::ScanOp(_) | Role::RoundOp(_) => {
                    let mut stage = stage_op(kind, written, on_tiles(role)?, limits, above);
                    if stage.op.tile().needs().moves {
                        stage.mover = Some(filters.len());
                        filters.push(moved(&stage));
                    }
                    ops.push(stage);
                }
            }
        }
        let source = source.ok_or_else(|| Error::pipeline("the pipeline reads nothing"))?;
        if sinks.is_empty() {
            return Err(Error::pipeline("the pipeline writes nothing"));
        }
        Ok(Sorted { source, transforms, ops, filters, sinks, endings, works, takers, root, names })
    }

    /// The stages that take from stage `number` and work, and the sinks that take from it.
    pub fn behind(&self, number: usize) -> (Vec<usize>, Vec<usize>) {
        let takers = &self.takers[number];
        let sink = |taker: &usize| match self.works[*taker] {
            StageWork::Sink(sink) => Some(sink),
            _ => None,
        };
        let working = takers.iter().copied().filter(|taker| sink(taker).is_none());
        (working.collect(), takers.iter().filter_map(sink).collect())
    }

    /// The stages on a path, those of the decode and all sinks that take from one of these
    /// included, as reports and outputs name them.
    pub fn named(&self, path: &[usize]) -> serde_json::Value {
        let on_path: BTreeSet<usize> = path.iter().copied().collect();
        let is_decode = |n: &usize| self.works[*n] == StageWork::Decode;
        let is_sink = |n: &usize| {
            let takes = |from: &usize| self.takers[*from].contains(n);
            let from = (0..*n).filter(takes).collect::<Vec<_>>();
            matches!(self.works[*n], StageWork::Sink(_))
                && from.iter().any(|from| on_path.contains(from) || is_decode(from))
        };
        let named = 0..self.names.len();
        let named = named.filter(|n| on_path.contains(n) || is_decode(n) || is_sink(n));
        named.map(|n| self.names[n].clone()).collect()
    }
}

/// The name of each stage; of those that have none their kind, from the second of a kind on with
/// its number.
fn labels(stages: &[GraphStage]) -> Vec<Arc<str>> {
    let label = |(n, stage): (usize, &GraphStage)| {
        let is_nameless = |other: &&GraphStage| other.name.is_none() && other.kind == stage.kind;
        let before = stages[..n].iter().filter(is_nameless).count();
        match (&stage.name, before) {
            (Some(name), _) => name.as_str().into(),
            (None, 0) => stage.kind.as_str().into(),
            (None, before) => format!("{}.{}", stage.kind, before + 1).into(),
        }
    };
    stages.iter().enumerate().map(label).collect()
}

/// A stage that works on tiles.
fn on_tiles(role: Role) -> Result<Op> {
    match role {
        Role::TileOp(op) => Ok(Op::Tile(op)),
        Role::ScanOp(op) => Ok(Op::Scan(op)),
        Role::RoundOp(op) => Ok(Op::Round(op)),
        _ => Err(Error::internal("a stage does not work on tiles and is to")),
    }
}

/// A tile stage before the plan has looked at what it is limited to.
fn stage_op(
    kind: String,
    written: Arc<dyn Written>,
    op: Op,
    limits: Limits,
    above: Vec<ColumnKind>,
) -> StageOp {
    let (selection, weighed, mover) = (0, Vec::new(), None);
    StageOp { kind, written, op, limits, above, selection, weighed, mover }
}

/// What writes where a stage moves records.
fn moved(stage: &StageOp) -> StreamOp {
    StreamOp {
        kind: stage.kind.clone(),
        label: stage.kind.as_str().into(),
        written: stage.written.clone(),
        transform: Box::new(Moved),
        choice: stage.limits.choice.clone(),
        above: stage.above.clone(),
        of_tiles: true,
    }
}

/// For each stage the columns that those above it compute, the newest last.
fn columns_above(stages: &[GraphStage]) -> Vec<Vec<ColumnKind>> {
    let mut above: Vec<Vec<ColumnKind>> = Vec::with_capacity(stages.len());
    for stage in stages {
        let mut columns = Vec::new();
        for &from in &stage.from {
            columns.extend_from_slice(&above[from]);
            let op = match &stages[from].role {
                Role::TileOp(op) => op.needs(),
                Role::ScanOp(op) => op.needs(),
                Role::RoundOp(op) => op.needs(),
                _ => continue,
            };
            columns.retain(|known: &ColumnKind| {
                op.writes.iter().all(|new| new.name() != known.name())
            });
            columns.extend(op.writes);
        }
        above.push(columns);
    }
    above
}

/// How the sinks are written.
fn endings(stages: &[GraphStage]) -> Vec<Arc<dyn Written>> {
    let sinks = stages.iter().filter(|stage| matches!(stage.role, Role::Sink(_)));
    sinks.map(|sink| sink.written.clone()).collect()
}

/// A source, and another that is merged with it.
fn merged(
    source: Option<(String, Box<dyn OpenSource>)>,
    kind: String,
    open: Box<dyn OpenSource>,
    written: &dyn Written,
) -> Result<(String, Box<dyn OpenSource>)> {
    match source {
        None => Ok((kind, open)),
        Some((first, all)) => {
            let merged = all.merged(&*open);
            Ok((first, merged.map_err(|error| blame(written, error))?))
        }
    }
}

/// What is wrong with a stage, told where it is written; at the value of the key if it begins with
/// an assignment of one: `grid.side = 1`.
pub(super) fn blame(written: &dyn Written, error: Error) -> Error {
    if error.kind() != ErrorKind::Pipeline {
        return error; // it is about a file
    }
    let told = error.to_string();
    let assigned = told.strip_prefix('`').and_then(|rest| rest.split_once(" = "));
    let told = match assigned.and_then(|(address, _)| address.rsplit_once('.')) {
        Some((_, key)) => written.wrong_key(key, told.clone()),
        None => written.wrong(told),
    };
    match error.remedy() {
        Some(help) => told.help(help.to_owned()),
        None => told,
    }
}

/// The stages that stream and that every record passes, and the last of them or the source.
fn decoded(stages: &[GraphStage], takers: &[Vec<usize>]) -> Result<(BTreeSet<usize>, usize)> {
    let (mut decoded, mut root) = (BTreeSet::new(), 0);
    while let [one] = takers.get(root).map_or(&[][..], Vec::as_slice) {
        if !matches!(stages[*one].role, Role::Transform(_)) {
            break;
        }
        decoded.insert(*one);
        root = *one;
    }
    match stages.is_empty() {
        true => Err(Error::pipeline("the pipeline reads nothing")),
        false => Ok((decoded, root)),
    }
}
