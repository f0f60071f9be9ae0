//! Runs whose output is split by values, by points or by bytes: one file after the other, the files
//! are the one that there would be without.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::{files, run};
use crate::support::case::Case;
use crate::support::scan::Scan;
use pointmill::synth::Scene;

/// Writes `pattern` with `keys` into a new folder of `at` by one thread and by three that spill;
/// the files, which are the same.
fn twice(
    at: &Path,
    input: &Path,
    stages: &str,
    (pattern, keys): (&str, &str),
) -> BTreeMap<String, PathBuf> {
    let mut all: Vec<BTreeMap<String, PathBuf>> = Vec::new();
    for settings in ["threads = 1", "threads = 3\nspill = 'always'\ntile_points = 2000"] {
        let folder = tempfile::tempdir_in(at).unwrap().keep();
        let write = format!("path = '{}'\n{keys}", folder.join(pattern).display());
        let report = run(settings, input, stages, &write).unwrap();
        let written = files(&folder);
        assert_eq!(report.run.outputs.len(), written.len());
        let total: u64 = report.run.outputs.iter().map(|output| output.points).sum();
        assert_eq!(total, report.result.ledger.kept);
        all.push(written);
    }
    let bytes = |files: &BTreeMap<String, PathBuf>| -> Vec<(String, Vec<u8>)> {
        files.iter().map(|(name, path)| (name.clone(), fs::read(path).unwrap())).collect()
    };
    assert!(bytes(&all[0]) == bytes(&all[1]), "the files depend on threads, spill or tiles");
    all.remove(0)
}

/// The records of files, one after the other.
fn records(files: &BTreeMap<String, PathBuf>) -> Vec<u8> {
    files.values().flat_map(|path| Scan::read(path, usize::MAX).records).collect()
}

const THIN: &str = "[[stage]]\nkind = 'grid'\nside = 1\n";
const FINE: &str = "[[stage]]\nkind = 'grid'\nside = 0.1\n";
const NORMALS: &str = "[[stage]]\nkind = 'normals'\nneighbors = 8\n";

#[test]
fn files_of_so_many_points_are_one_file_cut_at_these() {
    for (stages, keys, extension) in [
        ("", "", "las"),
        ("", "order = 'canonical'", "ply"),
        (THIN, "", "ply"),
        (THIN, "order = 'input'", "las"),
        (NORMALS, "dimensions = ['NormalX', 'NormalZ']", "las"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        Scan::synthetic(Scene::Als, 30_000, 5).write(&at("in.laz"));
        let whole = at(&format!("whole.{extension}"));
        run("", &at("in.laz"), stages, &format!("path = '{}'\n{keys}", whole.display())).unwrap();
        let whole = Scan::read(&whole, usize::MAX);
        let pattern = format!("t_{{number}}.{extension}");
        let keys = format!("points = 999\n{keys}");
        let written = twice(folder.path(), &at("in.laz"), stages, (&pattern, &keys));
        let count = whole.points().div_ceil(999);
        assert!(count > 2, "{count}");
        let names: Vec<String> = (1..=count).map(|n| format!("t_{n:04}.{extension}")).collect();
        assert_eq!(written.keys().cloned().collect::<Vec<_>>(), names);
        for (n, path) in written.values().enumerate() {
            let each = if n + 1 < count { 999 } else { whole.points() - 999 * n };
            assert_eq!(Scan::read(path, usize::MAX).points(), each);
        }
        assert!(records(&written) == whole.records, "{stages}{keys}");
    }
}

#[test]
fn files_of_so_many_bytes_are_as_long_as_they_may_be_and_no_longer() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    Scan::synthetic(Scene::Als, 400_000, 5).write(&at("in.laz"));
    let drop = "drop = ['ScanAngle', 'PointSourceId', 'Classification', 'UserData']";
    for (stages, keys, extension, most) in [
        ("", "", "las", 5_000_000),
        ("", "", "laz", 1_000_000),
        (FINE, "", "laz", 1_000_000),
        ("", "", "ply", 4_000_000),
        ("", "encoding = 'ascii'", "ply", 6_000_000),
        ("", "", "csv", 6_000_000),
        ("", drop, "e57", 3_000_000),
    ] {
        let whole = at(&format!("whole.{extension}"));
        run("", &at("in.laz"), stages, &format!("path = '{}'\n{keys}", whole.display())).unwrap();
        let pattern = format!("t_{{number}}.{extension}");
        let keys = format!("bytes = {most}\n{keys}");
        let written = twice(folder.path(), &at("in.laz"), stages, (&pattern, &keys));
        assert!(written.len() > 2, "{extension}: {written:?}");
        for path in written.values() {
            let bytes = fs::metadata(path).unwrap().len();
            assert!(bytes <= most, "{}: {bytes}", path.display());
        }
        let all: u64 = written.values().map(|path| fs::metadata(path).unwrap().len()).sum();
        let mean = all / written.len() as u64;
        assert!(mean > most / 3, "{extension}: {mean} bytes of {most}");
        if extension != "e57" {
            assert!(records(&written) == Scan::read(&whole, usize::MAX).records, "{extension}");
        }
    }
    let write = format!("path = '{}'\nbytes = '1 MiB'", at("{number}.las").display());
    let error = run("", &at("in.laz"), "", &write).unwrap_err();
    assert!(error.to_string().contains("`write.bytes` is too small"), "{error}");
}

