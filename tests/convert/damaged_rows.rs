//! Damaged files of formats other than LAS: what is whole of them is read where that is wanted, and
//! what is not is accounted for as it is for LAS.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::command::{done, fails, pointmill};
use crate::support::records::read;

/// Converts with this `--on-error` to PLY: warnings, records, the points that the report says are
/// lost with their bytes.
pub(super) fn run(at: &Path, scan: &str, how: &str) -> (String, Vec<u8>, Vec<(u64, u64)>) {
    let mut outputs = Vec::new();
    let mut all = None;
    for threads in ["1", "3"] {
        let more = ["--report", "r.json", "--threads", threads, "--no-provenance"];
        let convert = ["convert", scan, "-o", "out.ply", "--on-error", how];
        let (code, _, told) = pointmill(at, &[&convert[..], &more[..]].concat());
        assert_eq!(code, 0, "{told}");
        outputs.push(fs::read(at.join("out.ply")).unwrap());
        let report: Value = serde_json::from_slice(&fs::read(at.join("r.json")).unwrap()).unwrap();
        let lost = report["run"]["lost"].as_array().cloned().unwrap_or_default();
        let lost = lost.iter().map(|one| {
            assert!(one["path"].as_str().unwrap().ends_with(scan));
            (one["byte"].as_u64().unwrap(), one["points"].as_u64().unwrap())
        });
        all = Some((told, read(&at.join("out.ply")).1, lost.collect()));
    }
    assert!(outputs[0] == outputs[1], "{scan} {how}");
    all.unwrap()
}

/// A folder with a scan of 3,000 points in this format, and its records.
fn scan(name: &str, more: &[&str]) -> (tempfile::TempDir, Vec<u8>, usize) {
    let at = tempfile::tempdir().unwrap();
    done(at.path(), &["synth", "part", "-n", "3000", "-o", "in.ply", "--no-provenance"]);
    let convert = ["convert", "in.ply", "-o", name, "--no-provenance", "-q"];
    done(at.path(), &[&convert[..], more].concat());
    done(at.path(), &["convert", name, "-o", "all.ply", "--no-provenance", "-q"]);
    let (schema, records) = read(&at.path().join("all.ply"));
    (at, records, schema.stride)
}

#[test]
fn files_that_are_cut_off_have_the_points_before_the_cut() {
    for (name, more) in [
        ("s.ply", &["--encoding", "binary"][..]),
        ("s.ply", &["--encoding", "ascii"]),
        ("s.pcd", &["--encoding", "binary"]),
        ("s.pcd", &["--encoding", "ascii"]),
    ] {
        let (at, whole, stride) = scan(name, more);
        let at = at.path();
        let bytes = fs::read(at.join(name)).unwrap();
        let cut = format!("cut-{name}");
        fs::write(at.join(&cut), &bytes[..bytes.len() * 7 / 10]).unwrap();
        let convert = ["convert", &cut, "-o", "out.ply"];
        fails(at, &convert, 1, &[&cut, "at byte", "--on-error salvage"]);
        for how in ["skip", "salvage"] {
            let (told, records, lost) = run(at, &cut, how);
            assert!(told.contains("points are lost"), "{name} {more:?}: {told}");
            let kept = records.len() / stride;
            let points: u64 = lost.iter().map(|(_, points)| points).sum();
            assert_eq!(kept as u64 + points, 3_000, "{name} {more:?}: {told}");
            assert!(kept > 1_500 && kept < 2_700, "{kept} of {name} {more:?}");
            // The last number of a text may be cut short and be a number all the same.
            let sure = (kept - 1) * stride;
            assert!(records[..sure] == whole[..sure], "{name} {more:?}");
        }
    }
}

