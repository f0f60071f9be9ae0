//! What is held of a file's records and of its table of chunks is bounded, whatever it claims and
//! however long it is.

use std::io::{Cursor, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::support::allocator::{self, held};
use crate::support::case::execute;
use crate::support::case_file;
use crate::support::las::{LAZ, write};
use crate::support::records::read_source;
use crate::support::runs::remedy;
use laz::laszip::{ChunkTable, ChunkTableEntry};
use laz::{LasZipCompressor, LazVlr, LazVlrBuilder};
use pointmill::io::las;
use pointmill::{Error, ErrorKind};
use pointmill::{Graph, Overrides, Quiet, Registry};

fn describe(path: &Path) -> pointmill::Result<serde_json::Value> {
    pointmill::io::describe(path, Registry::builtin().formats())
}

/// A file of five points with `count` records, `payload` bytes each: variable length ones behind
/// the header, or extended ones at the end.
fn file(path: &Path, count: u32, payload: usize, extended: bool) {
    file_of("test", path, count, payload, extended);
}

/// The same with records of this user.
fn file_of(user: &str, path: &Path, count: u32, payload: usize, extended: bool) {
    let name = "19c-14count5-legacy3.las";
    let mut bytes = std::fs::read(case_file(name)).unwrap();
    let mut record = vec![0; if extended { 60 } else { 54 } + payload];
    record[2..2 + user.len()].copy_from_slice(user.as_bytes());
    record[20..22].copy_from_slice(&(payload as u16).to_le_bytes());
    let numbered = |i: u32| {
        let mut record = record.clone();
        record[18..20].copy_from_slice(&(i as u16).to_le_bytes());
        record
    };
    let records: Vec<u8> = (0..count).flat_map(numbered).collect();
    if extended {
        let at = bytes.len() as u64;
        bytes[235..243].copy_from_slice(&at.to_le_bytes());
        bytes[243..247].copy_from_slice(&count.to_le_bytes());
        bytes.extend(records);
    } else {
        let start = u32::from_le_bytes(bytes[96..100].try_into().unwrap());
        let moved = start + records.len() as u32;
        bytes[96..100].copy_from_slice(&moved.to_le_bytes());
        bytes[100..104].copy_from_slice(&count.to_le_bytes());
        bytes.splice(start as usize..start as usize, records);
    }
    std::fs::write(path, bytes).unwrap();
}

/// Plans a conversion.
fn plan(input: &Path) -> Result<(), Error> {
    let output = input.with_file_name("out.las");
    let text = format!(
        "[[stage]]\nkind = \"read\"\npath = {input:?}\n\n[[stage]]\nkind = \"write\"\npath = {output:?}\n"
    );
    Graph::parse(&text, "test.toml", &Registry::builtin())?.plan(&Overrides::default()).map(drop)
}

const MIB: usize = 1 << 20;

#[test]
fn more_records_than_any_scan_has_are_refused_before_they_are_held() {
    let _alone = allocator::alone();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.las");
    for (user, count, payload, extended, told) in [
        (
            "test",
            1_200_000,
            0,
            false,
            "1200000 variable length records are more than the 16384 held",
        ),
        ("liblas", 1_000, 65_000, false, "records that say what points are exceed 8 MiB"),
        ("test", 262_144, 0, true, "262144 extended variable length records are more than"),
    ] {
        file_of(user, &path, count, payload, extended);
        for work in [
            (&|path: &Path| las::open(&[path.to_owned()]).map(drop)) as &dyn Fn(&Path) -> _,
            &|path: &Path| describe(path).map(drop),
            &plan,
        ] {
            let (result, held) = held(|| work(&path));
            let error = result.unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Data);
            assert!(error.to_string().contains(told), "{error}");
            assert!(error.byte().is_some() && error.remedy().is_some());
            assert!(held < 12 * MIB, "{told}: {held} bytes");
        }
    }
}

