//! What the tests of one output per input share.

use std::path::{Path, PathBuf};

use pointmill::Result;
use pointmill::point::PointBatch;
use pointmill::stage::{CreateSink, Role, Source};
use pointmill::{Graph, Overrides, Quiet, Registry};

use super::case::execute;
use super::{assert_same, records};

/// A pipeline that reads `inputs` and writes with `keys`.
pub fn text(inputs: &[PathBuf], keys: &str) -> String {
    let inputs: Vec<String> = inputs.iter().map(|p| format!("'{}'", p.display())).collect();
    let inputs = inputs.join(", ");
    format!("[[stage]]\nkind = 'read'\npath = [{inputs}]\n[[stage]]\nkind = 'write'\n{keys}\n")
}

/// Both ends of that pipeline, the source open.
pub fn ends(inputs: &[PathBuf], keys: &str) -> Result<(Box<dyn Source>, Box<dyn CreateSink>)> {
    let mut pipeline = Graph::parse(&text(inputs, keys), "outdir.toml", &Registry::builtin())?;
    let Some(Role::Sink(sink)) = pipeline.stages.pop().map(|s| s.role) else { panic!("no sink") };
    let Some(Role::Source(open)) = pipeline.stages.pop().map(|s| s.role) else {
        panic!("no source")
    };
    Ok((open.open()?, sink))
}

/// The paths of the outputs that a `folder` would get.
pub fn named(inputs: &[PathBuf], keys: &str) -> Result<Vec<PathBuf>> {
    let (source, sink) = ends(inputs, keys)?;
    let each = sink.each_input(&source.inputs())?.expect("one output for each input");
    Ok(each.iter().map(|sink| sink.path().to_owned()).collect())
}

/// Writes all that `keep` holds for (input, number of the record in it) to a file for each input,
/// as a run does: one source, one sink after the other.
pub fn write_each(
    inputs: &[PathBuf],
    keys: &str,
    keep: impl Fn(usize, u64) -> bool,
) -> Result<Vec<PathBuf>> {
    let (source, sink) = ends(inputs, keys)?;
    let mut kept = vec![Vec::new(); inputs.len()];
    let mut read = vec![0u64; inputs.len()];
    let mut batch = PointBatch::new(source.schema().clone(), 777);
    for i in 0..source.parts() {
        let mut part = source.part(i)?;
        loop {
            part.read(&mut batch)?;
            if batch.is_empty() {
                break;
            }
            let input = batch.source as usize;
            for record in batch.iter() {
                if keep(input, read[input]) {
                    kept[input].extend_from_slice(record);
                }
                read[input] += 1;
            }
        }
    }
    assert_eq!(read, source.inputs().iter().map(|i| i.points).collect::<Vec<_>>());
    let each = sink.each_input(&source.inputs())?.expect("one output for each input");
    let family = sink.chunk(source.schema(), source.metadata())?;
    let mut paths = Vec::new();
    for (i, (sink, kept)) in each.iter().zip(&kept).enumerate() {
        let (path, metadata) = (sink.path().to_owned(), source.metadata_of(i)?);
        let sink = sink.create(&path, source.schema(), &metadata, false)?;
        assert_eq!(sink.chunk_points(), family.points);
        assert!(sink.chunk_bytes() <= family.bytes, "{}", path.display());
        records::write(sink, source.schema(), kept)?;
        paths.push(path);
    }
    Ok(paths)
}

/// A run that converts `inputs` into one file.
pub fn convert_one(inputs: &[PathBuf], output: &Path, keys: &str) {
    let text = text(inputs, &format!("path = '{}'\n{keys}", output.display()));
    let text = format!("[run]\nprovenance = false\n{text}");
    execute(&text, &Overrides::default(), &Quiet).unwrap();
}

/// Two files have the same bytes.
pub fn assert_equal_files(a: &Path, b: &Path) {
    let (one, two) = (std::fs::read(a).unwrap(), std::fs::read(b).unwrap());
    assert_same(&one, &two, &format!("{} and {}", a.display(), b.display()));
}
