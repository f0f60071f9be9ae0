//! A pipeline that fits: its source open, its lattice fixed, its stages in order, its memory divided.

use std::collections::BTreeSet;
use std::fmt;
use std::path::Path;

use super::publish::check_place;
use super::settings::{Overrides, RunSettings};
use super::shares::Demands;
use super::text::{Pipeline, PlacedStage, resolved};
use crate::budget::{Bytes, default_limit};
use crate::geom::lattice::Lattice;
use crate::point::Schema;
use crate::stage::{CreateSink, Needs, Order, Role, Source, TileOp, Transform};
use crate::{Error, ErrorKind, Result};

/// A pipeline ready to run.
pub struct Plan {
    pub(super) settings: RunSettings,
    pub(super) threads: usize,
    pub(super) source: Box<dyn Source>,
    pub(super) source_kind: String,
    pub(super) transforms: Vec<(String, Box<dyn Transform>)>,
    pub(super) ops: Vec<(String, Box<dyn TileOp>)>,
    pub(super) sink: Box<dyn CreateSink>,
    /// True if the run needs tiles: for its stages, or to sort.
    pub(super) mills: bool,
    /// Where points are; None for a stream that does not ask.
    pub(super) lattice: Option<Lattice>,
    /// The stages as the report names them.
    pub(super) stages: serde_json::Value,
    pub(super) demands: Demands,
}

/// The stages of a pipeline by role.
#[derive(Default)]
struct Sorted {
    source: Option<(String, Box<dyn crate::stage::OpenSource>)>,
    transforms: Vec<(String, Box<dyn Transform>)>,
    ops: Vec<(String, Box<dyn TileOp>)>,
    sink: Option<Box<dyn CreateSink>>,
}

impl Pipeline {
    /// Opens the inputs' headers and fits the stages to them and to the memory.
    ///
    /// Fails if the stages do not fit each other, the inputs disagree, an output is an input or
    /// cannot appear where it should, or the memory cannot do.
    pub fn plan(self, overrides: &Overrides) -> Result<Plan> {
        let settings = self.settings.with(overrides);
        let stages = self
            .stages
            .iter()
            .map(|stage| serde_json::json!({ "kind": stage.kind, "keys": stage.keys }))
            .collect();
        let sorted = sort(self.stages)?;
        let (source_kind, open) =
            sorted.source.ok_or_else(|| Error::pipeline("the pipeline reads nothing"))?;
        let sink = sorted.sink.ok_or_else(|| Error::pipeline("the pipeline writes nothing"))?;
        for input in open.paths() {
            refuse_overwrite(&input, sink.path())?;
            if let Some(report) = &settings.report {
                refuse_overwrite(&input, report)?;
            }
        }
        check_place(sink.path())?;
        if let Some(report) = &settings.report {
            check_place(report)?;
            if resolved(report) == resolved(sink.path()) {
                return Err(Error::pipeline("the report would replace the output").at(report));
            }
        }
        if let Some(folder) = settings.scratch.as_ref().filter(|folder| !folder.is_dir()) {
            return Err(Error::new(ErrorKind::Io, "the folder for scratch does not exist")
                .at(folder)
                .help("create it first, or name another with --scratch"));
        }
        let source = open.open()?;
        check_columns(&sorted.transforms, &sorted.ops, &*sink, source.schema())?;
        let mills = mills(&sorted.ops, &*sink)?;
        let z_scale = z_scale(&settings, &*source, &sorted.ops)?;
        let lattice = match mills || settings.nonfinite == super::settings::Nonfinite::Drop {
            true => Some(Lattice::stretched(source.schema(), settings.lattice, z_scale)?),
            false => None,
        };
        let threads = match settings.threads {
            Some(threads) => threads.get(),
            None => std::thread::available_parallelism().map_or(1, usize::from),
        };
        let limit = settings.memory.unwrap_or_else(default_limit);
        let chunk = sink.chunk(source.schema(), source.metadata())?;
        let ops = sorted.ops.iter().map(|(_, op)| op.needs()).collect();
        let demands = Demands { mills, ops, ..Demands::of(&*source, chunk, limit, threads) };
        demands.divide()?;
        Ok(Plan {
            settings,
            threads,
            source,
            source_kind,
            transforms: sorted.transforms,
            ops: sorted.ops,
            sink,
            mills,
            lattice,
            stages,
            demands,
        })
    }
}

fn sort(stages: Vec<PlacedStage>) -> Result<Sorted> {
    let mut sorted = Sorted::default();
    for stage in stages {
        let PlacedStage { kind, line, role, .. } = stage;
        let misplaced = |why: &str| {
            Err(Error::pipeline(format!("line {line}: `{kind}` cannot stand here: {why}")))
        };
        match role {
            Role::Source(_) if sorted.source.is_some() => {
                return misplaced("a pipeline has one source");
            }
            Role::Source(source) => sorted.source = Some((kind, source)),
            _ if sorted.source.is_none() => return misplaced("the first stage is a source"),
            Role::Sink(_) if sorted.sink.is_some() => {
                return misplaced("a pipeline has one output");
            }
            Role::Sink(sink) => sorted.sink = Some(sink),
            _ if sorted.sink.is_some() => return misplaced("the last stage writes"),
            Role::Transform(_) if !sorted.ops.is_empty() => {
                return misplaced("stages that stream come before those that work on tiles");
            }
            Role::Transform(transform) => sorted.transforms.push((kind, transform)),
            Role::TileOp(op) => sorted.ops.push((kind, op)),
        }
    }
    Ok(sorted)
}

