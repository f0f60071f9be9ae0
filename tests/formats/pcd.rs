//! PCD as the library and others write it: texts, bytes, packed, grids with holes, colours.

use std::fs;
use std::path::Path;

use super::{points, warned};
use crate::support::command::{done, fails, pointmill};

/// A header of fields of these names, sizes, types and counts.
fn header(fields: [&str; 4], width: usize, height: usize, data: &str) -> String {
    let [names, sizes, types, counts] = fields;
    format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS {names}\nSIZE {sizes}\n\
         TYPE {types}\nCOUNT {counts}\nWIDTH {width}\nHEIGHT {height}\nVIEWPOINT 0 0 0 1 0 0 0\n\
         POINTS {}\nDATA {data}\n",
        width * height
    )
}

fn write(at: &Path, name: &str, head: &str, body: &[u8]) {
    fs::write(at.join(name), [head.as_bytes(), body].concat()).unwrap();
}

/// LZF of literals alone.
fn literals(bytes: &[u8]) -> Vec<u8> {
    let packed: Vec<u8> =
        bytes.chunks(32).flat_map(|run| [&[run.len() as u8 - 1][..], run].concat()).collect();
    let sizes = [packed.len() as u32, bytes.len() as u32].map(u32::to_le_bytes);
    [sizes.as_flattened(), &packed].concat()
}

const FIELDS: [&str; 4] = ["x y z _ rgb label", "4 4 4 1 4 2", "F F F U F U", "1 1 1 3 1 1"];

fn point(n: u32) -> ([f32; 3], u32, u16) {
    let at = [n as f32 / 4.0, -(n as f32), 100.5];
    (at, (n % 256) << 16 | 7 << 8 | 255, (n % 60_000) as u16)
}

fn bytes(n: u32) -> Vec<u8> {
    let (at, color, label) = point(n);
    let at = at.map(f32::to_le_bytes);
    [at.as_flattened(), &[1, 2, 3], &color.to_le_bytes(), &label.to_le_bytes()].concat()
}

fn line(n: u32) -> String {
    let ([x, y, z], color, label) = point(n);
    let [_, r, g, b] = color.to_be_bytes();
    format!("{x},{y},{z},{r},{g},{b},{label}")
}

#[test]
fn the_same_points_are_read_from_text_bytes_and_packed_fields() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let count = 300_000u32;
    let all: Vec<u8> = (0..count).flat_map(bytes).collect();
    write(at, "b.pcd", &header(FIELDS, count as usize, 1, "binary"), &all);
    // Field by field.
    let stride = 3 * 4 + 3 + 4 + 2;
    let mut fields = Vec::new();
    for (start, size) in [(0, 4), (4, 4), (8, 4), (12, 3), (15, 4), (19, 2)] {
        fields.extend(all.chunks_exact(stride).flat_map(|p| &p[start..start + size]));
    }
    let head = header(FIELDS, count as usize, 1, "binary_compressed");
    write(at, "c.pcd", &head, &literals(&fields));
    let text: String = (0..count)
        .map(|n| {
            let ([x, y, z], color, label) = point(n);
            format!("{x} {y} {z} 1 2 3 {:e} {label}\n", f32::from_bits(color))
        })
        .collect();
    write(at, "a.pcd", &header(FIELDS, count as usize, 1, "ascii"), text.as_bytes());
    let expected: Vec<String> = std::iter::once("X,Y,Z,Red,Green,Blue,label".to_owned())
        .chain((0..count).map(line))
        .collect();
    for name in ["a.pcd", "b.pcd", "c.pcd"] {
        assert!(points(at, name) == expected, "{name}");
    }
    // Written by us, and read again.
    for (to, how) in [("d.pcd", "binary"), ("e.pcd", "ascii")] {
        done(at, &["convert", "c.pcd", "-o", to, "--encoding", how]);
        assert!(points(at, to) == expected, "{to}");
    }
    let info = done(at, &["info", "d.pcd"]);
    assert!(info.contains("rgb") && info.contains("F4") && info.contains("300000"), "{info}");
}

