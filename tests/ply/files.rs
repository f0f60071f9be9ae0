//! PLY files that the tests write themselves: every type and encoding, headers as others write
//! them, and what is carried.

use crate::support::ply::{file, read, records, write};
use pointmill::internals;
use pointmill::internals::ply::{Encoding, PlyOptions};
use pointmill::io::ply;
use pointmill::point::{Endian, Metadata, Value};
use proptest::prelude::*;

const ENCODINGS: [Encoding; 3] =
    [Encoding::Ascii, Encoding::BinaryLittleEndian, Encoding::BinaryBigEndian];

/// Types in both styles, and the size of one number.
const TYPES: [(&str, usize); 18] = [
    ("char", 1),
    ("int8", 1),
    ("uchar", 1),
    ("uint8", 1),
    ("short", 2),
    ("int16", 2),
    ("ushort", 2),
    ("uint16", 2),
    ("int", 4),
    ("int32", 4),
    ("uint", 4),
    ("uint32", 4),
    ("int64", 8),
    ("uint64", 8),
    ("float", 4),
    ("float32", 4),
    ("double", 8),
    ("float64", 8),
];

fn encoded(encoding: Encoding) -> PlyOptions {
    PlyOptions { encoding: Some(encoding), ..PlyOptions::default() }
}

/// Values of all records, to compare what is the same in different byte orders; NaN is one value.
fn values(path: &std::path::Path) -> Vec<Vec<String>> {
    let (schema, _, all) = read(path, 7).unwrap();
    let word = |value| match value {
        Value::Single(v) if v.is_nan() => "nan".to_owned(),
        Value::Double(v) if v.is_nan() => "nan".to_owned(),
        Value::Single(v) => format!("f{:x}", v.to_bits()),
        Value::Double(v) => format!("d{:x}", v.to_bits()),
        whole => format!("{whole:?}"),
    };
    all.chunks(schema.stride)
        .map(|r| schema.dimensions.iter().map(|d| word(d.get(r, schema.endian))).collect())
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_type_goes_round_through_every_encoding(
        extra in prop::collection::vec(0..TYPES.len(), 0..12),
        axes in prop::array::uniform3(0..TYPES.len()),
        big in any::<bool>(),
        bytes in prop::collection::vec(any::<u8>(), 0..2000),
        first in 0..3usize,
    ) {
        let folder = tempfile::tempdir().unwrap();
        let kinds: Vec<usize> = axes.into_iter().chain(extra).collect();
        let stride: usize = kinds.iter().map(|&k| TYPES[k].1).sum();
        let points = bytes.len() / stride;
        let format = if big { "binary_big_endian" } else { "binary_little_endian" };
        let mut text = format!("ply\nformat {format} 1.0\nelement vertex {points}\n");
        for (n, &k) in kinds.iter().enumerate() {
            let name = ["x", "y", "z"].get(n).map_or(format!("p{n}"), |s| (*s).to_owned());
            text += &format!("property {} {name}\n", TYPES[k].0);
        }
        text += "end_header\n";
        let mut content = text.into_bytes();
        let body = &bytes[..points * stride];
        content.extend_from_slice(body);
        let start = file(folder.path(), "start.ply", &content);

        // Kept encoding: kept bytes.
        let (schema, metadata, all) = read(&start, 5).unwrap();
        prop_assert_eq!(&all[..], body);
        prop_assert_eq!(schema.endian, if big { Endian::Big } else { Endian::Little });
        let same = folder.path().join("same.ply");
        write(&same, &PlyOptions::default(), (&schema, &metadata, &all), None, 4).unwrap();
        let (schema_again, _, again) = read(&same, 9).unwrap();
        prop_assert_eq!(&schema_again, &schema);
        prop_assert_eq!(&again[..], body);

        // Through all encodings, beginning with any of them, and back.
        let expected = values(&start);
        let mut at = start;
        for turn in 0..4 {
            let encoding = ENCODINGS[(first + turn) % 3];
            let (schema, metadata, all) = read(&at, 64).unwrap();
            let next = folder.path().join(format!("{turn}.ply"));
            write(&next, &encoded(encoding), (&schema, &metadata, &all), None, 3).unwrap();
            prop_assert_eq!(internals::ply::describe(&next).unwrap().encoding, encoding);
            prop_assert_eq!(values(&next), expected.clone());
            at = next;
        }
    }
}

