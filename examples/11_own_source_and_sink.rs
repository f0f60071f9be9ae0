//! Reach for this when points come from what is no file, or become what is no point cloud: a source
//! and a sink of kinds of your own, which pipelines name like any other. Here a dome that is made
//! up, and a table of how many points are at which height.
//!
//! `cargo run --example 11_own_source_and_sink`

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use pointmill::memory::schema;
use pointmill::point::{Metadata, PointBatch, Scalar, Schema, names};
use pointmill::stage::{
    ChunkSize, CreateSink, Encode, Encoded, OpenSource, Order, Part, Role, RoleName, Sink,
    SinkSummary, Source, StageKind, StagePlace,
};
use pointmill::{Error, Graph, Overrides, Quiet, Registry, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Records of a part: parts are read side by side.
const PART: u64 = 10_000;
/// Records that are counted at once.
const CHUNK: ChunkSize = ChunkSize { points: 10_000, bytes: 8 * 10_000 };

/// Makes a dome up. The fields are the keys of the stage.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
struct Dome {
    /// How many points.
    points: u64,
    /// The radius of the dome.
    radius: f64,
}

impl StageKind for Dome {
    const KIND: &'static str = "dome";
    const ROLE: RoleName = RoleName::Source;
    const ABOUT: &'static str = "Makes a dome up.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::Source(Box::new(self)))
    }
}

impl OpenSource for Dome {
    // Here a source of files would read their headers.
    fn open(&self) -> Result<Box<dyn Source>> {
        let schema = Arc::new(schema(&names::XYZ.map(|name| (name, Scalar::F64)))?);
        Ok(Box::new(OpenDome { dome: self.clone(), schema, metadata: Metadata::default() }))
    }
}

struct OpenDome {
    dome: Dome,
    schema: Arc<Schema>,
    metadata: Metadata,
}

impl Source for OpenDome {
    fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn points(&self) -> u64 {
        self.dome.points
    }

    // What reading a part takes besides the batch that it fills.
    fn part_bytes(&self) -> u64 {
        0
    }

    fn parts(&self) -> usize {
        self.dome.points.div_ceil(PART) as usize
    }

    // The number of a part's first record, so that records can be told apart by their numbers.
    fn first_record(&self, index: usize) -> Option<u64> {
        Some(index as u64 * PART)
    }

    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>> {
        let next = index as u64 * PART;
        let end = self.dome.points.min(next + PART);
        Ok(Box::new(DomePart { dome: &self.dome, next, end }))
    }
}

struct DomePart<'a> {
    dome: &'a Dome,
    next: u64,
    end: u64,
}

impl Part for DomePart<'_> {
    // The batch comes back empty when the part is over.
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        batch.clear();
        batch.source = 0;
        while self.next < self.end && batch.len() < batch.capacity() {
            let z = self.next as f64 / self.dome.points as f64;
            let (turn, r) = (self.next as f64 * 2.399_963, (1.0 - z * z).sqrt());
            let point = [r * turn.cos(), r * turn.sin(), z].map(|v| v * self.dome.radius);
            batch.extend(point.map(f64::to_ne_bytes).as_flattened());
            self.next += 1;
        }
        Ok(())
    }
}

/// Writes a table of how many points there are at which height.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
struct Heights {
    /// The table.
    path: PathBuf,
    /// The height of a row.
    step: f64,
}

impl StageKind for Heights {
    const KIND: &'static str = "heights";
    const ROLE: RoleName = RoleName::Sink;
    const ABOUT: &'static str = "Writes a table of heights.";

    // What is wrong with a key is told at its place.
    fn build(self, at: &StagePlace) -> Result<Role> {
        match self.step > 0.0 {
            true => Ok(Role::Sink(Box::new(self))),
            false => Err(at.blame("step", Error::pipeline("a step is above 0"))),
        }
    }
}

impl CreateSink for Heights {
    fn path(&self) -> &Path {
        &self.path
    }

    // Counts do not depend on it: what is cheapest will do.
    fn order(&self) -> Order {
        Order::Auto
    }

    fn chunk(&self, _: &Arc<Schema>, _: &Metadata) -> Result<ChunkSize> {
        Ok(CHUNK)
    }

    // The file grows at `staged`, and gets its name when the run is done.
    fn create(
        &self,
        staged: &Path,
        _: &Arc<Schema>,
        _: &Metadata,
        _: bool,
    ) -> Result<Box<dyn Sink>> {
        let (path, step) = (staged.to_owned(), self.step);
        Ok(Box::new(OpenHeights { path, step, counts: BTreeMap::new(), points: 0 }))
    }
}

struct OpenHeights {
    path: PathBuf,
    step: f64,
    counts: BTreeMap<i64, u64>,
    points: u64,
}

/// Runs on all threads: the heights of a batch, as bytes.
struct HeightsOf;

impl Encode for HeightsOf {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let axes = batch.schema().coordinates();
        let [_, _, z] = axes.ok_or_else(|| Error::internal("records have no coordinates"))?;
        let heights = batch.iter().map(|record| z.world(record, batch.schema().endian));
        let bytes = heights.flat_map(f64::to_ne_bytes).collect();
        Ok(Encoded::new(bytes, batch.len() as u64))
    }
}

impl Sink for OpenHeights {
    fn chunk_points(&self) -> usize {
        CHUNK.points
    }

    fn chunk_bytes(&self) -> u64 {
        CHUNK.bytes
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        Arc::new(HeightsOf)
    }

    // Called by one thread, chunk by chunk in their order.
    fn append(&mut self, chunk: Encoded) -> Result<()> {
        for height in chunk.bytes.as_chunks().0 {
            let row = (f64::from_ne_bytes(*height) / self.step).floor() as i64;
            *self.counts.entry(row).or_insert(0) += 1;
        }
        self.points += chunk.points;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<SinkSummary> {
        let mut text = String::from("height,points\n");
        for (row, count) in &self.counts {
            let _ = writeln!(text, "{},{count}", *row as f64 * self.step); // into a String
        }
        std::fs::write(&self.path, &text).map_err(|e| Error::io(&self.path, "write it", e))?;
        Ok(SinkSummary::new(self.points, text.len() as u64))
    }
}

const PIPELINE: &str = r#"
[[stage]]
kind = "dome"
points = 50_000
radius = 10.0

[[stage]]
kind = "filter"
where = "Z >= 5"

[[stage]]
kind = "heights"
path = "heights.csv"
step = 1.0
"#;

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("heights.csv");
    let text = PIPELINE.replace("heights.csv", &path.to_string_lossy());
    let registry = Registry::builtin().with::<Dome>().with::<Heights>();
    let plan = Graph::parse(&text, "heights.toml", &registry)?.plan(&Overrides::default())?;
    plan.run(&Quiet)?;

    let table = std::fs::read_to_string(&path)?;
    print!("{table}");
    // A dome has as many points at every height: Archimedes.
    let counts = table.lines().skip(1).filter_map(|line| line.split(',').nth(1)?.parse().ok());
    assert_eq!(counts.collect::<Vec<u64>>(), [5_000; 5]);
    Ok(())
}
