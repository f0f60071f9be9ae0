//! Scales, offsets and point formats that are found, and extra bytes that not all inputs have.

use std::path::Path;

use serde_json::Value;

use crate::support::command::{done, fails, info};
use crate::support::records::read;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// The coordinates of a file.
fn places(path: &Path) -> Vec<[f64; 3]> {
    let (schema, records) = read(path);
    let axes = schema.coordinates().unwrap();
    let each = records.chunks_exact(schema.stride);
    each.map(|record| axes.map(|axis| axis.world(record, schema.endian))).collect()
}

#[test]
fn the_scale_of_a_text_is_that_of_its_decimals() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    for (text, scale, offset) in [
        ("638000.12 5638123.5 1.25\n638001 5638124 1\n", [0.01; 3], [0.0; 3]),
        ("638000.125 5638123.5 1.25\n", [0.001; 3], [0.0, 5_638_000.0, 0.0]),
        ("7.1234567 51.7654321 188.1\n", [1e-7; 3], [0.0; 3]),
        ("7.1234567 51.7654321 8188.1\n-7 0 0\n", [1e-7, 1e-7, 0.1], [0.0; 3]),
        ("1 2 3\n", [1.0; 3], [0.0; 3]),
    ] {
        std::fs::write(at.join("a.xyz"), text).unwrap();
        let convert = ["convert", "a.xyz", "-o", "a.las", "--quiet", "--scale", "auto"];
        done(at, &convert);
        let told = info(at, "a.las");
        assert_eq!(numbers(&told["scale"]), scale, "{text}");
        assert_eq!(numbers(&told["offset"]), offset, "{text}");
        let (was, is) = (places(&at.join("a.xyz")), places(&at.join("a.las")));
        for (was, is) in was.iter().zip(&is) {
            assert!((0..3).all(|axis| (was[axis] - is[axis]).abs() < 1e-9), "{was:?} {is:?}");
        }
    }
}

#[test]
fn single_precision_has_the_decimals_that_it_was_written_with() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let ply = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n\
               property float z\nend_header\n0.1 12.34 -5\n0.2 1.5 7\n";
    std::fs::write(at.join("a.ply"), ply).unwrap();
    let convert = ["convert", "a.ply", "-o", "a.laz", "--quiet", "--scale", "auto"];
    done(at, &convert);
    assert_eq!(numbers(&info(at, "a.laz")["scale"]), [0.01; 3]);
}

#[test]
fn what_no_scale_holds_is_refused_with_one_that_nearly_does() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let convert = ["convert", "a.xyz", "-o", "a.las", "--quiet", "--scale"];
    let auto = [&convert[..], &["auto"]].concat();
    std::fs::write(at.join("a.xyz"), "0.0000001 0 0\n90000000 0 0\n").unwrap();
    fails(at, &auto, 2, &["reach farther than 2^32 of the steps", "--scale 0.1", "--offset auto"]);
    done(at, &[&convert[..], &["0.1", "--offset", "auto", "--nonfinite", "drop"]].concat());
    std::fs::write(at.join("a.xyz"), format!("{} 0 0\n", 1.0 / 3.0)).unwrap();
    fails(at, &auto, 2, &["the x of some points has more than 12 decimals", "--scale"]);
    // An offset that is out of the way says so too.
    std::fs::write(at.join("a.xyz"), "5000000.125 0 0\n").unwrap();
    let given = [&auto[..], &["--offset", "0,0,0"]].concat();
    fails(at, &given, 2, &["from `--offset` the points reach farther"]);
    std::fs::write(
        at.join("move.toml"),
        "stage = [{kind = 'read', path = 'a.xyz'}, {kind = 'transform', translate = [1, 0, 0]}, \
         {kind = 'write', path = 'b.las', scale = 'auto'}]",
    )
    .unwrap();
    fails(at, &["run", "move.toml"], 2, &["looks at points where they are read", "`transform`"]);
}

#[test]
fn las_stays_as_it_is_by_auto() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "part", "-n", "3000", "-o", "a.laz"]);
    let auto = ["--scale", "auto", "--offset", "auto", "--point-format", "auto"];
    let convert = ["convert", "a.laz", "--quiet", "--no-provenance", "-o"];
    done(at, &[&convert[..], &["b.laz"], &auto].concat());
    done(at, &[&convert[..], &["c.laz"]].concat());
    let uneven =
        ["convert", "a.laz", "-o", "d.laz", "--scale", "auto", "--offset", "0.0000125,0,0"];
    fails(at, &uneven, 2, &["no whole number of steps from the offset of the input"]);
    assert_eq!(std::fs::read(at.join("b.laz")).unwrap(), std::fs::read(at.join("c.laz")).unwrap());
}

/// A LAS file of these rows.
fn las(at: &Path, name: &str, rows: &str, more: &[&str]) {
    std::fs::write(at.join("rows.csv"), rows).unwrap();
    let convert = ["convert", "rows.csv", "--quiet", "--no-provenance", "-o", name];
    done(at, &[&convert[..], more].concat());
}