/// A file of three vertices, 1 2 3, 4 5 6 and 7 8 9, by the given lines.
fn of_lines(lines: &[&str], end: &str) -> Vec<u8> {
    let mut text = lines.join(end);
    text += end;
    text.into_bytes()
}

#[test]
fn headers_and_bodies_with_any_line_end_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let header = [
        "ply",
        "comment  made by hand ",
        "format ascii 1.0",
        "obj_info scanner 7",
        "  element vertex 3",
        "",
        "property float x",
        "\tproperty float y  ",
        "property  double\tz",
        "end_header ",
    ];
    for (n, end) in ["\n", "\r\n", "\r"].into_iter().enumerate() {
        let mut lines = header.to_vec();
        lines.extend(["1 2 3", "", "  4\t5 6 ", " ", "7 8 9"]);
        let path = file(folder.path(), &format!("{n}.ply"), of_lines(&lines, end));
        for capacity in [1, 2, 100] {
            let (schema, metadata, all) = read(&path, capacity).unwrap();
            assert_eq!(metadata.comments, [" made by hand "]);
            let z: Vec<f64> = all
                .chunks(schema.stride)
                .map(|r| schema.find("Z").unwrap().world(r, schema.endian))
                .collect();
            assert_eq!(z, [3.0, 6.0, 9.0], "{end:?}");
        }
        let unended = std::fs::read(&path).unwrap();
        let cut = unended.len() - end.len();
        let path = file(folder.path(), "unended.ply", &unended[..cut]);
        assert_eq!(read(&path, 8).unwrap().2.len(), 3 * 16);
    }
}

#[test]
fn a_binary_body_that_begins_with_a_line_feed_is_kept_whole() {
    let folder = tempfile::tempdir().unwrap();
    for end in ["\n", "\r\n", "\r"] {
        let lines = [
            "ply",
            "format binary_little_endian 1.0",
            "element vertex 1",
            "property uchar x",
            "property uchar y",
            "property uchar z",
            "end_header",
        ];
        let mut bytes = of_lines(&lines, end);
        bytes.extend([10, 13, 10]);
        let path = file(folder.path(), "feed.ply", bytes);
        assert_eq!(read(&path, 1).unwrap().2, [10, 13, 10], "{end:?}");
    }
}

#[test]
fn elements_before_the_vertices_are_stepped_over() {
    let folder = tempfile::tempdir().unwrap();
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement empty 9000000000000000000\n\
             element camera 2\nproperty float f\nproperty uchar g\n\
             element face 3\nproperty list uchar int vertex_indices\nproperty short kind\n\
             property list uint double weights\n\
             element vertex 2\nproperty short x\nproperty short y\nproperty short z\n\
             element edge 1\nproperty int a\nend_header\n"
        )
    };
    let ascii = header("ascii")
        + "0.5 1\n\n1.5 2\n3 0 1 0 5 0\n0 6 1 0.5\n1 1 7 2 0.25 0.75\n1 2 3\n-4 5 6\n17\n";
    let mut paths = vec![file(folder.path(), "ascii.ply", ascii)];
    for (encoding, big) in [("binary_little_endian", false), ("binary_big_endian", true)] {
        let mut bytes = header(encoding).into_bytes();
        let put = |bytes: &mut Vec<u8>, number: &[u8]| {
            // Given highest byte first.
            let mut number = number.to_vec();
            if !big {
                number.reverse();
            }
            bytes.extend(number);
        };
        bytes.extend([0; 10]);
        for (indices, weights) in [(3u8, 0u32), (0, 1), (1, 2)] {
            bytes.push(indices);
            bytes.extend(vec![0xff; 4 * indices as usize + 2]);
            put(&mut bytes, &weights.to_be_bytes());
            bytes.extend(vec![0xff; 8 * weights as usize]);
        }
        for v in [1i16, 2, 3, -4, 5, 6] {
            put(&mut bytes, &v.to_be_bytes());
        }
        bytes.extend([0; 4]);
        paths.push(file(folder.path(), encoding, bytes));
    }
    for path in paths {
        let source = ply::open(std::slice::from_ref(&path)).unwrap();
        let all = records(&*source, 10).unwrap();
        let schema = source.schema();
        let at = |n: usize, name: &str| {
            schema.find(name).unwrap().world(&all[n * schema.stride..], schema.endian)
        };
        assert_eq!((at(0, "X"), at(1, "X"), at(1, "Z")), (1.0, -4.0, 6.0), "{path:?}");
        let warnings = source.warnings().join("\n");
        assert!(warnings.contains("3 of `face`") && warnings.contains("1 of `edge`"), "{warnings}");
    }
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";

