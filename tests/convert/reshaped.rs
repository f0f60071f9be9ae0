//! Dimensions of an output under other names, in other types, or left out, and values that mean the
//! same in them.

use std::path::Path;

use pointmill::point::Scalar;

use crate::support::command::{done, fails, pointmill};
use crate::support::records::read;

const BASE: &str = "\
X,Y,Z,Intensity,Classification,GpsTime,Red,Green,Blue,amplitude,quality
1.001,2.002,3.003,100,2,1.25,65535,256,1,7,0.5
-1.5,2.25,4.125,200,6,3.5,1,2,3,8,-7.25
";

/// A LAS file with two extra bytes, in a folder of its own.
fn folder() -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    std::fs::write(at.path().join("base.csv"), BASE).unwrap();
    let convert = ["convert", "base.csv", "-o", "a.las", "--scale", "auto", "--quiet"];
    done(at.path(), &[&convert[..], &["--point-format", "3"]].concat());
    at
}

/// The values of one dimension of a file.
fn values(path: &Path, name: &str) -> Vec<f64> {
    let (schema, records) = read(path);
    let dimension = schema.find(name).unwrap_or_else(|| panic!("{name}: {schema:?}"));
    let each = records.chunks_exact(schema.stride);
    each.map(|record| dimension.world(record, schema.endian)).collect()
}

fn names(path: &Path) -> Vec<String> {
    let (schema, _) = read(path);
    schema.dimensions.iter().map(|dimension| dimension.name.clone()).collect()
}

fn converted(at: &Path, more: &[&str], to: &str) -> std::path::PathBuf {
    let arguments = [&["convert", "a.las", "-o", to, "--quiet"], more].concat();
    let told = pointmill(at, &arguments);
    assert_eq!(told.0, 0, "{arguments:?}: {}", told.2);
    at.join(to)
}

#[test]
fn dimensions_get_other_names() {
    let at = folder();
    let at = at.path();
    let taken = ["convert", "a.las", "-o", "b.las", "--map", "amplitude=Intensity"];
    fails(at, &taken, 2, &["the input has `Intensity`, too", "`--drop Intensity`"]);
    for to in ["b.las", "b.laz", "b.ply", "b.csv", "b.pcd", "b.e57"] {
        let more = ["--map", "Amplitude=intensity,quality=grade", "--drop", "INTENSITY"];
        let made = converted(at, &more, to);
        assert_eq!(values(&made, "Intensity"), [7.0, 8.0], "{to}");
        assert_eq!(values(&made, "grade"), [0.5, -7.25], "{to}");
        let names = names(&made);
        assert!(!names.contains(&"amplitude".into()) && !names.contains(&"quality".into()), "{to}");
    }
    // A field of the point format becomes extra bytes where the new one lacks it.
    let made = converted(at, &["--map", "GpsTime=time", "--point-format", "2"], "c.las");
    assert_eq!(values(&made, "time"), [1.25, 3.5]);
    // And two names are exchanged.
    let made = converted(at, &["--map", "amplitude=quality,quality=amplitude"], "d.las");
    assert_eq!(values(&made, "amplitude"), [0.5, -7.25]);
    assert_eq!(values(&made, "quality"), [7.0, 8.0]);
}

#[test]
fn names_that_cannot_be_are_refused() {
    let at = folder();
    for (map, part) in [
        ("Amplitud=amp", "did you mean `amplitude`?"),
        ("X=x", "coordinates keep their names"),
        ("amplitude=Z", "coordinates keep their names"),
        ("amplitude=a,quality=a", "another entry has one of the two names"),
        ("amplitude", "is not a name, `=` and a new name"),
        ("amplitude=a_name_of_more_than_32_bytes_is_none", "a name has at most 32 bytes"),
    ] {
        fails(at.path(), &["convert", "a.las", "-o", "b.las", "--map", map], 2, &["--map", part]);
    }
    let both = ["convert", "a.las", "-o", "b.las", "--map", "quality=q", "--drop", "quality"];
    fails(at.path(), &both, 2, &["`--drop` leaves `quality` out"]);
}