#[test]
fn values_have_a_file_each() {
    let case = Case::new();
    let points: Vec<_> = (0..3_000)
        .map(|n: u32| ([f64::from(n % 53), f64::from(n / 53), 1.0], n % 3 * 1000 + 1))
        .collect();
    case.ply(&points);
    for stages in ["", THIN] {
        let whole = case.path("whole.ply");
        let input = case.path("in.ply");
        run("", &input, stages, &format!("path = '{}'", whole.display())).unwrap();
        let whole = Scan::read(&whole, usize::MAX);
        let tag = whole.schema.find("tag").unwrap();
        let mut expected: BTreeMap<String, Vec<u8>> = BTreeMap::new();
        for i in 0..whole.points() {
            let value = tag.world(whole.record(i), whole.schema.endian);
            let records = expected.entry(format!("of {value}.ply")).or_default();
            records.extend_from_slice(whole.record(i));
        }
        assert_eq!(expected.len(), 3);
        let at = case.path(if stages.is_empty() { "streamed" } else { "milled" });
        fs::create_dir(&at).unwrap();
        let written = twice(&at, &input, stages, ("of {value}.ply", "by = 'tag'"));
        let read = |(name, path): (&String, &PathBuf)| {
            (name.clone(), Scan::read(path, usize::MAX).records)
        };
        assert!(written.iter().map(read).collect::<BTreeMap<_, _>>() == expected, "{stages}");
    }
}

#[test]
fn splits_that_cannot_be_are_refused() {
    let case = Case::new();
    case.ply(&[([0.0, 0.0, 0.0], 1), ([0.5, 1.0, 0.0], 2)]);
    let input = case.path("in.ply");
    let path = |name: &str| format!("path = '{}'", case.path(name).display());
    for (write, says, help) in [
        (path("{number}.ply"), "nothing says into which files", "points = "),
        (path("{value}.ply"), "nothing says into which files", "by = "),
        (format!("{}\npoints = 5", path("out.ply")), "has `{number}`, once", "{number}.ply"),
        (format!("{}\nby = 'tag'", path("{number}.ply")), "has `{value}`, once", "{value}.ply"),
        (format!("{}\nby = 'tg'", path("{value}.ply")), "names tg", "did you mean `tag`?"),
        (format!("{}\nby = 'x'", path("{value}.ply")), "names x", "they have X, Y, Z, tag"),
        (format!("{}\nby = 'X'", path("{value}.ply")), "X 0.5, which is no whole", "PointSource"),
        (
            format!("{}\npoints = 1\nbytes = 5", path("{number}.ply")),
            "`write.points` and `write.bytes` both split",
            "one of them",
        ),
        (
            format!("folder = '{}'\npoints = 5", case.at.path().display()),
            "`write.folder` has a file for each input",
            "{number}.laz",
        ),
        (format!("{}\nbytes = 1", path("{number}.copc.laz")), "is complete", "`write.points`"),
    ] {
        let error = run("", &input, "", &write).unwrap_err();
        let all = format!("{error} {}", error.remedy().unwrap_or_default());
        assert!(all.contains(says) && all.contains(help), "{write}: {all}");
    }
    assert_eq!(files(case.at.path()).len(), 1, "nothing is left behind");
}

#[test]
fn more_files_than_there_may_be_are_told_before_and_end_the_run() {
    let case = Case::new();
    let points: Vec<_> = (0..20_000).map(|n| ([f64::from(n), 0.0, 0.0], n as u32)).collect();
    case.ply(&points);
    for (keys, pattern, says) in [
        ("points = 1", "{number}.ply", "more than 16384 files of 1 points"),
        ("by = 'tag'", "{value}.ply", "more than 16384 values of tag"),
    ] {
        let write = format!("path = '{}'\n{keys}", case.path(pattern).display());
        let error = run("", &case.path("in.ply"), "", &write).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
    }
    assert_eq!(files(case.at.path()).len(), 1);
}
