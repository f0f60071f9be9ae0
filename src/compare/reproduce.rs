//! A run made again by what its output says: are the bytes the same?

use std::collections::BTreeMap;
use std::fmt;
use std::fs::{self, File};
use std::io::{self, BufReader, Read};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;

use super::told::{ToldInput, ToldRun};
use crate::engine::Watch;
use crate::engine::publish::folder_of;
use crate::engine::scratch::{Scratch, Trouble};
use crate::error::shown;
use crate::graph::{Graph, Overrides, RunSettings};
use crate::host::hashed::FileHash;
use crate::host::{lock, standard};
use crate::io::note;
use crate::language::{PipelineText, Registry};
use crate::report::Grouped;
use crate::{Error, ErrorKind, Result};

/// The version of this program.
const VERSION: &str = env!("CARGO_PKG_VERSION");
/// Bytes that are compared at once.
const PIECE: usize = 64 << 10;

/// How a run is made again.
#[derive(Debug, Clone, Default)]
pub struct ReproduceSettings {
    /// A folder where the inputs are; none: where the output says, from its own folder or from the
    /// one that the program is in.
    pub inputs: Option<PathBuf>,
    /// Memory, threads and scratch folder.
    pub run: RunSettings,
}

/// What came of a run that was made again.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Reproduction {
    /// True if it gave the same bytes.
    pub same: bool,
    /// Length of the output.
    pub bytes: u64,
    /// Length of what was made again.
    pub bytes_again: u64,
    /// The first byte that is another, from 0; None if all are the same.
    pub differs_at: Option<u64>,
    /// The version of pointmill that made the output.
    pub version: String,
    /// The version that made it again.
    pub version_again: String,
    /// The inputs, in the order in which the output names them.
    pub inputs: Vec<FoundInput>,
}

/// An input of a run that was made again.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct FoundInput {
    /// Its path.
    pub path: String,
    /// Its SHA-256, which is as the output says.
    pub sha256: String,
}

impl fmt::Display for Reproduction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Reproduction { bytes, bytes_again, version, version_again, .. } = self;
        match self.differs_at {
            None => write!(f, "the same {} bytes", Grouped(*bytes))?,
            Some(at) => {
                write!(f, "other bytes: they differ from byte {} on", Grouped(at))?;
                if bytes != bytes_again {
                    let (bytes, again) = (Grouped(*bytes), Grouped(*bytes_again));
                    write!(f, ", and there are {again} instead of {bytes}")?;
                }
            }
        }
        if version != version_again {
            let version = shown(Path::new(version)).to_string();
            write!(f, "; pointmill {version} made it, and this is {version_again}")?;
        }
        Ok(())
    }
}

/// Makes the run that the file at `output` came out of again, by what that says of it, and compares
/// the bytes. Nothing is written but scratch beside it.
///
/// ```
/// use pointmill::compare::{ReproduceSettings, reproduce};
/// use pointmill::{Graph, Overrides, Quiet, Registry};
///
/// let at = std::env::temp_dir().join(format!("pointmill-reproduce-{}", std::process::id()));
/// std::fs::create_dir_all(&at)?;
/// let path = at.join("thin.las");
/// let registry = Registry::builtin();
/// let line = format!("synth scene=part points=2000 ! grid side=0.1 ! write path={path:?}");
/// Graph::parse_line(&line, &registry)?.plan(&Overrides::default())?.run(&Quiet)?;
/// let again = reproduce(&path, &ReproduceSettings::default(), &registry, &Quiet)?;
/// assert!(again.same);
/// std::fs::remove_dir_all(&at)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// [`ErrorKind::Pipeline`] where it cannot be tried: the file does not say how it was made, or
/// inputs are missing or others, all of which are named. Else what a run may fail with.
pub fn reproduce(
    output: &Path,
    settings: &ReproduceSettings,
    registry: &Registry,
    watch: &dyn Watch,
) -> Result<Reproduction> {
    let text = note(output, registry.formats()).map_err(|error| untried(error.at(output)))?;
    let text = text.ok_or_else(|| {
        let told = "the file does not say how it was made";
        Error::pipeline(told).at(output).help(
            "pointmill wrote it with `run.provenance = false`, or of stages of a program, or \
             another program did",
        )
    })?;
    let run = ToldRun::read(&text).map_err(|error| error.at(output))?;
    let found = find(&run, output, settings.inputs.as_deref(), watch)?;
    let trouble = Trouble::default();
    let scratch = Scratch::below(&folder_of(output), &trouble);
    let outcome = again(&run, (&text, output), &found, &scratch, settings, registry, watch);
    drop(scratch);
    lock(&trouble).iter().for_each(|told| watch.warn(told));
    let (bytes, bytes_again, differs_at) = outcome?;
    let inputs = run.inputs.iter().filter_map(|input| {
        let path = found.get(&*input.path)?.to_string_lossy().into_owned();
        Some(FoundInput { path, sha256: input.sha256.clone() })
    });
    Ok(Reproduction {
        same: differs_at.is_none(),
        bytes,
        bytes_again,
        differs_at,
        inputs: inputs.collect(),
        version_again: VERSION.to_owned(),
        version: run.pointmill.clone(),
    })
}

