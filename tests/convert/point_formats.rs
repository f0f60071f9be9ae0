//! Records of one LAS point format as those of another: every value that both hold is the same, and
//! what the other does not hold is refused unless it is dropped.

use std::collections::BTreeMap;
use std::path::Path;

use crate::support::command::{done, fails};

const BASE: &str = "\
X,Y,Z,Intensity,ReturnNumber,NumberOfReturns,ScanDirectionFlag,EdgeOfFlightLine,Classification,\
Synthetic,KeyPoint,Withheld,ScanAngle,UserData,PointSourceId,GpsTime,Red,Green,Blue,quality
1.001,2.002,3.003,65535,1,7,0,1,31,0,1,0,-90,255,65535,1.25,65535,256,1,0.5
-1.5,2.25,100000.125,1,7,7,1,0,2,1,0,0,90,0,1,300000000.5,1,2,3,-7.25
0,0,0,0,1,1,0,0,0,0,0,1,-1,1,0,-5,0,0,0,0
";

/// The columns of a scan as a text.
fn columns(at: &Path, scan: &str) -> BTreeMap<String, Vec<f64>> {
    done(at, &["convert", scan, "-o", "told.csv", "--quiet"]);
    let text = std::fs::read_to_string(at.join("told.csv")).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = lines.next().unwrap();
    let rows: Vec<_> = lines.collect();
    let column = |n: usize| rows.iter().map(|row| row[n].parse().unwrap()).collect();
    names.iter().enumerate().map(|(n, name)| ((*name).to_owned(), column(n))).collect()
}

/// True if two columns are the same: scan angles as far as the steps of newer formats tell them.
fn alike(name: &str, a: &[f64], b: &[f64]) -> bool {
    let most = if name == "ScanAngle" { 0.003 + 1e-9 } else { 0.0 };
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= most)
}

/// What records of `from` have and those of `to` do not.
fn lacking(from: &BTreeMap<String, Vec<f64>>, to: u8) -> Vec<&str> {
    let waves = [4, 5, 9, 10].contains(&to);
    let lacks = |name: &str| match name {
        "GpsTime" => [0, 2].contains(&to),
        "Red" | "Green" | "Blue" => ![2, 3, 5, 7, 8, 10].contains(&to),
        "Nir" => ![8, 10].contains(&to),
        "Overlap" | "ScannerChannel" => to < 6,
        name => name.starts_with("Wave") && !waves,
    };
    from.keys().map(String::as_str).filter(|name| lacks(name)).collect()
}

#[test]
fn every_point_format_becomes_every_other() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    std::fs::write(at.join("base.csv"), BASE).unwrap();
    let base = columns(at, "base.csv");
    let into = |from: &str, columns: &BTreeMap<String, Vec<f64>>, to: u8, name: &str| {
        let format = to.to_string();
        let mut arguments = vec!["convert", from, "-o", name, "--point-format", &format, "--quiet"];
        let lost = lacking(columns, to).join(",");
        if !lost.is_empty() {
            fails(at, &arguments_with_scale(&arguments), 2, &["cannot hold", "--drop"]);
            arguments.extend(["--drop", &lost]);
        }
        done(at, &arguments_with_scale(&arguments));
    };
    for from in 0..=10 {
        into("base.csv", &base, from, "from.las");
        let one = columns(at, "from.las");
        for (name, values) in &base {
            assert!(one.get(name).is_none_or(|v| alike(name, v, values)), "{from} {name}: {one:?}");
        }
        for to in (0..=10).filter(|to| *to != from) {
            into("from.las", &one, to, "to.laz");
            let two = columns(at, "to.laz");
            let shared: Vec<_> = base.iter().filter(|(name, _)| one.contains_key(*name)).collect();
            for (name, values) in shared {
                let same = two.get(name).is_none_or(|v| alike(name, v, values));
                assert!(same, "{from} {to} {name}: {two:?}");
            }
            assert_eq!(two["quality"], base["quality"], "extra bytes");
        }
    }
}

