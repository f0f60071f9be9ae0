//! Points are held against what their header says of them: its box, its counts by return, its
//! count.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::support::case_file;
use crate::support::command::pointmill;
use crate::support::las::{LAS, LAZ, write};
use crate::support::random::Random;
use crate::support::records::read_source;
use pointmill::io::las::{fresh, layout, open};
use pointmill::point::Schema;

const POINTS: usize = 120_000;
/// Bytes of header fields (LAS 1.4 R15, table 3): largest z, smallest z, counts by return.
const MAX_Z: usize = 179 + 32;
const MIN_Z: usize = MAX_Z + 8;
const LEGACY_RETURNS: usize = 111;
const RETURNS: usize = 255;

/// A hilly scan of 1,200 by 100 points in centimetres, of which every fifth is a second return.
fn records(schema: &Schema) -> Vec<u8> {
    let mut random = Random(5);
    let mut records = vec![0; POINTS * schema.stride];
    for (i, record) in records.chunks_exact_mut(schema.stride).enumerate() {
        let (x, y) = ((i % 1200) as i32 * 10, (i / 1200) as i32 * 10);
        let z = 5000 + (x / 50) % 90 + random.below(9) as i32;
        for (axis, stored) in [x, y, z].into_iter().enumerate() {
            record[4 * axis..4 * axis + 4].copy_from_slice(&stored.to_le_bytes());
        }
        let shift = if schema.stride < 30 { 3 } else { 4 };
        record[14] = if i % 5 == 4 { 2 } else { 1 } | 2 << shift;
        // Interleaved fields are damaged together; layers of others would only be in the way.
        record[12] = if schema.stride < 30 { random.below(200) as u8 } else { 0 };
    }
    records
}

/// Writes the scan as `name`, of point format `format`, and changes its header.
fn scan(folder: &Path, name: &str, format: u8, change: impl Fn(&mut [u8])) -> PathBuf {
    let schema = Arc::new(layout(format, &[], [0.01; 3], [0.0; 3]));
    let options = if name.ends_with("laz") { LAZ } else { LAS };
    let path = folder.join(name);
    write(&path, options, &schema, &fresh(&schema, None), &records(&schema)).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    change(&mut bytes);
    std::fs::write(&path, bytes).unwrap();
    path
}

/// Exit code and standard error of the program with these arguments, on two threads.
fn program(arguments: &[&Path]) -> (i32, String) {
    let threads = [Path::new("--threads"), Path::new("2")];
    let (code, _, told) = pointmill(Path::new("."), &[arguments, &threads].concat());
    (code, told)
}

/// Converts `input` to `out.las` beside it, with `more` arguments.
fn convert(input: &Path, more: &[&str]) -> (i32, String) {
    let out = input.with_file_name("out.las");
    let mut arguments = vec![Path::new("convert"), input, Path::new("-o"), &out];
    arguments.extend(more.iter().map(Path::new));
    program(&arguments)
}

fn put(bytes: &mut [u8], at: usize, value: f64) {
    bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
}

/// Adds to the count of a return, in the fields of both widths.
fn count(bytes: &mut [u8], of: usize, add: i64) {
    let (narrow, wide) = (LEGACY_RETURNS + 4 * (of - 1), RETURNS + 8 * (of - 1));
    let now = i64::from_le_bytes(bytes[wide..wide + 8].try_into().unwrap()) + add;
    bytes[wide..wide + 8].copy_from_slice(&now.to_le_bytes());
    bytes[narrow..narrow + 4].copy_from_slice(&(now as u32).to_le_bytes());
}

