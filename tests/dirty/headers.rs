//! LAS, LAZ and PLY files whose headers, records or counts lie: each is refused with path, byte and
//! remedy and leaves nothing behind, or is read whole with a warning.

use std::path::{Path, PathBuf};

use crate::support::assert_holds;
use crate::support::las_file::{Beside, LasFile, STRIDES};
use crate::support::records::read;
use crate::support::setup::{Setup, convert, reduce};
use laz::{LasZipCompressor, LazVlr};
use pointmill::ErrorKind;

const POINTS: usize = 400;

/// Records of a waved square, X fastest; `stride` bytes each.
fn records(stride: usize) -> Vec<u8> {
    let mut all = Vec::new();
    for i in 0..POINTS as i32 {
        let mut record = vec![0; stride];
        for (axis, value) in [i % 20 * 50, i / 20 * 50, i * i % 31].into_iter().enumerate() {
            record[4 * axis..4 * axis + 4].copy_from_slice(&value.to_le_bytes());
        }
        record[14] = 0x11;
        all.extend(record);
    }
    all
}

/// A LAS 1.4 file with a record in front of its points and one behind.
fn las(format: u8) -> Vec<u8> {
    let stride = STRIDES[usize::from(format)];
    let beside = [Beside { user: "test", record: 7, payload: vec![1; 10] }];
    let records = records(stride);
    let file = LasFile {
        format,
        stride,
        scale: [0.01; 3],
        offset: [0.0; 3],
        vlrs: &beside,
        evlrs: &beside,
        records: &records,
    };
    file.bytes()
}

/// The same points as LAZ.
fn laz(format: u8) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let [from, to] = ["a.las", "a.laz"].map(|name| folder.path().join(name));
    std::fs::write(&from, las(format)).unwrap();
    convert(&[from], &to, &Setup::new(&[])).unwrap();
    std::fs::read(to).unwrap()
}

/// The same points as LAZ in chunks of 100, 7, 100, 7, … points, as the chunk table alone tells.
fn laz_of_varying_chunks(format: u8) -> Vec<u8> {
    let whole = laz(format);
    let start = word(&whole, 96);
    let payload = 52 + whole.windows(14).position(|w| w == b"laszip encoded").unwrap();
    // This chunk size means "as the table says".
    let mut file = std::io::Cursor::new(put(&whole[..start], payload + 12, &[0xff; 4]));
    file.set_position(start as u64);
    let laszip = LazVlr::read_from(&file.get_ref()[payload..]).unwrap();
    assert!(laszip.uses_variable_size_chunks());
    let mut encoder = LasZipCompressor::new(file, laszip).unwrap();
    let stride = STRIDES[usize::from(format)];
    for (i, record) in records(stride).chunks(stride).enumerate() {
        encoder.compress_one(record).unwrap();
        if [99, 106].contains(&(i % 107)) {
            encoder.finish_current_chunk().unwrap();
        }
    }
    encoder.done().unwrap();
    let file = encoder.into_inner().into_inner();
    // No records behind the points, where those of the file with fixed chunks were.
    put(&file, 235, &[0; 12])
}

fn put(bytes: &[u8], at: usize, what: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[at..at + what.len()].copy_from_slice(what);
    bytes
}