#[test]
fn cells_of_a_grid_have_rows_and_columns_and_those_without_a_point_are_left_out() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let fields = ["x y z", "4 4 4", "F F F", "1 1 1"];
    let text = "1 2 3\nnan nan nan\n4 5 6\n7 8 9\n";
    write(at, "a.pcd", &header(fields, 2, 2, "ascii"), text.as_bytes());
    let expected = ["X,Y,Z,Row,Column", "1,2,3,0,0", "4,5,6,1,0", "7,8,9,1,1"];
    assert_eq!(points(at, "a.pcd"), expected);
    assert!(warned(at, "a.pcd", &[]).contains("1 of 4 cells have no point: a coordinate is NaN"));
    let bytes: Vec<u8> = [1.0, 2.0, 3.0, f32::NAN, 0.0, 0.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]
        .into_iter()
        .flat_map(f32::to_le_bytes)
        .collect();
    write(at, "b.pcd", &header(fields, 2, 2, "binary"), &bytes);
    assert_eq!(points(at, "b.pcd"), expected);
    done(at, &["convert", "b.pcd", "-o", "c.ply", "--quiet"]);
    assert_eq!(points(at, "c.ply"), expected);
}

#[test]
fn others_ways_to_write_pcd_are_read() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let old = "COLUMNS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nDATA ascii\n";
    write(at, "old.pcd", old, b"1 2 3\r\n4 5 6\r\n");
    assert_eq!(points(at, "old.pcd"), ["X,Y,Z", "1,2,3", "4,5,6"]);
    // More digits than a float of the header holds; commas.
    write(at, "long.pcd", old, b"289814.15,4320978.61,170.76\n289814.64,4320978.84,170.76\n");
    assert_eq!(points(at, "long.pcd")[1], "289814.15,4320978.61,170.76");
    let fields = [
        "x y z rgba normal_x normal_y normal_z i",
        "8 8 8 4 4 4 4 1",
        "F F F U F F F U",
        "1 1 1 1 1 1 1 1",
    ];
    write(at, "rgba.pcd", &header(fields, 1, 1, "ascii"), b"1 2 3 4278255361 0 0 1 9\n");
    let lines = [
        "X,Y,Z,NormalX,NormalY,NormalZ,Intensity,Red,Green,Blue,Alpha",
        "1,2,3,0,0,1,9,0,255,1,255",
    ];
    assert_eq!(points(at, "rgba.pcd"), lines);
    done(at, &["convert", "rgba.pcd", "-o", "again.pcd", "--encoding", "binary"]);
    assert_eq!(points(at, "again.pcd"), lines);
}

#[test]
fn colours_of_16_bits_become_8_where_that_loses_nothing() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    fs::write(at.join("a.csv"), "X,Y,Z,Red,Green,Blue\n1,2,3,65535,257,0\n4,5,6,514,0,0\n")
        .unwrap();
    fs::write(at.join("b.csv"), "X,Y,Z,Red,Green,Blue\n1,2,3,65535,257,0\n4,5,6,513,0,0\n")
        .unwrap();
    done(at, &["convert", "a.csv", "-o", "a.pcd"]);
    assert_eq!(points(at, "a.pcd")[1..], ["1,2,3,255,1,0", "4,5,6,2,0,0"]);
    let told = crate::support::command::pointmill(at, &["convert", "b.csv", "-o", "b.pcd"]).2;
    assert!(told.contains("colours have 16 bits here, which many viewers of PCD"), "{told}");
    assert_eq!(points(at, "b.pcd")[1..], ["1,2,3,65535,257,0", "4,5,6,513,0,0"]);
    done(at, &["convert", "b.csv", "-o", "c.pcd", "--colors", "8bit", "--quiet"]);
    assert_eq!(points(at, "c.pcd")[1..], ["1,2,3,255,1,0", "4,5,6,2,0,0"]);
}