#[test]
fn points_outside_of_the_box_of_a_laz_header_are_an_error_with_a_switch() {
    let folder = tempfile::tempdir().unwrap();
    for format in [1, 6] {
        let good = scan(folder.path(), "good.laz", format, |_| ());
        let plain = "--no-provenance";
        assert_eq!(convert(&good, &[plain]), (0, convert(&good, &[plain]).1));
        let right = std::fs::read(folder.path().join("out.las")).unwrap();
        std::fs::remove_file(folder.path().join("out.las")).unwrap();
        let bad = scan(folder.path(), "bad.laz", format, |bytes| put(bytes, MAX_Z, 50.8));
        for command in ["convert", "reduce"] {
            let out = folder.path().join("out.las");
            let arguments = [Path::new(command), &bad, Path::new("-o"), &out];
            let (code, told) = program(&arguments);
            assert_eq!(code, 1, "{command}: {told}");
            assert!(told.contains("bad.laz: at byte 211: "), "{told}");
            assert!(told.contains("of 120,000 points lie outside of the header's box: z from 50"));
            assert!(told.contains("to 50.8 there"), "{told}");
            assert!(told.contains("headers") && told.contains("warn"), "{told}");
            assert!(!out.exists());
        }
        let (code, told) = convert(&bad, &["--headers", "warn", plain]);
        assert_eq!(code, 0, "{told}");
        assert!(told.contains("warning: ") && told.contains("outside of the header's box"));
        assert_eq!(std::fs::read(folder.path().join("out.las")).unwrap(), right);
    }
    let wrong = convert(&scan(folder.path(), "good.laz", 1, |_| ()), &["--headers", "trust"]);
    assert_eq!(wrong.0, 2, "{}", wrong.1);
}

#[test]
fn boxes_that_are_unset_wider_or_wrong_as_a_whole_are_their_writers() {
    let folder = tempfile::tempdir().unwrap();
    let unset = |bytes: &mut [u8]| (0..6).for_each(|i| put(bytes, 179 + 8 * i, 0.0));
    let swapped = |bytes: &mut [u8]| put(bytes, MIN_Z, 900.0);
    let wider = |bytes: &mut [u8]| (put(bytes, MIN_Z, -1e9), put(bytes, MAX_Z, 1e9)).0;
    let rounded = |bytes: &mut [u8]| put(bytes, MIN_Z, 50.009);
    let moved = |bytes: &mut [u8]| (put(bytes, MIN_Z, 150.0), put(bytes, MAX_Z, 160.0)).0;
    for name in ["a.las", "a.laz"] {
        for none in [&unset as &dyn Fn(&mut [u8]), &swapped] {
            let (code, told) = convert(&scan(folder.path(), name, 1, none), &[]);
            assert_eq!(code, 0, "{name}: {told}");
            assert!(told.starts_with("warning: ") && told.contains("the header has no box of"));
        }
        for silent in [&wider as &dyn Fn(&mut [u8]), &rounded] {
            let (code, told) = convert(&scan(folder.path(), name, 1, silent), &[]);
            assert_eq!((code, told.contains("box")), (0, false), "{name}: {told}");
        }
        let (code, told) = convert(&scan(folder.path(), name, 1, moved), &[]);
        assert_eq!(code, 0, "{told}");
        assert!(
            told.contains("120,000 of 120,000 points lie outside of the header's box"),
            "{told}"
        );
    }
}

#[test]
fn a_bit_that_flipped_in_a_plain_file_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let start = |bytes: &[u8]| u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
    let flip = |bytes: &mut [u8]| bytes[start(bytes) + 28 * 777 + 11] ^= 0x10;
    let (code, told) = convert(&scan(folder.path(), "a.las", 1, flip), &[]);
    assert_eq!(code, 1, "{told}");
    assert!(told.contains("1 of 120,000 points lie outside of the header's box: z from"), "{told}");
    let flip = |bytes: &mut [u8]| bytes[start(bytes) + 28 * 777 + 14] ^= 0x04;
    let (code, told) = convert(&scan(folder.path(), "a.las", 1, flip), &[]);
    assert_eq!(code, 1, "{told}");
    assert!(told.contains("the header counts 96000 points of return 1, and 95999 were found"));
    // A box that more than one point in a hundred leaves is wrong.
    let narrow = |bytes: &mut [u8]| put(bytes, MAX_Z, 50.5);
    let (code, told) = convert(&scan(folder.path(), "a.las", 1, narrow), &[]);
    assert_eq!(code, 0, "{told}");
    assert!(told.contains("points lie outside of the header's box"), "{told}");
}