#[test]
fn what_is_held_of_the_most_records_is_their_size() {
    let _alone = allocator::alone();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.las");
    file(&path, 8_000, 950, false);
    let (source, opened) = held(|| las::open(std::slice::from_ref(&path)).unwrap());
    assert!((7 * MIB..11 * MIB).contains(&opened), "{opened} bytes");
    drop(source);
    file(&path, 16_000, 0, true);
    let (_, described) = held(|| describe(&path).unwrap());
    assert!(described < 32 * MIB, "{described} bytes");
}

#[test]
fn the_union_of_several_files_records_is_bounded_too() {
    let _alone = allocator::alone();
    let folder = tempfile::tempdir().unwrap();
    let paths: Vec<PathBuf> = (0..3)
        .map(|i| {
            let path = folder.path().join(format!("{i}.las"));
            file(&path, 9_000, 1 + i, false);
            path
        })
        .collect();
    assert!(las::open(&paths[..1]).is_ok());
    let error = las::open(&paths).map(drop).unwrap_err();
    assert!(error.to_string().contains("18000 different variable length records"), "{error}");
}

/// The bytes between the header and the points.
fn records(path: &Path) -> Vec<u8> {
    let bytes = std::fs::read(path).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    bytes[375..word(96)].to_vec()
}

#[test]
fn many_bytes_of_records_are_carried_and_not_held() {
    let _alone = allocator::alone();
    let folder = tempfile::tempdir().unwrap();
    let [input, second, output] =
        ["in.las", "second.las", "out.las"].map(|name| folder.path().join(name));
    file(&input, 1_000, 65_000, false);
    let run = |inputs: &[&Path]| {
        let text = format!(
            "[run]\nthreads = 1\nprovenance = false\n[[stage]]\nkind = \"read\"\npath = {inputs:?}\n\
             [[stage]]\nkind = \"write\"\npath = {output:?}\n"
        );
        let go = |memory| {
            let overrides = Overrides { memory: Some(memory), ..Overrides::default() };
            execute(&text, &overrides, &Quiet)
        };
        // What the process holds counts against the budget, so a refusal tells what would do.
        let least = remedy(&go(1 << 20).map(drop).unwrap_err());
        let (done, held) = held(|| go(least));
        done.unwrap();
        assert!(held < 40 * MIB, "{held} bytes");
    };
    let (about, held) = held(|| describe(&input).unwrap());
    assert!(held < 2 * MIB, "{held} bytes");
    let last = &about["vlrs"][999];
    assert_eq!(last["length"], 65_000, "{last}");
    run(&[&input]);
    assert!(records(&input).len() > 60 * MIB);
    let same = |a: &Path| records(&output).starts_with(&records(a));
    assert!(same(&input), "the records are the same bytes");
    // So are those of two files that have them all in common, and those of which only one has some.
    std::fs::copy(&input, &second).unwrap();
    run(&[&input, &second]);
    assert!(same(&input));
    file(&second, 1_010, 65_000, false);
    run(&[&input, &second]);
    assert!(records(&output) == records(&second), "the union");
}

/// Bytes of a record of point format 1.
const RECORD: usize = 28;

/// Head of a LAZ file of `points` points in chunks of varying size, and what its record says of
/// them.
fn chunked(path: &Path, points: u64) -> (Vec<u8>, LazVlr) {
    let schema = Arc::new(las::layout(1, &[], [0.01; 3], [0.0; 3]));
    write(path, LAZ, &schema, &las::fresh(&schema, None), &[0; RECORD]).unwrap();
    let mut head = std::fs::read(path).unwrap();
    head.truncate(u32::from_le_bytes(head[96..100].try_into().unwrap()) as usize);
    let user = head.windows(14).position(|bytes| bytes == b"laszip encoded").unwrap();
    let laszip = user + 52;
    head[laszip + 12..laszip + 16].copy_from_slice(&u32::MAX.to_le_bytes());
    head[107..111].copy_from_slice(&(points as u32).to_le_bytes());
    head[247..255].copy_from_slice(&points.to_le_bytes());
    // No box and no counts by return.
    head[111..131].fill(0);
    head[255..375].fill(0);
    head[179..227].fill(0);
    let builder = LazVlrBuilder::default().with_point_format(1, 0).unwrap();
    (head, builder.with_variable_chunk_size().build())
}

