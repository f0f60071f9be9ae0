//! Points of a box, and of COPC those down to a resolution, are read without the others.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::support::command::{done, fails, pointmill};
use crate::support::records::read;

/// A folder with the same 150,000 points as LAS, LAZ and COPC, in point format 6.
fn scan() -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    let one =
        |arguments: &[&str]| drop(done(at.path(), &[arguments, &["--no-provenance"]].concat()));
    one(&["synth", "als", "-n", "150000", "-o", "s.las"]);
    one(&["convert", "s.las", "-o", "a.las", "--point-format", "6"]);
    one(&["convert", "a.las", "-o", "a.laz"]);
    one(&["convert", "a.las", "-o", "a.copc.laz"]);
    at
}

/// Its records, sorted.
fn sorted(path: &Path) -> Vec<Vec<u8>> {
    let (schema, records) = read(path);
    let mut all: Vec<Vec<u8>> = records.chunks(schema.stride).map(<[u8]>::to_vec).collect();
    all.sort();
    all
}

/// The points that `convert` reads by these arguments, on any number of threads the same bytes.
fn converted(at: &Path, scan: &str, more: &[&str]) -> Vec<Vec<u8>> {
    let mut first: Option<Vec<u8>> = None;
    for threads in ["1", "3"] {
        let convert = ["convert", scan, "-o", "out.las", "--no-provenance", "--threads", threads];
        let (code, _, told) = pointmill(at, &[&convert[..], more].concat());
        assert_eq!(code, 0, "{told}");
        let written = fs::read(at.join("out.las")).unwrap();
        assert!(first.get_or_insert_with(|| written.clone()) == &written, "{scan} {more:?}");
    }
    sorted(&at.join("out.las"))
}

#[test]
fn a_box_of_any_format_has_the_points_that_a_crop_has() {
    let at = scan();
    let at = at.path();
    let (schema, records) = read(&at.join("a.las"));
    let corner = |of: fn(f64, f64) -> f64, start: f64| -> [f64; 3] {
        let axes = schema.coordinates().unwrap();
        let each = |axis: usize| {
            let world = |r: &[u8]| axes[axis].world(r, schema.endian);
            records.chunks(schema.stride).map(world).fold(start, of)
        };
        [each(0), each(1), each(2)]
    };
    let (lo, hi) = (corner(f64::min, f64::MAX), corner(f64::max, f64::MIN));
    let between = |axis: usize, share: f64| lo[axis] + share * (hi[axis] - lo[axis]);
    let flat = [between(0, 0.3), between(1, 0.1), between(0, 0.45), between(1, 0.4)];
    let [x0, y0, x1, y1] = flat;
    let high = [x0, y0, lo[2], x1, y1, between(2, 0.4)];
    let border = [lo[0], lo[1], lo[0], hi[1]];
    for (corners, is_part) in [(&flat[..], true), (&high, true), (&border, true)] {
        let corners: Vec<String> = corners.iter().map(|v| format!("{v:.3}")).collect();
        let pipeline = format!("read a.las ! crop box=[{}] ! write crop.las", corners.join(","));
        done(at, &["run", &pipeline, "--quiet"]);
        let cropped = sorted(&at.join("crop.las"));
        assert!(!cropped.is_empty() && is_part && cropped.len() < 150_000);
        let corners = corners.join(",");
        for scan in ["a.las", "a.laz", "a.copc.laz"] {
            let boxed = converted(at, scan, &["--box", &corners]);
            assert!(boxed == cropped, "{scan} {corners}: {} {}", boxed.len(), cropped.len());
        }
    }
    // Tiles see no other points either.
    let corners = flat.map(|v| format!("{v:.3}")).join(",");
    let reduce = |scan| {
        let more = ["--keep", "20%", "--box", &corners, "--no-provenance", "--quiet"];
        done(at, &[&["reduce", scan, "-o", "thin.las"], &more[..]].concat());
        fs::read(at.join("thin.las")).unwrap()
    };
    assert!(reduce("a.laz") == reduce("a.copc.laz"));
    let nowhere = ["convert", "a.copc.laz", "-o", "out.las", "--box", "-9,-9,-8,-8"];
    let (code, stdout, told) = pointmill(at, &nowhere);
    assert_eq!(code, 0, "{told}");
    assert!(told.contains("no node of its octree is in the box"), "{told}");
    assert!(stdout.starts_with("points     0 in, 0 out"), "{stdout}");
}

#[test]
fn a_resolution_reads_the_levels_of_the_octree_down_to_it() {
    let at = scan();
    let at = at.path();
    let all: BTreeSet<Vec<u8>> = sorted(&at.join("a.las")).into_iter().collect();
    let mut before = 0;
    for resolution in ["1000", "20", "2", "0.001"] {
        let found = converted(at, "a.copc.laz", &["--resolution", resolution]);
        assert!(found.iter().all(|record| all.contains(record)));
        assert!(found.len() >= before && !found.is_empty(), "{resolution}: {}", found.len());
        before = found.len();
    }
    assert_eq!(before, 150_000);
    let coarse = converted(at, "a.copc.laz", &["--resolution", "1000"]);
    assert!(coarse.len() < 75_000, "{}", coarse.len());
    let flat = ["convert", "a.laz", "-o", "out.las", "--resolution", "1"];
    fails(at, &flat, 1, &["a.laz: only COPC files have a resolution", "--resolution"]);
    fails(at, &["convert", "a.copc.laz", "-o", "o.las", "--resolution", "0"], 2, &["--resolution"]);
    fails(at, &["convert", "a.laz", "-o", "o.las", "--box", "5,5,1,1"], 2, &["--box", "begins"]);
}

#[test]
fn an_octree_that_cannot_be_followed_is_told() {
    let at = scan();
    let at = at.path();
    let whole = fs::read(at.join("a.copc.laz")).unwrap();
    // The byte of the root's page in the info record.
    for (byte, bytes) in [(429 + 40, u64::MAX.to_le_bytes()), (429 + 24, [0; 8])] {
        let mut bad = whole.clone();
        bad[byte..byte + 8].copy_from_slice(&bytes);
        fs::write(at.join("bad.copc.laz"), bad).unwrap();
        let boxed = ["convert", "bad.copc.laz", "-o", "o.las", "--box", "0,0,1,1"];
        fails(at, &boxed, 1, &["bad.copc.laz", "octree", "cannot be followed", "--box"]);
        done(at, &["convert", "bad.copc.laz", "-o", "o.las", "--quiet"]);
    }
}