fn arguments_with_scale<'a>(arguments: &[&'a str]) -> Vec<&'a str> {
    let is_text = arguments[1].ends_with(".csv");
    let scale: &[&str] = if is_text { &["--scale", "0.001"] } else { &[] };
    [arguments, scale].concat()
}

#[test]
fn values_without_room_are_refused() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    for (name, value) in [("ReturnNumber", "9"), ("Classification", "40"), ("ScanAngle", "12.498")]
    {
        std::fs::write(at.join("a.csv"), format!("x,y,z,{name}\n1,2,3,{value}\n")).unwrap();
        let six = ["convert", "a.csv", "-o", "a.las", "--point-format", "6", "--scale", "0.01"];
        done(at, &[&six[..], &["--quiet"]].concat());
        let one = ["convert", "a.las", "-o", "b.las", "--point-format", "1", "--quiet", "--drop"];
        let drop = "Overlap,ScannerChannel";
        fails(at, &[&one[..], &[drop]].concat(), 1, &[name, value, "does not fit"]);
        let drop = format!("{drop},{name}");
        done(at, &[&one[..], &[&drop]].concat());
    }
    let bad = |format: &str, out: &str, part: &str| {
        let arguments = ["convert", "a.las", "-o", out, "--point-format", format];
        fails(at, &arguments, 2, &["--point-format", part]);
    };
    bad("11", "b.las", "10");
    bad("six", "b.las", "six");
    bad("6", "b.ply", "ply");
    // Nothing to drop where records stay as they are.
    let same = ["convert", "a.las", "-o", "b.las", "--point-format", "6", "--drop", "Overlap"];
    fails(at, &same, 2, &["--drop"]);
}

#[test]
fn the_header_is_one_of_a_version_that_has_the_point_format() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let old = crate::support::case_file("80j-count-fewer.laz");
    let read = std::fs::read(&old).unwrap();
    assert!(read[25] < 4 && read[104] & 63 < 6, "LAS 1.{} {}", read[25], read[104]);
    let old = old.to_str().unwrap();
    done(at, &["convert", old, "-o", "a.laz", "--point-format", "7", "--quiet"]);
    let new = std::fs::read(at.join("a.laz")).unwrap();
    assert_eq!((new[25], new[104] & 63), (4, 7));
    assert_eq!(u16::from_le_bytes([new[94], new[95]]), 375);
    // The WKT bit, as the point format wants it; and no count for older readers.
    assert_eq!(new[6] & 16, 16);
    assert_eq!(new[107..111], [0; 4]);
    let names = ["GpsTime", "Red", "Nir"].map(|name| columns(at, "a.laz").contains_key(name));
    assert_eq!(names, [true, true, false]);
    let own = columns(at, old);
    let now = columns(at, "a.laz");
    own.iter().filter(|(name, _)| now.contains_key(*name)).for_each(|(name, values)| {
        assert!(alike(name, &now[name], values), "{name}");
    });
}

#[test]
fn auto_is_the_smallest_point_format_that_holds_what_is_left() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    std::fs::write(at.join("base.csv"), BASE).unwrap();
    let las = ["convert", "base.csv", "-o", "3.las", "--scale", "0.001", "--quiet"];
    done(at, &las);
    for (drop, format) in
        [("gpstime", 2), ("Red,Green,Blue", 1), ("GpsTime,Red,Green,Blue", 0), ("quality", 3)]
    {
        let run = ["convert", "3.las", "-o", "o.las", "--point-format", "auto", "--drop", drop];
        done(at, &[&run[..], &["--quiet"]].concat());
        let told = done(at, &["info", "o.las"]);
        let found = told.lines().find(|line| line.contains("point_format")).unwrap();
        assert!(found.ends_with(&format!(" {format}")), "{drop}: {found}");
        let (own, left) = (columns(at, "3.las"), columns(at, "o.las"));
        let dropped = drop.to_lowercase();
        for (name, column) in &own {
            let is_dropped = dropped.split(',').any(|drop| drop == name.to_lowercase());
            assert_eq!(left.get(name), Some(column).filter(|_| !is_dropped), "{drop}: {name}");
        }
    }
}
