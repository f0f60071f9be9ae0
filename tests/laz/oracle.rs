//! The decoder of compressed points held against the `laz` crate: the same bytes, whatever is in the
//! records, however they are compressed and in batches of any size.

use std::path::{Path, PathBuf};

use crate::support::laz::points::{Kind, Maker, ways};
use crate::support::laz::{Chunks, Recipe, Theirs, difference, read_file};
use crate::support::random::Random;
use crate::support::records::read_without;
use crate::support::scans;
use pointmill::io::las::open;
use pointmill::point::{PointBatch, Schema};

/// Records of a batch.
const CAPACITIES: [usize; 5] = [1, 7, 128, 129, 4096];

/// Versions of items that a format has.
fn versions(format: u8) -> [u16; 2] {
    if format < 6 { [1, 2] } else { [3, 4] }
}

/// Writes records into a file and reads them by both decoders: both give what was written.
fn agree(path: &Path, recipe: &Recipe, records: &[u8], capacities: &[usize]) {
    std::fs::write(path, recipe.bake(records)).unwrap();
    if !recipe.is_beyond_the_crate() {
        let theirs = Theirs::open(path).unwrap().next(records.len() / recipe.stride());
        let differ = difference(&theirs, records, recipe.stride());
        assert_eq!(differ, None, "the crate by itself, {recipe:?}");
    }
    for &capacity in capacities {
        let ours = read_file(path, capacity);
        let ours = ours.unwrap_or_else(|e| panic!("{recipe:?}, batches of {capacity}: {e:?}"));
        let differ = difference(&ours, records, recipe.stride());
        assert_eq!(differ, None, "{recipe:?}, batches of {capacity}");
    }
}

/// All versions, extra bytes, kinds of records and of chunks of one format.
fn agrees(format: u8) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.laz");
    let mut random = Random(u64::from(format));
    for version in versions(format) {
        for extra in [0, 1, 7, 40] {
            for kind in [Kind::Walk, Kind::Noise, Kind::Mixed, Kind::Constant] {
                let points = 1 + random.below(600);
                for chunks in ways(format, &mut random, points) {
                    let recipe = Recipe { format, extra, version, chunks };
                    let records = Maker::new(&recipe, random.number()).records(kind, points);
                    let odd = CAPACITIES[random.below(CAPACITIES.len())];
                    agree(&path, &recipe, &records, &[odd, 4096]);
                }
            }
        }
    }
}

macro_rules! formats {
    ($($name:ident $format:literal)*) => { $(
        #[test]
        fn $name() { agrees($format); }
    )* };
}

formats! {
    records_of_format_0 0 records_of_format_1 1 records_of_format_2 2 records_of_format_3 3
    records_of_format_4 4 records_of_format_5 5 records_of_format_6 6 records_of_format_7 7
    records_of_format_8 8 records_of_format_9 9 records_of_format_10 10
}

#[test]
fn batches_of_every_size_give_the_same_records() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.laz");
    let mut random = Random(7);
    for format in 0..=10 {
        for version in versions(format) {
            for chunks in ways(format, &mut random, 1000) {
                let recipe = Recipe { format, extra: 3, version, chunks };
                let records = Maker::new(&recipe, random.number()).records(Kind::Mixed, 1000);
                agree(&path, &recipe, &records, &CAPACITIES);
            }
        }
    }
}

#[test]
fn chunks_of_1_to_100_000_points() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.laz");
    for (format, version) in [(1, 1), (3, 2), (5, 2), (6, 3), (8, 4), (10, 3)] {
        for kind in [Kind::Walk, Kind::Mixed] {
            let sizes = vec![1, 100_000, 1, 2, 4096, 1, 20_000, 127, 128, 129, 1];
            let points = sizes.iter().sum();
            let recipe = Recipe { format, extra: 2, version, chunks: Chunks::Varying(sizes) };
            let records = Maker::new(&recipe, 11).records(kind, points);
            agree(&path, &recipe, &records, &[4096]);
        }
    }
}

/// One point a record, the smallest files: a point that is stored as it is, and nothing behind it.
#[test]
fn files_of_1_to_5_points() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.laz");
    let mut random = Random(13);
    for format in 0..=10 {
        for version in versions(format) {
            for points in 1..=5 {
                for chunks in ways(format, &mut random, points) {
                    let recipe = Recipe { format, extra: points - 1, version, chunks };
                    for kind in [Kind::Noise, Kind::Walk] {
                        let mut maker = Maker::new(&recipe, random.number());
                        agree(&path, &recipe, &maker.records(kind, points), &[1, 7]);
                    }
                }
            }
        }
    }
}