/// An error by which a run cannot be tried.
fn untried(error: Error) -> Error {
    if matches!(error.kind(), ErrorKind::Pipeline | ErrorKind::Interrupted) {
        return error;
    }
    let told = Error::pipeline(error.to_string());
    match error.remedy() {
        Some(help) => told.help(help.to_owned()),
        None => told,
    }
}

/// Runs it again and compares: the lengths, and the first byte that is another.
fn again(
    run: &ToldRun,
    (text, output): (&str, &Path),
    found: &BTreeMap<&str, PathBuf>,
    scratch: &Scratch,
    settings: &ReproduceSettings,
    registry: &Registry,
    watch: &dyn Watch,
) -> Result<(u64, u64, Option<u64>)> {
    let folder = scratch.path("again")?;
    fs::create_dir(&folder).map_err(|e| Error::io(&folder, "make the folder", e))?;
    let pipeline = run.pipeline(found, &folder, registry).map_err(|error| error.at(output))?;
    let made = run.made(&folder).map_err(|error| error.at(output))?;
    let graph = PipelineText::new(pipeline, "").graph(registry, &[]).and_then(|graph| {
        let known = |(_, file): &(_, PathBuf)| found.values().any(|found| found == file);
        let untold = graph.stages.iter().flat_map(|stage| stage.role.files()).find(|f| !known(f));
        untold.map_or(Ok(graph), |_| Err(Error::pipeline("it reads what it does not say")))
    });
    let graph = graph.map_err(|error| untried(of_version(error, run).at(output)))?;
    let RunSettings { memory, threads, scratch, .. } = settings.run.clone();
    let deciding = graph.settings.deciding();
    let settings = RunSettings { memory, threads, scratch, ..deciding };
    let graph = Graph { note: Some(Arc::from(text)), settings, ..graph };
    graph.plan(&Overrides::default())?.run(watch)?;
    compare(output, &made, watch)
}

/// What is wrong with a pipeline of another version may be that it is of another version.
fn of_version(error: Error, run: &ToldRun) -> Error {
    match run.pointmill == VERSION {
        true => error,
        false => error.help(format!(
            "pointmill {} made it, and this is {VERSION}: run it again with that version",
            shown(Path::new(&run.pointmill))
        )),
    }
}

/// Where each input is. All that are missing or others are told.
fn find<'a>(
    run: &'a ToldRun,
    output: &Path,
    folder: Option<&Path>,
    watch: &dyn Watch,
) -> Result<BTreeMap<&'a str, PathBuf>> {
    let (mut found, mut wrong) = (BTreeMap::new(), Vec::new());
    for input in &run.inputs {
        match found_one(input, &candidates(&input.path, output, folder), watch) {
            Ok(path) => drop(found.insert(&*input.path, path)),
            Err(error) if error.kind() == ErrorKind::Interrupted => return Err(error),
            Err(error) => wrong.push(untried(error)),
        }
    }
    Error::all(wrong).map(|()| found)
}