#[test]
fn comments_crs_and_names_are_carried() {
    let folder = tempfile::tempdir().unwrap();
    let text = "ply\nformat ascii 1.0\ncomment by hand\nobj_info kept\nelement vertex 1\n\
                property float x\nproperty float y\nproperty float z\nproperty uchar diffuse_red\n\
                property uchar r\nproperty float quality\nend_header\n1 2 3 4 5 6\n";
    let path = file(folder.path(), "in.ply", text);
    let (schema, mut metadata, all) = read(&path, 1).unwrap();
    let names = |s: &pointmill::point::Schema| {
        s.dimensions.iter().map(|d| d.name.clone()).collect::<Vec<_>>()
    };
    assert_eq!(names(&schema), ["X", "Y", "Z", "Red", "r", "quality"]);
    let crs = format!("PROJCS[\"Ω\",\n  {}]", "AUTHORITY[\"EPSG\", \"2056\"], ".repeat(90));
    metadata.crs = Some(crs.clone());

    let (one, two) = (folder.path().join("one.ply"), folder.path().join("two.ply"));
    write(&one, &PlyOptions::default(), (&schema, &metadata, &all), None, 8).unwrap();
    let (schema_again, again, _) = read(&one, 8).unwrap();
    assert_eq!(names(&schema_again), names(&schema));
    assert_eq!(again.comments, ["by hand"]);
    assert_eq!(again.crs.clone().unwrap(), crs.replace('\n', " "));
    let info = internals::ply::describe(&one).unwrap();
    assert_eq!(info.obj_info, ["kept"]);
    let properties: Vec<&str> =
        info.elements[0].properties.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(properties, ["x", "y", "z", "diffuse_red", "r", "quality"]);
    let longest = std::fs::read_to_string(&one).unwrap().lines().map(str::len).max().unwrap();
    assert!(longest < 1000, "a line of {longest} bytes");

    write(&two, &PlyOptions::default(), (&schema_again, &again, &all), None, 8).unwrap();
    assert_eq!(std::fs::read(&one).unwrap(), std::fs::read(&two).unwrap());
}

#[test]
fn a_return_within_a_comment_says_the_same_before_and_after_it_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let text = b"ply\nformat ascii 1.0\ncomment crs:\r WGS 84\nelement vertex 1\n\
        property float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n";
    let (schema, metadata, all) = read(&file(folder.path(), "a.ply", text), 9).unwrap();
    let out = folder.path().join("b.ply");
    write(&out, &PlyOptions::default(), (&schema, &metadata, &all), None, 9).unwrap();
    let (_, again, _) = read(&out, 9).unwrap();
    assert_eq!(metadata.crs.as_deref(), Some(" WGS 84"));
    assert_eq!((again.crs, again.comments), (metadata.crs, metadata.comments));
}

