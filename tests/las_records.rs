//! What is held of a file's records is bounded, whatever it claims and however long it is.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use pointmill::io::{describe, las};
use pointmill::pipeline::{Overrides, Pipeline, Quiet, Registry};
use pointmill::{Error, ErrorKind};

/// Counts what is held, and the most that was.
struct Watched;

static HELD: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: hands everything to the system's allocator and only counts.
unsafe impl GlobalAlloc for Watched {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let held = HELD.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        MOST.fetch_max(held, Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static WATCHED: Watched = Watched;

/// What is counted is the process's: one test at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// Bytes that `work` held at most, besides what was held before.
fn held<T>(work: impl FnOnce() -> T) -> (T, usize) {
    let before = HELD.load(Ordering::Relaxed);
    MOST.store(before, Ordering::Relaxed);
    let result = work();
    (result, MOST.load(Ordering::Relaxed).saturating_sub(before))
}

/// A file of five points with `count` records, `payload` bytes each: variable length ones behind the
/// header, or extended ones at the end.
fn file(path: &Path, count: u32, payload: usize, extended: bool) {
    file_of("test", path, count, payload, extended);
}

/// The same with records of this user.
fn file_of(user: &str, path: &Path, count: u32, payload: usize, extended: bool) {
    let name = "19c-14count5-legacy3.las";
    let case = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases").join(name);
    let mut bytes = std::fs::read(case).unwrap();
    let mut record = vec![0; if extended { 60 } else { 54 } + payload];
    record[2..2 + user.len()].copy_from_slice(user.as_bytes());
    record[20..22].copy_from_slice(&(payload as u16).to_le_bytes());
    let numbered = |i: u32| {
        let mut record = record.clone();
        record[18..20].copy_from_slice(&(i as u16).to_le_bytes());
        record
    };
    let records: Vec<u8> = (0..count).flat_map(numbered).collect();
    if extended {
        let at = bytes.len() as u64;
        bytes[235..243].copy_from_slice(&at.to_le_bytes());
        bytes[243..247].copy_from_slice(&count.to_le_bytes());
        bytes.extend(records);
    } else {
        let start = u32::from_le_bytes(bytes[96..100].try_into().unwrap());
        let moved = start + records.len() as u32;
        bytes[96..100].copy_from_slice(&moved.to_le_bytes());
        bytes[100..104].copy_from_slice(&count.to_le_bytes());
        bytes.splice(start as usize..start as usize, records);
    }
    std::fs::write(path, bytes).unwrap();
}

fn convert(input: &Path, output: &Path) -> Result<(), Error> {
    let text = format!(
        "[[stage]]\nkind = \"read\"\npath = {input:?}\n\n[[stage]]\nkind = \"write\"\npath = {output:?}\n"
    );
    let pipeline = Pipeline::parse(&text, "test.toml", &Registry::builtin())?;
    let plan = pipeline.plan(&Overrides::default())?;
    drop(plan);
    Ok(())
}

const MIB: usize = 1 << 20;

#[test]
fn more_records_than_any_scan_has_are_refused_before_they_are_held() {
    let _alone = ALONE.lock().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.las");
    for (user, count, payload, extended, told) in [
        (
            "test",
            1_200_000,
            0,
            false,
            "1200000 variable length records are more than the 16384 held",
        ),
        ("liblas", 1_000, 65_000, false, "records that say what points are exceed 8 MiB"),
        ("test", 262_144, 0, true, "262144 extended variable length records are more than"),
    ] {
        file_of(user, &path, count, payload, extended);
        for work in [
            (&|path: &Path| las::open(&[path.to_owned()]).map(drop)) as &dyn Fn(&Path) -> _,
            &|path: &Path| describe(path).map(drop),
            &|path: &Path| convert(path, &path.with_file_name("out.las")),
        ] {
            let (result, held) = held(|| work(&path));
            let error = result.unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Data);
            assert!(error.to_string().contains(told), "{error}");
            assert!(error.byte().is_some() && error.remedy().is_some());
            assert!(held < 12 * MIB, "{told}: {held} bytes");
        }
    }
}

#[test]
fn what_is_held_of_the_most_records_is_their_size() {
    let _alone = ALONE.lock().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.las");
    file(&path, 8_000, 950, false);
    let (source, opened) = held(|| las::open(std::slice::from_ref(&path)).unwrap());
    assert!((7 * MIB..11 * MIB).contains(&opened), "{opened} bytes");
    drop(source);
    file(&path, 16_000, 0, true);
    let (_, described) = held(|| describe(&path).unwrap());
    assert!(described < 32 * MIB, "{described} bytes");
}

#[test]
fn the_union_of_several_files_records_is_bounded_too() {
    let _alone = ALONE.lock().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let paths: Vec<PathBuf> = (0..3)
        .map(|i| {
            let path = folder.path().join(format!("{i}.las"));
            file(&path, 9_000, 1 + i, false);
            path
        })
        .collect();
    assert!(las::open(&paths[..1]).is_ok());
    let error = las::open(&paths).map(drop).unwrap_err();
    assert!(error.to_string().contains("18000 different variable length records"), "{error}");
}

/// The bytes between the header and the points.
fn records(path: &Path) -> Vec<u8> {
    let bytes = std::fs::read(path).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    bytes[375..word(96)].to_vec()
}

#[test]
fn many_bytes_of_records_are_carried_and_not_held() {
    let _alone = ALONE.lock().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let [input, second, output] =
        ["in.las", "second.las", "out.las"].map(|name| folder.path().join(name));
    file(&input, 1_000, 65_000, false);
    let run = |inputs: &[&Path]| {
        let text = format!(
            "[run]\nmemory = \"64MiB\"\nthreads = 1\n[[stage]]\nkind = \"read\"\npath = {inputs:?}\n\
             [[stage]]\nkind = \"write\"\npath = {output:?}\n"
        );
        let pipeline = Pipeline::parse(&text, "test.toml", &Registry::builtin()).unwrap();
        let (done, held) = held(|| pipeline.plan(&Overrides::default())?.run(&Quiet));
        done.unwrap();
        assert!(held < 40 * MIB, "{held} bytes");
    };
    let (about, held) = held(|| describe(&input).unwrap());
    assert!(held < 2 * MIB, "{held} bytes");
    let last = &about["vlrs"][999];
    assert_eq!(last["length"], 65_000, "{last}");
    run(&[&input]);
    assert!(records(&input).len() > 60 * MIB);
    let same = |a: &Path| records(&output).starts_with(&records(a));
    assert!(same(&input), "the records are the same bytes");
    // So are those of two files that have them all in common, and those of which only one has some.
    std::fs::copy(&input, &second).unwrap();
    run(&[&input, &second]);
    assert!(same(&input));
    file(&second, 1_010, 65_000, false);
    run(&[&input, &second]);
    assert!(records(&output) == records(&second), "the union");
}
