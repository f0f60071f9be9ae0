//! Colours keep what they mean between LAS, where white is 65535, and PLY, where it is 255.

use std::path::{Path, PathBuf};

use crate::support::case_file;
use crate::support::runs::{Settings, run};
use crate::support::scan::Scan;
use pointmill::point::{Scalar, Value};

/// The input's conversion by a `write` with these keys, and what the run warned of.
fn converted(folder: &Path, input: &Path, write: &str) -> (PathBuf, Vec<String>) {
    let ran = run(folder, &[input.to_owned()], "", write, Settings::PLAIN).unwrap();
    (ran.output, ran.report.run.warnings)
}

/// Type and values of the red of a file.
fn red(path: &Path) -> (Scalar, Vec<u64>) {
    let scan = Scan::read(path, usize::MAX);
    let red = scan.schema.find("Red").unwrap();
    let of = |record: &[u8]| match red.get(record, scan.schema.endian) {
        Value::Unsigned(v) => v,
        other => panic!("{other:?}"),
    };
    (red.scalar, scan.records.chunks(scan.schema.stride).map(of).collect())
}

#[test]
fn eight_bits_of_ply_are_257_times_as_much_in_las_and_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let input = case_file("50-rgb8.ply");
    let (las, _) = converted(folder.path(), &input, "las\nscale = 0.001");
    assert_eq!(red(&las), (Scalar::U16, vec![65_535, 257, 0]));
    let kept = folder.path().join("kept.las");
    std::fs::rename(&las, &kept).unwrap();
    for encoding in ["binary", "ascii"] {
        let write = format!("ply\nencoding = {encoding:?}");
        let (back, warnings) = converted(folder.path(), &kept, &write);
        assert_eq!(red(&back), (Scalar::U8, vec![255, 1, 0]), "{encoding}");
        assert!(warnings.iter().all(|w| !w.contains("colour")), "{warnings:?}");
    }
}

#[test]
fn colors_that_eight_bits_hold_are_eight_bits_in_ply() {
    let folder = tempfile::tempdir().unwrap();
    let cases: [(&[u16], Scalar, &[u64], &str); 7] = [
        (&[0, 257, 65_535], Scalar::U8, &[0, 1, 255], ""),
        (&[0, 256, 65_280], Scalar::U8, &[0, 1, 255], ""),
        (&[0, 1, 255], Scalar::U8, &[0, 1, 255], "did not scale"),
        (&[0, 0, 0], Scalar::U8, &[0, 0, 0], ""),
        (&[0, 257, 65_280], Scalar::U8, &[0, 1, 255], "both are taken for 8 bits"),
        (&[0, 257, 256, 3], Scalar::U16, &[0, 257, 256, 3], "have 16 bits"),
        (&[0, 1000, 65_535], Scalar::U16, &[0, 1000, 65_535], "have 16 bits"),
    ];
    for (colors, scalar, values, told) in cases {
        let input = folder.path().join("in.las");
        Scan::colored(colors).write(&input);
        for encoding in ["binary", "ascii"] {
            let write = format!("ply\nencoding = {encoding:?}");
            let (output, warnings) = converted(folder.path(), &input, &write);
            assert_eq!(red(&output), (scalar, values.to_vec()), "{colors:?}");
            let warned = warnings.iter().any(|w| w.contains("colour"));
            assert_eq!(warned, !told.is_empty(), "{warnings:?}");
            assert!(told.is_empty() || warnings.iter().any(|w| w.contains(told)), "{warnings:?}");
        }
    }
}

#[test]
fn a_color_of_sixteen_bits_late_in_the_scan_widens_what_is_written_already() {
    // More than one chunk has 8 bits before the one that has not, and another comes behind it.
    let points = 300_000;
    for factor in [257, 256, 1] {
        let folder = tempfile::tempdir().unwrap();
        let mut colors: Vec<u16> = (0..points).map(|i| (i % 256) as u16 * factor).collect();
        colors[200_000] = 12_345;
        let input = folder.path().join("in.las");
        Scan::colored(&colors).write(&input);
        colors.rotate_left(200_000);
        let first = folder.path().join("first.las");
        Scan::colored(&colors).write(&first);
        for encoding in ["binary", "ascii"] {
            let keys = format!("ply\nencoding = {encoding:?}");
            let read = |input: &Path, keys: &str| {
                let (output, warnings) = converted(folder.path(), input, keys);
                assert!(warnings.iter().any(|w| w.contains("16 bits")) || keys.contains("16bit"));
                std::fs::read(output).unwrap()
            };
            let bytes = read(&input, &keys);
            let all = format!("{keys}\ncolors = '16bit'");
            assert!(bytes == read(&input, &all), "{factor} {encoding}");
            assert!(read(&first, &keys) == read(&first, &all), "{factor} {encoding}");
            assert!(String::from_utf8_lossy(&bytes[..400]).contains("property ushort red"));
        }
    }
}

