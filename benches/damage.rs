//! What share of damage to compressed points is told: `cargo bench --bench damage -- [SCAN.laz …]`.
//!
//! The first points of each scan (or of made-up ones) become a file of one chunk, written by our own
//! writer, and, in formats 0 to 5, a file without chunks. Each is harmed ten thousand times in each way
//! (`POINTMILL_DAMAGE_TIMES`), and read.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints and may fail")]

#[path = "../tests/support/mod.rs"]
mod support;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::support::las::{LAZ, write};
use crate::support::las_file::STRIDES;
use crate::support::laz::damage::{Harm, Tally, Victim};
use crate::support::laz::points::{Kind, Maker};
use crate::support::laz::{Chunks, Recipe};
use crate::support::records::read_source;
use pointmill::io::las::{fresh, layout, open};
use pointmill::point::{Metadata, Schema};

/// Points of a file: fewer than a chunk has, so that ten thousand are read in minutes.
const POINTS: usize = 20_000;

/// Records and what they are of.
struct Scan {
    name: String,
    schema: Arc<Schema>,
    metadata: Metadata,
    records: Vec<u8>,
}

impl Scan {
    fn read(path: &Path) -> Scan {
        let source = open(&[path.to_owned()]).unwrap();
        let records = read_source(&*source, POINTS).unwrap();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let (schema, metadata) = (source.schema().clone(), source.metadata().clone());
        Scan { name, schema, metadata, records }
    }

    fn made_up(format: u8) -> Scan {
        let schema = Arc::new(layout(format, &[], [0.01; 3], [0.0; 3]));
        let recipe = Recipe { format, extra: 0, version: 2, chunks: Chunks::None };
        let records = Maker::new(&recipe, 1).records(Kind::Walk, POINTS);
        let metadata = fresh(&schema, None);
        Scan { name: format!("made up, format {format}"), schema, metadata, records }
    }

    fn format(&self) -> u8 {
        let format = self.schema.layout.form.expect("a LAS file");
        format
    }

    /// The same, compressed in every way that its format has.
    fn victims(&self, folder: &Path) -> Vec<(&'static str, Victim)> {
        let format = self.format();
        let path = folder.join("chunk.laz");
        write(&path, LAZ, &self.schema, &self.metadata, &self.records).unwrap();
        let chunk = if format < 6 { "chunk" } else { "layers" };
        let mut all = vec![(chunk, Victim::new(&path))];
        if format < 6 {
            let extra = self.schema.stride - STRIDES[usize::from(format)];
            let recipe = Recipe { format, extra, version: 2, chunks: Chunks::None };
            let path = folder.join("stream.laz");
            std::fs::write(&path, recipe.bake(&self.records)).unwrap();
            all.push(("no chunks", Victim::new(&path)));
        }
        all
    }
}

fn main() {
    let paths: Vec<PathBuf> =
        std::env::args_os().skip(1).filter(|a| a != "--bench").map(PathBuf::from).collect();
    let times = std::env::var("POINTMILL_DAMAGE_TIMES")
        .map_or(10_000, |text| text.parse().expect("POINTMILL_DAMAGE_TIMES is a whole number"));
    let shared = Path::new("/dev/shm");
    let work = if shared.is_dir() { shared.to_owned() } else { std::env::temp_dir() };
    let folder = tempfile::tempdir_in(work).unwrap();
    let scans: Vec<Scan> = if paths.is_empty() {
        [1, 3, 6, 7].map(Scan::made_up).into()
    } else {
        paths.iter().map(|path| Scan::read(path)).collect()
    };
    println!(
        "| file | compressed as | points | bytes | damage | harmless | an error | other points, \
         contradicting the header | other points, untold | share with an error |"
    );
    println!("|---|---|--:|--:|---|--:|--:|--:|--:|--:|");
    let mut places: BTreeMap<(String, &str), usize> = BTreeMap::new();
    for scan in &scans {
        for (way, victim) in scan.victims(folder.path()) {
            for (seed, harm) in Harm::ALL.into_iter().enumerate() {
                let tally = Tally::of(&victim, harm, times, seed as u64);
                println!(
                    "| {}, format {} | {way} | {} | {} | {harm:?} | {} | {} | {} | {} | {:.3} % |",
                    scan.name,
                    scan.format(),
                    victim.points(),
                    victim.bytes(),
                    tally.harmless,
                    tally.found,
                    tally.contradicted,
                    tally.untold,
                    100.0 * tally.share(),
                );
                for (place, count) in tally.places {
                    *places.entry((place, way)).or_default() += count;
                }
            }
        }
    }
    println!("\nUntold, by the place of the damage and the records that it changes:\n");
    for ((place, way), count) in places {
        println!("- {way}, {place}: {count}");
    }
}
