//! The budget that a refusal names does when it is given, and much less does not: on scans that are
//! spread evenly, on a line, in clusters and in copies, on one thread and on several.

use std::path::Path;

use crate::support::command::{mebibytes, pointmill_told};
use crate::support::random::Random;
use crate::support::scan::Scan;
use pointmill::synth::Scene;

/// Runs pointmill in `folder` with a budget; gives its exit code and what it told on stderr.
fn with(folder: &Path, command: &str, budget: u64) -> (i32, String) {
    pointmill_told(folder, &format!("{command} --memory {budget}MiB"))
}

/// Scans that need very different tiles; the last has more points than tiles take in least memory.
fn scenes() -> Vec<(&'static str, Scan)> {
    let even = Scan::synthetic(Scene::Als, 30_000, 3);
    let mut random = Random(11);
    let cluster = even.moved(|i, p| match i % 3 {
        0 => p,
        _ => [0, 1, 2].map(|axis| [700, 700, 300][axis] + random.below(400) as i32),
    });
    let line = even.moved(|i, _| [17 * i as i32, 0, 0]);
    let copies = even.moved(|i, p| if i % 4 == 0 { p } else { [5_000, 5_000, (i % 7) as i32] });
    let heavy = Scan::synthetic(Scene::Als, 200_000, 5);
    vec![("even", even), ("cluster", cluster), ("line", line), ("copies", copies), ("heavy", heavy)]
}

#[test]
fn the_budget_that_a_refusal_names_does_and_sixteen_mebibytes_less_do_not() {
    let stages = ["--max-angle 0.3", "--side 2.5", "--side 100000 --method pca"];
    let (mut random, mut after_the_decode, mut fewer) = (Random(5), 0, 0);
    for (n, (what, scan)) in scenes().iter().enumerate() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        scan.write(&at.join("scan.las"));
        for (m, stages) in stages.iter().enumerate() {
            let most = if *what == "heavy" { 2 } else { 8 };
            let threads = 1 + (random.below(8) + n + m) % most;
            let command = format!("reduce scan.las -o out.laz --threads {threads} {stages}");
            let mut budget = 1 + random.below(20) as u64;
            let (mut refusals, mut is_last) = (0, false);
            let told = loop {
                let (code, told) = with(at, &command, budget);
                if code == 0 {
                    break told;
                }
                assert_eq!(code, 1, "{what}: {command} in {budget} MiB: {told}");
                let enough = mebibytes(&told);
                assert!(!is_last && enough > budget, "{what}: {command} in {budget} MiB: {told}");
                let (code, less) = with(at, &command, enough.saturating_sub(16).max(1));
                assert_eq!(code, 1, "{what}: {command} does in 16 MiB less: {told}{less}");
                // What is said before the decode may be no more than a lower bound, if it says so.
                is_last = refusals == 1 || !told.contains("at least");
                after_the_decode += usize::from(told.contains("the cube from"));
                refusals += 1;
                budget = enough;
            };
            fewer += usize::from(told.contains("leaves memory for"));
            println!("{what}: {command}: {budget} MiB after {refusals} refusals");
        }
    }
    assert!(after_the_decode >= 1, "{after_the_decode} refusals came from the points");
    assert!(fewer >= 1, "no scan was milled by fewer threads");
}

#[test]
fn rounds_are_refused_with_budgets_that_lead_to_one_that_does() {
    for (n, (what, scan)) in scenes().iter().enumerate() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        scan.write(&at.join("scan.las"));
        for stages in ["--keep 10%", "--tolerance 1"] {
            let command = format!("reduce scan.las -o out.laz --threads {} {stages}", 1 + n % 3);
            let (mut budget, mut refusals) = (5, 0);
            loop {
                let (code, told) = with(at, &command, budget);
                if code == 0 {
                    break;
                }
                // Each round may reach farther than those before it.
                let enough = mebibytes(&told);
                assert!(enough > budget && refusals < 4, "{what}: {command} in {budget}: {told}");
                assert!(refusals > 0 || told.contains("at least"), "{told}");
                (budget, refusals) = (enough, refusals + 1);
            }
            assert!(refusals > 0, "{what}: {command} in {budget}");
        }
    }
}

#[test]
fn a_side_that_samples_choose_is_refused_with_a_lower_bound_before_them_and_fits_in_the_end() {
    // Most points lie in one place: what the first cells take is not what the last do.
    let even = Scan::synthetic(Scene::Als, 400_000, 3);
    let mut random = Random(7);
    let scan = even.moved(|i, p| match i % 4 {
        0 => p,
        _ => [0, 1, 2].map(|axis| [7_000, 7_000, 300][axis] + random.below(60) as i32),
    });
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    scan.write(&at.join("scan.las"));
    let (mut budget, mut refusals, mut was_last) = (12, 0, false);
    loop {
        let (code, told) = with(at, "reduce scan.las -o out.las --threads 1 --side spread", budget);
        if code == 0 {
            break;
        }
        assert!(code == 1 && mebibytes(&told) > budget && !was_last, "{told}");
        was_last = !told.contains("at least");
        refusals += 1;
        assert!(refusals < 5, "{told}");
        budget = mebibytes(&told);
    }
    assert!(refusals > 1, "{refusals}");
}

#[test]
fn copies_that_differ_in_class_are_refused_with_a_lower_bound_and_fit_in_the_end() {
    // 200,000 copies of one position: neighbours in the order of their bytes differ in class.
    let even = Scan::synthetic(Scene::Als, 200_000, 3);
    let mut scan = even.moved(|_, _| [1_000, 2_000, 3_000]);
    let class = scan.schema.find("Classification").unwrap().clone();
    let (schema, mut random) = (scan.schema.clone(), Random(4));
    for record in scan.records.chunks_exact_mut(schema.stride) {
        let value = pointmill::point::Value::Unsigned(random.below(9) as u64);
        assert!(class.put(record, schema.endian, value));
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    scan.write(&at.join("scan.las"));
    let command = "reduce scan.las -o out.las --threads 1 --side spread --classes 2,6";
    let (mut budget, mut refusals, mut of_copies) = (1, 0, 0);
    loop {
        let (code, told) = with(at, command, budget);
        if code == 0 {
            break;
        }
        assert!(code == 1 && told.contains("at least"), "{told}");
        assert!(mebibytes(&told) > budget, "{told}");
        of_copies += usize::from(told.contains("copies that differ in class or flags"));
        refusals += 1;
        assert!(refusals < 5, "{told}");
        budget = mebibytes(&told);
    }
    assert!(of_copies > 0, "the copies took no more than what is planned");
}