#[test]
fn inputs_of_several_scales_and_formats_get_what_all_have() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    las(at, "a.las", "X,Y,Z\n1.01,2.02,3\n", &["--scale", "0.01"]);
    let more = ["--scale", "0.0025", "--offset", "1000.005,0,0", "--point-format", "2"];
    las(at, "b.las", "X,Y,Z,Red,Green,Blue\n1001.0075,2.5,3,1,2,3\n", &more);
    las(at, "c.las", "X,Y,Z,GpsTime\n5,6,7,8.5\n", &["--scale", "0.5", "--point-format", "1"]);
    let auto = ["--scale", "auto", "--point-format"];
    let convert = ["convert", "a.las", "b.las", "c.las", "-o", "all.las", "--quiet"];
    done(at, &[&convert[..], &auto, &["auto"]].concat());
    let told = info(at, "all.las");
    assert_eq!(numbers(&told["scale"]), [0.0025; 3]);
    assert_eq!(told["point_format"], 7, "a.las has format 6");
    let all = places(&at.join("all.las"));
    let near = |place: &[f64; 3], to: [f64; 3]| (0..3).all(|i| (place[i] - to[i]).abs() < 1e-9);
    assert_eq!(all.len(), 3);
    assert!(near(&all[0], [1.01, 2.02, 3.0]) && near(&all[1], [1001.0075, 2.5, 3.0]), "{all:?}");
    // Steps too small for where the points are.
    las(at, "d.las", "X,Y,Z\n1.0000001,0,0\n", &["--scale", "1e-9"]);
    las(at, "e.las", "X,Y,Z\n900000,0,0\n", &["--scale", "0.01"]);
    let far = ["convert", "d.las", "e.las", "-o", "f.las", "--scale", "auto"];
    fails(at, &far, 2, &["no common step that reaches all points", "--scale"]);
}

#[test]
fn extra_bytes_that_a_file_lacks_are_nothing_there() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let scale = ["--scale", "0.01"];
    las(at, "a.las", "X,Y,Z,zeta,alpha\n1,2,3,7,0.5\n", &scale);
    // The value for no data is a double in the description, whatever the type.
    las(at, "f.las", "X,Y,Z,gamma\n1,2,3,0.5\n", &["--scale", "0.01", "--type", "gamma=f32"]);
    no_data(&at.join("f.las"), 0, (-9999.9f64).to_bits());
    done(at, &["convert", "a.las", "f.las", "-o", "g.las", "--quiet", "--assume", "extra-bytes"]);
    let (schema, records) = read(&at.join("g.las"));
    let gamma = schema.find("gamma").unwrap().world(&records, schema.endian);
    assert_eq!(gamma as f32, -9999.9_f32);
    las(at, "b.las", "X,Y,Z,alpha,beta\n4,5,6,1.5,9\n", &scale);
    las(at, "c.las", "X,Y,Z\n7,8,9\n", &scale);
    no_data(&at.join("b.las"), 1, 200);
    let convert = ["convert", "a.las", "b.las", "c.las", "-o", "all.las", "--quiet"];
    let help = "--assume extra-bytes";
    fails(at, &convert, 1, &["their extra bytes differ: zeta, alpha and alpha, beta", help]);
    done(at, &[&convert[..], &["--assume", "extra-bytes"]].concat());
    let (schema, records) = read(&at.join("all.las"));
    let extras = ["alpha", "beta", "zeta"];
    let rows: Vec<Vec<f64>> = records
        .chunks_exact(schema.stride)
        .map(|record| {
            let value = |name| schema.find(name).unwrap().world(record, schema.endian);
            extras.into_iter().map(value).collect()
        })
        .collect();
    assert_eq!(rows, [vec![0.5, 200.0, 7.0], vec![1.5, 9.0, 0.0], vec![0.0, 200.0, 0.0]]);
    // Each by itself in a folder has them as well.
    std::fs::write(
        at.join("each.toml"),
        "stage = [{kind = 'read', path = ['a.las', 'b.las', 'c.las'], assume = ['extra-bytes']}, \
         {kind = 'write', folder = 'out'}]",
    )
    .unwrap();
    done(at, &["run", "each.toml", "--quiet"]);
    for name in ["a.las", "b.las", "c.las"] {
        let (one, _) = read(&at.join("out").join(name));
        assert_eq!(one.dimensions.len(), schema.dimensions.len(), "{name}");
    }
    // Two descriptions of one name are not taken for one.
    las(at, "d.las", "X,Y,Z,alpha\n1,2,3,4\n", &scale);
    let unlike = ["convert", "a.las", "d.las", "-o", "no.las", "--assume", "extra-bytes"];
    fails(at, &unlike, 1, &["its extra bytes `alpha` are of another type", "--map"]);
}

/// Gives the descriptor number `which` of a file a value for no data.
fn no_data(path: &Path, which: usize, value: u64) {
    let mut bytes = std::fs::read(path).unwrap();
    let user = bytes.windows(9).position(|window| window == b"LASF_Spec").unwrap();
    let descriptor = user - 2 + 54 + 192 * which;
    bytes[descriptor + 3] |= 1;
    bytes[descriptor + 40..descriptor + 48].copy_from_slice(&value.to_le_bytes());
    std::fs::write(path, bytes).unwrap();
}
