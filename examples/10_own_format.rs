//! Reach for this when your points are in files that pointmill does not read: a format of your own,
//! here of lines with three numbers below a first line that says so. It is registered by one line;
//! then `read` and `write`, `info` and every command know it by its extension and by its first line.
//!
//! `cargo run --example 10_own_format`

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use pointmill::io::{Projected, Projection};
use pointmill::point::{Dimension, Endian, Layout, Metadata, PointBatch, Scalar, Schema, names};
use pointmill::stage::{
    ChunkSize, Encode, Encoded, Format, Input, Part, ReadKeys, Sink, SinkSummary, Source,
    WriteKeys, foreign,
};
use pointmill::{Error, Graph, Overrides, Quiet, Registry, Result};
use serde_json::{Value, json};

/// A text of lines `x y z`, in files that end in `.toy` and begin with the line `toy`.
pub struct Toy;

const FIRST: &str = "toy\n";
const CALLED: &str = "a TOY file";
/// Points that are encoded at once, and the longest text of one.
const CHUNK_POINTS: usize = 10_000;
const LONGEST: usize = 3 * 330;

/// A record: three numbers, little-endian.
fn schema() -> Arc<Schema> {
    let field = |(i, name)| Dimension::new(name, Scalar::F64, 8 * i);
    let dimensions = names::XYZ.into_iter().enumerate().map(field).collect();
    let layout = Layout::plain("TOY");
    Arc::new(Schema { layout, endian: Endian::Little, stride: 24, dimensions })
}

impl Format for Toy {
    fn name(&self) -> &'static str {
        "toy"
    }

    fn family(&self) -> &'static str {
        "TOY"
    }

    fn about(&self) -> &'static str {
        "Lines of three numbers."
    }

    fn called(&self) -> &'static str {
        CALLED
    }

    fn sniff(&self, first: &[u8]) -> bool {
        first.starts_with(FIRST.as_bytes())
    }

    // Errors of formats say where: the file, and the byte where it can be named.
    fn open(&self, files: &[PathBuf], _: &ReadKeys) -> Result<Box<dyn Source>> {
        let mut inputs = Vec::new();
        for path in files {
            let lines = lines(path)?.count();
            inputs.push(Input::new(path, lines as u64));
        }
        Ok(Box::new(Texts { schema: schema(), metadata: Metadata::default(), inputs }))
    }

    fn describe(&self, path: &Path) -> Result<Value> {
        Ok(json!({"kind": "TOY", "points": lines(path)?.count()}))
    }

    fn chunk(&self, keys: &WriteKeys, from: &Arc<Schema>, _: &Metadata) -> Result<ChunkSize> {
        // Refuses records of which this format cannot hold a dimension, unless it is dropped.
        Projection::new(from, &schema(), &keys.drop)?;
        Ok(Projected::chunk(CHUNK, &schema()))
    }

    fn create(
        &self,
        staged: &Path,
        keys: &WriteKeys,
        from: &Arc<Schema>,
        _: &Metadata,
        _whole: bool,
    ) -> Result<Box<dyn Sink>> {
        let projection = Projection::new(from, &schema(), &keys.drop)?;
        let failed = |e| Error::io(staged, "write", e);
        let mut file = File::create(staged).map_err(failed)?;
        file.write_all(FIRST.as_bytes()).map_err(failed)?;
        let summary = SinkSummary::new(0, FIRST.len() as u64);
        let sink = Box::new(Text { file, path: staged.to_owned(), summary });
        Ok(Box::new(Projected::new(sink, projection, schema(), &keys.path)))
    }
}

/// The lines behind the first, each with its end.
fn lines(path: &Path) -> Result<impl Iterator<Item = Result<String>> + use<>> {
    let file = File::open(path).map_err(|e| Error::io(path, "open it", e))?;
    let (mut text, mut first) = (BufReader::new(file), Vec::new());
    let failed = |e| Error::io(path, "read it", e);
    text.by_ref().take(FIRST.len() as u64).read_to_end(&mut first).map_err(failed)?;
    if !Toy.sniff(&first) {
        return Err(foreign(path, CALLED));
    }
    let path = path.to_owned();
    Ok(text.lines().map(move |line| line.map_err(|e| Error::io(&path, "read it", e))))
}

