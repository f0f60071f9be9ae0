//! The vertices of OBJ, OFF and STL.

use std::fs;

use super::{points, warned};
use crate::support::command::fails;

fn folder(files: &[(&str, &[u8])]) -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    files.iter().for_each(|(name, text)| fs::write(at.path().join(name), text).unwrap());
    at
}

#[test]
fn vertices_of_obj_are_read_with_their_colours() {
    let at = folder(&[
        ("a.obj", b"# a mesh\nmtllib a.mtl\no part\nv 1 2 3\n  v -1e1 .5 0 # here\nvn 0 0 1\nvt 0 0\nf 1 2 1\n"),
        ("b.obj", b"v 1 2 3 1 0.501961 0\nv 4 5 6 0 0 1\n"),
        ("c.obj", b"v 1 2 3 255 128 0\n"),
        ("d.obj", b"v 1 2 3 1.0\nv 4 5 6 1.0\n"),
    ]);
    let at = at.path();
    assert_eq!(points(at, "a.obj"), ["X,Y,Z", "1,2,3", "-10,0.5,0"]);
    assert_eq!(points(at, "b.obj"), ["X,Y,Z,Red,Green,Blue", "1,2,3,255,128,0", "4,5,6,0,0,255"]);
    assert_eq!(points(at, "c.obj")[1], "1,2,3,255,128,0");
    assert_eq!(points(at, "d.obj"), ["X,Y,Z", "1,2,3", "4,5,6"]);
    assert!(warned(at, "d.obj", &[]).contains("are not read"));
}

#[test]
fn vertices_of_off_are_read_with_what_its_first_word_says() {
    let at = folder(&[
        ("a.off", b"OFF\n# two\n2 1 0\n\n1 2 3\n4 5 6 # last\n3 0 1 0\n"),
        ("b.off", b"COFF 1 0 0\n1 2 3 255 0 7 255\n"),
        ("c.off", b"NOFF\n1 0 0\n1 2 3 0 0 1\n"),
        ("d.off", b"OFF\n1 0 0\n1 2 3 0.123 0 1\n"),
    ]);
    let at = at.path();
    assert_eq!(points(at, "a.off"), ["X,Y,Z", "1,2,3", "4,5,6"]);
    assert_eq!(points(at, "b.off"), ["X,Y,Z,Red,Green,Blue", "1,2,3,255,0,7"]);
    assert_eq!(points(at, "c.off"), ["X,Y,Z,NormalX,NormalY,NormalZ", "1,2,3,0,0,1"]);
    assert_eq!(points(at, "d.off"), ["X,Y,Z,Red,Green,Blue", "1,2,3,8061,0,65535"]);
}

/// A binary STL of so many facets.
fn binary(facets: u32) -> Vec<u8> {
    let mut file = [&[b' '; 80][..], &facets.to_le_bytes()].concat();
    for n in 0..facets {
        let mut numbers = vec![0.0, 0.0, 1.0];
        numbers.extend((0..9).map(|i| (n * 9 + i) as f32));
        file.extend(numbers.iter().flat_map(|v: &f32| v.to_le_bytes()));
        file.extend([0, 0]);
    }
    file
}

#[test]
fn corners_of_stl_are_read_with_the_normals_of_their_facets() {
    let text =
        b"solid part\n facet normal 0 0 1\n  outer loop\n   vertex 1 2 3\n   vertex 4 5 6\n   \
                 vertex 7 8 9\n  endloop\n endfacet\nendsolid part\n";
    let many = binary(70_000);
    let at = folder(&[
        ("a.stl", text),
        ("b.STL", &binary(1)),
        ("c.stl", &many),
        ("d.stl", b"solid x\nendsolid x\n"),
    ]);
    let at = at.path();
    let names = "X,Y,Z,NormalX,NormalY,NormalZ";
    assert_eq!(points(at, "a.stl"), [names, "1,2,3,0,0,1", "4,5,6,0,0,1", "7,8,9,0,0,1"]);
    assert_eq!(points(at, "b.STL"), [names, "0,1,2,0,0,1", "3,4,5,0,0,1", "6,7,8,0,0,1"]);
    assert!(warned(at, "b.STL", &[]).contains("corners of 1 facets"));
    let lines = points(at, "c.stl");
    assert_eq!(lines.len(), 210_001);
    let expected = (0..210_000u32).map(|n| format!("{},{},{},0,0,1", 3 * n, 3 * n + 1, 3 * n + 2));
    assert!(lines[1..].iter().cloned().eq(expected));
    assert_eq!(points(at, "d.stl").len(), 1);
}

#[test]
fn what_is_wrong_is_told_and_none_of_them_is_written() {
    let cut = &binary(2)[..150];
    let at = folder(&[
        ("a.off", b"OFF\n3 0 0\n1 2 3\n"),
        ("b.off", b"OFF BINARY\n1 0 0\n"),
        ("c.off", b"4OFF\n1 0 0\n1 2 3 4\n"),
        ("d.obj", b"v 1 2 3\nv 1 2\n"),
        ("e.obj", b"v 1 2 z\n"),
        ("f.stl", cut),
        ("g.obj", b"1 2 3\n"),
        ("h.off", b"OFF\n1 0 0\n1 2 3 4 5 6 7 8 9\n"),
        ("i.obj", b"v 1 2 3 300 0 0\n"),
    ]);
    let told = |name: &str, part: &str| {
        fails(at.path(), &["convert", name, "-o", "o.ply"], 1, &[name, part]);
    };
    told("a.off", "after 1 of 3 vertices");
    told("b.off", "binary OFF is not read");
    told("c.off", "other than three coordinates");
    told("d.obj", "line 2: it has more or fewer numbers");
    told("e.obj", "`z` is no number");
    told("f.stl", "not an STL file");
    told("g.obj", "this is a text of numbers, not an OBJ file");
    told("h.off", "have 9 numbers");
    told("i.obj", "its colours are neither");
    for name in ["o.obj", "o.off", "o.stl"] {
        let told = ["read and not written", "`mesh`"];
        fails(at.path(), &["convert", "a.off", "-o", name], 2, &told);
    }
}
