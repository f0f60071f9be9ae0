//! Stretches of one byte where compressed points were, as sparse copies and bad disks leave them: the
//! program tells or reads, and does not die of them.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic and tell why")]

mod scans_support;

use std::os::unix::process::ExitStatusExt;
use std::path::Path;

use scans_support::command::command;
use scans_support::{LasFile, Random, STRIDES, Setup, assert_holds, convert};

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

/// What a conversion of a file came to: its exit code, or None if it died by a stack that overflowed.
fn converted(at: &Path, file: &[u8], what: &str) -> Option<i32> {
    std::fs::write(at.join("in.laz"), file).unwrap();
    std::fs::write(at.join("out.las"), "old").unwrap();
    let arguments = ["convert", "in.laz", "-o", "out.las", "--threads", "1", "-q"];
    let output = command(at, &arguments).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    if output.status.code() != Some(0) {
        assert_eq!(std::fs::read(at.join("out.las")).unwrap(), b"old", "{what}");
    }
    match output.status.code() {
        Some(0) => {}
        Some(1) => assert!(told.contains("in.laz"), "{what}: {told}"),
        code => {
            let overflows =
                output.status.signal() == Some(6) && told.contains("has overflowed its stack");
            assert!(overflows, "{what}: {code:?} {}: {told}", output.status);
            return None;
        }
    }
    assert_holds(at, &["in.laz", "out.las"]);
    output.status.code()
}

/// Holes of some lengths at places all over the points of some formats, each in a run of its own:
/// how many runs there were, failed, and died.
fn holes(byte: u8, places: usize) -> [usize; 3] {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(u64::from(byte));
    let mut counts = [0; 3];
    for format in [1, 3, 6, 7] {
        let whole = laz(format);
        let start = u32::from_le_bytes(whole[96..100].try_into().unwrap()) as usize;
        for length in [8, 200, 6000] {
            for _ in 0..places {
                let mut file = whole.clone();
                let at = start + 8 + random.below(whole.len() - start - 8 - length);
                file[at..at + length].fill(byte);
                let what = format!("format {format}: {length} bytes of {byte:#x} at {at}");
                let code = converted(folder.path(), &file, &what);
                counts[0] += 1;
                counts[1] += usize::from(code == Some(1));
                counts[2] += usize::from(code.is_none());
            }
        }
    }
    counts
}

#[test]
fn a_hole_of_zeroes_or_of_any_other_byte_is_told_or_read() {
    for byte in [0x00, 0x55, 0xfe] {
        let [runs, failed, died] = holes(byte, 2);
        println!("{byte:#x}: {failed} of {runs} runs failed");
        assert!(runs == 24 && failed >= 4 && died == 0, "{byte:#x}: {failed} failed, {died} died");
    }
}

/// The decoder of the `laz` crate calls itself for every symbol that switches to another sequence of
/// times, and a hole of ones is read as many thousands of them. Until there is another decoder, what
/// is promised of such a file is that its output stays what it was.
#[test]
fn a_hole_of_ones_leaves_the_output_as_it_was_whatever_becomes_of_the_run() {
    let [runs, failed, died] = holes(0xff, 3);
    println!("{failed} of {runs} runs failed, {died} died");
    assert!(runs == 36 && failed >= 4, "{failed} of {runs} runs failed, {died} died");
}
