//! Texts of points: headings, separators, counts, PTX; how they are written.

use std::fs;

use super::{converted, points, warned};
use crate::support::command::{done, fails, scans};

fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    files.iter().for_each(|(name, text)| fs::write(at.path().join(name), text).unwrap());
    at
}

#[test]
fn headings_name_the_columns_in_any_spelling() {
    let at = folder(&[
        ("a.txt", "X Y Z Intensity\n1 2 3 40\n-1.5 2e1 .5 300\n"),
        ("b.csv", "\"x\",\"y\",\"z\",\"GPS Time\",\"R\",\"G\",\"B\"\r\n1,2,3,0.25,255,0,7\r\n"),
        ("c.asc", "//X Y Z Nx Ny Nz Pulse_width\n1 2 3 0 0 1 4.5\n"),
        ("d.xyz", "\u{feff}# by a program\n# x y z class\n\n 1\t2  3 6\n"),
        ("e.txt", "north;Easting;Northing;Elevation\n7;1;2;3;\n"),
        ("f.TXT", "# nothing but a remark\n1 2 3\n// and another\n4 5 6"),
    ]);
    let is = |name: &str, lines: &[&str]| assert_eq!(points(at.path(), name), lines, "{name}");
    is("a.txt", &["X,Y,Z,Intensity", "1,2,3,40", "-1.5,20,0.5,300"]);
    is("b.csv", &["X,Y,Z,GpsTime,Red,Green,Blue", "1,2,3,0.25,255,0,7"]);
    is("c.asc", &["X,Y,Z,NormalX,NormalY,NormalZ,Pulse_width", "1,2,3,0,0,1,4.5"]);
    is("d.xyz", &["X,Y,Z,Classification", "1,2,3,6"]);
    is("e.txt", &["north,X,Y,Z", "7,1,2,3"]);
    is("f.TXT", &["X,Y,Z", "1,2,3", "4,5,6"]);
}

#[test]
fn columns_are_what_the_user_says_or_what_their_number_leaves_no_doubt_of() {
    let at = folder(&[
        ("four.xyz", "1 2 3 4\n5 6 7 8\n"),
        ("colors.xyz", "1 2 3 255 0 7\n5 6 7 8 9 10\n"),
        ("normals.xyz", "1 2 3 0 0.6 0.8\n5 6 7 1 0 -0.5\n"),
        ("seven.pts", "2\n1 2 3 -5 255 0 7\n5 6 7 2047 9 10 11\n"),
        ("named.txt", "X Y Z Intensity\n1 2 3 4\n"),
        ("swapped.csv", "y,x,z\n200,100,3\n"),
    ]);
    let at = at.path();
    fails(at, &["convert", "swapped.csv", "-o", "o.pts"], 2, &["another order than Y, X, Z"]);
    fails(at, &["convert", "four.xyz", "-o", "o.las"], 1, &["4 columns", "--columns x,y,z,i"]);
    let (lines, _) = converted(at, "four.xyz", &["--columns", "z,_,x,y"]);
    assert_eq!(lines, ["Z,X,Y", "1,3,4", "5,7,8"]);
    assert!(warned(at, "colors.xyz", &[]).contains("taken for Red, Green and Blue, `--columns`"));
    assert_eq!(points(at, "colors.xyz")[0], "X,Y,Z,Red,Green,Blue");
    assert_eq!(points(at, "normals.xyz")[0], "X,Y,Z,NormalX,NormalY,NormalZ");
    assert!(!warned(at, "seven.pts", &[]).contains("--columns"));
    assert_eq!(
        points(at, "seven.pts")[..2],
        ["X,Y,Z,Intensity,Red,Green,Blue", "1,2,3,-5,255,0,7"]
    );
    // What the user says goes before the heading.
    assert_eq!(converted(at, "named.txt", &["--columns", "x,y,z,c"]).0[0], "X,Y,Z,c");
    fails(
        at,
        &["convert", "named.txt", "-o", "o.las", "--columns", "x,y,z"],
        2,
        &["names 3 columns"],
    );
    fails(
        at,
        &["convert", "named.txt", "-o", "o.las", "--columns", "x,y,z,x"],
        2,
        &["two columns"],
    );
    fails(
        at,
        &["convert", "named.txt", "-o", "o.las", "--columns", "x,y,_,_"],
        2,
        &["no column is Z"],
    );
}

