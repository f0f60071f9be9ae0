//! The rules of LAS that `validate` holds files to: none is without a file that breaks it.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use super::validate::{Change, broken, rules, told, word};
use crate::support::command::done;
use crate::support::las_file::{Beside, Header, STRIDES, extend, extra_bytes};

/// Rules that changes of single fields break.
fn of_fields(at: &Path) -> BTreeSet<String> {
    done(at, &["synth", "als", "-n", "3k", "-o", "scan.las"]);
    done(at, &["convert", "scan.las", "-o", "new.las", "--point-format", "7", "--quiet"]);
    let bytes = fs::read(at.join("new.las")).unwrap();
    let point = word(&bytes, 96);
    let nan = f64::NAN.to_le_bytes();
    let far = 1e300f64.to_le_bytes();
    let float = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    let middle = f64::midpoint(float(179), float(187)).to_le_bytes();
    let big = u32::MAX.to_le_bytes();
    let changes: &[Change<'_>] = &[
        ("version", 25, &[9]),
        ("global-encoding", 6, &[0xff, 0xff]),
        ("wkt-bit", 6, &[1, 0]),
        ("waveform-bits", 6, &[0b10011, 0]),
        ("waveform-start", 227, &[1, 1]),
        ("identifier-padding", 57, b"x"),
        ("creation-date", 90, &[0xff, 1]),
        ("header-size", 94, &[100, 0]),
        ("points-start", 96, &big),
        ("point-format", 104, &[11]),
        ("compressed", 104, &[0x87]),
        ("record-length", 105, &[20, 0]),
        ("point-count", 247, &big),
        ("legacy-count", 107, &[7]),
        ("legacy-returns", 111, &[7]),
        ("returns", 255, &[7]),
        ("scale", 131, &nan),
        ("odd-scale", 131, &0.0123f64.to_le_bytes()),
        ("offset", 155, &nan),
        ("box-order", 179, &nan),
        ("box", 179, &middle),
        ("loose-box", 179, &far),
        ("vlrs", 100, &[200]),
        ("evlr-start", 235, &[77]),
        ("evlrs", 243, &[3]),
        ("return-zero", point + 14, &[0x10]),
        ("return-beyond", point + 14, &[0x12]),
        ("class", point + 16, &[60]),
        ("scan-angle", point + 18, &[0xff, 0x7f]),
        ("gps-time", point + 22, &nan),
    ];
    broken(at, "new.las", "las", changes)
}

/// A file of LAS 1.`minor` with three points of zeros in `format` but for return numbers, and more
/// bytes behind each.
fn made(minor: u8, format: u8, extra: usize, vlrs: &[Beside], evlrs: &[Beside]) -> Vec<u8> {
    let stride = STRIDES[usize::from(format)] + extra;
    let mut record = vec![0; stride];
    record[14] = if format < 6 { 0b1001 } else { 0x11 };
    let records = record.repeat(3);
    let scale = [0.01; 3];
    let header = Header { minor, format, is_compressed: false, stride, scale, offset: [0.0; 3] };
    let mut file = header.bytes(vlrs, &records);
    let counts = if minor >= 4 { 255 } else { 111 };
    file[counts] = 3;
    file.extend(&records);
    extend(&mut file, evlrs);
    file
}

/// The file with other bytes at some places.
fn with(mut file: Vec<u8>, changes: &[(usize, &[u8])]) -> Vec<u8> {
    for (at, bytes) in changes {
        file[*at..*at + bytes.len()].copy_from_slice(bytes);
    }
    file
}

fn of_system(record: u16, payload: &[u8]) -> Beside {
    Beside { user: "LASF_Projection", record, payload: payload.to_vec() }
}

/// A descriptor of extra bytes: its kind, options and name.
fn described(kind: u8, options: u8, name: &str) -> Beside {
    let mut payload = vec![0; 192];
    (payload[2], payload[3]) = (kind, options);
    payload[4..4 + name.len()].copy_from_slice(name.as_bytes());
    payload[88..96].copy_from_slice(&(-5i64).to_le_bytes());
    Beside { user: "LASF_Spec", record: 4, payload }
}

