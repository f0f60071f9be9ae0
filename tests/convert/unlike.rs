//! Inputs of one format whose points hold different dimensions: refused with what each lacks, or
//! one scan where what a file lacks is taken to be nothing.

use std::fs;
use std::path::Path;

use crate::support::command::{done, fails};

/// The scan as lines of CSV.
fn lines(at: &Path, scan: &str) -> Vec<String> {
    done(at, &["convert", scan, "-o", "told.csv", "--quiet", "--no-provenance"]);
    let text = fs::read_to_string(at.join("told.csv")).unwrap();
    text.lines().map(str::to_owned).collect()
}

/// Converts these scans with this assumption; the same in any order of them but for the order of
/// the points.
fn assumed(at: &Path, scans: [&str; 2], out: &str) -> Vec<String> {
    let go = |scans: [&str; 2], out: &str| {
        let more = ["-o", out, "--assume", "dimensions", "--quiet", "--no-provenance"];
        done(at, &[&["convert"], &scans[..], &more].concat());
    };
    go(scans, out);
    let turned = format!("turned-{out}");
    go([scans[1], scans[0]], &turned);
    let (all, mut other) = (lines(at, out), lines(at, &turned));
    let points = all.len() - 1;
    other[1..].rotate_right(points / 2);
    assert_eq!(all, other);
    all
}

fn ply(at: &Path, name: &str, properties: &[&str], body: &str) {
    let properties: String =
        properties.iter().map(|property| format!("property {property}\n")).collect();
    let count = body.lines().count();
    let head = format!("ply\nformat ascii 1.0\nelement vertex {count}\n{properties}end_header\n");
    fs::write(at.join(name), head + body).unwrap();
}

#[test]
fn properties_that_a_ply_lacks_are_nothing_there() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let axes = ["float x", "float y", "float z"];
    ply(at, "a.ply", &[&axes[..], &["uchar tag", "float heat"]].concat(), "1 2 3 7 0.5\n");
    ply(at, "b.ply", &[&["ushort tag"], &axes[..], &["uchar red"]].concat(), "900 4 5 6 8\n");
    let convert = ["convert", "a.ply", "b.ply", "-o", "o.ply"];
    let told = [
        "its vertex properties are not those of a.ply",
        "it lacks `heat`; it alone has `red`",
        "--assume dimensions",
    ];
    fails(at, &convert, 1, &told);
    let all = assumed(at, ["a.ply", "b.ply"], "o.ply");
    assert_eq!(all, ["X,Y,Z,Red,heat,tag", "1,2,3,0,0.5,7", "4,5,6,8,0,900"]);
    let head = String::from_utf8(fs::read(at.join("o.ply")).unwrap()).unwrap();
    for property in ["float x", "uchar red", "float heat", "ushort tag"] {
        assert!(head.contains(&format!("property {property}\n")), "{head}");
    }
    // Each by itself in a folder has them as well.
    let text = "stage = [{kind = 'read', path = ['a.ply', 'b.ply'], assume = ['dimensions']}, \
                {kind = 'write', folder = 'out'}]";
    fs::write(at.join("each.toml"), text).unwrap();
    done(at, &["run", "each.toml", "--quiet"]);
    assert_eq!(lines(at, "out/a.ply"), all[..2]);
    assert_eq!(lines(at, "out/b.ply"), [&*all[0], &all[2]]);
    // Of numbers that no type holds together none is changed, and a name means one thing.
    ply(at, "c.ply", &[&axes[..], &["int64 tag"]].concat(), "1 2 3 9007199254740993\n");
    ply(at, "d.ply", &[&axes[..], &["float tag", "float more"]].concat(), "1 2 3 0.5 1\n");
    let convert = ["convert", "c.ply", "d.ply", "-o", "o.ply", "--assume", "dimensions"];
    fails(at, &convert, 1, &["no type holds all numbers of `tag`"]);
}

#[test]
fn times_of_two_kinds_are_not_taken_for_one_whatever_is_assumed() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let axes = ["float x", "float y", "float z"];
    let timed = [&axes[..], &["double GpsTime"]].concat();
    for (name, kind) in
        [("w.ply", "seconds of the GPS week"), ("s.ply", "seconds of GPS time minus 1e9")]
    {
        ply(at, name, &timed, "1 2 3 100\n");
        let text = fs::read_to_string(at.join(name)).unwrap();
        let said = format!("1.0\ncomment gps_time: {kind}\n");
        fs::write(at.join(name), text.replace("1.0\n", &said)).unwrap();
    }
    ply(at, "n.ply", &axes, "4 5 6\n");
    let all = assumed(at, ["w.ply", "n.ply"], "o.ply");
    assert_eq!(all, ["X,Y,Z,GpsTime", "1,2,3,100", "4,5,6,0"]);
    let convert = ["convert", "n.ply", "w.ply", "s.ply", "-o", "o.ply", "--assume", "dimensions"];
    fails(at, &convert, 1, &["s.ply", "GPS time type is not the same as in w.ply"]);
}

