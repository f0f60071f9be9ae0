//! PTX with damage: what is right is read with the places that it has, what is lost is told scan by
//! scan.

use std::fs;
use std::path::Path;

use super::damaged_rows::run;
use crate::support::command::{done, fails};

const PLACE: &str = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";

/// The first lines of a scan of so many columns and rows, moved along x.
fn head(columns: u32, rows: u32, x: u32) -> String {
    format!("{columns}\n{rows}\n{PLACE}1 0 0 0\n0 1 0 0\n0 0 1 0\n{x} 0 0 1\n")
}

/// Cells from one to another; each fifth has no point.
fn cells(from: u32, to: u32) -> String {
    let line = |n: u32| match n % 5 {
        4 => "0 0 0 0.5\n".to_owned(),
        _ => format!("{n} 1 2 0.25\n"),
    };
    (from..to).map(line).collect()
}

/// What the file is when it is salvaged: what is told, the points as `x number row column`, what is
/// lost from which byte on.
fn salvaged(at: &Path, text: &str) -> (String, Vec<String>, Vec<(u64, u64)>) {
    fs::write(at.join("a.ptx"), text).unwrap();
    fails(at, &["convert", "a.ptx", "-o", "o.ply"], 1, &["a.ptx", "--on-error salvage"]);
    let (told, _, lost) = run(at, "a.ptx", "skip");
    done(at, &["convert", "out.ply", "-o", "out.csv", "--no-provenance", "--quiet"]);
    let csv = fs::read_to_string(at.join("out.csv")).unwrap();
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("X,Y,Z,Intensity,PointSourceId,Row,Column"));
    let of_line = |line: &str| {
        let all: Vec<&str> = line.split(',').collect();
        [all[0], all[4], all[5], all[6]].join(" ")
    };
    (told, lines.map(of_line).collect(), lost)
}

/// The points of cells from one to another of a scan with this number, of so many rows.
fn points(from: u32, to: u32, x: u32, number: u32, rows: u32) -> Vec<String> {
    let is_point = |n: &u32| n % 5 != 4;
    let of = |n: u32| format!("{} {number} {} {}", n + x, n % rows, n / rows);
    (from..to).filter(is_point).map(of).collect()
}

/// The byte where `part` begins for the last time.
fn byte(text: &str, part: &str) -> u64 {
    text.rfind(part).unwrap() as u64
}

#[test]
fn a_scan_that_is_cut_off_has_the_cells_before_the_cut() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    // At the end of the file, and where the next scan begins.
    let text = head(3, 4, 0) + &cells(0, 12) + &head(4, 4, 100) + &cells(0, 11);
    let (told, read, lost) = salvaged(at, &text);
    assert!(
        told.contains("5 points are lost: the file ends after 11 of 16 cells of scan 2"),
        "{told}"
    );
    assert!(told.contains("a.ptx: 4 of 23 cells have no point"), "{told}");
    assert_eq!(lost, [(text.len() as u64, 5)]);
    assert_eq!(read, [points(0, 12, 0, 1, 4), points(0, 11, 100, 2, 4)].concat());
    let second = head(3, 4, 100);
    let text = head(4, 4, 0) + &cells(0, 7) + &second + &cells(0, 12);
    let (told, read, lost) = salvaged(at, &text);
    assert!(told.contains("scan 1 has 7 of its 16 cells, and the next begins"), "{told}");
    assert_eq!(lost, [(byte(&text, &second), 9)]);
    assert_eq!(read, [points(0, 7, 0, 1, 4), points(0, 12, 100, 2, 4)].concat());
}