#[test]
fn extra_bytes_are_left_out_of_las() {
    let at = folder();
    let made = converted(at.path(), &["--drop", "amplitude"], "b.las");
    assert_eq!(values(&made, "quality"), [0.5, -7.25]);
    let (was, is) = (read(&at.path().join("a.las")).0, read(&made).0);
    let size = was.find("amplitude").unwrap().scalar.size();
    assert_eq!(is.stride, was.stride - size);
    let field = ["convert", "a.las", "-o", "c.las", "--drop", "GpsTime"];
    fails(at.path(), &field, 2, &["every record of LAS point format 3 has", "--point-format"]);
}

#[test]
fn dimensions_get_other_types() {
    let at = folder();
    let at = at.path();
    let made = converted(at, &["--type", "x=f32,Intensity=f64,quality=i8"], "b.ply");
    let (schema, _) = read(&made);
    let scalar = |name: &str| schema.find(name).unwrap().scalar;
    assert_eq!(
        ["X", "Y", "Intensity", "quality"].map(scalar),
        [Scalar::F32, Scalar::F64, Scalar::F64, Scalar::I8]
    );
    assert_eq!(values(&made, "quality"), [0.0, -7.0], "rounded to even");
    assert_eq!(values(&made, "X"), [f64::from(1.001_f32), -1.5]);
    let told = pointmill(at, &["convert", "a.las", "-o", "c.ply", "--type", "quality=i8"]).2;
    assert!(
        told.contains("values of 2 points were rounded to their types in the output"),
        "{told}"
    );
    let made = converted(at, &["--type", "quality=f32,amplitude=f64"], "d.laz");
    assert_eq!(values(&made, "quality"), [0.5, -7.25]);
    assert_eq!(read(&made).0.find("amplitude").unwrap().scalar, Scalar::F64);
    for (kind, to, part) in [
        ("quality=u8", "e.las", "quality = -7.25"),
        ("Y=u8,X=u8", "e.ply", "give it a type in `--type` that holds it"),
    ] {
        fails(at, &["convert", "a.las", "-o", to, "--type", kind], 1, &[part]);
    }
    for (kind, to, part) in [
        ("Intensity=f32", "e.las", "has a type for it that is always the same"),
        ("Intensity=f32", "e.laz", "`--map Intensity=Intensity2` with `--type Intensity2=f32`"),
        ("none=f32", "e.ply", "there is no `none`"),
        ("quality=u64", "e.ply", "PLY has no whole numbers of 64 bits"),
        ("quality=double", "e.ply", "types are u8, i8"),
    ] {
        fails(at, &["convert", "a.las", "-o", to, "--type", kind], 2, &[part]);
    }
}

#[test]
fn whole_numbers_are_never_rounded_by_a_type() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let text = "X,Y,Z,stamp\n1,2,3,1700000000123456789\n4,5,6,1700000000123456790\n";
    std::fs::write(at.join("a.csv"), text).unwrap();
    let convert = ["convert", "a.csv", "-o", "a.las", "--scale", "1", "--quiet"];
    done(at, &[&convert[..], &["--type", "stamp=u64"]].concat());
    let back = ["convert", "a.las", "-o", "b.csv", "--quiet", "--type", "stamp=i64"];
    done(at, &back);
    let back = std::fs::read_to_string(at.join("b.csv")).unwrap();
    assert!(back.contains("1700000000123456789") && back.contains("1700000000123456790"), "{back}");
    let float = ["convert", "a.las", "-o", "b.ply", "--type", "stamp=f64"];
    fails(at, &float, 1, &["stamp = 1700000000123456789", "does not fit a 64-bit float"]);
}

