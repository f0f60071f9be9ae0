//! `picture`: scans of every format side by side, in a PNG file that appears complete or not at all.

use std::fs;

use crate::support::command::{done, fails, pointmill, scans};

#[test]
fn scans_of_all_formats_are_drawn_side_by_side() {
    let at = scans(&["a.laz", "b.ply"]);
    let args = ["picture", "a.laz", "b.ply", "-o", "both.png", "--from", "south", "--width", "300"];
    let told = done(at.path(), &args);
    let lines: Vec<&str> =
        told.lines().map(|line| line.split_whitespace().next().unwrap()).collect();
    assert_eq!(lines, ["scan", "scan", "colours", "pixel", "output"], "{told}");
    let bytes = fs::read(at.path().join("both.png")).unwrap();
    assert_eq!(&bytes[..8], b"\x89PNG\r\n\x1a\n");
    let size = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    assert!(size(16) <= 300 && size(16) > 200, "{} pixels wide", size(16));
    // Drawn again it is the same file.
    done(at.path(), &[&args[..], &["--threads", "1"]].concat());
    assert!(fs::read(at.path().join("both.png")).unwrap() == bytes);
    assert_eq!(fs::read_dir(at.path()).unwrap().count(), 3, "nothing else is left");
}

#[test]
fn what_is_wrong_with_a_picture_is_told() {
    let at = scans(&["a.laz"]);
    let input = fs::read(at.path().join("a.laz")).unwrap();
    fails(
        at.path(),
        &["picture", "a.laz", "-o", "a.jpg"],
        2,
        &["error: -o: a picture is a PNG file", "| a.jpg\n   | ^^^^^\n   = write -o a.png"],
    );
    fs::hard_link(at.path().join("a.laz"), at.path().join("a.png")).unwrap();
    fails(at.path(), &["picture", "a.laz", "-o", "a.png"], 2, &["a.png: ", "is the input a.laz"]);
    assert!(fs::read(at.path().join("a.laz")).unwrap() == input);
    fails(at.path(), &["picture", "a.laz", "-o", "p.png", "--width", "5"], 2, &["64 to 4096"]);
    fails(at.path(), &["picture", "none.laz", "-o", "p.png"], 1, &["none.laz: "]);
    assert!(!at.path().join("p.png").exists());
}

#[test]
fn a_scan_without_colours_is_drawn_and_told_to_be_black() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let ply = |red: u8| {
        let vertices: String =
            (0..9).map(|i| format!("{}.00001 {}.00002 {i} {red} 0 0 0\n", i % 3, i / 3)).collect();
        format!(
            "ply\nformat ascii 1.0\nelement vertex 9\nproperty double x\nproperty double y\n\
             property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
             property ushort intensity\nend_header\n{vertices}"
        )
    };
    fs::write(at.join("none.ply"), ply(0)).unwrap();
    fs::write(at.join("red.ply"), ply(9)).unwrap();
    let drawn = |by: &str| {
        let both = ["picture", "none.ply", "red.ply", "-o", "p.png", "--by", by, "--width", "4096"];
        let (code, stdout, stderr) = pointmill(at, &both);
        assert_eq!(code, 0, "{stderr}");
        assert!(stdout.contains("pixel      0.00097"), "{stdout}");
        stderr
    };
    let told = "warning: none.ply: all colours are 0, so that the scan is drawn black: use `--by height` or";
    for by in ["color", "colour"] {
        let stderr = drawn(by);
        assert!(stderr.starts_with(told) && stderr.lines().count() == 1, "{stderr}");
    }
    let stderr = drawn("intensity");
    assert_eq!(stderr.matches("all intensities are 0").count(), 2, "{stderr}");
    assert_eq!(drawn("height"), "");
}

#[test]
fn what_a_picture_lacks_is_told_in_words_and_with_what_can_be_done() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\n\
                  property double z\nproperty ushort intensity\nend_header\n";
    let points = "1 2 3 9\nnan 2 3 9\n2 2 inf 9\n4 2 3 9\n";
    fs::write(at.join("a.ply"), format!("{header}{points}")).unwrap();
    let told =
        ["error: a.ply: the scan has no colours\nhelp: use `--by height` or `--by intensity`\n"];
    fails(at, &["picture", "a.ply", "-o", "p.png", "--by", "color"], 2, &told);
    let class = ["error: a.ply: the scan has no classes\n"];
    fails(at, &["picture", "a.ply", "-o", "p.png", "--by", "class"], 2, &class);
    let (code, stdout, stderr) = pointmill(at, &["picture", "a.ply", "-o", "p.png"]);
    assert_eq!((code, stdout.contains("a.ply, 2 points\n")), (0, true), "{stdout}{stderr}");
    let nowhere = "warning: a.ply: 2 points cannot be drawn: their coordinates are not finite";
    assert!(stderr.starts_with(nowhere) && stderr.lines().count() == 1, "{stderr}");
    assert!(stdout.contains("1600 × 64 pixels"), "a line of points: {stdout}");
}
