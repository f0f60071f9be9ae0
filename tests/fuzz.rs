//! Bounded fuzzing: some thousands of made-up inputs a target, the committed ones that once broke a
//! promise, and failures planted to see that none goes unseen. `benches/fuzz.rs` is the same for
//! hours.

#![allow(clippy::unwrap_used, reason = "a test that fails says so")]

mod fuzzing;
mod support;

use std::path::Path;
use std::time::Duration;

use fuzzing::campaign::Campaign;
use fuzzing::harness::Harness;
use fuzzing::judge::{Judgement, Outcome, refused};
use fuzzing::{TARGETS, Target, formats, las, las_seeds, laz, mutate, pipeline, ply, text};
use support::allocator;

#[global_allocator]
static COUNTED: allocator::Counted = allocator::Counted;

/// Time that one input may take.
const MOST_TIME: Duration = Duration::from_secs(5);

/// Inputs that once broke a promise, or are of a sort that could.
fn committed(target: &Target) -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus").join(target.name);
    let Ok(entries) = std::fs::read_dir(&folder) else { return Vec::new() };
    let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
    files.iter().map(|path| (name(path), std::fs::read(path).unwrap())).collect()
}

/// Takes `executions` inputs: no promise is broken, and what they came to is no few things.
fn bounded(target: Target, executions: u64, fewest: usize) {
    let corpus = committed(&target).into_iter().map(|(_, input)| input).collect();
    let mut campaign = Campaign::new(target, MOST_TIME, 20, corpus);
    campaign.run(executions);
    for finding in campaign.findings.values() {
        eprintln!(
            "{}: {}: {:?}",
            target.name,
            finding.promise,
            String::from_utf8_lossy(&finding.input)
        );
    }
    assert!(campaign.findings.is_empty(), "{} promises are broken", campaign.findings.len());
    let outcomes = campaign.outcomes();
    assert!(outcomes.len() >= fewest, "only {} outcomes: {outcomes:#?}", outcomes.len());
    let (accepted, all) = (campaign.accepted, campaign.executions);
    assert!(accepted >= 50 && all - accepted >= 50, "{accepted} of {all} inputs are accepted");
}

#[test]
fn las_files_of_any_bytes_fail_or_read() {
    bounded(las::TARGET, 2500, 80);
}

#[test]
fn compressed_points_of_any_bytes_fail_or_read() {
    bounded(laz::TARGET, 20_000, 100);
}

#[test]
fn ply_files_of_any_bytes_fail_or_read() {
    bounded(ply::TARGET, 20_000, 200);
}

#[test]
fn texts_of_points_of_any_bytes_fail_or_read() {
    bounded(formats::XYZ, 8000, 60);
    bounded(formats::PTX, 8000, 25);
}

#[test]
fn pcd_files_of_any_bytes_fail_or_read() {
    bounded(formats::PCD, 8000, 60);
}

#[test]
fn meshes_of_any_bytes_fail_or_read() {
    bounded(formats::OBJ, 4000, 15);
    bounded(formats::OFF, 4000, 20);
    bounded(formats::STL, 4000, 10);
}

#[test]
fn e57_files_of_any_bytes_fail_or_read() {
    bounded(formats::E57, 4000, 25);
}

#[test]
fn pipelines_of_any_text_fail_or_are_planned() {
    bounded(pipeline::TARGET, 10_000, 90);
}

#[test]
fn arguments_of_any_text_are_taken_or_refused() {
    bounded(text::TARGET, 10_000, 90);
}

#[test]
fn inputs_that_once_broke_a_promise_keep_it() {
    let mut replayed = 0;
    for target in TARGETS {
        let harness = Harness::new(target, MOST_TIME);
        harness.seeds();
        let _home = harness.at_home();
        for (name, input) in committed(&target) {
            let judgement = harness.judge(&input);
            assert!(judgement.is_ok(), "{}/{name}: {judgement:?}", target.name);
            replayed += 1;
        }
    }
    assert!(replayed >= 4, "only {replayed} inputs are committed");
}

