//! Every point format, plain and compressed, with and without extra bytes: what goes in comes out.

use std::sync::Arc;

use crate::support::las::{LAS, LAZ, normals, read_files, write};
use crate::support::random::Random;
use pointmill::internals::las::LasOptions;
use pointmill::io::las::{fresh, layout};
use pointmill::point::{GpsTime, Metadata, Scalar, Schema, names};

/// Records as scanners make them (runs, repeats, small steps) among ones of random bytes.
fn records(schema: &Schema, points: usize, random: &mut Random) -> Vec<u8> {
    let mut all = Vec::new();
    let mut record = random.bytes(schema.stride);
    for i in 0..points {
        match i % 4 {
            0 => record = random.bytes(schema.stride),
            1 => record[0] = record[0].wrapping_add(3),
            2 => {
                let at = random.below(schema.stride);
                record[at] = random.number() as u8;
            }
            _ => {}
        }
        all.extend_from_slice(&record);
    }
    all
}

fn extra(with: bool) -> Vec<(String, Scalar)> {
    let names = [("Amplitude", Scalar::F32), ("Deviation", Scalar::U16), ("Class 2", Scalar::U8)];
    names.iter().filter(|_| with).map(|(name, scalar)| ((*name).to_owned(), *scalar)).collect()
}

fn comes_back(format: u8, options: LasOptions, with_extra: bool) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan");
    let schema = Arc::new(layout(format, &extra(with_extra), [0.01, 0.01, 0.001], [5e5, 4e6, 0.0]));
    let metadata = fresh(&schema, None);
    let mut random = Random(u64::from(format) + 1);
    for points in [0, 1, 2, 50_001] {
        let written = records(&schema, points, &mut random);
        let summary = write(&path, options.clone(), &schema, &metadata, &written).unwrap();
        assert_eq!(summary.points, points as u64);
        assert_eq!(summary.bytes, std::fs::metadata(&path).unwrap().len());
        let (source, read) = read_files(std::slice::from_ref(&path)).unwrap();
        assert_eq!(source.points(), points as u64);
        assert_eq!(**source.schema(), *schema);
        assert!(read == written, "{points} points differ");
        assert!(source.warnings().is_empty(), "{:?}", source.warnings());
    }
}

macro_rules! matrix {
    ($($name:ident $format:literal)*) => { $(mod $name {
        use super::*;
        #[test]
        fn comes_back_plain() { comes_back($format, LAS, false); }
        #[test]
        fn comes_back_compressed() { comes_back($format, LAZ, false); }
        #[test]
        fn comes_back_plain_with_extra_bytes() { comes_back($format, LAS, true); }
        #[test]
        fn comes_back_compressed_with_extra_bytes() { comes_back($format, LAZ, true); }
    })* };
}

matrix! {
    format_0 0 format_1 1 format_2 2 format_3 3 format_4 4 format_5 5
    format_6 6 format_7 7 format_8 8 format_9 9 format_10 10
}

#[test]
fn the_same_records_make_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let schema = Arc::new(layout(7, &extra(true), [0.01; 3], [0.0; 3]));
    let metadata = fresh(&schema, None);
    let written = records(&schema, 60_000, &mut Random(3));
    let bytes = ["a", "b"].map(|name| {
        let path = folder.path().join(name);
        write(&path, LAZ, &schema, &metadata, &written).unwrap();
        std::fs::read(path).unwrap()
    });
    assert!(bytes[0] == bytes[1]);
}

#[test]
fn counts_and_box_are_those_of_the_points() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.las");
    let schema = Arc::new(layout(1, &[], [0.5, 0.25, 2.0], [100.0, 0.0, -1.0]));
    let mut records = vec![0u8; 3 * schema.stride];
    for (i, record) in records.chunks_exact_mut(schema.stride).enumerate() {
        for axis in 0..3 {
            record[4 * axis..4 * axis + 4].copy_from_slice(&(i as i32 * 10 - 10).to_le_bytes());
        }
        record[14] = [1, 1, 7][i];
    }
    write(&path, LAS, &schema, &fresh(&schema, None), &records).unwrap();
    let about = pointmill::internals::las::describe(&path).unwrap();
    assert_eq!((about.min, about.max), ([95.0, -2.5, -21.0], [105.0, 2.5, 19.0]));
    let bytes = std::fs::read(&path).unwrap();
    let u32_at = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let u64_at = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    assert_eq!((u32_at(107), u32_at(111), u32_at(115)), (3, 2, 0), "legacy counts");
    assert_eq!((u64_at(247), u64_at(255), u64_at(255 + 48)), (3, 2, 1), "1.4 counts");
}

