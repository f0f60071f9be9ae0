//! Several files as one scan: what they must share, what becomes of the rest, in any order.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::support::las::{LAS, LAZ, read_files, write};
use crate::support::records::read_source;
use crate::support::scans;
use pointmill::io::las::{fresh, layout, open};
use pointmill::point::{Metadata, Scalar, Schema};

/// A file of ten points of `format` whose stored coordinates count up from `first`.
fn file(path: &Path, schema: &Arc<Schema>, metadata: &Metadata, first: i32) {
    let mut records = vec![0u8; 10 * schema.stride];
    for (record, stored) in records.chunks_exact_mut(schema.stride).zip(first..) {
        for axis in 0..3 {
            record[4 * axis..4 * axis + 4].copy_from_slice(&stored.to_le_bytes());
        }
    }
    let options = if first % 2 == 0 { LAS } else { LAZ };
    write(path, options, schema, metadata, &records).unwrap();
}

fn plain(offset: f64) -> (Arc<Schema>, Metadata) {
    let schema = Arc::new(layout(1, &[], [0.01; 3], [offset; 3]));
    let metadata = fresh(&schema, None);
    (schema, metadata)
}

fn patch(path: &Path, at: usize, bytes: &[u8]) {
    let mut whole = std::fs::read(path).unwrap();
    whole[at..at + bytes.len()].copy_from_slice(bytes);
    std::fs::write(path, whole).unwrap();
}

fn pair(folder: &Path) -> [PathBuf; 2] {
    let paths = ["a.las", "b.las"].map(|name| folder.join(name));
    let (schema, metadata) = plain(100.0);
    file(&paths[0], &schema, &metadata, 0);
    file(&paths[1], &schema, &metadata, 3);
    paths
}

/// Opening both must fail and name both and `what`.
fn refused(paths: &[PathBuf; 2], what: &str) {
    for paths in [[&paths[0], &paths[1]], [&paths[1], &paths[0]]] {
        let error = open(&paths.map(Clone::clone)).err().expect("the files are refused");
        let told = error.to_string();
        assert!(told.contains(what), "{told}");
        for path in paths {
            assert!(told.contains(path.to_str().unwrap()), "{told}");
        }
    }
}

#[test]
fn offsets_apart_by_whole_steps_are_shifted_exactly_to_the_smallest() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["a", "b"].map(|name| folder.path().join(name));
    for (path, offset, first) in [(&paths[0], 4_000_000.37, 1), (&paths[1], 4_000_001.0, 2)] {
        let (schema, metadata) = plain(offset);
        file(path, &schema, &metadata, first);
    }
    let (source, records) = read_files(&paths).unwrap();
    let schema = source.schema();
    let x = schema.find("X").unwrap();
    assert_eq!(x.origin, 4_000_000.37);
    let stored = |i: usize| x.get(&records[i * schema.stride..], schema.endian).as_f64();
    assert_eq!((stored(0), stored(10)), (1.0, 2.0 + 63.0));
    assert_eq!(source.points(), 20);
}

#[test]
fn a_shift_beyond_the_stored_range_is_refused_where_it_happens() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["a", "b"].map(|name| folder.path().join(name));
    for (path, offset, first) in [(&paths[0], 0.0, 0), (&paths[1], 100.0, i32::MAX - 20)] {
        let (schema, metadata) = plain(offset);
        file(path, &schema, &metadata, first);
    }
    let error = read_files(&paths).err().expect("the shift overflows");
    assert_eq!(error.path(), Some(paths[1].as_path()));
}

#[test]
fn files_that_do_not_agree_are_refused_naming_both() {
    let folder = tempfile::tempdir().unwrap();
    let paths = pair(folder.path());
    let other = |schema: Schema, crs: Option<&str>| {
        let schema = Arc::new(schema);
        file(&paths[1], &schema, &fresh(&schema, crs), 3);
    };
    other(layout(3, &[], [0.01; 3], [0.0; 3]), None);
    refused(&paths, "point format");
    other(layout(1, &[("A".to_owned(), Scalar::U8)], [0.01; 3], [0.0; 3]), None);
    refused(&paths, "extra bytes differ: ");
    other(layout(1, &[], [0.02; 3], [0.0; 3]), None);
    refused(&paths, "scale");
    other(layout(1, &[], [0.01; 3], [0.005; 3]), None);
    refused(&paths, "whole steps");
    other(layout(1, &[], [0.01; 3], [100.0; 3]), Some("PROJCS[\"a\"]"));
    refused(&paths, "CRS");
    other(layout(1, &[], [0.01; 3], [100.0; 3]), None);
    patch(&paths[1], 6, &[1, 0]);
    refused(&paths, "GPS time type");
}

