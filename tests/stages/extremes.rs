//! Every number that an argument or a key can carry, at its extremes: it works or is refused with a
//! message, and nothing panics, aborts, hangs or wraps.

use std::path::Path;
use std::time::{Duration, Instant};

use pointmill::ErrorKind;
use pointmill::{Graph, Overrides, Quiet, Registry};

use crate::support::case::execute;
use crate::support::command;

/// Runs pointmill in `folder`; gives its exit code and what it told on stderr.
fn pointmill(folder: &Path, arguments: &[&str]) -> (i32, String) {
    let (code, _, told) = command::pointmill(folder, arguments);
    (code, told)
}

/// A pipeline of all stages that have numbers, with `value` for `key` of `stage`.
fn pipeline(folder: &Path, points: &str, stage: &str, key: &str, value: &str) -> String {
    let run = if stage == "run" { format!("{key} = {value}\n") } else { String::new() };
    let mut text = format!("[run]\n{run}");
    if key != "threads" {
        text += "threads = 2\n";
    }
    let output = folder.join("out.las");
    let stages = [
        ("synth", format!("scene = 'part'\npoints = {points}"), "points"),
        ("outliers", String::new(), ""),
        ("normals", String::new(), ""),
        ("cells", String::new(), ""),
        ("median", String::new(), ""),
        ("grid", "side = 0.5".to_owned(), "side"),
        ("write", format!("path = '{}'", output.display()), ""),
    ];
    for (kind, keys, own) in stages {
        text += &format!("[[stage]]\nkind = '{kind}'\n");
        if kind == stage {
            text += &format!("{key} = {value}\n");
        }
        if kind != stage || own != key {
            text += &format!("{keys}\n");
        } else if kind == "synth" {
            text += "scene = 'part'\n";
        }
        if kind == stage && key == "radius" {
            text += "method = 'radius'\nmin_neighbors = 2\n";
        }
        if kind == stage && key == "min_neighbors" {
            text += "method = 'radius'\nradius = 1.0\n";
        }
    }
    text
}

const WHOLE: [&str; 10] = [
    "-9223372036854775808",
    "-1",
    "0",
    "1",
    "255",
    "65536",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "340282366920938463463374607431768211455",
];
const REAL: [&str; 11] = [
    "nan",
    "inf",
    "-inf",
    "-0.0",
    "0",
    "5e-324",
    "1e-300",
    "1e-9",
    "1e18",
    "1e300",
    "1.7976931348623157e308",
];