#[test]
fn counts_by_return_that_a_writer_kept_must_hold() {
    let folder = tempfile::tempdir().unwrap();
    for (name, format) in [("a.laz", 1), ("a.laz", 6), ("a.las", 6)] {
        let few = |bytes: &mut [u8]| (count(bytes, 1, 3), count(bytes, 2, -3)).0;
        let (code, told) = convert(&scan(folder.path(), name, format, few), &[]);
        assert_eq!(code, 1, "{name}: {told}");
        assert!(told.contains("counts 96003 points of return 1, and 96000 were found"), "{told}");
        let none = |bytes: &mut [u8]| (count(bytes, 1, -96_000), count(bytes, 2, -24_000)).0;
        let many = |bytes: &mut [u8]| count(bytes, 1, 7);
        for silent in [&none as &dyn Fn(&mut [u8]), &many] {
            let (code, told) = convert(&scan(folder.path(), name, format, silent), &[]);
            assert_eq!((code, told.contains("return")), (0, false), "{name}: {told}");
        }
    }
    let all = |bytes: &mut [u8]| (count(bytes, 1, 24_000), count(bytes, 2, -24_000)).0;
    let (code, told) = convert(&scan(folder.path(), "a.las", 6, all), &[]);
    assert_eq!(code, 0, "{told}");
    assert!(told.contains("counts 120000 points of return 1, and 96000 were found"), "{told}");
}

#[test]
fn points_without_a_return_number_may_count_as_first_returns() {
    let folder = tempfile::tempdir().unwrap();
    for (name, format) in [("a.laz", 1), ("a.laz", 6), ("a.las", 6)] {
        let schema = Arc::new(layout(format, &[], [0.01; 3], [0.0; 3]));
        let options = if name.ends_with("laz") { LAZ } else { LAS };
        let mut records = records(&schema);
        records.chunks_exact_mut(schema.stride).step_by(100).for_each(|record| record[14] = 0);
        let of = |change: &dyn Fn(&mut [u8])| {
            let path = folder.path().join(name);
            write(&path, options.clone(), &schema, &fresh(&schema, None), &records).unwrap();
            let mut bytes = std::fs::read(&path).unwrap();
            change(&mut bytes);
            std::fs::write(&path, bytes).unwrap();
            convert(&path, &[])
        };
        let (code, told) = of(&|_| ());
        assert_eq!((code, told.contains("return")), (0, false), "{name}: {told}");
        let (code, told) = of(&|bytes| count(bytes, 1, 1_200));
        assert_eq!(code, 0, "{name}: {told}");
        let one = "counts 96000 points of return 1, and 94800 were found, besides 1200 without a";
        assert!(told.contains(one), "{name}: {told}");
        // Among others they do not count, and neither does another number of them.
        for (of_return, more) in [(2, 1_200), (1, 1_199)] {
            let (code, told) = of(&|bytes| count(bytes, of_return, more));
            assert_eq!(code, 1, "{name}: {told}");
        }
    }
}

#[test]
fn layers_that_are_not_decoded_are_not_missed() {
    let folder = tempfile::tempdir().unwrap();
    let input = scan(folder.path(), "a.laz", 6, |_| ());
    let out = folder.path().join("out.ply");
    let names = "Intensity,GpsTime,UserData,PointSourceId,ScanAngle,ReturnNumber,NumberOfReturns";
    let drop = ["--drop", names].map(Path::new);
    let arguments = [Path::new("convert"), &input, Path::new("-o"), &out, drop[0], drop[1]];
    let (code, told) = program(&arguments);
    assert_eq!(code, 0, "{told}");
}

#[test]
fn nothing_is_told_of_inputs_that_were_not_read_to_their_end() {
    let folder = tempfile::tempdir().unwrap();
    let bad = scan(folder.path(), "bad.laz", 1, |bytes| put(bytes, MAX_Z, 50.8));
    let source = open(&[bad]).unwrap();
    assert!(source.parts() > 1);
    read_source(&*source, 1000).unwrap();
    assert!(source.contradictions().is_empty());
    read_source(&*source, usize::MAX / 4096).unwrap();
    let told = source.contradictions();
    assert!(told.len() == 1 && told[0].is_damage, "{told:?}");
    // Read once more, they are no more points.
    read_source(&*source, usize::MAX / 4096).unwrap();
    assert_eq!(source.contradictions(), told);
}

