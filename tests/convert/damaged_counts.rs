//! PCD whose header counts its points in ways that cannot all be right: the file's length says how
//! many there are.

use std::fs;
use std::path::Path;

use super::damaged_rows::run;
use crate::support::command::{done, fails, pointmill};

/// Points of the files.
const POINTS: u32 = 60;

/// A PCD with a header of these counts, of points `n, 2 n, 3`.
fn pcd(at: &Path, [width, height, points]: [u32; 3], data: &str, body: &[u8]) {
    let head = format!(
        "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {width}\n\
         HEIGHT {height}\nPOINTS {points}\nDATA {data}\n"
    );
    fs::write(at.join("a.pcd"), [head.as_bytes(), body].concat()).unwrap();
}

fn floats(values: impl Iterator<Item = u32>) -> Vec<u8> {
    values.flat_map(|v| (v as f32).to_le_bytes()).collect()
}

/// The same points in each of the three ways.
fn bodies() -> [(&'static str, Vec<u8>); 3] {
    let text: String = (0..POINTS).map(|n| format!("{n} {} 3\n", 2 * n)).collect();
    let binary = floats((0..POINTS).flat_map(|n| [n, 2 * n, 3]));
    let all = [(0..POINTS).collect::<Vec<_>>(), (0..POINTS).map(|n| 2 * n).collect(), vec![3; 60]];
    let packed = packed(&floats(all.into_iter().flatten()));
    [("ascii", text.into_bytes()), ("binary", binary), ("binary_compressed", packed)]
}

/// LZF of literals alone, behind its two sizes.
fn packed(bytes: &[u8]) -> Vec<u8> {
    let packed: Vec<u8> =
        bytes.chunks(32).flat_map(|run| [&[run.len() as u8 - 1][..], run].concat()).collect();
    let sizes = [packed.len() as u32, bytes.len() as u32].map(u32::to_le_bytes);
    [sizes.as_flattened(), &packed].concat()
}

/// What the file is when it is salvaged: what is told, the lines of its points as CSV, what is lost
/// from which byte on.
fn salvaged(at: &Path) -> (String, Vec<String>, Vec<(u64, u64)>) {
    let (told, _, lost) = run(at, "a.pcd", "salvage");
    done(at, &["convert", "out.ply", "-o", "out.csv", "--no-provenance", "--quiet"]);
    let text = fs::read_to_string(at.join("out.csv")).unwrap();
    (told, text.lines().map(str::to_owned).collect(), lost)
}

#[test]
fn of_counts_that_differ_the_one_is_right_that_the_file_bears_out() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    for (data, body) in bodies() {
        // `POINTS` is wrong: the grid is what it is said to be.
        for points in [59, 61, u32::MAX] {
            pcd(at, [6, 10, points], data, &body);
            let wrong = format!("`POINTS {points}` is not `WIDTH 6` times `HEIGHT 10`");
            fails(at, &["convert", "a.pcd", "-o", "o.ply"], 1, &[&wrong, "--on-error salvage"]);
            let (told, lines, lost) = salvaged(at);
            assert!(told.contains(&format!("{wrong}: it has 60 points")), "{data}: {told}");
            assert!(lost.is_empty() && lines.len() == 61, "{data} {lost:?}");
            assert_eq!([&*lines[0], &lines[10]], ["X,Y,Z,Row,Column", "9,18,3,1,3"], "{data}");
        }
        // The grid is wrong: nobody knows the row of a point.
        for grid in [[7, 10, 60], [0, 3, 60]] {
            pcd(at, grid, data, &body);
            let (told, lines, lost) = salvaged(at);
            assert!(told.contains("without rows and columns"), "{data}: {told}");
            assert!(lost.is_empty() && lines.len() == 61, "{data} {lost:?}");
            assert_eq!([&*lines[0], &lines[10]], ["X,Y,Z", "9,18,3"], "{data}");
        }
    }
}

#[test]
fn of_counts_that_are_all_wrong_the_file_has_as_many_points_as_there_are() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    for (data, body) in bodies() {
        pcd(at, [70, 1, 80], data, &body);
        let (told, lines, lost) = salvaged(at);
        let end = fs::metadata(at.join("a.pcd")).unwrap().len();
        let points: u64 = lost.iter().map(|(_, points)| points).sum();
        assert!(points == 20 && lost.iter().all(|(byte, _)| *byte == end), "{data} {lost:?}");
        assert!(told.contains("claims 80 points, the file ends after 60"), "{data}: {told}");
        assert_eq!((lines.len(), &*lines[60]), (61, "59,118,3"), "{data}");
        // More than either: all are read, and none is lost.
        pcd(at, [50, 1, 40], data, &body);
        let (told, lines, lost) = salvaged(at);
        assert!(told.contains("it has 60 points, and they are read"), "{data}: {told}");
        assert!(lost.is_empty() && lines[60] == "59,118,3", "{data} {lost:?}");
    }
}

#[test]
fn a_line_that_is_no_point_is_counted_and_lost() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    pcd(at, [3, 1, 4], "ascii", b"1 2 3\n\n?\n3 4 5\n\n");
    let (_, lines, lost) = salvaged(at);
    assert_eq!(lines, ["X,Y,Z", "1,2,3", "3,4,5"]);
    let head = fs::read(at.join("a.pcd")).unwrap().len() - b"?\n3 4 5\n\n".len();
    assert_eq!(lost, [(head as u64, 1)]);
}

#[test]
fn packed_points_have_the_number_that_is_packed_or_none_is_saved() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let [.., (data, body)] = bodies();
    // Both counts of the header agree, and are not what is packed.
    for count in [50, 80] {
        pcd(at, [count, 1, count], data, &body);
        let convert = ["convert", "a.pcd", "-o", "o.ply"];
        let wrong = "720 bytes are said to be packed";
        fails(at, &convert, 1, &["a.pcd", wrong, "--on-error salvage"]);
        let (told, lines, lost) = salvaged(at);
        assert!(told.contains(wrong) && lines[60] == "59,118,3", "{told}");
        let gone: Vec<u64> = lost.iter().map(|(_, points)| *points).collect();
        assert_eq!(gone, if count == 80 { vec![20] } else { vec![] });
    }
    // Cut off, with a byte too many or too few, or of bytes that make no point.
    let spoilt = |place: usize, by: u32| {
        let mut body = body.clone();
        let four = body[place..place + 4].try_into().unwrap();
        let wrong = u32::from_le_bytes(four).wrapping_add(by).to_le_bytes();
        body[place..place + 4].copy_from_slice(&wrong);
        body
    };
    for (what, body) in [
        ("are there", body[..body.len() / 2].to_vec()),
        ("the file ends where its packed points begin", body[..5].to_vec()),
        ("a point has 12", spoilt(4, 1)),
        ("its packed bytes end before its points do", spoilt(4, 12)),
        ("more than the 708 bytes", spoilt(4, 12u32.wrapping_neg())),
    ] {
        pcd(at, [61, 1, 60], data, &body);
        for how in ["skip", "salvage"] {
            let convert = ["convert", "a.pcd", "-o", "o.ply", "--on-error", how];
            let (code, _, told) = pointmill(at, &convert);
            let why = "no point can be saved";
            assert!(code == 1 && told.contains(what) && told.contains(why), "{what}: {told}");
            assert!(!told.contains("--on-error"), "{told}");
        }
    }
}