/// Files that are read as one scan, each a part of it.
struct Texts {
    schema: Arc<Schema>,
    metadata: Metadata,
    inputs: Vec<Input>,
}

impl Source for Texts {
    fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn inputs(&self) -> Vec<Input> {
        self.inputs.clone()
    }

    fn points(&self) -> u64 {
        self.inputs.iter().map(|input| input.points).sum()
    }

    fn part_bytes(&self) -> u64 {
        1 << 13
    }

    fn parts(&self) -> usize {
        self.inputs.len()
    }

    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>> {
        let path = &self.inputs[index].path;
        Ok(Box::new(Lines { lines: Box::new(lines(path)?), path, source: index as u32 }))
    }
}

struct Lines<'a> {
    lines: Box<dyn Iterator<Item = Result<String>> + Send>,
    path: &'a Path,
    source: u32,
}

impl Part for Lines<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        batch.clear();
        batch.source = self.source;
        for line in self.lines.by_ref().take(batch.capacity()) {
            let line = line?;
            let numbers: Vec<f64> = line.split(' ').flat_map(str::parse).collect();
            let &[x, y, z] = &numbers[..] else {
                return Err(Error::data(self.path, format!("`{line}` is not three numbers")));
            };
            batch.extend([x, y, z].map(f64::to_le_bytes).as_flattened());
        }
        Ok(())
    }
}

/// A file that is being written.
struct Text {
    file: File,
    path: PathBuf,
    summary: SinkSummary,
}

const CHUNK: ChunkSize = ChunkSize { points: CHUNK_POINTS, bytes: (CHUNK_POINTS * LONGEST) as u64 };

struct Numbers;

impl Encode for Numbers {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let axes = batch.schema().coordinates();
        let axes = axes.ok_or_else(|| Error::internal("records have no coordinates"))?;
        let mut text = String::new();
        for record in batch.iter() {
            let [x, y, z] = axes.map(|axis| axis.world(record, batch.schema().endian));
            let _ = writeln!(text, "{x} {y} {z}"); // into a String it cannot fail
        }
        Ok(Encoded::new(text.into_bytes(), batch.len() as u64))
    }
}

impl Sink for Text {
    fn chunk_points(&self) -> usize {
        CHUNK.points
    }

    fn chunk_bytes(&self) -> u64 {
        CHUNK.bytes
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        Arc::new(Numbers)
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        self.summary.points += chunk.points;
        self.summary.bytes += chunk.bytes.len() as u64;
        self.file.write_all(&chunk.bytes).map_err(|e| Error::io(&self.path, "write", e))
    }

    fn finish(self: Box<Self>) -> Result<SinkSummary> {
        self.file.sync_all().map_err(|e| Error::io(&self.path, "write", e))?;
        Ok(self.summary)
    }
}

/// What pointmill knows, and the format. A program that calls `pointmill::cli::main` with it has all
/// commands of pointmill for such files.
pub fn registry() -> Registry {
    Registry::builtin().with_format(Toy)
}

#[allow(dead_code, reason = "the tests of formats use this file without its program")]
fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let file = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    std::fs::write(file("a.toy"), "toy\n0 0 0\n0.25 0 1.5\n2 2 2\n")?;
    let text = format!(
        "[[stage]]\nkind = 'read'\npath = '{}'\n[[stage]]\nkind = 'grid'\nside = 1.0\n\
         [[stage]]\nkind = 'write'\npath = '{}'\n",
        file("a.toy"),
        file("b.toy")
    );
    let graph = Graph::parse(&text, "thin.toml", &registry())?;
    println!("{}", graph.plan(&Overrides::default())?.run(&Quiet)?);
    println!("{}", std::fs::read_to_string(file("b.toy"))?);
    Ok(())
}
