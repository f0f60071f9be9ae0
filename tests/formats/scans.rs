//! Every real file of these formats is read whole, or refused for what is wrong with it.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::lossless::{assert_same, table};
use crate::support::command::pointmill;

/// Files that hold no points, or too many kinds of lines; and what is said of them.
const REFUSED: [(&str, &str); 9] = [
    ("badheader.txt", "two columns are `X`"),
    ("missingheader.txt", "4 columns, and no heading"),
    ("text.txt", "not a text of numbers"),
    ("utf17_3.txt", "names 3 columns"),
    ("utm17_3.txt", "names 3 columns"),
    ("missingheader.pcd", "not a PCD file"),
    ("points_cloudcompare.xyz", "7 columns, and no heading"),
    ("ZeroPointsInvalid.e57", "its points are not read"),
    ("InvalidCVHeader.e57", "its points are not read"),
];

fn files(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if path.is_dir() {
            files(&path, into);
        } else if ["xyz", "txt", "pts", "ptx", "pcd", "e57", "obj", "off", "stl"]
            .contains(&extension.as_str())
        {
            into.push(path);
        }
    }
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn every_scan_is_read_or_refused_for_what_is_wrong() {
    let folder = std::env::var_os("POINTMILL_SCANS").expect("POINTMILL_SCANS names the folder");
    let mut all = Vec::new();
    files(Path::new(&folder), &mut all);
    all.sort();
    assert!(all.len() >= 60, "only {} files", all.len());
    let at = tempfile::tempdir().unwrap();
    let mut read = 0;
    for path in &all {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let start = Instant::now();
        let input = path.to_str().unwrap();
        let arguments = ["convert", input, "-o", "o.csv", "--quiet", "--memory", "256MiB"];
        let (code, _, told) = pointmill(at.path(), &arguments);
        assert!(start.elapsed() < Duration::from_secs(20), "{name}");
        match REFUSED.iter().find(|(refused, _)| *refused == name) {
            Some((_, why)) => assert!(code == 1 && told.contains(why), "{name}: {told}"),
            None if name == "bad-crc.e57" => {
                assert!(code == 1 && told.contains("checksum"), "{told}")
            }
            None => {
                assert_eq!(code, 0, "{name}: {told}");
                // What we write of it is the same again.
                let lines = |csv: &str| -> Vec<String> {
                    let text = std::fs::read_to_string(at.path().join(csv)).unwrap();
                    text.lines().map(str::to_owned).collect()
                };
                let own = table(&lines("o.csv"));
                for to in ["p.pcd", "p.e57", "p.txt"] {
                    let header = if to == "p.txt" { &["--header", "true"][..] } else { &[] };
                    let arguments = [&["convert", "o.csv", "-o", to, "--quiet"], header].concat();
                    let (code, _, told) = pointmill(at.path(), &arguments);
                    assert_eq!(code, 0, "{name} {to}: {told}");
                    let (code, _, told) =
                        pointmill(at.path(), &["convert", to, "-o", "q.csv", "--quiet"]);
                    assert_eq!(code, 0, "{name} {to}: {told}");
                    assert_same(&format!("{name} {to}"), &own, &table(&lines("q.csv")));
                }
                read += 1;
            }
        }
    }
    assert!(read >= 50, "only {read} of {} files are read", all.len());
}
