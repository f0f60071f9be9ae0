//! Real files: all that can be read is read and survives LAS → LAZ → LAS; damage is told.

use std::fs::File;
use std::io::{BufReader, Seek, SeekFrom};
use std::path::Path;

use crate::support::las::{BROKEN, LAS, LAZ, manifest, write};
use crate::support::records::read_source;
use crate::support::scans;
use pointmill::internals::las::{Description, Record, describe};
use pointmill::io::las::open;
use pointmill::stage::Source;

/// Files above this are read in part.
const PARTLY: u64 = 300_000;
const PART: usize = 20_000;

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn every_readable_scan_has_the_points_of_the_manifest_and_survives_a_round_trip() {
    let folder = scans();
    let temporary = tempfile::tempdir().unwrap();
    let mut tested = 0;
    for scan in manifest(&folder) {
        if BROKEN.contains(&scan.name.as_str()) {
            continue;
        }
        let source = open(std::slice::from_ref(&scan.path)).unwrap_or_else(|e| panic!("{e:?}"));
        if let Some(points) = scan.points {
            assert_eq!(source.points(), points, "{}", scan.name);
        }
        let whole = source.points() <= PARTLY;
        let limit = if whole { usize::MAX / 4096 } else { PART };
        let records = read_source(&*source, limit).unwrap_or_else(|e| panic!("{e:?}"));
        if whole {
            assert_eq!(records.len() as u64, source.points() * source.schema().stride as u64);
        }
        for warning in source.warnings() {
            println!("{warning}");
        }
        round_trip(&scan.name, &*source, &records, temporary.path());
        tested += 1;
    }
    assert!(tested > 100, "only {tested} scans");
}