#[test]
fn what_is_wrong_in_a_text_is_told_with_its_line() {
    let at = folder(&[
        ("few.xyz", "1 2 3\n4 5\n"),
        ("many.xyz", "1 2 3\n4 5 6 7\n"),
        ("word.xyz", "1 2 3\n4 five 6\n"),
        ("commas.txt", "1,5 2,5 3,5\n"),
        ("heading.csv", "X,Y,Z,I\n1,2,3\n"),
        ("twice.csv", "X,Y,X\n1,2,3\n"),
        ("prose.txt", "This is no file of numbers at all.\n"),
        ("short.pts", "3\n1 2 3\n4 5 6\n"),
        ("ply.txt", "ply\nformat ascii 1.0\n"),
        ("empty.xyz", ""),
        ("utf16.txt", "\u{0}1\u{0} \u{0}2\u{0} \u{0}3\u{0}\n"),
    ]);
    let told = |name: &str, parts: &[&str]| {
        fails(at.path(), &["convert", name, "-o", "o.ply"], 1, parts);
        assert!(!at.path().join("o.ply").exists());
    };
    told("few.xyz", &["few.xyz: at byte 6: line 2 has 2 numbers, the first point has 3"]);
    told("many.xyz", &["line 2 has more than the 3 numbers"]);
    told("word.xyz", &["at byte 8: line 2", "`five`"]);
    told("commas.txt", &["line 1 has decimal commas"]);
    told("heading.csv", &["line 1 names 4 columns", "3 numbers"]);
    told("twice.csv", &["two columns are `X`"]);
    told("prose.txt", &["not a text of numbers, by its first bytes"]);
    told("short.pts", &["it says that it has 3 points, and ends after 2"]);
    told("ply.txt", &["this is a PLY file, not a text of numbers"]);
    told("empty.xyz", &["this is an empty file"]);
    told("utf16.txt", &["not a text of numbers"]);
}

#[test]
fn more_points_than_a_pts_counts_are_read_and_told() {
    let at = folder(&[("a.pts", "1\n1 2 3\n4 5 6\n2\n7 8 9\n1 1 1\n2 2 2\n")]);
    assert!(warned(at.path(), "a.pts", &[]).contains("it says that it has 3 points, and has 5"));
    assert_eq!(points(at.path(), "a.pts").len(), 6);
}

#[test]
fn ptx_scans_are_brought_together_by_their_poses() {
    let head = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
    let still = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    let turned = "0 1 0 0\n-1 0 0 0\n0 0 1 0\n100 0 0 1\n";
    let cells = "1 2 3 0.5 255 0 7\n0 0 0 0.5 0 0 0\n4 5 6 0.25 1 2 3\n7 8 9 1 4 5 6\n";
    let text = format!("2\n2\n{head}{still}{cells}1\n4\n{head}{turned}{cells}");
    let at = folder(&[("a.ptx", &text)]);
    assert!(warned(at.path(), "a.ptx", &[]).contains("a.ptx: 2 of 8 cells have no point"));
    assert_eq!(
        points(at.path(), "a.ptx"),
        [
            "X,Y,Z,Intensity,Red,Green,Blue,PointSourceId,Row,Column",
            "1,2,3,0.5,255,0,7,1,0,0",
            "4,5,6,0.25,1,2,3,1,0,1",
            "7,8,9,1,4,5,6,1,1,1",
            "98,1,3,0.5,255,0,7,2,0,0",
            "95,4,6,0.25,1,2,3,2,2,0",
            "92,7,9,1,4,5,6,2,3,0",
        ]
    );
    fails(
        at.path(),
        &["convert", "a.ptx", "-o", "b.ptx"],
        2,
        &["PTX files are read and not written"],
    );
    fs::write(at.path().join("cut.ptx"), &text[..text.len() - 20]).unwrap();
    let cut = ["after 2 of 4 cells of scan 2", "line 27"];
    let (code, _, told) =
        crate::support::command::pointmill(at.path(), &["convert", "cut.ptx", "-o", "o.las"]);
    assert!(code == 1 && cut.iter().any(|part| told.contains(part)), "{told}");
}