#[test]
fn lines_that_are_no_points_are_left_out_and_told_by_their_bytes() {
    for (name, more) in [
        ("s.ply", &["--encoding", "ascii"][..]),
        ("s.pcd", &["--encoding", "ascii"]),
        ("s.csv", &[]),
        ("s.xyz", &["--header", "true"]),
    ] {
        let (at, whole, stride) = scan(name, more);
        let at = at.path();
        let text = fs::read_to_string(at.join(name)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        let head = lines.len() - 3_000;
        let bad = [10, 11, 1_500, 2_999];
        let mut damaged = String::new();
        let mut bytes = Vec::new();
        for (n, line) in lines.iter().enumerate() {
            match bad.iter().position(|bad| head + bad == n) {
                None => damaged += line,
                Some(which) => {
                    bytes.push(damaged.len() as u64);
                    damaged += match which {
                        0 => "no numbers at all",
                        1 => "1 2",
                        2 => "1,2,",
                        _ => &line[..line.len() - 1],
                    };
                    if which == 3 {
                        damaged += "x";
                    }
                }
            }
            damaged += "\n";
        }
        let cut = format!("bad-{name}");
        fs::write(at.join(&cut), damaged).unwrap();
        let convert = ["convert", &cut, "-o", "out.ply"];
        fails(at, &convert, 1, &[&cut, &format!("line {}", head + 11), "--on-error salvage"]);
        let (told, records, lost) = run(at, &cut, "skip");
        assert!(told.contains("4 points are lost in 4 places"), "{name}: {told}");
        let good = (0..3_000).filter(|n| !bad.contains(n));
        let expected: Vec<u8> =
            good.flat_map(|n| whole[n * stride..(n + 1) * stride].to_vec()).collect();
        assert!(records == expected, "{name}: {} records", records.len() / stride);
        assert_eq!(lost.len(), 4, "{name}");
        for ((byte, points), begins) in lost.iter().zip(bytes) {
            let end = begins + 4_000;
            assert!(*points == 1 && (begins..end).contains(byte), "{name}: {byte} of {begins}");
        }
    }
}

#[test]
fn more_lines_that_are_wrong_than_are_held_are_counted_all_the_same() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let line = |n: u32| if n.is_multiple_of(3) { format!("{n} 2 3\n") } else { "?\n".to_owned() };
    fs::write(at.join("a.xyz"), (0..3_000).map(line).collect::<String>()).unwrap();
    let (told, records, lost) = run(at, "a.xyz", "salvage");
    let all = "2,000 points are lost in 2,000 places; the report has the first 100 one by one";
    assert!(told.contains(all), "{told}");
    assert_eq!((records.len(), lost.len()), (1_000 * 24, 100));
    assert_eq!(lost.iter().map(|(_, points)| points).sum::<u64>(), 2_000);
}

#[test]
fn of_a_damaged_scan_the_points_before_the_damage_are_read() {
    let (at, whole, stride) = scan("s.e57", &[]);
    let at = at.path();
    let mut bytes = fs::read(at.join("s.e57")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle..middle + 8].iter_mut().for_each(|byte| *byte ^= 0x5a);
    fs::write(at.join("bad.e57"), bytes).unwrap();
    fails(at, &["convert", "bad.e57", "-o", "o.ply"], 1, &["scan 1", "--on-error salvage"]);
    let (told, records, lost) = run(at, "bad.e57", "skip");
    assert!(told.contains("points are lost: scan 1"), "{told}");
    let kept = records.len() / stride;
    assert!(kept < 3_000 && lost == [(lost[0].0, 3_000 - kept as u64)], "{lost:?} {kept}");
    assert!(records == whole[..records.len()]);
    // All of it: what is reduced is what was read.
    let reduce = ["reduce", "bad.e57", "-o", "o.ply", "--keep", "50%", "--on-error", "skip", "-q"];
    let (code, _, told) = pointmill(at, &reduce);
    assert_eq!(code, 0, "{told}");
}

