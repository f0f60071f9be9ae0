//! Damaged files: what is whole of them is read where that is wanted, what is not is accounted for.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::case_file;
use crate::support::command::{done, fails, pointmill};
use crate::support::records::read;

const POINTS: usize = 130_000;
const CHUNK: usize = 50_000;

/// A folder with `whole.laz`, of three chunks.
fn scan() -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    let points = POINTS.to_string();
    done(at.path(), &["synth", "als", "-n", &points, "-o", "whole.las", "--no-provenance"]);
    let convert = ["convert", "whole.las", "-o", "whole.laz", "--no-provenance"];
    done(at.path(), &convert);
    at
}

/// Converts with this `--on-error`: warnings, records, what the report says is lost.
fn run(at: &Path, scan: &str, how: &str) -> (String, Vec<u8>, Vec<Value>) {
    let mut first: Option<Vec<u8>> = None;
    let mut all = None;
    for threads in ["1", "3"] {
        let more = ["--report", "r.json", "--threads", threads, "--no-provenance"];
        let convert = ["convert", scan, "-o", "out.las", "--on-error", how];
        let (code, _, told) = pointmill(at, &[&convert[..], &more[..]].concat());
        assert_eq!(code, 0, "{told}");
        let written = fs::read(at.join("out.las")).unwrap();
        assert!(first.get_or_insert_with(|| written.clone()) == &written, "{how} by {threads}");
        let report: Value = serde_json::from_slice(&fs::read(at.join("r.json")).unwrap()).unwrap();
        let lost = report["run"]["lost"].as_array().cloned().unwrap_or_default();
        all = Some((told, read(&at.join("out.las")).1, lost));
    }
    all.unwrap()
}

fn lost(all: &[Value]) -> u64 {
    all.iter().map(|one| one["points"].as_u64().unwrap()).sum()
}

#[test]
fn a_damaged_chunk_costs_its_points_or_those_behind_the_damage() {
    let at = scan();
    let at = at.path();
    let mut bytes = fs::read(at.join("whole.laz")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle..middle + 64].iter_mut().for_each(|byte| *byte ^= 0x5a);
    fs::write(at.join("bad.laz"), bytes).unwrap();
    let parts = ["bad.laz: at byte", "chunk 2 of the compressed points is damaged"];
    fails(at, &["convert", "bad.laz", "-o", "out.las"], 1, &[&parts[..], &["--on-error"]].concat());
    let (schema, whole) = read(&at.join("whole.laz"));
    let chunk = CHUNK * schema.stride;

    let (told, records, all) = run(at, "bad.laz", "skip");
    assert!(told.contains("50,000 points are lost: chunk 2"), "{told}");
    assert_eq!((lost(&all), all.len()), (CHUNK as u64, 1));
    assert!(records == [&whole[..chunk], &whole[2 * chunk..]].concat());

    let (told, records, all) = run(at, "bad.laz", "salvage");
    let kept = POINTS - lost(&all) as usize;
    assert!(told.contains("points are lost: chunk 2"), "{told}");
    // Damage that shows in one field may have changed it long before.
    assert!(told.contains("which are kept, values may be wrong"), "{told}");
    assert!(kept > POINTS - CHUNK && kept < POINTS, "{kept}");
    assert_eq!(records.len(), kept * schema.stride);
    assert!(records[..chunk] == whole[..chunk]);
    let last = records.len() - (POINTS - 2 * CHUNK) * schema.stride;
    assert!(records[last..] == whole[2 * chunk..]);
    // Of the damaged chunk itself most of what is kept is as it was.
    let middle = records[chunk..last].chunks(schema.stride);
    let same = middle.zip(whole[chunk..].chunks(schema.stride)).take_while(|(a, b)| a == b).count();
    assert!(same > CHUNK / 20, "{same}");

    // The files that are read more than once lose each point once.
    let reduce = ["reduce", "bad.laz", "-o", "thin.laz", "--keep", "10%", "--on-error", "skip"];
    let (code, _, told) = pointmill(at, &[&reduce[..], &["--report", "r.json"]].concat());
    assert_eq!(code, 0, "{told}");
    let report: Value = serde_json::from_slice(&fs::read(at.join("r.json")).unwrap()).unwrap();
    assert_eq!(report["result"]["ledger"]["read"].as_u64(), Some((POINTS - CHUNK) as u64));
    assert_eq!(report["run"]["lost"][0]["points"].as_u64(), Some(CHUNK as u64));
}

#[test]
fn a_file_that_is_cut_off_has_the_points_before_the_cut() {
    let at = scan();
    let at = at.path();
    for name in ["whole.las", "whole.laz"] {
        let bytes = fs::read(at.join(name)).unwrap();
        let cut = format!("cut-{name}");
        let (schema, whole) = read(&at.join(name));
        for part in [2, 5, 9] {
            fs::write(at.join(&cut), &bytes[..bytes.len() * part / 10]).unwrap();
            fails(at, &["convert", &cut, "-o", "out.las"], 1, &[&cut, "--on-error salvage"]);
            for how in ["skip", "salvage"] {
                let (told, records, all) = run(at, &cut, how);
                let kept = records.len() / schema.stride;
                assert_eq!(kept + lost(&all) as usize, POINTS, "{told}");
                assert!(told.contains("points are lost"), "{told}");
                let is_whole = how == "skip" || name == "whole.las";
                let sure = if is_whole { records.len() } else { records.len() * 9 / 10 };
                assert!(records[..sure] == whole[..sure], "{name} {part} {how}");
                let least = if name == "whole.las" { 1 } else { CHUNK };
                assert!(kept + least > POINTS * part / 10 - CHUNK / 5, "{kept} of {name} {part}");
            }
        }
    }
}