/// A PLY file of one vertex with `lines` in its header, before and behind its coordinates.
fn one_vertex(before: &str, behind: &str, more: usize) -> Vec<u8> {
    format!(
        "ply\nformat ascii 1.0\n{before}element vertex 1\nproperty float x\nproperty float y\n\
         property float z\n{behind}end_header\n1 2 3{}\n",
        " 1".repeat(more)
    )
    .into_bytes()
}

#[test]
fn the_longest_headers_take_no_longer_than_they_are() {
    let lines = |range: std::ops::Range<usize>, line: fn(usize) -> String| -> String {
        range.map(line).collect()
    };
    let las = Harness::new(las::TARGET, MOST_TIME).judge(&las_seeds::same_names());
    assert!(las.as_ref().is_ok_and(|o| o.accepted), "{las:?}");
    let elements = lines(0..60_000, |i| format!("element {i:x} 0\n"));
    let comments = lines(0..15_000, |i| format!("comment dimension p{i:x}: D{i:x}\n"));
    let others = lines(15_000..35_000, |i| format!("property float p{i:x}\n"));
    let own = lines(0..15_000, |i| format!("property float p{i:x}\n"));
    let harness = Harness::new(ply::TARGET, MOST_TIME);
    for (what, file) in [
        ("elements", one_vertex(&elements, "", 0)),
        ("comments about none of the properties", one_vertex(&comments, &others, 20_000)),
        ("comments about all of the properties", one_vertex(&comments, &own, 15_000)),
    ] {
        assert!(file.len() > 500_000, "{what}");
        let outcome = harness.judge(&file);
        assert!(outcome.as_ref().is_ok_and(|o| o.accepted), "{what}: {outcome:?}");
    }
}

/// A target that breaks a promise if its input has the byte 0xff at 3 and asks for it.
fn planted(_: &Path, data: &[u8]) -> Judgement {
    let asked = data.get(3) == Some(&0xff);
    match data.first() {
        Some(0) if asked => panic!("planted"),
        Some(1) if asked => drop(std::hint::black_box(vec![0u8; 100 << 20])),
        Some(2) if asked => (0..700_000_000u64).for_each(|i| {
            std::hint::black_box(i);
        }),
        Some(3) if asked => {
            let error = pointmill::Error::internal("planted");
            return refused("planted", &error, &[pointmill::ErrorKind::Data]);
        }
        _ => {}
    }
    Ok(Outcome { accepted: asked, marks: vec![format!("{}", data.len().min(4))] })
}

#[test]
fn planted_failures_are_found_and_made_small() {
    let target = Target {
        name: "planted",
        judge: planted,
        seeds: |_| (0..4).map(|i| vec![i; 40]).collect(),
        mutate: |random, data, other| mutate::bytes(random, data, other, &[]),
        at_home: false,
    };
    let mut campaign = Campaign::new(target, Duration::from_millis(60), 1, Vec::new());
    assert!(campaign.findings.is_empty(), "the seeds are sound");
    campaign.run(4000);
    let told: Vec<&str> = campaign.findings.values().map(|f| f.promise.as_str()).collect();
    for promise in ["it panics", "it holds 104857600 bytes", "it takes", "Internal"] {
        assert!(told.iter().any(|t| t.contains(promise)), "{promise} is not among {told:?}");
    }
    assert_eq!(told.len(), 4, "{told:?}");
    assert!(
        campaign.findings.values().all(|finding| finding.input.len() == 4),
        "as small as can be"
    );
}

/// A thread that makes what others give back is not taken for one that holds it.
#[test]
fn memory_that_other_threads_give_back_does_not_count() {
    for _ in 0..48 {
        let large: Vec<u8> = Vec::with_capacity(64 << 20);
        std::thread::spawn(move || drop(large)).join().unwrap();
    }
    let (bytes, peak) = allocator::peak_of(|| std::hint::black_box(vec![1u8; 1 << 20]).len());
    assert_eq!(bytes, 1 << 20);
    assert!((1 << 20..2 << 20).contains(&peak), "{peak}");
    let refused = allocator::peak_of(|| Vec::<u8>::new().try_reserve_exact(3 << 30).is_err());
    assert!(refused.0, "so much is refused");
}