/// Where an input may be, the likeliest first.
fn candidates(told: &str, output: &Path, folder: Option<&Path>) -> Vec<PathBuf> {
    if told == standard::DASH {
        return unnamed(folder);
    }
    let told = Path::new(told);
    let down: PathBuf =
        told.components().filter(|part| matches!(part, Component::Normal(_))).collect();
    let name = PathBuf::from(told.file_name().unwrap_or_default());
    let all = match folder {
        Some(folder) => vec![folder.join(&down), folder.join(&name)],
        None => {
            let own = folder_of(output);
            vec![own.join(told), told.to_owned(), own.join(&name)]
        }
    };
    all.into_iter().filter(|path| path.is_file()).collect()
}

/// Where an input may be that came by standard input: there, or under any name in the folder.
fn unnamed(folder: Option<&Path>) -> Vec<PathBuf> {
    let Some(folder) = folder else { return vec![standard::input(standard::DASH)] };
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut all: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    all.retain(|path| path.is_file());
    all.sort();
    all
}

/// The first of `candidates` that is the input, or what is wrong with them.
fn found_one(input: &ToldInput, candidates: &[PathBuf], watch: &dyn Watch) -> Result<PathBuf> {
    let go_on = || if watch.cancelled() { Err(Error::interrupted()) } else { Ok(()) };
    let mut wrong = None;
    for path in candidates {
        let bytes = standard::about(path)?.len();
        let told = if bytes != input.bytes {
            let (was, is) = (Grouped(input.bytes), Grouped(bytes));
            format!("the input had {was} bytes, and this file has {is}")
        } else {
            let hash = FileHash::of(&standard::opened(path)?, go_on)?;
            if hash.sha256.eq_ignore_ascii_case(&input.sha256) {
                return Ok(path.clone());
            }
            "the input had other bytes than this file: their SHA-256 differ".to_owned()
        };
        wrong.get_or_insert_with(|| Error::pipeline(told).at(path));
    }
    Err(wrong.unwrap_or_else(|| {
        let told = format!("the input {} is not there", shown(Path::new(&input.path)));
        Error::pipeline(told).help("name the folder that the inputs are in")
    }))
}

/// The lengths of two files, and the first byte that is another.
fn compare(a: &Path, b: &Path, watch: &dyn Watch) -> Result<(u64, u64, Option<u64>)> {
    let open = |path: &Path| File::open(path).map_err(|e| Error::io(path, "open it", e));
    let length = |path: &Path, file: &File| {
        file.metadata().map(|about| about.len()).map_err(|e| Error::io(path, "read its length", e))
    };
    let (one, two) = (open(a)?, open(b)?);
    let lengths = (length(a, &one)?, length(b, &two)?);
    let (mut one, mut two) = (BufReader::new(one), BufReader::new(two));
    let (mut left, mut right, mut at) = (vec![0; PIECE], vec![0; PIECE], 0u64);
    loop {
        if watch.cancelled() {
            return Err(Error::interrupted());
        }
        let n = fill(&mut one, &mut left).map_err(|e| Error::io(a, "read it", e))?;
        let m = fill(&mut two, &mut right).map_err(|e| Error::io(b, "read it", e))?;
        let differs = (0..n.max(m)).find(|&i| i >= n || i >= m || left[i] != right[i]);
        if let Some(i) = differs {
            return Ok((lengths.0, lengths.1, Some(at + i as u64)));
        }
        if n == 0 {
            return Ok((lengths.0, lengths.1, None));
        }
        at += n as u64;
    }
}

/// Fills `piece` as far as there are bytes; how many there were.
fn fill(from: &mut impl Read, piece: &mut [u8]) -> io::Result<usize> {
    let mut done = 0;
    while done < piece.len() {
        match from.read(&mut piece[done..]) {
            Ok(0) => break,
            Ok(read) => done += read,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(done)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Quiet;

    #[test]
    fn the_first_other_byte_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            fs::write(&path, bytes).unwrap();
            path
        };
        let mut bytes = vec![7; 3 * PIECE + 5];
        let whole = at("whole", &bytes);
        let compared = |other: &Path| compare(&whole, other, &Quiet).unwrap().2;
        assert_eq!(compared(&whole), None);
        let shorter = at("shorter", &bytes[..3 * PIECE + 1]);
        assert_eq!(compared(&shorter), Some(3 * PIECE as u64 + 1));
        bytes[2 * PIECE + 3] = 8;
        assert_eq!(compared(&at("other", &bytes)), Some(2 * PIECE as u64 + 3));
        assert_eq!(compared(&at("empty", b"")), Some(0));
    }
}
