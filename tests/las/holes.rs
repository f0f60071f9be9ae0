//! Stretches of one byte where compressed points were, as sparse copies and bad disks leave them: the
//! program tells or reads, and does not die of them.

use std::path::Path;

use crate::support::assert_holds;
use crate::support::case_file;
use crate::support::command::pointmill;
use crate::support::las_file::{LasFile, STRIDES};
use crate::support::random::Random;
use crate::support::setup::{Setup, convert};

/// Points of a format with times, colours and all else that changes from one to the next.
fn records(format: u8, points: i32) -> Vec<u8> {
    let stride = STRIDES[usize::from(format)];
    let mut random = Random(u64::from(format));
    let mut all = Vec::new();
    for i in 0..points {
        let mut record = random.bytes(stride);
        for (axis, value) in [i % 50 * 40, i / 50 * 40, i * i % 301].into_iter().enumerate() {
            record[4 * axis..4 * axis + 4].copy_from_slice(&value.to_le_bytes());
        }
        record[14..16].copy_from_slice(&[0x11, 0]);
        let time = if format < 6 { 20 } else { 22 };
        record[time..time + 8].copy_from_slice(&(f64::from(i) * 1e-5 + 3e8).to_le_bytes());
        all.extend(record);
    }
    all
}

/// A LAZ file of a format.
fn laz(format: u8) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let [from, to] = ["a.las", "a.laz"].map(|name| folder.path().join(name));
    let file = LasFile {
        format,
        stride: STRIDES[usize::from(format)],
        scale: [0.01; 3],
        offset: [0.0; 3],
        vlrs: &[],
        evlrs: &[],
        records: &records(format, 2000),
    };
    std::fs::write(&from, file.bytes()).unwrap();
    convert(&[from], &to, &Setup::new(&[])).unwrap();
    std::fs::read(to).unwrap()
}

/// The exit code of a conversion of a file, which ends in an error that names the file, or reads.
fn converted(at: &Path, file: &[u8], what: &str) -> i32 {
    std::fs::write(at.join("in.laz"), file).unwrap();
    std::fs::write(at.join("out.las"), "old").unwrap();
    let arguments = ["convert", "in.laz", "-o", "out.las", "--threads", "1", "-q"];
    let (code, _, told) = pointmill(at, &arguments);
    assert!(code == 0 || (code == 1 && told.contains("in.laz")), "{what}: {code}: {told}");
    if code == 1 {
        assert_eq!(std::fs::read(at.join("out.las")).unwrap(), b"old", "{what}");
    }
    assert_holds(at, &["in.laz", "out.las"]);
    code
}

/// Holes of some lengths at places all over the points of some formats, each in a run of its own:
/// how many runs there were and failed.
fn holes(byte: u8, places: usize) -> [usize; 2] {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(u64::from(byte));
    let mut counts = [0; 2];
    for format in [1, 3, 6, 7] {
        let whole = laz(format);
        let start = u32::from_le_bytes(whole[96..100].try_into().unwrap()) as usize;
        for length in [8, 200, 6000] {
            for _ in 0..places {
                let mut file = whole.clone();
                let at = start + 8 + random.below(whole.len() - start - 8 - length);
                file[at..at + length].fill(byte);
                let what = format!("format {format}: {length} bytes of {byte:#x} at {at}");
                counts[0] += 1;
                counts[1] += usize::from(converted(folder.path(), &file, &what) == 1);
            }
        }
    }
    counts
}

#[test]
fn a_hole_of_equal_bytes_is_told() {
    for byte in [0x00, 0x55, 0xfe, 0xff] {
        let [runs, failed] = holes(byte, 2);
        println!("{byte:#x}: {failed} of {runs} runs failed");
        assert!(runs == 24 && failed >= 22, "{byte:#x}: {failed} of {runs} runs failed");
    }
}

/// A decoder that calls itself for every symbol that switches to another sequence of times overflows its
/// stack by this file: six bytes of ones are read as thousands of those.
#[test]
fn times_that_switch_sequences_without_end_are_an_error() {
    let case = case_file("laz-recursion-1.laz");
    let folder = tempfile::tempdir().unwrap();
    let file = std::fs::read(case).unwrap();
    assert_eq!(converted(folder.path(), &file, "laz-recursion-1.laz"), 1);
}
