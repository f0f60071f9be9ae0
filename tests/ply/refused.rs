//! PLY files that must be refused, and what is said of them.

use std::path::PathBuf;

use crate::support::ply::{file, read};
use pointmill::io::ply;

fn refusal(bytes: impl AsRef<[u8]>) -> pointmill::Error {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), "bad.ply", bytes);
    let error = read(&path, 16).map(|_| ()).expect_err("this is to be refused");
    assert_eq!(error.path(), Some(path.as_path()), "{error:?}");
    error
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";

#[test]
fn what_is_wrong_is_named_with_its_byte() {
    let ascii = "ply\nformat ascii 1.0\n";
    let cases: &[(String, &str, Option<u64>)] = &[
        (String::new(), "not a PLY file", Some(0)),
        ("LASF\u{0}\u{0}".into(), "not a PLY file", Some(0)),
        ("ply\nformat ascii 1.0\nelement vertex 1\n".into(), "no end_header", Some(38)),
        ("ply\nelement vertex 0\nend_header\n".into(), "no `format`", Some(21)),
        ("ply\nformat asci 1.0\nend_header\n".into(), "`asci` is not known", Some(4)),
        ("ply\nformat ascii 2.0\nend_header\n".into(), "version 2.0", Some(4)),
        (format!("{ascii}end_header\n"), "no element at all", None),
        (format!("{ascii}element point 1\nend_header\n"), "the file has `point`", None),
        (format!("{ascii}element vertex -1\nend_header\n"), "`-1` is no count", Some(21)),
        (format!("{ascii}propety float x\nend_header\n"), "`propety`", Some(21)),
        (format!("{ascii}property float x\nend_header\n"), "before any element", Some(21)),
        (format!("{ascii}element vertex 1\nproperty half x\nend_header\n"), "`half`", Some(38)),
        (
            format!(
                "{ascii}element vertex 1\nproperty float x\nproperty float y\nend_header\n1 2\n"
            ),
            "no property z",
            None,
        ),
        (
            format!("{ascii}element vertex 1\n{XYZ}property float x\nend_header\n1 2 3 4\n"),
            "second property `x`",
            Some(89),
        ),
        (
            format!(
                "{ascii}element vertex 1\n{XYZ}property list uchar int of\nend_header\n1 2 3 4 5\n"
            ),
            "the list `of` is not as long as it says",
            Some(127),
        ),
        (
            format!("{ascii}element vertex 0\nelement vertex 1\n{XYZ}end_header\n1 2 3\n"),
            "second element `vertex`",
            Some(38),
        ),
        (
            format!("{ascii}element vertex 1\n{XYZ}end_header\n1 2\n    "),
            "line 8: 2 values",
            Some(100),
        ),
        (format!("{ascii}element vertex 1\n{XYZ}end_header\n1 2 3 4\n"), "more values", Some(106)),
        (
            format!("{ascii}element vertex 1\n{XYZ}end_header\n1 2 1e39\n"),
            "line 8: `1e39`",
            Some(104),
        ),
        (
            format!("{ascii}element vertex 2\n{XYZ}end_header\n1 2 3.0000000\n"),
            "after 1 of 2",
            Some(114),
        ),
        (
            format!("{ascii}element vertex 9000000000000000000\n{XYZ}end_header\n1 2 3\n"),
            "claims 9000000000000000000",
            None,
        ),
        (
            format!("{ascii}element vertex 1\n{XYZ}end_header\n{}1 2 3\n", " ".repeat(10_000)),
            "line 8 is longer than",
            Some(100),
        ),
        (
            format!(
                "ply\nformat binary_little_endian 1.0\nelement vertex 2\n{XYZ}end_header\n0123456789012345678901"
            ),
            "ends after 1 at most",
            Some(137),
        ),
        (
            format!(
                "ply\nformat binary_little_endian 1.0\nelement face 2\nproperty list char int i\nelement vertex 0\n{XYZ}end_header\n\u{1}0123\u{7f}"
            ),
            "ends within element `face`",
            None,
        ),
        (
            format!("ply\nformat ascii 1.0\ncomment {}\n", "c".repeat(2_000_000)),
            "longer than",
            None,
        ),
    ];
    for (content, message, byte) in cases {
        let error = refusal(content);
        assert!(error.to_string().contains(message), "{message}: {error}");
        if byte.is_some() {
            assert_eq!(error.byte(), *byte, "{message}: {error}");
        }
    }
    let negative = "ply\nformat binary_little_endian 1.0\nelement face 1\nproperty list char int i\n\
                    element vertex 0\n";
    let mut bytes = format!("{negative}{XYZ}end_header\n").into_bytes();
    bytes.push(0xff);
    assert!(refusal(bytes).to_string().contains("negative count"));
}

#[test]
fn several_files_agree_or_both_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let text = |comment: &str, kind: &str, body: &str| {
        format!(
            "ply\nformat ascii 1.0\n{comment}element vertex 1\nproperty {kind} x\n\
             property float y\nproperty float z\nend_header\n{body}"
        )
    };
    let open = |names: &[&str]| {
        let paths: Vec<PathBuf> = names.iter().map(|n| folder.path().join(n)).collect();
        ply::open(&paths)
    };
    file(folder.path(), "a.ply", text("comment one\n", "float", "1 2 3\n"));
    file(folder.path(), "b.ply", text("comment two\n", "float32", "4 5 6\n"));
    let more = text("", "float", "1 2 3 4\n").replace("end_header", "property int n\nend_header");
    file(folder.path(), "more.ply", more);
    file(folder.path(), "crs.ply", text("comment crs: EPSG:2056\n", "float", "1 2 3\n"));

    let both = open(&["b.ply", "a.ply"]).unwrap();
    assert_eq!(both.metadata().comments, ["one", "two"]);
    assert_eq!((both.points(), both.parts()), (2, 2));
    let mut batch = pointmill::point::PointBatch::new(both.schema().clone(), 4);
    for (index, x) in [(0, 4f32), (1, 1f32)] {
        both.part(index).unwrap().read(&mut batch).unwrap();
        assert_eq!((batch.source, &batch.records()[..4]), (index as u32, &x.to_le_bytes()[..]));
    }
    for other in ["more.ply", "crs.ply"] {
        let error = open(&["a.ply", other]).err().expect("they disagree");
        let told = error.to_string();
        assert!(told.contains("a.ply") && told.contains(other), "{told}");
    }
}