#[test]
fn counts_and_records_that_lie_are_read_around() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let few = |case: &str, how: &str| {
        fs::copy(case_file(case), at.join(case)).unwrap();
        let (told, records, all) = run(at, case, how);
        (told, records.len() / read(&at.join("out.las")).0.stride, lost(&all))
    };
    let (told, points, lost) = few("20a-count-too-many.las", "skip");
    assert!(told.contains("4 points are lost") && (points, lost) == (5, 4), "{told}");
    let (told, points, lost) = few("20b-count-too-few.las", "salvage");
    assert!(told.contains("2 points behind the 3") && (points, lost) == (5, 0), "{told}");
    let (told, points, _) = few("20b-count-too-few.las", "skip");
    assert!(told.contains("are not read") && points == 3, "{told}");
    let (told, points, lost) = few("118-vlrcount.las", "salvage");
    assert!(told.contains("3 variable length records do not fit"), "{told}");
    assert_eq!((points, lost), (5, 0));
    fails(at, &["convert", "118-vlrcount.las", "-o", "o.las"], 1, &["--on-error salvage"]);
    fails(
        at,
        &["convert", "118-vlrcount.las", "-o", "o.las", "--on-error", "mend"],
        2,
        &["--on-error", "salvage"],
    );
    fs::write(at.join("a.obj"), "v 1 2 3\n").unwrap();
    let other = ["convert", "a.obj", "-o", "o.ply", "--on-error", "skip"];
    fails(at, &other, 2, &["--on-error", "las, laz, copc, ply"]);
}

/// The same LAZ file whose header counts so many points.
fn counting(at: &Path, laz: &str, points: u32) -> String {
    let mut bytes = fs::read(at.join(laz)).unwrap();
    let old = u32::from_le_bytes(bytes[107..111].try_into().unwrap());
    if bytes[25] == 4 {
        bytes[247..255].copy_from_slice(&u64::from(points).to_le_bytes());
    }
    if old > 0 {
        bytes[107..111].copy_from_slice(&points.to_le_bytes());
    }
    let name = format!("{points}-{laz}");
    fs::write(at.join(&name), bytes).unwrap();
    name
}

#[test]
fn laz_that_counts_fewer_points_than_its_chunks_have_gives_all_of_them() {
    let at = scan();
    let at = at.path();
    // Layered chunks, and those of old point formats, of which the last does not say its count.
    let old = ["convert", "whole.laz", "-o", "old.laz", "--point-format", "1", "--no-provenance"];
    let old = [&old[..], &["--drop", "Overlap,ScannerChannel,ScanAngle"]].concat();
    let (code, _, told) = pointmill(at, &old);
    assert_eq!(code, 0, "{told}");
    for laz in ["whole.laz", "old.laz"] {
        let whole = read(&at.join(laz)).1;
        for points in [0, 1, 70_000, 129_999] {
            let name = counting(at, laz, points);
            let (told, records, all) = run(at, &name, "salvage");
            let more = ["130,000", "129,999", "60,000", "1"];
            let more = more[[0, 1, 70_000, 129_999].iter().position(|n| *n == points).unwrap()];
            assert!(told.contains(&format!("{more} points behind the ")), "{name}: {told}");
            assert!(records == whole && all.is_empty(), "{name}");
        }
        let name = counting(at, laz, 0);
        fails(at, &["convert", &name, "-o", "o.las"], 1, &["counts no points", "--on-error salv"]);
    }
    let case = case_file("80j-count-fewer.laz");
    fs::copy(case, at.join("80j.laz")).unwrap();
    let points = |how: &str| {
        let records = run(at, "80j.laz", how).1;
        records.len() / read(&at.join("out.las")).0.stride
    };
    assert_eq!((points("fail"), points("skip")), (1_100, 1_100));
    assert!(points("salvage") >= 1_200);
}

#[test]
fn points_of_a_chunk_whose_bytes_do_not_tell_their_number_are_not_made_up() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    // All records are alike: they cost next to no bits.
    fs::write(at.join("a.csv"), "x,y,z\n".to_owned() + &"1,2,3\n".repeat(70_000)).unwrap();
    let convert = ["convert", "a.csv", "-o", "old.laz", "--point-format", "0", "--scale", "0.01"];
    done(at, &[&convert[..], &["--no-provenance", "--quiet"]].concat());
    let whole = read(&at.join("old.laz")).1;
    let stride = whole.len() / 70_000;
    let (told, records, lost) = run(at, &counting(at, "old.laz", 35_000), "salvage");
    let points = records.len() / stride;
    assert!(points > 60_000 && points < 70_000, "{points}");
    assert!(records == whole[..records.len()] && lost.is_empty());
    let behind = format!("{},{:03} points behind", (points - 35_000) / 1000, points % 1000);
    assert!(told.contains(&behind), "{told}");
    assert!(told.contains("the last chunk may have up to "), "{told}");
    // The header's count is believed where the bytes do not contradict it.
    let (told, records, _) = run(at, "old.laz", "salvage");
    assert!(records == whole && !told.contains("points behind"), "{told}");
}