/// LAS → LAZ → LAS: records, header and records beside the points are the same bytes again.
fn round_trip(name: &str, source: &dyn Source, records: &[u8], folder: &std::path::Path) {
    let [one, two, three] = ["1.las", "2.laz", "3.las"].map(|file| folder.join(file));
    write(&one, LAS, source.schema(), source.metadata(), records).unwrap();
    let plain = open(std::slice::from_ref(&one)).unwrap_or_else(|e| panic!("{name}: {e:?}"));
    assert_eq!(plain.schema(), source.schema(), "{name}");
    write(&two, LAZ, plain.schema(), plain.metadata(), records).unwrap();
    let packed = open(std::slice::from_ref(&two)).unwrap_or_else(|e| panic!("{name}: {e:?}"));
    let unpacked =
        read_source(&*packed, usize::MAX / 4096).unwrap_or_else(|e| panic!("{name}: {e:?}"));
    assert!(unpacked == records, "{name}: records differ");
    write(&three, LAS, packed.schema(), packed.metadata(), &unpacked).unwrap();
    let bytes = [&one, &three].map(|path| std::fs::read(path).unwrap());
    assert!(bytes[0] == bytes[1], "{name}: LAS → LAZ → LAS changed the file");
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn a_plain_file_written_again_keeps_all_but_recomputed_fields() {
    let folder = scans();
    let temporary = tempfile::tempdir().unwrap();
    let mut tested = 0;
    for scan in manifest(&folder) {
        let plain = scan.name.ends_with(".las") && !BROKEN.contains(&scan.name.as_str());
        if !plain || scan.points.is_none_or(|n| n > PARTLY) {
            continue;
        }
        let source = open(std::slice::from_ref(&scan.path)).unwrap();
        let records = read_source(&*source, usize::MAX / 4096).unwrap();
        let path = temporary.path().join("again.las");
        write(&path, LAS, source.schema(), source.metadata(), &records).unwrap();
        let (old, new) = (std::fs::read(&scan.path).unwrap(), std::fs::read(&path).unwrap());
        let start = u32::from_le_bytes(old[96..100].try_into().unwrap()) as usize;
        let size = usize::from(u16::from_le_bytes(old[94..96].try_into().unwrap()));
        // Counts (107 to 131, 247 to 375) and box (179 to 227) follow the points, the extended
        // records (235 to 247) the end of the points. Bits of the encoding (6 to 8) may be mended,
        // and the software (58 to 90) is ours.
        for (from, to) in [(0, 6), (8, 58), (90, 107)] {
            assert!(old[from..to] == new[from..to], "{}", scan.name);
        }
        assert!(old[131..179] == new[131..179], "{}", scan.name);
        assert!(old[size..start + records.len()] == new[size..start + records.len()]);
        tested += 1;
    }
    assert!(tested > 40, "only {tested} scans");
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn broken_scans_fail_with_path_and_place() {
    let folder = scans();
    for name in BROKEN {
        let path = folder.join(name);
        let result =
            open(std::slice::from_ref(&path)).and_then(|s| read_source(&*s, 1 << 22).map(drop));
        let error = result.expect_err(name);
        println!("{error:?}");
        assert_eq!(error.path(), Some(path.as_path()));
        assert!(error.byte().is_some(), "{error:?}");
    }
}

/// Holds the variable length records of `about` against what the crate `las` reads of them, whose
/// reader of records is not ours; returns how many there are.
fn count_same_records(path: &Path, about: &Description) -> usize {
    let mut file = BufReader::new(File::open(path).unwrap());
    let header = las::raw::Header::read_from(&mut file).unwrap();
    let text = |bytes: &[u8]| {
        let text = bytes.split(|byte| *byte == 0).next().unwrap();
        String::from_utf8_lossy(text).trim_end().to_owned()
    };
    let same = |file: &mut BufReader<File>, record: &Record, extended| {
        let raw = las::raw::Vlr::read_from(file, extended).unwrap();
        let length = u64::from(raw.record_length_after_header);
        let found = (text(&raw.user_id), raw.record_id, length, text(&raw.description));
        let Record { user_id, record_id, length, description } = record.clone();
        assert_eq!(found, (user_id, record_id, length, description), "{path:?}");
    };
    about.vlrs.iter().for_each(|record| same(&mut file, record, false));
    assert_eq!(header.number_of_variable_length_records as usize, about.vlrs.len(), "{path:?}");
    if let Some(evlr) = header.evlr {
        assert_eq!(evlr.number_of_evlrs as usize, about.evlrs.len(), "{path:?}");
        file.seek(SeekFrom::Start(evlr.start_of_first_evlr)).unwrap();
        about.evlrs.iter().for_each(|record| same(&mut file, record, true));
    }
    about.vlrs.len() + about.evlrs.len()
}

#[test]
fn variable_length_records_are_those_that_another_reader_finds() {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases");
    let paths = std::fs::read_dir(cases).unwrap().map(|entry| entry.unwrap().path());
    let (mut files, mut records) = (0, 0);
    for path in paths.filter(|path| path.extension().is_some_and(|e| e == "las" || e == "laz")) {
        if let Ok(about) = describe(&path) {
            files += 1;
            records += count_same_records(&path, &about);
        }
    }
    assert!(files >= 30 && records >= 26, "{files} files, {records} records");
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn every_scan_describes_itself() {
    let folder = scans();
    let mut records = 0;
    for scan in manifest(&folder) {
        if BROKEN.contains(&scan.name.as_str()) {
            continue;
        }
        let about = describe(&scan.path).unwrap();
        assert_eq!(about.kind == "LAZ", about.compressor != "none", "{}", scan.name);
        assert!(about.dimensions.len() >= 15);
        serde_json::to_string(&about).unwrap();
        records += count_same_records(&scan.path, &about);
    }
    assert!(records > 200, "{records} records");
    let copc = describe(&folder.join("laspy/simple.copc.laz")).unwrap();
    assert!(copc.warnings.iter().all(|w| !w.contains("copc")), "{:?}", copc.warnings);
    let wkt = describe(&folder.join("laspy/1_4_w_evlr.laz")).unwrap();
    assert!(wkt.crs.is_some() && wkt.evlrs.len() == 1);
    let keys = describe(&folder.join("pdal/las/test_utm16.las")).unwrap();
    assert_eq!(keys.crs.as_deref(), Some("EPSG:26916"));
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn plain_and_compressed_files_of_the_same_points_decode_alike() {
    let folder = scans();
    let pairs = [
        "laz-rs/point10",
        "laz-rs/point-color",
        "laz-rs/point-time",
        "laz-rs/point-time-color",
        "laz-rs/extra-bytes",
        "laz-rs/point-version-1-point-wise",
        "loaders.gl/las/pdrf4-1.3",
        "loaders.gl/las/pdrf7-v4-1.4",
        "laspy/1_4_w_evlr",
        "pasture/10_points_format_5",
        "pasture/10_points_format_8",
    ];
    for name in pairs {
        let [plain, packed] = ["las", "laz"].map(|extension| {
            let path = folder.join(format!("{name}.{extension}"));
            read_source(&*open(&[path]).unwrap(), usize::MAX / 4096).unwrap()
        });
        assert!(!plain.is_empty() && plain == packed, "{name}");
    }
}