#[test]
fn lists_of_vertices_that_are_cut_off_end_the_points() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 100\nproperty float x\n\
        property float y\nproperty float z\nproperty list uchar int near\nend_header\n"
        .to_vec();
    for n in 0..60u32 {
        [n as f32, 1.0, 2.0].iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        bytes.push(2);
        bytes.extend([7u8; 8]);
    }
    bytes.extend([0; 5]);
    fs::write(at.join("l.ply"), bytes).unwrap();
    fails(at, &["convert", "l.ply", "-o", "o.ply"], 1, &["ends after 97 at most", "--on-error"]);
    let (told, records, lost) = run(at, "l.ply", "skip");
    assert!(told.contains("are lost"), "{told}");
    assert_eq!(records.len(), 60 * 12);
    assert_eq!(lost.iter().map(|(_, points)| points).sum::<u64>(), 40);
}

#[test]
fn columns_that_are_not_read_make_no_line_wrong() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let text = "1 2 3 roof\n2 3 4 wall\n3 4 x roof\n4 5 6 7\n5 6 7 tree\n";
    fs::write(at.join("a.txt"), text).unwrap();
    for how in ["skip", "salvage"] {
        let convert = ["convert", "a.txt", "-o", "a.ply", "--columns", "x,y,z,_"];
        let more = ["--on-error", how, "--report", "r.json"];
        let (code, _, told) = pointmill(at, &[&convert[..], &more].concat());
        assert_eq!(code, 0, "{told}");
        assert!(told.contains("1 points are lost") && told.contains("line 3: `x`"), "{told}");
        let (schema, records) = read(&at.join("a.ply"));
        assert_eq!(records.len(), 4 * schema.stride);
    }
}

#[test]
fn points_that_a_text_counts_and_does_not_have_are_lost_at_its_end() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let text = "5\n1 2 3 4\n2 3 4 5\n3 4 5 6\n";
    fs::write(at.join("a.pts"), text).unwrap();
    fails(at, &["convert", "a.pts", "-o", "o.ply"], 1, &["has 5 points", "--on-error salvage"]);
    let (told, records, lost) = run(at, "a.pts", "salvage");
    assert!(told.contains("2 points are lost: it says that it has 5 points"), "{told}");
    assert_eq!(lost, [(text.len() as u64, 2)]);
    assert_eq!(records.len() / read(&at.join("out.ply")).0.stride, 3);
    // A line that is no point is counted, and lost where it is.
    fs::write(at.join("b.pts"), "4\n1 2 3 4\n?\n3 4 5 6\n").unwrap();
    assert_eq!(run(at, "b.pts", "skip").2, [(10, 1), (20, 1)]);
}

/// A text of 6 points in these lines, the fourth of which stands behind a blank line and is too
/// long to be read, is read but for that one.
fn without_the_long_line(at: &Path, name: &str, head: &str, kind: &str) {
    let lines = ["0 1 2", "1 2 3", "2 3 4", "", "4 5 6", "5 6 7"].map(str::to_owned);
    let mut lines = Vec::from(lines);
    lines[3] = format!("\n{}", "1 ".repeat(1_500_000));
    let text = format!("{}{}\n", head.replace("KIND", kind), lines.join("\n"));
    fs::write(at.join(name), &text).unwrap();
    fails(at, &["convert", name, "-o", "o.ply"], 1, &["is longer than", "--on-error salvage"]);
    let (told, records, lost) = run(at, name, "skip");
    let byte = text.find("\n\n").unwrap() as u64 + 2;
    assert_eq!(lost, [(byte, 1)], "{name} {kind}: {told}");
    assert_eq!(records.len() / read(&at.join("out.ply")).0.stride, 5, "{name} {kind}");
}

#[test]
fn lines_that_are_too_long_are_lost_once() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let property = |axis: &str| format!("property KIND {axis}\n");
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex 6\n{}end_header\n",
        ["x", "y", "z"].map(property).concat()
    );
    for kind in ["float", "double"] {
        without_the_long_line(at, "l.ply", &ply, kind);
    }
    let pcd = "VERSION 0.7\nFIELDS x y z\nSIZE KIND KIND KIND\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 6\n\
               HEIGHT 1\nPOINTS 6\nDATA ascii\n";
    for size in ["4", "8"] {
        without_the_long_line(at, "l.pcd", pcd, size);
    }
    without_the_long_line(at, "l.xyz", "", "");
}
