//! Compressed points with bits, bytes and stretches that are others: reading ends, and almost always says
//! where the damage is. `benches/damage.rs` is the same by the ten thousand, and on real scans.

use std::path::Path;

use crate::support::laz::damage::{Harm, Tally, Victim};
use crate::support::laz::points::{Kind, Maker};
use crate::support::laz::{Chunks, Recipe, read_file};

/// Points of a file.
const POINTS: usize = 30_000;
/// Times that a file is harmed in each way.
const TIMES: usize = 150;

/// A file of `format` whose points are cut into chunks, or not.
fn victim(folder: &Path, format: u8, chunks: Chunks) -> Victim {
    let recipe = Recipe { format, extra: 2, version: if format < 6 { 2 } else { 3 }, chunks };
    let records = Maker::new(&recipe, u64::from(format)).records(Kind::Walk, POINTS);
    let path = folder.join(format!("{format}.laz"));
    std::fs::write(&path, recipe.bake(&records)).unwrap();
    Victim::new(&path)
}

/// Harms a file in all ways; the share that is told is `least` or more.
fn harm(format: u8, chunks: Chunks, least: f64) {
    let folder = tempfile::tempdir().unwrap();
    let victim = victim(folder.path(), format, chunks);
    for (seed, harm) in Harm::ALL.into_iter().enumerate() {
        let tally = Tally::of(&victim, harm, TIMES, seed as u64);
        println!("format {format}, {harm:?}: {:.3} found, {tally:?}", tally.share());
        assert!(tally.found > TIMES / 2, "format {format}, {harm:?}: {tally:?}");
        assert!(tally.share() >= least, "format {format}, {harm:?}: {tally:?}");
    }
    assert!(read_file(&victim.path, 4096).is_ok(), "the file is healed");
}

#[test]
fn damage_to_chunks_of_format_1_is_told() {
    harm(1, Chunks::Fixed(10_000), 0.96);
}

#[test]
fn damage_to_chunks_of_format_3_is_told() {
    harm(3, Chunks::Fixed(10_000), 0.96);
}

#[test]
fn damage_to_a_file_without_chunks_is_told() {
    harm(1, Chunks::None, 0.96);
}

#[test]
fn damage_to_layers_of_format_6_is_told() {
    harm(6, Chunks::Fixed(10_000), 0.96);
}

#[test]
fn damage_to_layers_of_format_7_is_told() {
    harm(7, Chunks::Varying(vec![10_000, 1, 9_999]), 0.96);
}