/// Files made for a rule each.
fn of_records() -> Vec<(&'static str, Vec<u8>)> {
    let plain = |minor, format| made(minor, format, 0, &[], &[]);
    let one = |vlr: Beside, extra| made(4, 6, extra, &[vlr], &[]);
    let keys: Vec<u8> = [1u16, 1, 0, 2, 3072, 0, 1, 25832, 1024, 0, 1, 1]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    let wkt = of_system(2112, b"PROJCS[\"a\",UNIT[\"metre\",1]]\0");
    let point = 375;
    let mut gap = plain(4, 6);
    gap.splice(point..point, [0; 5]);
    let mut behind = plain(4, 6);
    behind.extend([0; 3]);
    let mut long = gap.clone();
    long[94] += 5;
    let times = |bit: u8, time: f64| {
        with(plain(4, 6), &[(6, &[16 | bit]), (point + 22, &time.to_le_bytes())])
    };
    let none = Header {
        minor: 4,
        format: 6,
        is_compressed: false,
        stride: 30,
        scale: [0.01; 3],
        offset: [0.0; 3],
    };
    vec![
        ("wkt-text", one(of_system(2112, b"PROJCS[\"a\"\0"), 0)),
        ("wkt-end", one(of_system(2112, b"PROJCS[\"a\"]"), 0)),
        ("wkt-version", one(of_system(2112, b"PROJCRS[\"a\"]\0"), 0)),
        ("geotiff-keys", made(2, 1, 0, &[of_system(34735, &keys)], &[])),
        ("crs-kind", one(of_system(34735, &keys[..16]), 0)),
        ("wkt-bit", with(one(wkt.clone(), 0), &[(6, &[0])])),
        ("vlr-twice", made(4, 6, 0, &[wkt.clone(), wkt], &[])),
        ("extra-bytes-type", one(described(31, 0, "a"), 2)),
        ("extra-bytes-deprecated", one(described(11, 0, "a"), 2)),
        ("extra-bytes-name", one(described(3, 0, ""), 2)),
        ("extra-bytes-options", one(described(3, 0x80, "a"), 2)),
        ("extra-bytes-range", one(described(4, 4, "a"), 2)),
        ("extra-bytes-length", one(extra_bytes().0, 4)),
        ("extra-bytes-undescribed", made(4, 6, 7, &[], &[])),
        ("extra-bytes-records", made(4, 6, 13, &[extra_bytes().0, described(1, 0, "b")], &[])),
        ("gap", with(gap, &[(96, &[0x7c])])),
        ("header-bytes", with(long, &[(96, &[0x7c])])),
        ("behind", behind),
        ("reserved", with(plain(1, 1), &[(6, &[1])])),
        ("file-source-id", with(plain(4, 6), &[(4, &[0, 0])])),
        ("identifier", with(plain(4, 6), &[(58, &[0; 32])])),
        ("no-creation-date", with(plain(4, 6), &[(90, &[0; 4])])),
        ("no-points", none.bytes(&[], &[])),
        ("colors", with(plain(4, 7), &[(point + 30, &[200])])),
        ("gps-time-week", times(1, 100.0)),
        ("gps-time-bit", times(0, 1e9)),
        ("no-waveforms", plain(3, 4)),
        ("waveform-file", with(plain(3, 4), &[(6, &[4])])),
        ("las-unread", with(plain(4, 6), &[(100, &[99])])),
        ("no-crs", plain(4, 6)),
        ("offset-steps", with(plain(4, 6), &[(155, &0.0037f64.to_le_bytes())])),
        ("coarse-coordinates", with(plain(4, 6), &[(point, &[20])])),
        ("same-values", plain(4, 7)),
        ("return-above", with(plain(2, 1), &[(227 + 14, &[6 | 7 << 3])])),
        ("point-source-id", with(plain(4, 6), &[(point + 20, &[9])])),
        ("waveform-descriptor", with(plain(3, 4), &[(235 + 28, &[3])])),
    ]
}

/// Compressed files that are damaged, a rule each.
fn of_compressed(at: &Path) -> Vec<(&'static str, Vec<u8>)> {
    done(at, &["synth", "als", "-n", "20k", "-o", "scan.laz"]);
    let whole = fs::read(at.join("scan.laz")).unwrap();
    let (start, middle) = (word(&whole, 96), whole.len() / 2);
    let record = whole.windows(14).position(|bytes| bytes == b"laszip encoded").unwrap();
    vec![
        ("points", with(whole.clone(), &[(middle, &[0xa5; 400])])),
        ("chunk-table", with(whole.clone(), &[(start, &[0xff; 8])])),
        ("las-readable", with(whole, &[(record + 52 + 2, &[9])])),
    ]
}

#[test]
fn no_rule_of_las_is_without_a_file_that_breaks_it() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let mut met = of_fields(at);
    for (rule, bytes) in of_records().into_iter().chain(of_compressed(at)) {
        fs::write(at.join("made.las"), bytes).unwrap();
        let (one, _, names) = told(at, "made.las");
        assert!(names.contains(rule), "{rule}: {one:#}");
        met.extend(names);
    }
    let all = rules("las");
    let other: Vec<_> = all.difference(&met).collect();
    assert!(other.is_empty(), "no file breaks {other:?}");
    // A file that is made by the book breaks none that matters.
    fs::write(at.join("made.las"), made(4, 6, 0, &[], &[])).unwrap();
    let (one, _, names) = told(at, "made.las");
    let names: Vec<String> = names.into_iter().collect();
    assert_eq!(names, ["coarse-coordinates", "no-crs", "same-values"], "{one:#}");
}

#[test]
fn a_point_is_told_with_its_number_and_its_byte() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let byte = 375 + 30 + 14;
    fs::write(at.join("made.las"), with(made(4, 6, 0, &[], &[]), &[(byte, &[0x12])])).unwrap();
    let (one, ..) = told(at, "made.las");
    let finding = one["findings"].as_array().unwrap().iter();
    let finding = finding.into_iter().find(|f| f["name"] == "return-beyond").unwrap();
    let place = &finding["places"][0];
    assert_eq!((&place["point"], &place["byte"]), (&1.into(), &byte.into()));
    assert_eq!((&place["found"], &finding["count"]), (&"2 of 1".into(), &1.into()));
}