#[test]
fn texts_are_written_as_asked() {
    let at = scans(&["a.las"]);
    let at = at.path();
    done(at, &["convert", "a.las", "-o", "a.csv", "--quiet"]);
    let csv = fs::read_to_string(at.join("a.csv")).unwrap();
    let names: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    assert_eq!(names[..3], ["X", "Y", "Z"]);
    let drop = names[3..].join(",");
    let text = |name: &str, more: &[&str]| {
        done(at, &[&["convert", "a.las", "-o", name, "--quiet", "--drop", &drop], more].concat());
        fs::read_to_string(at.join(name)).unwrap()
    };
    let xyz = text("a.xyz", &[]);
    assert_eq!(xyz.lines().count(), 3_000, "coordinates alone need no heading");
    let first = xyz.lines().next().unwrap();
    assert_eq!(csv.lines().nth(1).unwrap().split(',').take(3).collect::<Vec<_>>().join(" "), first);
    assert_eq!(text("a.txt", &["--header", "true"]).lines().next(), Some("X Y Z"));
    let tabs = text("b.txt", &["--separator", "tab"]);
    assert_eq!(tabs.lines().next().unwrap().replace('\t', " "), first);
    let (count, rest) =
        text("a.pts", &[]).split_once('\n').map(|(a, b)| (a.to_owned(), b.to_owned())).unwrap();
    assert_eq!((count.trim(), rest), ("3000", xyz.clone()));
    let one = text("one.csv", &["--decimals", "1", "--header", "false"]);
    let decimals = |word: &str| word.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    assert!(one.lines().all(|line| line.split(',').all(|word| decimals(word) == 1)), "{one}");
    fails(at, &["convert", "a.las", "-o", "b.pts"], 2, &["PTS cannot hold", "--drop"]);
    fails(at, &["convert", "a.las", "-o", "b.las", "--decimals", "2"], 2, &["--decimals"]);
    fails(at, &["convert", "a.las", "-o", "b.csv", "--separator", "dot"], 2, &["--separator"]);
    fails(at, &["convert", "a.las", "-o", "b.csv", "--decimals", "99"], 2, &["--decimals"]);
}

#[test]
fn a_text_of_many_parts_has_every_line_once_at_any_number_of_threads() {
    let at = scans(&["seed.las"]);
    let at = at.path();
    done(at, &["synth", "als", "-n", "250000", "-o", "a.laz"]);
    // It has times, and a text does not say what they count.
    assert!(warned(at, "a.laz", &[]).contains("text does not hold what GPS times count"));
    done(at, &["convert", "a.laz", "-o", "a.csv", "--quiet"]);
    assert!(fs::metadata(at.join("a.csv")).unwrap().len() > 2 << 22, "three parts at least");
    done(at, &["convert", "a.csv", "-o", "one.csv", "--threads", "1"]);
    done(at, &["convert", "a.csv", "-o", "two.csv", "--threads", "2"]);
    let bytes = |name: &str| fs::read(at.join(name)).unwrap();
    // Coordinates from LAS have the decimals of its scale, those from a text as few as will do.
    done(at, &["convert", "one.csv", "-o", "again.csv", "--threads", "2"]);
    assert!(bytes("one.csv") == bytes("two.csv") && bytes("one.csv") == bytes("again.csv"));
    assert_eq!(points(at, "one.csv").len(), 250_001);
    // A file in two is the same scan.
    let text = fs::read_to_string(at.join("a.csv")).unwrap();
    let (heading, rest) = text.split_once('\n').unwrap();
    let cut = rest[..rest.len() / 2].rfind('\n').unwrap() + 1;
    fs::write(at.join("b1.csv"), format!("{heading}\n{}", &rest[..cut])).unwrap();
    fs::write(at.join("b2.csv"), format!("{heading}\n{}", &rest[cut..])).unwrap();
    done(at, &["convert", "b1.csv", "b2.csv", "-o", "both.csv"]);
    assert!(bytes("both.csv") == bytes("one.csv"));
}

#[test]
fn folders_hold_texts_of_points_by_extension_and_no_others() {
    let at = folder(&[]);
    fs::create_dir(at.path().join("in")).unwrap();
    for (name, text) in [("a.xyz", "1 2 3\n"), ("b.pts", "1\n4 5 6\n"), ("readme.txt", "no points")]
    {
        fs::write(at.path().join("in").join(name), text).unwrap();
    }
    assert_eq!(points(at.path(), "in"), ["X,Y,Z", "1,2,3", "4,5,6"]);
    let (lines, _) = converted(at.path(), "in/a.xyz", &["--from", "txt"]);
    assert_eq!(lines[1], "1,2,3");
}

#[test]
fn columns_of_words_are_passed_over_where_the_user_says_so() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let text = "name,x,y,z,remark\nwall,1,2,3,\"dry\"\n12,4,5,6,7\nroof,7,8,9,wet\n";
    fs::write(at.join("a.csv"), text).unwrap();
    let (lines, _) = converted(at, "a.csv", &["--columns", "_,x,y,z,_"]);
    assert_eq!(lines, ["X,Y,Z", "1,2,3", "4,5,6", "7,8,9"]);
    let wrong = ["convert", "a.csv", "-o", "o.csv", "--columns", "_,x,y,_,z"];
    fails(at, &wrong, 1, &["a.csv"]);
    fs::write(at.join("b.txt"), "tree 1 2 3\npole 4 5 6\n").unwrap();
    let (lines, _) = converted(at, "b.txt", &["--columns", "_,x,y,z"]);
    assert_eq!(lines, ["X,Y,Z", "1,2,3", "4,5,6"]);
}