#[test]
fn normals_are_appended_or_overwritten_in_place() {
    let folder = tempfile::tempdir().unwrap();
    let normals = [[0.5f32, -0.25, 1.0], [f32::NAN, f32::NAN, f32::NAN]];
    let options = PlyOptions { computed: crate::support::las::normals(), ..PlyOptions::default() };
    let bare = format!("ply\nformat ascii 1.0\nelement vertex 2\n{XYZ}end_header\n1 2 3\n4 5 6\n");
    let had = "ply\nformat ascii 1.0\nelement vertex 2\nproperty double nx\nproperty float ny\n\
               property float nz\nproperty float x\nproperty float y\nproperty float z\nend_header\n\
               7 7 7 1 2 3\n7 7 7 4 5 6\n";
    for (content, expected) in [
        (bare.as_str(), ["1 2 3 0.5 -0.25 1", "4 5 6 nan nan nan"]),
        (had, ["0.5 -0.25 1 1 2 3", "nan nan nan 4 5 6"]),
    ] {
        let path = file(folder.path(), "in.ply", content);
        let (schema, metadata, all) = read(&path, 2).unwrap();
        let out = folder.path().join("out.ply");
        write(&out, &options, (&schema, &metadata, &all), Some(&normals), 1).unwrap();
        let text = std::fs::read_to_string(&out).unwrap();
        let body: Vec<&str> = text.lines().rev().take(2).collect();
        assert_eq!([body[1], body[0]], expected);
        assert!(write(&out, &options, (&schema, &metadata, &all), None, 1).is_err());
    }
    let whole = bare.replace("end_header", "property int nx\nend_header").replace("3\n", "3 0\n");
    let path = file(folder.path(), "whole.ply", whole.replace("6\n", "6 0\n"));
    let (schema, metadata, _) = read(&path, 2).unwrap();
    let refused =
        internals::ply::create(&folder.path().join("out.ply"), &options, &schema, &metadata);
    assert!(refused.err().unwrap().to_string().contains("NormalX"));
}

#[test]
fn faces_are_carried_only_by_an_unchanged_binary_conversion() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement camera 1\nproperty uchar c\n\
          element vertex 2\nproperty uchar x\nproperty uchar y\nproperty uchar z\n\
          element face 1\nproperty list uchar uchar vertex_indices\nend_header\n"
        .to_vec();
    bytes.extend([99, 1, 2, 3, 4, 5, 6, 3, 0, 1, 0]);
    let path = file(folder.path(), "in.ply", &bytes);
    let (schema, metadata, all) = read(&path, 2).unwrap();
    let out = folder.path().join("out.ply");
    let carry = PlyOptions { carry_rest: true, ..PlyOptions::default() };
    let summary = write(&out, &carry, (&schema, &metadata, &all), None, 1).unwrap();
    assert!(summary.notes[0].contains("carried"), "{:?}", summary.notes);
    let written = std::fs::read(&out).unwrap();
    assert!(written.ends_with(&bytes[bytes.len() - 11..]));
    assert_eq!(
        internals::ply::describe(&out).unwrap().elements,
        internals::ply::describe(&path).unwrap().elements
    );
    assert_eq!(read(&out, 2).unwrap().2, all);

    assert!(write(&out, &carry, (&schema, &metadata, &all[..3]), None, 1).is_err());
    let ascii = PlyOptions { encoding: Some(Encoding::Ascii), ..carry };
    let summary = write(&out, &ascii, (&schema, &metadata, &all), None, 1).unwrap();
    assert!(summary.notes[0].contains("dropped"), "{:?}", summary.notes);
    assert_eq!(internals::ply::describe(&out).unwrap().elements.len(), 1);
    write(&out, &PlyOptions::default(), (&schema, &metadata, &all), None, 1).unwrap();
    assert_eq!(internals::ply::describe(&out).unwrap().elements.len(), 1);
}