/// Dimensions that share no layer with others, by layer.
const LAYERS: [&[&str]; 12] = [
    &["Classification"],
    &["Synthetic", "KeyPoint", "Withheld", "Overlap", "ScanDirectionFlag", "EdgeOfFlightLine"],
    &["Intensity"],
    &["ScanAngle"],
    &["UserData"],
    &["PointSourceId"],
    &["GpsTime"],
    &["Red", "Green", "Blue"],
    &["NIR"],
    &["Wave"],
    &["ExtraBytes"],
    &["Intensity", "GpsTime", "Red", "Green", "Blue"],
];

/// Names of the dimensions of a schema that begin with one of these words.
fn named(schema: &Schema, words: &[&str]) -> Vec<String> {
    let names = schema.dimensions.iter().map(|dimension| dimension.name.clone());
    names.filter(|name| words.iter().any(|word| name.starts_with(word))).collect()
}

#[test]
fn fields_that_are_read_do_not_depend_on_those_that_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.laz");
    let mut left_out = 0;
    for format in [1, 3, 5, 6, 7, 8, 9, 10] {
        for version in versions(format) {
            let chunks = Chunks::Varying(vec![700, 1, 300]);
            let recipe = Recipe { format, extra: 5, version, chunks };
            let records = Maker::new(&recipe, u64::from(format)).records(Kind::Mixed, 1500);
            std::fs::write(&path, recipe.bake(&records)).unwrap();
            let source = open(std::slice::from_ref(&path)).unwrap();
            let schema = source.schema();
            let all: Vec<&str> = LAYERS.iter().copied().flatten().copied().collect();
            for words in LAYERS.iter().copied().chain([&all[..], &[]]) {
                let unread = named(schema, words);
                left_out += unread.len();
                let some = read_without(&*source, 129, &unread).unwrap();
                assert_eq!(some.len(), records.len());
                let read = schema.dimensions.iter().filter(|d| !unread.contains(&d.name));
                for dimension in read {
                    let field = |record| dimension.get(record, schema.endian);
                    let both = some.chunks(schema.stride).zip(records.chunks(schema.stride));
                    for (i, (ours, theirs)) in both.enumerate() {
                        let values = [field(ours), field(theirs)].map(|v| format!("{v:?}"));
                        let what = format!("{recipe:?}: {} of record {i}", dimension.name);
                        assert_eq!(values[0], values[1], "{what} without {unread:?}");
                    }
                }
            }
        }
    }
    assert!(left_out > 400, "only {left_out} dimensions were left out");
}

/// What pointmill refuses, and why.
const REFUSED: [(&str, &str); 4] = [
    ("laszip/broken_coder.laz", "its coder does not exist"),
    ("laszip/broken_type.laz", "its items are none of its point format"),
    ("pasture/10_points_format_9.laz", "its points are cut off"),
    ("pasture/10_points_format_10.laz", "its points are cut off"),
];

/// Every LAZ file below a folder.
fn compressed(folder: &Path, all: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        let is_laz = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("laz"));
        if path.is_dir() {
            compressed(&path, all);
        } else if is_laz {
            all.push(path);
        }
    }
}

/// Reads a file by both decoders, to its end: where they first differ, and how many records there are.
fn compare(path: &Path) -> pointmill::Result<u64> {
    let source = open(&[path.to_owned()])?;
    let stride = source.schema().stride;
    let mut theirs = Theirs::open(path).unwrap();
    let mut batch = PointBatch::new(source.schema().clone(), 4096);
    let mut records = 0;
    for index in 0..source.parts() {
        let mut part = source.part(index)?;
        loop {
            part.read(&mut batch)?;
            if batch.is_empty() {
                break;
            }
            let other = theirs.next(batch.len());
            if let Some(what) = difference(batch.records(), &other, stride) {
                panic!("{}: behind {records} records, {what}", path.display());
            }
            records += batch.len() as u64;
        }
    }
    assert_eq!(theirs.left, 0, "{}: records that only the crate reads", path.display());
    Ok(records)
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn every_real_scan_is_read_as_the_crate_reads_it_and_ends_where_it_should() {
    let folder = scans();
    let mut all = Vec::new();
    compressed(&folder, &mut all);
    let (mut same, mut refused) = (0, 0);
    for path in all {
        let name = path.strip_prefix(&folder).unwrap().to_str().unwrap().to_owned();
        let why = REFUSED.iter().find(|(file, _)| *file == name).map(|(_, why)| why);
        match (compare(&path), why) {
            (Ok(records), None) => {
                println!("{name}: {records} records");
                same += 1;
            }
            (Err(error), Some(why)) => {
                println!("{name} is refused, {why}: {error}");
                refused += 1;
            }
            (Err(error), None) => panic!("{name}: {error:?}"),
            (Ok(_), Some(why)) => panic!("{name} is read although {why}"),
        }
    }
    assert!(same >= 50 && refused == REFUSED.len(), "{same} are the same, {refused} refused");
}