fn word(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

fn long(bytes: &[u8], at: usize) -> usize {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize
}

/// A folder with one input of these bytes.
fn input(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

/// Asserts that a file is refused by both sorts of runs: a message with `says`, at `byte`, and a
/// remedy.
fn refused(what: &str, name: &str, bytes: &[u8], byte: Option<usize>, says: &str) {
    let (folder, path) = input(name, bytes);
    let output = folder.path().join("out").with_extension(path.extension().unwrap());
    for run in [reduce, convert] {
        let error = run(std::slice::from_ref(&path), &output, &Setup::new(&[])).expect_err(what);
        assert_eq!(error.path(), Some(path.as_path()), "{what}: {error:?}");
        assert_eq!(error.kind(), ErrorKind::Data, "{what}: {error:?}");
        assert!(error.to_string().contains(says), "{what}: {error:?}");
        assert!(error.remedy().is_some(), "{what}: {error:?}");
        assert!(error.byte().is_some(), "{what}: {error:?}");
        if let Some(byte) = byte {
            assert_eq!(error.byte(), Some(byte as u64), "{what}: {error:?}");
        }
        assert_holds(folder.path(), &[name]);
    }
}

/// Asserts that a file is read whole, that a warning says `says` (none where that is empty), and that
/// what comes out is what comes out of `good`.
fn reads_as(what: &str, name: &str, bytes: &[u8], good: &[u8], says: &str) {
    let outputs = [bytes, good].map(|bytes| {
        let (folder, path) = input(name, bytes);
        let output = folder.path().join("out").with_extension(path.extension().unwrap());
        let done =
            reduce(&[path], &output, &Setup::new(&[])).unwrap_or_else(|e| panic!("{what}: {e:?}"));
        let warnings = done.report.run.warnings.clone();
        (std::fs::read(output).unwrap(), warnings.join("\n"))
    });
    let [(out, warned), (expected, _)] = outputs;
    assert!(out == expected, "{what}: another output");
    assert!(warned.contains(says) && warned.is_empty() == says.is_empty(), "{what}: {warned}");
}

#[test]
fn a_file_cut_anywhere_in_its_head_is_refused() {
    for (name, whole) in [("in.las", las(6)), ("in.laz", laz(6)), ("in.laz", laz(1))] {
        let start = word(&whole, 96);
        for cut in [0, 1, 4, 100, 226, 227, 374, 375, 376, start - 1, start, start + 7, start + 40]
        {
            refused(&format!("{name} cut at {cut}"), name, &whole[..cut], None, "");
        }
    }
    let whole = las(6);
    let points_end = word(&whole, 96) + POINTS * STRIDES[6];
    let cut = points_end - 5;
    // The extended records are missed before the points are.
    refused("cut in the points", "in.las", &whole[..cut], Some(243), "do not fit");
    let plain = put(&whole, 243, &[0; 4]);
    refused("cut in the points", "in.las", &plain[..cut], Some(cut), "after 399 of the 400 points");
}

#[test]
fn counts_that_lie_are_told() {
    let whole = las(6);
    let more = put(&whole, 247, &4_000_000_000_000u64.to_le_bytes());
    refused("points", "in.las", &more, None, "of the 4,000,000,000,000 points");
    let packed = laz(6);
    for count in [401u64, 50_000, u64::MAX] {
        let lie = put(&packed, 247, &count.to_le_bytes());
        refused(&format!("{count} LAZ points"), "in.laz", &lie, None, "");
    }
    let legacy = laz(1);
    for count in [401u64, 1 << 40] {
        let lie = put(&legacy, 247, &count.to_le_bytes());
        refused(&format!("{count} LAZ points"), "in.laz", &lie, None, "");
    }
    // A point behind those that are counted is told as such, as in plain files.
    let one_less = put(&las(1), 247, &399u64.to_le_bytes());
    let lie = put(&legacy, 247, &399u64.to_le_bytes());
    let out = |name: &str, bytes: &[u8]| {
        let (folder, path) = input(name, bytes);
        let output = folder.path().join("out.las");
        let done = reduce(&[path], &output, &Setup::new(&[])).unwrap();
        let warned = done.report.run.warnings.join("\n");
        assert!(warned.contains("that the header counts are not read"), "{name}: {warned}");
        std::fs::read(output).unwrap()
    };
    assert_eq!(out("in.laz", &lie), out("in.las", &one_less));
    // Never a file without points where the points are.
    let none = put(&put(&whole, 247, &[0; 8]), 107, &[0; 4]);
    refused("no points", "in.las", &none, Some(107), "counts no points and 12000 bytes");
    for packed in [packed, legacy] {
        let none = put(&put(&packed, 247, &[0; 8]), 107, &[0; 4]);
        refused("no LAZ points", "in.laz", &none, Some(107), "counts no points");
    }
    let fewer = put(&whole, 247, &380u64.to_le_bytes());
    let start = word(&whole, 96);
    let end = start + 380 * STRIDES[6];
    let mut cut = put(&fewer, 235, &(end as u64).to_le_bytes());
    cut.drain(end..start + POINTS * STRIDES[6]);
    let warning = "600 bytes behind the 380 points that the header counts are not read";
    reads_as("fewer points", "in.las", &fewer, &cut, warning);
}

#[test]
fn the_older_count_serves_where_the_newer_is_empty() {
    let whole = las(1);
    assert_eq!(word(&whole, 107), POINTS);
    let legacy = put(&whole, 247, &[0; 8]);
    let warning = "counts 0 points and, in the field for older readers, 400: 400 are read";
    reads_as("legacy count", "in.las", &legacy, &whole, warning);
}

#[test]
fn records_beside_the_points_that_lie_are_refused() {
    for (name, whole) in [("in.las", las(6)), ("in.laz", laz(6))] {
        let size = 375;
        let evlr = long(&whole, 235);
        for count in [3u32, 1000, u32::MAX] {
            let lie = put(&whole, 100, &count.to_le_bytes());
            refused(&format!("{count} VLRs"), name, &lie, None, "");
        }
        refused(
            "VLR length",
            name,
            &put(&whole, size + 20, &[255, 255]),
            Some(size),
            "has 65535 bytes",
        );
        for count in [2u32, 1000, u32::MAX] {
            let lie = put(&whole, 243, &count.to_le_bytes());
            refused(&format!("{count} EVLRs"), name, &lie, None, "");
        }
        for length in [1u64 << 20, u64::MAX, u64::MAX - 59, 1 << 63] {
            let lie = put(&whole, evlr + 20, &length.to_le_bytes());
            refused("EVLR length", name, &lie, Some(evlr + 20), "claims");
        }
        for start in [0u64, 5, whole.len() as u64, u64::MAX] {
            let lie = put(&whole, 235, &start.to_le_bytes());
            refused("EVLR start", name, &lie, Some(243), "do not fit");
        }
        for start in [0u32, 374, u32::MAX] {
            let lie = put(&whole, 96, &start.to_le_bytes());
            refused("points start", name, &lie, Some(96), "cannot start");
        }
    }
}

#[test]
fn a_great_many_tiny_records_are_refused_and_not_held() {
    let whole = las(6);
    let start = word(&whole, 96);
    let count = 300_000u32;
    let mut many = put(&whole[..start + POINTS * STRIDES[6]], 243, &count.to_le_bytes());
    many.resize(many.len() + 60 * count as usize, 0);
    refused("EVLRs", "in.las", &many, Some(243), "more than the 16384 held");
    let mut many = put(&whole[..375], 100, &1_300_000u32.to_le_bytes());
    let bytes = 1_300_000 * 54;
    many = put(&many, 96, &(375 + bytes as u32).to_le_bytes());
    many.resize(375 + bytes, 0);
    many.extend(records(STRIDES[6]));
    refused("VLRs", "in.las", &put(&many, 243, &[0; 4]), Some(100), "more than the 16384 held");
}

#[test]
fn boxes_are_hints_and_nothing_else() {
    for (name, whole) in [("in.las", las(6)), ("in.laz", laz(6))] {
        for value in [8e8, -8e8, f64::NAN, f64::INFINITY, f64::MAX, 0.0] {
            let lie: Vec<u8> = (0..6)
                .flat_map(|i| if i % 2 == 0 { value } else { -value }.to_le_bytes())
                .collect();
            // A wide one may be that of a file that had more points.
            let says = if value == 8e8 { "" } else { "the header has no box of the points" };
            reads_as(&format!("a box of {value}"), name, &put(&whole, 179, &lie), &whole, says);
        }
    }
}

#[test]
fn scales_and_offsets_that_place_nothing_are_refused() {
    let whole = las(6);
    for axis in 0..3 {
        for scale in [0.0f64, -0.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, f64::MAX] {
            let lie = put(&whole, 131 + 8 * axis, &scale.to_le_bytes());
            refused(&format!("scale {scale}"), "in.las", &lie, Some(131), "places no point");
        }
        for offset in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let lie = put(&whole, 155 + 8 * axis, &offset.to_le_bytes());
            refused(&format!("offset {offset}"), "in.las", &lie, Some(131), "places no point");
        }
    }
}

#[test]
fn scales_that_are_odd_are_told_and_taken_as_they_are() {
    let whole = las(6);
    for (scale, says) in [(-0.01f64, "is negative"), (1e-12, "below 1e-9")] {
        let lie = put(&whole, 131, &scale.to_le_bytes());
        let (folder, path) = input("in.las", &lie);
        let output = folder.path().join("out.las");
        let done = reduce(std::slice::from_ref(&path), &output, &Setup::new(&[])).unwrap();
        assert!(done.report.run.warnings.join("\n").contains(says), "{scale}");
        assert_eq!(done.report.result.ledger.read, POINTS as u64);
        convert(&[path], &output, &Setup::new(&[])).unwrap();
        assert!(read(&output).1 == records(STRIDES[6]), "{scale}: a copy differs");
    }
}

#[test]
fn an_offset_far_away_names_the_first_point_beyond() {
    let (folder, path) = input("in.las", &put(&las(6), 155, &1e300f64.to_le_bytes()));
    let output = folder.path().join("out.las");
    let error = reduce(std::slice::from_ref(&path), &output, &Setup::new(&[])).unwrap_err();
    assert_eq!(error.path(), Some(path.as_path()));
    assert!(
        error.to_string().contains("1e300") && error.to_string().contains("beyond the lattice")
    );
    assert!(error.remedy().unwrap().contains("lattice"));
    assert_holds(folder.path(), &["in.las"]);
}

#[test]
fn chunk_tables_that_lie_or_lack_cost_speed_and_no_point() {
    for format in [1, 3, 6, 7] {
        let whole = laz(format);
        let start = word(&whole, 96);
        let table = long(&whole, start);
        for place in [0i64, -1, i64::MAX, whole.len() as i64, 1 << 40] {
            let lie = put(&whole, start, &place.to_le_bytes());
            reads_as(&format!("a table at {place}"), "in.laz", &lie, &whole, "chunk table");
        }
        for claimed in [2u32, 1000, u32::MAX] {
            let lie = put(&whole, table + 4, &claimed.to_le_bytes());
            reads_as(&format!("{claimed} chunks"), "in.laz", &lie, &whole, "chunk table");
        }
        let end = table + 12;
        reads_as("junk", "in.laz", &put(&whole, table + 8, &[0xff; 4]), &whole, "chunk table");
        reads_as("version", "in.laz", &put(&whole, table, &[9; 4]), &whole, "chunk table");
        let bare = put(&whole, 243, &[0; 4]);
        let good = put(&whole, 243, &[0; 4]);
        reads_as("no table", "in.laz", &bare[..table], &good, "chunk table");
        reads_as("half a table", "in.laz", &bare[..end - 6], &good, "chunk table");
    }
}

#[test]
fn no_flipped_bit_of_a_chunk_table_costs_a_point() {
    for format in [1, 6] {
        let whole = laz(format);
        let table = long(&whole, word(&whole, 96));
        let points = |bytes: &[u8]| {
            let (folder, path) = input("in.laz", bytes);
            let output = folder.path().join("out.las");
            convert(&[path], &output, &Setup::new(&[])).map(|_| read(&output).1)
        };
        let good = points(&whole).unwrap();
        // The table ends where the record behind the points begins.
        for bit in 0..8 * (long(&whole, 235) - table) {
            let mut lie = whole.clone();
            lie[table + bit / 8] ^= 1 << (bit % 8);
            let read = points(&lie).unwrap_or_else(|e| panic!("format {format}, {bit}: {e:?}"));
            assert!(read == good, "format {format}: other points by bit {bit}");
        }
        let zeros = vec![0; long(&whole, 235) - table - 8];
        reads_as("zeros", "in.laz", &put(&whole, table + 8, &zeros), &whole, "chunk table");
    }
}

#[test]
fn a_chunk_table_told_at_the_end_of_the_file_is_found() {
    for format in [1, 6] {
        for whole in [laz(format), laz_of_varying_chunks(format)] {
            let start = word(&whole, 96);
            let place = long(&whole, start);
            // Writers to a pipe leave −1 in front and append the place behind everything else.
            let mut piped = put(&whole, start, &(-1i64).to_le_bytes());
            piped.extend(place.to_le_bytes());
            reads_as("a table told at the end", "in.laz", &piped, &whole, "");
        }
    }
}

#[test]
fn chunks_of_varying_size_are_read_and_found_without_their_table_where_they_tell_their_length() {
    for format in [1, 6] {
        let varying = laz_of_varying_chunks(format);
        let fixed = put(&laz(format), 243, &[0; 4]);
        let outputs = [&varying, &fixed].map(|bytes| {
            let (folder, path) = input("in.laz", bytes);
            let output = folder.path().join("out.las");
            convert(&[path], &output, &Setup::new(&[])).unwrap();
            read(&output).1
        });
        assert!(outputs[0] == outputs[1], "format {format}: other points");
        let start = word(&varying, 96);
        let bare = &varying[..long(&varying, start)];
        if format >= 6 {
            reads_as("no table", "in.laz", bare, &varying, "chunk table");
        } else {
            refused("no table", "in.laz", bare, Some(start), "chunks of varying size need one");
        }
    }
}

#[test]
fn damaged_chunks_are_refused() {
    for format in [1, 6] {
        let whole = laz(format);
        let start = word(&whole, 96);
        let table = long(&whole, start);
        let mut lie = whole.clone();
        lie[start + 8 + STRIDES[usize::from(format)]..table].fill(0xff);
        let (folder, path) = input("in.laz", &lie);
        let output = folder.path().join("out.laz");
        // An arithmetic decoder makes points of most bytes: what it cannot is told with its chunk.
        match convert(std::slice::from_ref(&path), &output, &Setup::new(&[])) {
            Ok(done) => assert_eq!(done.report.result.ledger.read, POINTS as u64),
            Err(error) => {
                assert_eq!((error.kind(), error.path()), (ErrorKind::Data, Some(path.as_path())));
                assert!(error.byte().is_some() && error.remedy().is_some(), "{error:?}");
                assert_holds(folder.path(), &["in.laz"]);
            }
        }
    }
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z\nend_header\n";

#[test]
fn ply_headers_that_lie_are_refused() {
    let binary = |count: &str| {
        format!("ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{XYZ}")
    };
    let ascii =
        |count: &str| format!("ply\nformat ascii 1.0\nelement vertex {count}\n{XYZ}1 2 3\n4 5 6\n");
    for count in ["2", "1000000", "18446744073709551615"] {
        refused(count, "in.ply", (binary(count) + "0123456789ab").as_bytes(), None, "claims");
    }
    for count in ["3", "18446744073709551615"] {
        refused(count, "in.ply", ascii(count).as_bytes(), None, "");
    }
    refused("empty", "in.ply", b"", Some(0), "not a PLY file");
}

#[test]
fn vertices_that_a_ply_header_does_not_count_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let two = [1f32, 2.0, 3.0, 4.0, 5.0, 6.0].map(f32::to_le_bytes).concat();
    let head = format!("ply\nformat binary_little_endian 1.0\nelement vertex 1\n{XYZ}");
    let binary = [head.as_bytes(), &two].concat();
    let text = format!("ply\nformat ascii 1.0\nelement vertex 1\n{XYZ}1 2 3\n4 5 6\n");
    let blank = format!("ply\nformat ascii 1.0\nelement vertex 1\n{XYZ}1 2 3\n\n\n");
    for (bytes, says) in [
        (binary, "12 bytes behind the 1 vertices"),
        (text.into_bytes(), "lines behind the 1 vertices"),
        (blank.into_bytes(), ""),
    ] {
        let [from, to] = ["in.ply", "out.ply"].map(|name| folder.path().join(name));
        std::fs::write(&from, bytes).unwrap();
        for run in [reduce, convert] {
            let done = run(std::slice::from_ref(&from), &to, &Setup::new(&[])).unwrap();
            let warned = done.report.run.warnings.join("\n");
            assert!(warned.contains(says) && warned.is_empty() == says.is_empty(), "{warned}");
        }
    }
}

#[test]
fn extra_bytes_may_be_described_behind_the_points() {
    let (describing, bytes) = crate::support::las_file::extra_bytes();
    let stride = STRIDES[6] + bytes;
    let records = records(stride);
    let folder = tempfile::tempdir().unwrap();
    let written = |evlr: bool| -> (PathBuf, Vec<String>) {
        let lists = [vec![describing.clone()], vec![]];
        let (vlrs, evlrs) = (&lists[usize::from(evlr)], &lists[usize::from(!evlr)]);
        let file = LasFile {
            format: 6,
            stride,
            scale: [0.01; 3],
            offset: [0.0; 3],
            vlrs,
            evlrs,
            records: &records,
        };
        let path = folder.path().join(format!("{evlr}.las"));
        std::fs::write(&path, file.bytes()).unwrap();
        let names = names_of(&path);
        (path, names)
    };
    let ((_, before), (path, behind)) = (written(false), written(true));
    assert_eq!(before, behind);
    assert!(behind.iter().any(|name| name == "amplitude"), "{behind:?}");
    let output = folder.path().join("out.laz");
    let normals =
        Setup::new(&[("write.dimensions", serde_json::json!(["NormalX", "NormalY", "NormalZ"]))]);
    reduce(&[path], &output, &normals).unwrap();
    let with_normals = names_of(&output);
    assert_eq!(with_normals[..behind.len()], behind);
    assert_eq!(with_normals.len(), behind.len() + 3);
}

fn names_of(path: &Path) -> Vec<String> {
    read(path).0.dimensions.iter().map(|d| d.name.clone()).collect()
}