#[test]
fn lines_that_are_no_cells_are_lost_and_those_behind_them_keep_their_places() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let long = "1 ".repeat(10_000);
    // The first line of a scan, numbers too few and too many, no number, one, a line too long.
    let bad = [("0", "x 1 2 0.25"), ("2", "2 1 2"), ("5", "5 1 2 0.25 7"), ("6", "6 1 ? 0.25")];
    let bad = [&bad[..], &[("7", "7"), ("10", &long)]].concat();
    for second in [false, true] {
        let mut lines = cells(0, 12);
        for (n, line) in &bad {
            lines = lines.replace(&format!("\n{n} 1 2 0.25\n"), &format!("\n{line}\n"));
            let first = format!("{n} 1 2 0.25\n");
            if *n == "0" && lines.starts_with(&first) {
                lines = lines.replacen(&first, &format!("{line}\n"), 1);
            }
        }
        let whole = head(3, 4, 50) + &cells(0, 12);
        let before = if second { whole.as_str() } else { "" };
        let text = format!("{before}{}{lines}{whole}", head(3, 4, 0));
        let (told, read, lost) = salvaged(at, &text);
        assert!(told.contains("6 points are lost in 6 places"), "{told}");
        assert!(lost.len() == 6 && lost.iter().all(|(_, points)| *points == 1), "{lost:?}");
        assert_eq!(lost[1].0, byte(&text, "\n2 1 2\n") + 1);
        assert_eq!(lost[5].0, byte(&text, &long));
        let number = 1 + u32::from(second);
        let all = points(0, 12, 0, number, 4);
        let is_lost = |p: &String| bad.iter().any(|(n, _)| p.split(' ').next() == Some(*n));
        let kept = all.into_iter().filter(|p| !is_lost(p)).collect();
        let first = if second { points(0, 12, 50, 1, 4) } else { Vec::new() };
        assert_eq!(read, [first, kept, points(0, 12, 50, number + 1, 4)].concat());
    }
}

#[test]
fn a_scan_whose_first_lines_are_wrong_is_passed_over() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let first = head(3, 4, 0) + &cells(0, 12);
    let third = head(2, 2, 200) + &cells(0, 4);
    let expected = [points(0, 12, 0, 1, 4), points(0, 4, 200, 3, 2)].concat();
    for (right, wrong) in [
        ("100 0 0 1\n", "100 0 0 7\n"),
        ("0 0 1 0\n", "0 0 x 0\n"),
        ("1 0 0\n", "1 0\n"),
        ("3\n5\n", "3\nfive\n"),
    ] {
        let second = (head(3, 5, 100) + &cells(0, 15)).replacen(right, wrong, 1);
        let text = format!("{first}{second}{third}");
        let (told, read, lost) = salvaged(at, &text);
        let why = "and without its first lines nobody knows where the points of scan 2 are";
        assert!(told.contains("12 points are lost") && told.contains(why), "{told}");
        assert_eq!(read, expected);
        let [begin, end] = [first.len(), first.len() + second.len()].map(|n| n as u64);
        assert!(lost.len() == 1 && (begin..end).contains(&lost[0].0), "{lost:?} {begin} {end}");
        assert_eq!(lost[0].1, 12, "{wrong}");
    }
    // It counts cells that nobody has, at the end of the file, too.
    let second = head(3, 5, 100).replace("0 0 1 0\n", "0 0 x 0\n") + &cells(0, 5);
    assert_eq!(salvaged(at, &format!("{first}{second}{third}")).2[0].1, 4 + 10);
    let (_, read, lost) = salvaged(at, &format!("{first}3\n5\n0 0 0\n"));
    assert_eq!((lost[0].1, read.len()), (15, 10));
}

#[test]
fn lines_behind_the_cells_of_a_scan_are_lost() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let second = head(3, 4, 100) + &cells(0, 12);
    let text = head(3, 4, 0) + &cells(0, 17) + &second;
    let (told, read, lost) = salvaged(at, &text);
    let why = "4 points are lost: line 23 is behind all cells of scan 1, and begins no other";
    assert!(told.contains(why), "{told}");
    assert_eq!(lost, [(byte(&text, "12 1 2 0.25\n13"), 4)]);
    assert_eq!(read, [points(0, 12, 0, 1, 4), points(0, 12, 100, 2, 4)].concat());
    // What is no point at all is told, and nothing is lost.
    let text = head(3, 4, 0) + &cells(0, 12) + "end of scan\n";
    let (told, read, lost) = salvaged(at, &text);
    assert!(told.contains("line 23 is behind all cells of scan 1"), "{told}");
    assert!(lost.is_empty() && read == points(0, 12, 0, 1, 4), "{lost:?}");
}