#[test]
fn damage_is_told_with_its_place() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let fields = ["x y z", "4 4 4", "F F F", "1 1 1"];
    let told = |head: &str, body: &[u8], part: &str| {
        write(at, "a.pcd", head, body);
        fails(at, &["convert", "a.pcd", "-o", "o.las", "--scale", "0.001"], 1, &["a.pcd: ", part]);
    };
    let zeros = literals(&[0; 24]);
    told(&header(fields, 3, 1, "binary"), &[0; 30], "claims 3 points, the file ends after 2");
    told(&header(fields, 1_000_000_000, 9, "binary"), &[0; 30], "the file ends after 2");
    told(&header(fields, 2, 1, "ascii"), b"1 2 3\n", "claims 2 points");
    told(
        &header(fields, 2, 1, "ascii"),
        b"1 2 3\n4 5\n\n\n\n",
        "line 13: 2 numbers, the header has 3",
    );
    told(&header(fields, 1, 1, "ascii"), b"1 2 3 4\n", "more numbers than the header's 3");
    told(&header(fields, 1, 1, "ascii"), b"1 2 z\n", "`z` is no number");
    told(&header(fields, 3, 1, "binary_compressed"), &zeros, "24 bytes are said to be packed");
    told(&header(fields, 2, 1, "binary_compressed"), &zeros[..20], "are there");
    let mut early = zeros.clone();
    early[8] = 20;
    told(&header(fields, 2, 1, "binary_compressed"), &early, "end before its points do");
    told(
        &header(["a b c", "4 4 4", "F F F", "1 1 1"], 1, 1, "ascii"),
        b"1 2 3\n",
        "no field x, y, z",
    );
    told("VERSION .7\nDATA ascii\n", b"", "no line `FIELDS`");
}

#[test]
fn a_point_that_would_be_none_is_refused_or_left_out_and_counted() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    std::fs::write(at.join("a.csv"), "x,y,z\n1,2,3\nnan,2,3\n4,5,6\n").unwrap();
    for out in ["o.pcd", "o.e57"] {
        let convert = ["convert", "a.csv", "-o", out];
        fails(at, &convert, 1, &["(NaN, 2, 3)", "is none", "--nonfinite drop"]);
        let (code, _, told) = pointmill(at, &[&convert[..], &["--nonfinite", "drop"]].concat());
        assert!(code == 0, "{told}");
        assert_eq!(points(at, out), ["X,Y,Z", "1,2,3", "4,5,6"]);
    }
    // Others hold it.
    done(at, &["convert", "a.csv", "-o", "o.ply", "--quiet"]);
    assert_eq!(points(at, "o.ply"), ["X,Y,Z", "1,2,3", "nan,2,3", "4,5,6"]);
}

#[test]
fn where_the_sensor_was_is_carried_unless_points_were_moved() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let head = header(["x y z", "4 4 4", "F F F", "1 1 1"], 1, 1, "ascii");
    let viewpoint = |name: &str| {
        let head = String::from_utf8_lossy(&fs::read(at.join(name)).unwrap()).into_owned();
        head.lines().find_map(|line| line.strip_prefix("VIEWPOINT ")).unwrap().to_owned()
    };
    let own = "7 8 9 0 1 0 0";
    write(at, "v.pcd", &head.replace("0 0 0 1 0 0 0", own), b"1 2 3\n");
    write(at, "none.pcd", &head, b"1 2 3\n");
    done(at, &["convert", "v.pcd", "-o", "o.pcd", "--quiet"]);
    assert_eq!(viewpoint("o.pcd"), own);
    let not_carried = "VIEWPOINT is not carried";
    for (stage, moves) in [
        ("transform translate=[10,0,0]", true),
        ("transform rotate={axis='z',angle='30 deg'}", true),
        ("filter where='X > 0'", false),
    ] {
        for name in ["v", "none"] {
            let line = format!("read {name}.pcd ! {stage} ! write o.pcd");
            let (code, _, told) = pointmill(at, &["run", &line]);
            assert_eq!(code, 0, "{told}");
            assert_eq!(told.contains(not_carried), moves && name == "v", "{stage}: {told}");
            let kept = if name == "v" && !moves { own } else { "0 0 0 1 0 0 0" };
            assert_eq!(viewpoint("o.pcd"), kept, "{stage}");
        }
    }
    let reproject = ["--crs", "EPSG:25832", "--reproject", "EPSG:25833"];
    let run = [&["convert", "v.pcd", "-o", "o.pcd"], &reproject[..]].concat();
    let (code, _, told) = pointmill(at, &run);
    assert!(code == 0 && told.contains(not_carried), "{told}");
    assert_eq!(viewpoint("o.pcd"), "0 0 0 1 0 0 0");
}