/// A file whose table has `chunks` chunks of a point each; the points are not there to be read.
fn tiny_chunks(path: &Path, chunks: u64) {
    let (mut bytes, vlr) = chunked(path, chunks);
    let table = bytes.len() + 8 + chunks as usize * RECORD;
    bytes.extend((table as u64).to_le_bytes());
    bytes.resize(table, 0);
    let mut entries = ChunkTable::default();
    (0..chunks)
        .for_each(|_| entries.push(ChunkTableEntry { point_count: 1, byte_count: RECORD as u64 }));
    entries.write_to(&mut bytes, &vlr).unwrap();
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn a_table_of_millions_of_chunks_is_held_in_little_memory() {
    let _alone = allocator::alone();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.laz");
    tiny_chunks(&path, 4_000_000);
    let (source, held_by_one) = held(|| las::open(std::slice::from_ref(&path)).unwrap());
    assert_eq!((source.points(), source.parts()), (4_000_000, 80));
    assert!(held_by_one < 20 * MIB, "{held_by_one} bytes");
    // A list of the chunks of one part is counted.
    assert!(source.part_bytes() > 50_000 * 32, "{}", source.part_bytes());
    drop(source);
    // Files add up, and one has an end of its own.
    let paths: Vec<PathBuf> =
        ["a.laz", "b.laz", "c.laz"].map(|name| folder.path().join(name)).into();
    paths.iter().for_each(|other| std::fs::hard_link(&path, other).unwrap());
    let (opened, held_by_all) = held(|| las::open(&paths));
    let error = opened.map(drop).unwrap_err();
    assert!(
        error.to_string().contains("c.laz: the inputs up to this one have more chunks"),
        "{error}"
    );
    assert!(held_by_all < 40 * MIB, "{held_by_all} bytes");
    tiny_chunks(&path, 9_000_000);
    let (opened, held) = held(|| las::open(std::slice::from_ref(&path)));
    let error = opened.map(drop).unwrap_err();
    assert!(error.to_string().contains("its first 8"), "{error}");
    assert!(error.remedy().unwrap().contains("50,000"), "{error:?}");
    assert!(held < 40 * MIB, "{held} bytes");
}

#[test]
fn points_of_tiny_chunks_are_read_in_their_order() {
    let _alone = allocator::alone();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.laz");
    let mut records = vec![0; 120_000 * RECORD];
    for (i, record) in records.chunks_exact_mut(RECORD).enumerate() {
        record[..4].copy_from_slice(&(i as i32 * 7 % 10_007).to_le_bytes());
        record[14] = 1 | 1 << 3;
    }
    let (head, vlr) = chunked(&path, 120_000);
    let mut file = Cursor::new(head);
    file.seek(SeekFrom::End(0)).unwrap();
    let mut compressor = LasZipCompressor::new(file, vlr).unwrap();
    // Chunks of a point between larger ones.
    let (mut at, mut chunks) = (0, 0);
    while at < 120_000 {
        let points = if chunks % 4 == 3 { 1_000 } else { 1 };
        let end = (at + points).min(120_000);
        compressor.compress_many(&records[at * RECORD..end * RECORD]).unwrap();
        compressor.finish_current_chunk().unwrap();
        (at, chunks) = (end, chunks + 1);
    }
    compressor.done().unwrap();
    std::fs::write(&path, compressor.into_inner().into_inner()).unwrap();
    let source = las::open(std::slice::from_ref(&path)).unwrap();
    assert!(chunks > 450 && source.parts() == 3, "{chunks} chunks, {} parts", source.parts());
    assert!(read_source(&*source, usize::MAX / 4096).unwrap() == records);
}