#[test]
fn legacy_counts_are_zero_for_format_6() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.las");
    let schema = Arc::new(layout(6, &[], [0.01; 3], [0.0; 3]));
    write(&path, LAS, &schema, &fresh(&schema, None), &[0x11; 60]).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert!(bytes[107..131].iter().all(|b| *b == 0));
    assert_eq!(bytes[247], 2);
    assert_eq!(bytes[255], 2);
}

#[test]
fn normals_come_behind_undescribed_bytes_and_are_then_overwritten_in_place() {
    let folder = tempfile::tempdir().unwrap();
    let (first, second) = (folder.path().join("1.laz"), folder.path().join("2.laz"));
    // No native header: the three bytes of the schema are described anew, the normals behind them.
    let schema = Arc::new(layout(6, &[("A".to_owned(), Scalar::U16)], [0.01; 3], [0.0; 3]));
    let options = LasOptions { compressed: true, computed: normals() };
    let records = vec![7u8; schema.stride * 5];
    write(&first, options.clone(), &schema, &Metadata::default(), &records).unwrap();
    let (source, with_normals) = read_files(std::slice::from_ref(&first)).unwrap();
    let schema = source.schema().clone();
    assert_eq!(schema.stride, 30 + 2 + 12);
    let [nx, ny, nz] = names::NORMAL.map(|name| schema.find(name).unwrap().clone());
    let last = &with_normals[4 * schema.stride..];
    assert_eq!(nx.world(last, schema.endian), 4.0);
    assert_eq!(ny.world(last, schema.endian), 0.5);
    assert!(nz.world(last, schema.endian).is_nan());
    assert_eq!(&last[..32], &[7; 32]);

    let mut zeroed = with_normals.clone();
    zeroed.chunks_exact_mut(schema.stride).for_each(|r| r[32..].fill(0));
    write(&second, options, &schema, source.metadata(), &zeroed).unwrap();
    let (source, again) = read_files(std::slice::from_ref(&second)).unwrap();
    assert_eq!(source.schema(), &schema, "no second normals");
    assert!(again == with_normals);
}

#[test]
fn normals_that_nobody_computed_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let schema = Arc::new(layout(0, &[], [0.01; 3], [0.0; 3]));
    let options = LasOptions { compressed: false, computed: normals() };
    let sink = pointmill::internals::las::create(
        &folder.path().join("x"),
        &options,
        &schema,
        &Metadata::default(),
    )
    .unwrap();
    let mut batch = pointmill::point::PointBatch::new(schema.clone(), 1);
    batch.extend(&[0; 20]);
    let error = sink.encoder().encode(&batch).unwrap_err();
    assert!(error.to_string().contains("NormalX is to be written and not computed"), "{error}");
}

#[test]
fn wkt_is_carried_and_another_crs_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.las");
    let schema = Arc::new(layout(7, &[], [0.01; 3], [0.0; 3]));
    let cases = [
        ("PROJCS[\"Lambert-93\"]", true, None),
        ("EPSG:2154", true, None),
        ("EPSG:4979", true, Some("asks for WKT")),
        ("a field of ours", false, Some("not carried")),
    ];
    for (crs, carried, told) in cases {
        let mut metadata = fresh(&schema, Some(crs));
        metadata.gps_time = Some(GpsTime::Week);
        let summary = write(&path, LAS, &schema, &metadata, &[]).unwrap();
        let about = pointmill::internals::las::describe(&path).unwrap();
        assert_eq!(about.crs.is_some(), carried);
        assert_eq!(summary.notes.len(), usize::from(told.is_some()), "{:?}", summary.notes);
        assert!(summary.notes.iter().all(|note| note.contains(told.unwrap())), "{crs}");
    }
}
