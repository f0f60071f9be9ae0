//! Every value of every LAS point format comes back from every format that holds it.

use std::collections::BTreeMap;
use std::path::Path;

use super::points;
use crate::support::command::{done, pointmill};
use crate::support::las_file::{LasFile, STRIDES};
use crate::support::random::Random;

/// Values by name: a list for each.
pub(super) fn table(lines: &[String]) -> BTreeMap<String, Vec<f64>> {
    let names: Vec<&str> = lines[0].split(',').collect();
    let mut table: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for line in &lines[1..] {
        for (name, word) in names.iter().zip(line.split(',')) {
            let number = word.parse().unwrap_or_else(|_| panic!("{name}: {word}"));
            table.entry(name.replace(' ', "_")).or_default().push(number);
        }
    }
    table
}

pub(super) fn assert_same(
    what: &str,
    one: &BTreeMap<String, Vec<f64>>,
    two: &BTreeMap<String, Vec<f64>>,
) {
    assert_eq!(one.keys().collect::<Vec<_>>(), two.keys().collect::<Vec<_>>(), "{what}");
    for (name, values) in one {
        for (n, (a, b)) in values.iter().zip(&two[name]).enumerate() {
            let near = (a - b).abs() <= 1e-12 * a.abs().max(1e-3);
            assert!(near || (a.is_nan() && b.is_nan()), "{what}: {name} of {n}: {a} and {b}");
        }
        assert_eq!(values.len(), two[name].len(), "{what}: {name}");
    }
}

/// A file of a point format, of any bytes but those that a record cannot have.
fn las(at: &Path, format: u8) {
    let stride = STRIDES[usize::from(format)];
    let mut random = Random(u64::from(format) + 77);
    let mut records = random.bytes(stride * 500);
    for record in records.chunks_exact_mut(stride) {
        // Times and waveforms that are numbers.
        let time =
            if format >= 6 { Some(22) } else { [1, 3, 4, 5].contains(&format).then_some(20) };
        if let Some(time) = time {
            let seconds = f64::from(record[time]) * 1000.25;
            record[time..time + 8].copy_from_slice(&seconds.to_le_bytes());
        }
        if [4, 5, 9, 10].contains(&format) {
            let end = record.len();
            record[end - 29..].fill(0);
        }
    }
    let (scale, offset) = ([0.001, 0.01, 0.0025], [500_000.0, 5_600_000.5, -10.0]);
    let file = LasFile { format, stride, scale, offset, vlrs: &[], evlrs: &[], records: &records };
    std::fs::write(at.join("a.las"), file.bytes()).unwrap();
}

#[test]
fn every_format_gives_back_what_las_has() {
    for format in [0u8, 1, 2, 3, 5, 6, 7, 8, 10] {
        let at = tempfile::tempdir().unwrap();
        let at = at.path();
        las(at, format);
        let own = table(&points(at, "a.las"));
        for (to, more) in [
            ("a.ply", &[][..]),
            ("t.ply", &["--encoding", "ascii"]),
            ("a.pcd", &[]),
            ("t.pcd", &["--encoding", "ascii"]),
            ("a.e57", &[]),
            ("a.csv", &[]),
            ("a.txt", &["--separator", "semicolon"]),
            ("a.xyz", &[]),
        ] {
            let arguments = [&["convert", "a.las", "-o", to, "--quiet", "--colors", "16bit"], more];
            let (code, _, told) = pointmill(at, &arguments.concat());
            assert_eq!(code, 0, "{format} {to}: {told}");
            assert_same(&format!("{format} {to}"), &own, &table(&points(at, to)));
        }
    }
}

#[test]
fn chains_of_formats_change_nothing() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    las(at, 7);
    let own = table(&points(at, "a.las"));
    let chain = ["a.las", "b.pcd", "c.e57", "d.ply", "e.csv", "f.e57", "g.txt", "h.pcd"];
    for pair in chain.windows(2) {
        let (code, _, told) = pointmill(at, &["convert", pair[0], "-o", pair[1], "--quiet"]);
        assert_eq!(code, 0, "{pair:?}: {told}");
    }
    assert_same("chain", &own, &table(&points(at, "h.pcd")));
    done(at, &["info", "h.pcd"]);
}