/// Flips bytes of compressed points: how many files then read without an error, to other points,
/// and how many of these contradict no header.
fn damage(folder: &Path, format: u8, flips: u64) -> (usize, usize) {
    let path = scan(folder, "a.laz", format, |_| ());
    let good = std::fs::read(&path).unwrap();
    let schema = layout(format, &[], [0.01; 3], [0.0; 3]);
    let right = records(&schema);
    let start = u32::from_le_bytes(good[96..100].try_into().unwrap()) as usize + 8;
    let mut random = Random(99);
    let (mut others, mut silent) = (0, 0);
    for _ in 0..flips {
        let mut bytes = good.clone();
        let at = start + random.below(good.len() - start - 100);
        bytes[at] ^= 1 << random.below(8);
        std::fs::write(&path, bytes).unwrap();
        let Ok(source) = open(std::slice::from_ref(&path)) else { continue };
        match read_source(&*source, usize::MAX / 4096) {
            Ok(found) if found != right => {
                others += 1;
                let told = source.contradictions().iter().any(|told| told.is_damage);
                silent += usize::from(!told);
            }
            _ => {}
        }
    }
    println!("format {format}: {others} of {flips} flips gave other points, {silent} untold");
    (others, silent)
}

#[test]
fn flipped_bits_of_interleaved_points_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let (_, silent) = damage(folder.path(), 1, 60);
    assert_eq!(silent, 0);
}

#[test]
fn flipped_bits_of_layers_are_told_by_the_ends_of_their_streams() {
    let folder = tempfile::tempdir().unwrap();
    let (others, silent) = damage(folder.path(), 6, 150);
    assert_eq!((others, silent), (0, 0), "of 150 that were decoded to other points");
}

#[test]
fn points_that_the_header_does_not_count_are_told_and_left() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.las");
    for (name, points, told) in [
        ("20b-count-too-few.las", 3, "56 bytes behind the 3 points"),
        ("80j-count-fewer.laz", 1100, "100 points or more behind those that the header counts"),
        ("19-legacy-nonzero-pdrf6.las", 5, ""),
        ("19c-14count5-legacy3.las", 5, "counts 5 points and, in the field for older readers, 3"),
        ("21-box-wrong.las", 5, "the header has no box of the points"),
    ] {
        let input = case_file(name);
        let (code, text) = program(&[Path::new("convert"), &input, Path::new("-o"), &out]);
        assert_eq!(code, 0, "{name}: {text}");
        assert_eq!(text.contains("warning: "), !told.is_empty(), "{name}: {text}");
        assert!(text.contains(told), "{name}: {text}");
        let read =
            read_source(&*open(std::slice::from_ref(&out)).unwrap(), usize::MAX / 4096).unwrap();
        let all = open(&[input]).unwrap();
        assert_eq!(read.len(), points * all.schema().stride, "{name}");
    }
    // The same where the bytes behind are no points: that is damage.
    let mut bytes = std::fs::read(case_file("80j-count-fewer.laz")).unwrap();
    put(&mut bytes, MAX_Z - 32, 110.0);
    let path = folder.path().join("cut.laz");
    std::fs::write(&path, bytes).unwrap();
    let (code, text) = convert(&path, &[]);
    assert_eq!(code, 1, "{text}");
    assert!(text.contains("the header's points end before its bytes"), "{text}");
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn real_scans_are_as_their_headers_say() {
    let folder = std::env::var_os("POINTMILL_SCANS").expect("POINTMILL_SCANS names the scans");
    let mut left = vec![PathBuf::from(folder)];
    let (mut files, mut wrong) = (0, Vec::new());
    while let Some(path) = left.pop() {
        if path.is_dir() {
            left.extend(std::fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()));
            continue;
        }
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if !["las", "laz"].contains(&extension.as_str()) {
            continue;
        }
        let Ok(source) = open(std::slice::from_ref(&path)) else { continue };
        read_source(&*source, usize::MAX / 4096).unwrap_or_else(|e| panic!("{e}"));
        files += 1;
        if source.contradictions().iter().any(|told| told.is_damage) {
            wrong.push(path.file_name().unwrap().to_string_lossy().into_owned());
        }
    }
    assert!(files > 100, "{files} files");
    assert_eq!(wrong, [""; 0], "of {files} files");
}