/// A vertex with a list of so many numbers between its coordinates, in one of the encodings.
fn listed_vertex(n: u32, encoding: Encoding) -> Vec<u8> {
    let items: Vec<f32> = (0..n % 5).map(|i| i as f32).collect();
    let [x, y, z] = [n as f32, 0.5, -1.0];
    if encoding == Encoding::Ascii {
        let list: String = items.iter().map(|v| format!(" {v}")).collect();
        return format!("{x} {y} {}{list} {z} {n}\n", items.len()).into_bytes();
    }
    let is_big = encoding == Encoding::BinaryBigEndian;
    let float = |v: f32| if is_big { v.to_be_bytes() } else { v.to_le_bytes() };
    let count = items.len() as u16;
    let count = if is_big { count.to_be_bytes() } else { count.to_le_bytes() };
    let number = if is_big { n.to_be_bytes() } else { n.to_le_bytes() };
    let list: Vec<u8> = items.into_iter().flat_map(float).collect();
    [&float(x)[..], &float(y), &count, &list, &float(z), &number].concat()
}

#[test]
fn lists_of_vertices_are_passed_over_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let count = 20_000u32;
    for encoding in ENCODINGS {
        let word = match encoding {
            Encoding::Ascii => "ascii",
            Encoding::BinaryLittleEndian => "binary_little_endian",
            Encoding::BinaryBigEndian => "binary_big_endian",
        };
        let head = format!(
            "ply\nformat {word} 1.0\nelement vertex {count}\nproperty float x\nproperty float y\n\
             property list ushort float uv\nproperty float z\nproperty uint n\nend_header\n"
        );
        let body: Vec<u8> = (0..count).flat_map(|n| listed_vertex(n, encoding)).collect();
        let path = file(folder.path(), "in.ply", [head.as_bytes(), &body].concat());
        let (schema, _, all) = read(&path, 999).unwrap();
        let names: Vec<&str> = schema.dimensions.iter().map(|d| d.name.as_str()).collect();
        assert_eq!(names, ["X", "Y", "Z", "n"]);
        for (n, record) in (0..count).zip(all.chunks_exact(schema.stride)) {
            let values = schema.dimensions.iter().map(|d| d.get(record, schema.endian).as_f64());
            assert!(values.eq([f64::from(n), 0.5, -1.0, f64::from(n)]), "{word} {n}");
        }
        let warnings = ply::open(std::slice::from_ref(&path)).unwrap().warnings();
        assert!(warnings[0].contains("lists of its vertices are not read: `uv`"), "{warnings:?}");
        // Cut within the last vertex, and a list that claims more than there is.
        if encoding != Encoding::Ascii {
            let cut =
                file(folder.path(), "cut.ply", [head.as_bytes(), &body[..body.len() - 5]].concat());
            assert!(
                read(&cut, 999).unwrap_err().to_string().contains("the file ends within"),
                "{word}"
            );
            let mut long = body.clone();
            long[8..10].fill(0xff);
            let few = head.replace(&count.to_string(), "1");
            let long = file(folder.path(), "long.ply", [few.as_bytes(), &long[..20]].concat());
            assert!(read(&long, 9).unwrap_err().to_string().contains("longer than the file"));
        }
    }
    let case = crate::support::case_file("33-vertex-list.ply");
    assert_eq!(values(&case).len(), 2);
}

#[test]
fn dimensions_can_be_dropped_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let text = "ply\nformat binary_big_endian 1.0\nelement vertex 1\nproperty uchar x\n\
                property ushort quality\nproperty uchar y\nproperty uchar z\nend_header\n\u{1}ab\u{2}\u{3}";
    let path = file(folder.path(), "in.ply", text);
    let (schema, metadata, all) = read(&path, 1).unwrap();
    let out = folder.path().join("out.ply");
    let without = |name: &str| PlyOptions { drop: vec![name.into()], ..PlyOptions::default() };
    write(&out, &without("quality"), (&schema, &metadata, &all), None, 1).unwrap();
    assert_eq!(read(&out, 1).unwrap().2, [1, 2, 3]);
    for name in ["qualty", "X"] {
        let refused = internals::ply::create(&out, &without(name), &schema, &Metadata::default());
        assert!(refused.err().unwrap().to_string().contains(name));
    }
}