#[test]
fn fields_that_a_pcd_lacks_are_nothing_there() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    fs::write(at.join("a.csv"), "X,Y,Z,Red,Green,Blue\n1,2,3,255,0,7\n").unwrap();
    fs::write(at.join("b.csv"), "X,Y,Z,Intensity,label\n4,5,6,1000,2\n").unwrap();
    for encoding in ["binary", "ascii"] {
        for name in ["a", "b"] {
            let (from, to) = (format!("{name}.csv"), format!("{name}.pcd"));
            done(at, &["convert", &from, "-o", &to, "--quiet", "--encoding", encoding]);
        }
        let convert = ["convert", "b.pcd", "a.pcd", "-o", "o.pcd"];
        let told = ["a.pcd", "its fields are not those of b.pcd", "it lacks `Intensity`, `label`"];
        fails(at, &convert, 1, &[&told[..], &["--assume dimensions"]].concat());
        let all = assumed(at, ["a.pcd", "b.pcd"], "o.pcd");
        let expected =
            ["X,Y,Z,Intensity,Red,Green,Blue,label", "1,2,3,0,255,0,7,0", "4,5,6,1000,0,0,0,2"];
        assert_eq!(all, expected);
        let head = String::from_utf8_lossy(&fs::read(at.join("o.pcd")).unwrap()).into_owned();
        assert!(head.contains("rgb") && head.contains("\nPOINTS 2\n"), "{head}");
    }
    // A grid and a list, of other types.
    let grid = "FIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 2\nPOINTS 4\n\
                DATA ascii\n1 0 0\n2 0 0\nnan 0 0\n4 0 0\n";
    fs::write(at.join("grid.pcd"), grid).unwrap();
    let list = "FIELDS z y x\nSIZE 4 4 4\nTYPE F F F\nWIDTH 3\nDATA ascii\n7 8 9\n5 5 5\n6 6 6\n";
    fs::write(at.join("list.pcd"), list).unwrap();
    let all = assumed(at, ["grid.pcd", "list.pcd"], "o.ply");
    let expected = [
        "X,Y,Z,Row,Column",
        "1,0,0,0,0",
        "2,0,0,0,1",
        "4,0,0,1,1",
        "9,8,7,0,0",
        "5,5,5,0,0",
        "6,6,6,0,0",
    ];
    assert_eq!(all, expected);
}

#[test]
fn coordinates_of_a_pcd_text_keep_their_digits_beside_bytes() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let head = |fields: &str, size: u8, data: &str| {
        let count = fields.split(' ').count();
        let each = |of: &str| vec![of; count].join(" ");
        let (sizes, types) = (each(&size.to_string()), each("F"));
        format!("FIELDS {fields}\nSIZE {sizes}\nTYPE {types}\nWIDTH 1\nDATA {data}\n")
    };
    let text = |fields: &str, line: &str| head(fields, 4, "ascii") + line;
    fs::write(at.join("t.pcd"), text("x y z", "638123.4567 1 2\n")).unwrap();
    fs::write(at.join("more.pcd"), text("x y z tag", "638123.4567 1 2 3\n")).unwrap();
    let double = [0.1, 5.0, 6.0].map(f64::to_le_bytes);
    let bytes = [head("x y z", 8, "binary").as_bytes(), double.as_flattened()].concat();
    fs::write(at.join("d.pcd"), bytes).unwrap();
    let float = [0.25, 5.0, 6.0].map(f32::to_le_bytes);
    let bytes = [head("x y z", 4, "binary").as_bytes(), float.as_flattened()].concat();
    fs::write(at.join("f.pcd"), bytes).unwrap();
    let all = assumed(at, ["more.pcd", "d.pcd"], "o.pcd");
    assert_eq!(all, ["X,Y,Z,tag", "638123.4567,1,2,3", "0.1,5,6,0"]);
    // Nothing is to be assumed of files that have the same fields.
    for (other, told) in [("d.pcd", "0.1,5,6"), ("f.pcd", "0.25,5,6")] {
        for (n, scans) in [["t.pcd", other], [other, "t.pcd"]].into_iter().enumerate() {
            let out = ["-o", "o.pcd", "--quiet", "--no-provenance"];
            done(at, &[&["convert"], &scans[..], &out].concat());
            let mut expected = ["638123.4567,1,2", told];
            expected.rotate_left(n);
            assert_eq!(lines(at, "o.pcd")[1..], expected);
        }
    }
}

#[test]
fn columns_that_a_text_lacks_are_nothing_there() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    fs::write(at.join("a.csv"), "X,Y,Z,tag,Intensity\n1,2,3,7,200\n").unwrap();
    fs::write(at.join("b.csv"), "Intensity,X,Y,Z,heat\n70000,4,5,6,0.5\n").unwrap();
    let convert = ["convert", "a.csv", "b.csv", "-o", "o.ply"];
    let told = ["b.csv", "its columns are not those of a.csv: it lacks `tag`; it alone has `heat`"];
    fails(at, &convert, 1, &[&told[..], &["--assume dimensions"]].concat());
    let all = assumed(at, ["a.csv", "b.csv"], "o.ply");
    assert_eq!(all, ["X,Y,Z,Intensity,heat,tag", "1,2,3,200,0,7", "4,5,6,70000,0.5,0"]);
}

#[test]
fn extra_bytes_of_las_are_dimensions_too() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    for (name, text) in [("a", "X,Y,Z,alpha\n1,2,3,4\n"), ("b", "X,Y,Z,beta\n5,6,7,8\n")] {
        fs::write(at.join("t.csv"), text).unwrap();
        let to = format!("{name}.las");
        done(at, &["convert", "t.csv", "-o", &to, "--scale", "0.01", "--quiet"]);
    }
    for word in ["dimensions", "extra-bytes"] {
        let out = format!("{word}.las");
        let more = ["--quiet", "--no-provenance", "--assume", word];
        done(at, &[&["convert", "a.las", "b.las", "-o", &out], &more[..]].concat());
    }
    let [one, two] = ["dimensions.las", "extra-bytes.las"].map(|n| fs::read(at.join(n)).unwrap());
    assert!(one == two);
    let all = lines(at, "dimensions.las");
    assert!(all[0].ends_with("alpha,beta") && all[1].ends_with(",4,0"), "{all:?}");
}
