//! Layers of LAZ that nobody looks at are not decoded, and no output tells.

use std::path::Path;
use std::sync::Arc;

use crate::support::command::done;
use crate::support::las::{LAS, LAZ, write};
use crate::support::random::Random;
use crate::support::records::read_source;
use pointmill::io::las::{fresh, layout, open};
use pointmill::point::{PointBatch, Scalar, Schema, names};

const POINTS: usize = 60_000;

/// A scan whose fields all vary, as LAS and as LAZ.
fn scan(folder: &Path, format: u8) -> Schema {
    let extra = [("Amplitude".to_owned(), Scalar::U16), ("Width".to_owned(), Scalar::F32)];
    let schema = Arc::new(layout(format, &extra, [0.01; 3], [0.0; 3]));
    let mut random = Random(u64::from(format) + 7);
    let mut records = random.bytes(POINTS * schema.stride);
    for record in records.chunks_exact_mut(schema.stride) {
        // Returns and channels as they come, the rest of the record noise.
        record[14] = 0x11 + (record[14] & 3);
        record[15] &= 0xdf;
        // A place in a file of waveforms: PLY holds it as a double, if it is not beyond 2^53.
        if let Some(place) = schema.find(names::WAVE_OFFSET) {
            record[place.offset + 4..place.offset + 8].fill(0);
        }
    }
    let metadata = fresh(&schema, None);
    for (name, options) in [("scan.las", LAS), ("scan.laz", LAZ)] {
        write(&folder.join(name), options, &schema, &metadata, &records).unwrap();
    }
    (*schema).clone()
}

fn converted(folder: &Path, input: &str, output: &str, drop: &str) -> Vec<u8> {
    done(folder, &["convert", input, "-o", output, "--drop", drop, "--quiet", "--no-provenance"]);
    std::fs::read(folder.join(output)).unwrap()
}

#[test]
fn what_is_dropped_need_not_be_decoded() {
    for format in [6, 7, 8, 9, 10] {
        let folder = tempfile::tempdir().unwrap();
        let schema = scan(folder.path(), format);
        let own = |d: &&pointmill::point::Dimension| d.offset >= 12;
        let names: Vec<String> =
            schema.dimensions.iter().filter(own).map(|d| d.name.clone()).collect();
        let mut choices = vec![names.join(",")];
        choices.extend(names.chunks(3).map(|some| some.join(",")));
        for drop in choices {
            let one = converted(folder.path(), "scan.las", "one.ply", &drop);
            let two = converted(folder.path(), "scan.laz", "two.ply", &drop);
            assert!(one == two, "format {format} without {drop}");
        }
    }
}

#[test]
fn layers_are_left_out_and_no_other_field_changes() {
    let folder = tempfile::tempdir().unwrap();
    let schema = scan(folder.path(), 8);
    let source = open(&[folder.path().join("scan.laz")]).unwrap();
    let all = read_source(&*source, POINTS).unwrap();
    let unread = ["Intensity", "GpsTime", "Nir", "Red", "Green", "Amplitude", "Width"];
    let unread = unread.map(str::to_owned);
    let mut batch = PointBatch::new(source.schema().clone(), 50_000);
    source.part_without(0, &unread).unwrap().read(&mut batch).unwrap();
    for dimension in &schema.dimensions {
        let of = |records: &[u8]| -> Vec<_> {
            let records = records.chunks_exact(schema.stride).take(batch.len());
            records.map(|record| dimension.get(record, schema.endian)).collect()
        };
        // Red and Green share a layer with Blue, which is read.
        let left_out = ["Intensity", "GpsTime", "Nir", "Amplitude", "Width"];
        let (is, was) = (of(batch.records()), of(&all));
        let same = format!("{is:?}") == format!("{was:?}");
        assert_eq!(same, !left_out.contains(&dimension.name.as_str()), "{}", dimension.name);
    }
}