#[test]
fn multiples_of_256_and_of_257_in_different_chunks_are_eight_bits_all_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.las");
    let colors: Vec<u16> =
        (0..200_000).map(|i| (i % 256) as u16 * if i < 100_000 { 257 } else { 256 }).collect();
    Scan::colored(&colors).write(&input);
    for encoding in ["binary", "ascii"] {
        let write = format!("ply\nencoding = {encoding:?}");
        let (output, _) = converted(folder.path(), &input, &write);
        let (scalar, values) = red(&output);
        assert_eq!(scalar, Scalar::U8);
        assert!(values.iter().zip(0..).all(|(&red, i)| red == i % 256));
        let eight = std::fs::read(&output).unwrap();
        let (output, _) = converted(folder.path(), &input, &format!("{write}\ncolors = '8bit'"));
        assert!(eight == std::fs::read(output).unwrap(), "{encoding}");
    }
}

#[test]
fn reduced_colors_have_the_type_that_all_kept_ones_ask_for() {
    let folder = tempfile::tempdir().unwrap();
    let input = case_file("50e-las-rgb16.las");
    let (output, _) = converted(folder.path(), &input, "ply\norder = 'canonical'");
    let (of_input, values) = red(&input);
    let narrow: Vec<u64> = values.iter().map(|v| v >> 8).collect();
    assert_eq!(of_input, Scalar::U16);
    let (scalar, mut kept) = red(&output);
    kept.sort_unstable();
    let mut narrow = narrow;
    narrow.sort_unstable();
    assert_eq!((scalar, kept), (Scalar::U8, narrow));
}

#[test]
fn the_number_of_bits_can_be_asked_for_where_las_becomes_ply_and_nowhere_else() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.las");
    Scan::colored(&[0, 257, 1000, 65_535]).write(&input);
    let (output, warnings) = converted(folder.path(), &input, "ply\ncolors = '8bit'");
    assert_eq!(red(&output), (Scalar::U8, vec![0, 1, 3, 255]));
    assert!(warnings.iter().any(|w| w.contains("cut to their upper 8 bits")), "{warnings:?}");
    Scan::colored(&[0, 257]).write(&input);
    let (output, _) = converted(folder.path(), &input, "ply\ncolors = '16bit'");
    assert_eq!(red(&output), (Scalar::U16, vec![0, 257]));
    let again = folder.path().join("again.ply");
    std::fs::rename(output, &again).unwrap();
    for (input, write) in [(&again, "ply\ncolors = '8bit'"), (&input, "las\ncolors = '8bit'")] {
        let refused = run(folder.path(), std::slice::from_ref(input), "", write, Settings::PLAIN);
        assert!(refused.err().unwrap().to_string().contains("colors`"), "{write}");
    }
    let (output, _) = converted(folder.path(), &again, "ply");
    assert_eq!(red(&output), (Scalar::U16, vec![0, 257]), "from PLY to PLY nothing changes");
}

#[test]
fn points_without_returns_are_the_only_return_of_their_pulse() {
    let folder = tempfile::tempdir().unwrap();
    let (las, _) = converted(folder.path(), &case_file("50-rgb8.ply"), "laz\nscale = 0.001");
    let scan = Scan::read(&las, usize::MAX);
    for name in ["ReturnNumber", "NumberOfReturns"] {
        let field = scan.schema.find(name).unwrap();
        for i in 0..scan.points() {
            let value = field.get(scan.record(i), scan.schema.endian);
            assert_eq!(value, Value::Unsigned(1), "{name}");
        }
    }
    // What the file says is kept, be it odd.
    let told = folder.path().join("told.ply");
    let header = "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty double y\n\
                  property double z\nproperty uchar number_of_returns\nend_header\n1 2 3 0\n";
    std::fs::write(&told, header).unwrap();
    let (las, _) = converted(folder.path(), &told, "las\nscale = 0.001");
    let scan = Scan::read(&las, usize::MAX);
    let returns = scan.schema.find("NumberOfReturns").unwrap();
    assert_eq!(returns.get(scan.record(0), scan.schema.endian), Value::Unsigned(0));
}