#[test]
fn extra_bytes_of_other_names_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["a", "b"].map(|name| folder.path().join(name));
    for (path, name) in paths.iter().zip(["One", "Two"]) {
        let schema = Arc::new(layout(6, &[(name.to_owned(), Scalar::U8)], [0.01; 3], [0.0; 3]));
        file(path, &schema, &fresh(&schema, None), 0);
    }
    refused(&paths, "extra bytes");
}

#[test]
fn differing_header_fields_become_neutral_and_equal_ones_are_carried() {
    let folder = tempfile::tempdir().unwrap();
    let paths = pair(folder.path());
    for (path, id, day, year) in [(&paths[0], 7u8, 300u16, 2019u16), (&paths[1], 8, 12, 2020)] {
        patch(path, 4, &[id, 0]);
        patch(path, 8, &[id; 16]);
        patch(path, 26, &[b'A' + id; 10]);
        patch(path, 90, &[day.to_le_bytes(), year.to_le_bytes()].concat());
    }
    let mut outputs = Vec::new();
    for order in [[0, 1], [1, 0]] {
        let source = open(&order.map(|i: usize| paths[i].clone())).unwrap();
        let out = folder.path().join("out.las");
        let mut records = read_source(&*source, 100).unwrap();
        let stride = source.schema().stride;
        let mut sorted: Vec<&[u8]> = records.chunks_exact(stride).collect();
        sorted.sort();
        records = sorted.concat();
        write(&out, LAS, source.schema(), source.metadata(), &records).unwrap();
        outputs.push(std::fs::read(out).unwrap());
    }
    assert!(outputs[0] == outputs[1], "the order of inputs must not matter");
    let out = &outputs[0];
    assert_eq!(out[4..6], [0, 0], "source id");
    assert_eq!(out[8..24], [0; 16], "GUID");
    assert_eq!(&out[26..32], b"MERGE\0");
    assert_eq!(&out[58..67], b"pointmill", "both say the same software");
    assert_eq!(out[90..94], [12, 0, 0xe4, 0x07], "the later date: day 12 of 2020");
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn unlike_records_are_united_in_one_order() {
    let scans = scans();
    // The same points twice; one has been given one more record by LAStools.
    let folder = tempfile::tempdir().unwrap();
    let paths = ["a.las", "b.las"].map(|name| folder.path().join(name));
    let original = scans.join("lasR/Example.las");
    std::fs::copy(&original, &paths[0]).unwrap();
    std::fs::copy(&original, &paths[1]).unwrap();
    // Rename the second record's user in one copy: the lists differ.
    let bytes = std::fs::read(&original).unwrap();
    let at = bytes.windows(16).rposition(|w| w == b"LAStools\0\0\0\0\0\0\0\0").unwrap();
    patch(&paths[1], at, b"AAStools");
    let mut heads = Vec::new();
    for order in [[0, 1], [1, 0]] {
        let source = open(&order.map(|i: usize| paths[i].clone())).unwrap();
        let out = folder.path().join("out.las");
        write(&out, LAS, source.schema(), source.metadata(), &[]).unwrap();
        let about = pointmill::internals::las::describe(&out).unwrap();
        let users: Vec<_> = about.vlrs.iter().map(|v| v.user_id.clone()).collect();
        assert_eq!(users, ["AAStools", "LASF_Projection", "LAStools"]);
        heads.push(std::fs::read(out).unwrap());
    }
    assert!(heads[0] == heads[1]);
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn a_scan_cut_into_files_is_the_scan() {
    let scans = scans();
    let folder = tempfile::tempdir().unwrap();
    let whole = open(&[scans.join("laspy/1_4_w_evlr.laz")]).unwrap();
    let records = read_source(&*whole, usize::MAX / 4096).unwrap();
    let stride = whole.schema().stride;
    let paths = ["1.laz", "2.las", "3.laz"].map(|name| folder.path().join(name));
    let cuts = [0, 1, 400, records.len() / stride];
    for (i, path) in paths.iter().enumerate() {
        let options = if i == 1 { LAS } else { LAZ };
        let records = &records[cuts[i] * stride..cuts[i + 1] * stride];
        write(path, options, whole.schema(), whole.metadata(), records).unwrap();
    }
    let (source, again) = read_files(&paths).unwrap();
    assert!(again == records);
    let outputs = [whole.metadata(), source.metadata()].map(|metadata| {
        let out = folder.path().join("out.laz");
        write(&out, LAZ, whole.schema(), metadata, &records).unwrap();
        std::fs::read(out).unwrap()
    });
    assert!(outputs[0] == outputs[1]);
}