#[test]
fn numbers_of_every_stage_work_or_are_refused() {
    let whole: &[(&str, &[&str])] = &[
        ("run", &["tile_points"]),
        ("synth", &["seed"]),
        ("outliers", &["neighbors", "min_neighbors"]),
        ("normals", &["neighbors"]),
        ("cells", &["min_points", "keep"]),
        ("median", &["passes"]),
    ];
    let real: &[(&str, &[&str])] = &[
        ("run", &["lattice", "z_scale"]),
        ("synth", &["noise"]),
        ("outliers", &["multiplier", "radius"]),
        ("cells", &["side", "max_angle", "max_side", "min_spacing"]),
        ("grid", &["side"]),
        ("write", &["scale"]),
    ];
    let of = |keys: &[(&'static str, &'static [&'static str])], values: &'static [&'static str]| {
        let each = keys.iter().flat_map(|(stage, keys)| keys.iter().map(move |key| (*stage, *key)));
        each.flat_map(|(stage, key)| values.iter().map(move |v| (stage, key, (*v).to_owned())))
            .collect::<Vec<_>>()
    };
    let mut cases = of(whole, &WHOLE);
    cases.extend(of(real, &REAL));
    for share in ["0%", "1e-300%", "100%", "1e300%", "nan%", "1e300", "-1%"] {
        cases.push(("cells", "keep", format!("'{share}'")));
    }
    for v in REAL {
        cases.push(("cells", "reference", format!("[{v}, 1e-300, 0.0]")));
        cases.push(("write", "offset", format!("[{v}, 0.0, {v}]")));
    }
    let (mut worked, mut refused) = (0, 0);
    for (stage, key, value) in cases {
        let folder = tempfile::tempdir().unwrap();
        let text = pipeline(folder.path(), "600", stage, key, &value);
        let begun = Instant::now();
        let outcome = execute(&text, &Overrides::default(), &Quiet);
        match outcome {
            Ok(_) => worked += 1,
            Err(error) => {
                assert_ne!(error.kind(), ErrorKind::Internal, "{stage}.{key} = {value}: {error:?}");
                refused += 1;
            }
        }
        let seconds = begun.elapsed().as_secs();
        assert!(seconds < 30, "{stage}.{key} = {value}: {seconds} s");
    }
    assert!(worked > 60 && refused > 60, "{worked} worked, {refused} were refused");
}

#[test]
fn points_without_end_are_planned_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    for points in WHOLE {
        let text = pipeline(folder.path(), points, "", "", "");
        let plan = Graph::parse(&text, "p.toml", &Registry::builtin())
            .and_then(|p| p.plan(&Overrides::default()));
        if let Err(error) = plan {
            assert_ne!(error.kind(), ErrorKind::Internal, "{points}: {error:?}");
        } else {
            assert!(points.parse::<u64>().unwrap() <= 1 << 33, "{points} points fit no memory");
        }
    }
}

#[test]
fn threads_and_memory_beyond_reason_are_refused_in_a_message() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("p.toml");
    for threads in ["18446744073709551615", "9223372036854775808", "4294967296", "1025", "0", "-1"]
    {
        std::fs::write(&file, pipeline(folder.path(), "600", "", "", "")).unwrap();
        for memory in ["64MiB", "18446744073709551615"] {
            let argument = format!("--threads={threads}");
            let plan = ["plan", "p.toml", "--memory", memory, &argument];
            let (code, told) = pointmill(folder.path(), &plan);
            assert_eq!(code, 2, "{threads}: {told}");
            assert!(told.contains("1024") || told.contains("1 or more"), "{told}");
        }
        std::fs::write(&file, pipeline(folder.path(), "600", "run", "threads", threads)).unwrap();
        let (code, told) = pointmill(folder.path(), &["plan", "p.toml"]);
        assert_eq!(code, 2, "{threads}: {told}");
        assert!(told.contains("threads"), "{told}");
    }
    let plan =
        Graph::parse(&pipeline(folder.path(), "600", "", "", ""), "p.toml", &Registry::builtin());
    let threads = std::num::NonZeroUsize::new(usize::MAX);
    let error = plan.unwrap().plan(&Overrides { threads, ..Overrides::default() }).err().unwrap();
    assert_eq!(error.kind(), ErrorKind::Pipeline);
    assert!(error.remedy().unwrap().contains("`run.threads`"), "{error:?}");
    // What is within the bound is a question of memory alone.
    std::fs::write(&file, pipeline(folder.path(), "600", "", "", "")).unwrap();
    let plan = ["plan", "p.toml", "--threads", "1024", "--memory", "64MiB"];
    let (code, told) = pointmill(folder.path(), &plan);
    assert_eq!(code, 1, "{told}");
    assert!(told.contains("64 MiB is too small: 1024 threads"), "{told}");
    for memory in ["1", "18446744073709551615", "16777215TiB"] {
        let (code, told) = pointmill(folder.path(), &["plan", "p.toml", "--memory", memory]);
        assert_eq!(code, i32::from(memory == "1"), "{memory}: {told}");
    }
}

#[test]
fn more_stages_than_a_pipeline_has_are_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = "[[stage]]\nkind = 'synth'\nscene = 'plane'\npoints = 9\n".to_owned();
    for n in 0..30_000 {
        text += &format!("[[stage]]\nkind = 'write'\npath = '{n}.las'\nname = 'n{n}'\n");
    }
    std::fs::write(folder.path().join("p.toml"), text).unwrap();
    let begun = Instant::now();
    let (code, told) = pointmill(folder.path(), &["run", "p.toml"]);
    assert_eq!(code, 2, "{told}");
    assert!(told.contains("a pipeline has at most 256 stages"), "{told}");
    assert!(begun.elapsed() < Duration::from_secs(10), "{:?}", begun.elapsed());
}