#[test]
fn what_a_type_does_not_reach_is_refused() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    std::fs::write(at.join("a.csv"), "X,Y,Z,foo\n1,2,3,1e300\n4,5,6,0.5\n").unwrap();
    for to in ["b.ply", "b.las"] {
        let convert = ["convert", "a.csv", "-o", to, "--type", "foo=f32"];
        let scale = if to == "b.las" { &["--scale", "1"][..] } else { &[] };
        fails(at, &[&convert[..], scale].concat(), 1, &["does not fit a 32-bit float", "--type"]);
    }
}

#[test]
fn keys_that_would_say_two_things_of_one_dimension_are_refused() {
    let at = folder();
    let at = at.path();
    let colors = ["convert", "a.las", "-o", "b.ply", "--type", "Red=u16", "--colors", "8bit"];
    fails(at, &colors, 2, &["`--type` has `Red=u16`, and `--colors`"]);
    std::fs::write(
        at.join("normals.toml"),
        "stage = [{kind = 'read', path = 'a.las'}, {kind = 'normals'}, {kind = 'write', path = \
         'b.ply', map = ['quality=NormalX'], dimensions = ['NormalX', 'NormalY', 'NormalZ']}]",
    )
    .unwrap();
    fails(at, &["run", "normals.toml"], 2, &["`write.dimensions` computes `NormalX`"]);
    let no = ["convert", "a.las", "-o", "b.ply", "--map", "quality=Foo", "--drop", "Foo"];
    fails(at, &no, 2, &["`--drop` names `Foo`, which the input does not have"]);
}

#[test]
fn fractions_are_parts_of_the_most() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let header = "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\n\
                  property double z\nproperty float intensity\nproperty float red\n\
                  property float green\nproperty float blue\nend_header\n";
    std::fs::write(at.join("a.ply"), format!("{header}1 2 3 0.5 0 0.2 1\n4 5 6 1 1 0 0.501961\n"))
        .unwrap();
    let convert = ["convert", "a.ply", "-o", "a.las", "--scale", "1"];
    fails(at, &convert, 1, &["Intensity = 0.5", "--intensity unit", "--map Intensity=Amplitude"]);
    done(at, &[&convert[..], &["--intensity", "unit", "--quiet"]].concat());
    let las = at.join("a.las");
    assert_eq!(values(&las, "Intensity"), [32768.0, 65535.0]);
    assert_eq!(values(&las, "Red"), [0.0, 65535.0]);
    assert_eq!(values(&las, "Green"), [13107.0, 0.0]);
    assert_eq!(values(&las, "Blue"), [65535.0, 32896.0], "128 of 255 is 128 times 257");
    let kept = ["--map", "Intensity=Amplitude", "--quiet"];
    done(at, &[&convert[..], &kept].concat());
    assert_eq!(values(&las, "Amplitude"), [0.5, 1.0]);
    let bytes = ["convert", "a.ply", "-o", "b.ply", "--quiet", "--type", "Red=u8,Blue=u8"];
    done(at, &bytes);
    assert_eq!(values(&at.join("b.ply"), "Red"), [0.0, 255.0]);
    assert_eq!(values(&at.join("b.ply"), "Blue"), [255.0, 128.0]);
    let back = ["convert", "b.ply", "-o", "c.ply", "--quiet", "--type", "Red=f32,Blue=f32"];
    done(at, &back);
    assert_eq!(values(&at.join("c.ply"), "Red"), [0.0, 1.0]);
    std::fs::write(at.join("a.ply"), format!("{header}1 2 3 0 0 200 1\n1 2 3 0 0 0 0\n")).unwrap();
    let told = ["colours of floating-point numbers go from 0 to 1", "Green = 200"];
    fails(at, &[&convert[..], &["--intensity", "unit"]].concat(), 1, &told);
    std::fs::write(at.join("a.ply"), format!("{header}1 2 3 1.2 0 0 1\n1 2 3 0 0 0 0\n")).unwrap();
    let told = ["with `--intensity unit` intensities go from 0 to 1", "Intensity = 1.2"];
    fails(at, &[&convert[..], &["--intensity", "unit"]].concat(), 1, &told);
}