/// Columns that stages compute; everything else that a stage reads is a dimension of the records.
const COLUMNS: [&str; 2] = ["Normal", "Cell"];

/// Checks that every stage's reads are written before it, and that no neighbourhood follows a
/// removal (that would be a second pass).
fn check_columns(
    transforms: &[(String, Box<dyn Transform>)],
    ops: &[(String, Box<dyn TileOp>)],
    sink: &dyn CreateSink,
    schema: &Schema,
) -> Result<()> {
    let mut there: BTreeSet<String> = schema.dimensions.iter().map(|d| d.name.clone()).collect();
    let mut removed_by: Option<&str> = None;
    // What a transform removes is gone before the tiles are cut: no neighbourhood ever saw it.
    let needs = transforms
        .iter()
        .map(|(kind, t)| (kind, t.needs(), false))
        .chain(ops.iter().map(|(kind, op)| (kind, op.needs(), true)));
    for (kind, needs, on_tiles) in needs {
        let Needs { reads, writes, neighbors, removes, .. } = needs;
        if let Some(missing) = reads.iter().find(|name| !there.contains(*name)) {
            let help = match COLUMNS.iter().position(|column| column == missing) {
                Some(0) => "put a `normals` stage before it",
                Some(_) => "put a `cells` stage before it",
                None => "the input has no such dimension",
            };
            let told = format!("`{kind}` needs {missing}, which nothing before it gives");
            return Err(Error::pipeline(told).help(help));
        }
        if let (Some(earlier), true) = (removed_by, neighbors > 0) {
            return Err(Error::pipeline(format!(
                "`{kind}` looks at neighbours after `{earlier}` removed points: that takes a second \
                 pass, which one pipeline cannot make yet"
            ))
            .help("write the reduced scan and run a second pipeline on it"));
        }
        there.extend(writes);
        if removes && on_tiles {
            removed_by = Some(kind);
        }
    }
    if sink.wants_normals() && !there.contains("Normal") {
        return Err(Error::pipeline("the output wants normals, which no stage computes")
            .at(sink.path())
            .help("put a `normals` stage before it, or leave `dimensions` out"));
    }
    Ok(())
}

/// What z is multiplied by where stages measure distances; else 1.
fn z_scale(
    settings: &RunSettings,
    source: &dyn Source,
    ops: &[(String, Box<dyn TileOp>)],
) -> Result<f64> {
    if ops.is_empty() {
        return Ok(1.0);
    }
    let stretch = settings.stretch(source.metadata().units);
    stretch.map_err(|error| match source.inputs().first() {
        Some(input) => error.at(&input.path),
        None => error,
    })
}

fn mills(ops: &[(String, Box<dyn TileOp>)], sink: &dyn CreateSink) -> Result<bool> {
    match sink.order() {
        Order::Input if !ops.is_empty() => Err(Error::pipeline(
            "order = \"input\" is for pipelines that stream; tiles write the canonical order",
        )
        .at(sink.path())
        .help("leave `order` out")),
        Order::Canonical => Ok(true),
        Order::Input | Order::Auto => Ok(!ops.is_empty()),
    }
}

/// Refuses `output` if it is the file `input`, whatever its name.
fn refuse_overwrite(input: &Path, output: &Path) -> Result<()> {
    use std::os::unix::fs::MetadataExt;
    let same = match (std::fs::metadata(input), std::fs::metadata(output)) {
        (Ok(a), Ok(b)) => (a.dev(), a.ino()) == (b.dev(), b.ino()),
        _ => false,
    };
    if same {
        return Err(Error::pipeline("this is an input and would be overwritten")
            .at(output)
            .help("write to another file"));
    }
    Ok(())
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shares = self.demands.divide().map_err(|_| fmt::Error)?;
        let inputs = self.source.inputs();
        writeln!(
            f,
            "source   {} ({} files, {} points by their headers)",
            self.source_kind,
            inputs.len(),
            self.source.points()
        )?;
        for (kind, _) in &self.transforms {
            writeln!(f, "streams  {kind}")?;
        }
        for (n, (kind, op)) in self.ops.iter().enumerate() {
            let needs = op.needs();
            let pass = if n == 0 { "pass 1" } else { "" };
            write!(f, "{pass:<8} {kind}: reads {}", needs.reads.join(", "))?;
            if !needs.writes.is_empty() {
                write!(f, ", writes {}", needs.writes.join(", "))?;
            }
            if needs.neighbors > 0 {
                write!(f, ", {} nearest neighbours", needs.neighbors)?;
            }
            writeln!(f)?;
        }
        writeln!(f, "sink     {}", self.sink.path().display())?;
        match &self.lattice {
            Some(lattice) => {
                write!(f, "lattice  step {} world units", lattice.step)?;
                if lattice.z_scale() != 1.0 {
                    write!(f, ", z times {}", lattice.z_scale())?;
                }
                writeln!(f)?;
            }
            None => writeln!(f, "lattice  none: records stream by as they are")?,
        }
        writeln!(f, "order    {}", if self.mills { "canonical" } else { "of the input" })?;
        writeln!(f, "threads  {}", self.threads)?;
        write!(f, "memory   {}", Bytes(self.demands.limit))?;
        if self.mills {
            write!(
                f,
                ": {} for the program, {} for the index, {} for work, {} to keep points in\n         \
                 runs of {} records, tiles of {} positions with their rims",
                Bytes(shares.base),
                Bytes(shares.index),
                Bytes(shares.work),
                Bytes(shares.kept_in_memory),
                shares.run_records,
                shares.tile_positions
            )?;
        }
        Ok(())
    }
}
