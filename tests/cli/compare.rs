//! `compare`: the same records or not, how far apart, and depth images.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use serde_json::Value;

use crate::support::command::{done, fails, pointmill};

/// What is said of two scans as JSON, and the exit code.
fn told(at: &Path, arguments: &[&str]) -> (i32, Value) {
    let (code, told, error) = pointmill(at, &[&["compare"], arguments, &["--json"]].concat());
    (code, serde_json::from_str(&told).unwrap_or_else(|_| panic!("{arguments:?}: {told}{error}")))
}

/// What is said of the records of two scans, whatever the threads and the memory.
fn records(at: &Path, first: &str, second: &str) -> Value {
    let (code, all) = told(at, &[first, second]);
    assert_eq!((code, &all["distances"], &all["depth"]), (0, &Value::Null, &Value::Null));
    let few = [first, second, "--threads", "1", "--memory", "64MiB"];
    assert_eq!(told(at, &few).1, all);
    all["records"].clone()
}

/// A text with a record a line: x, y, z and two more values.
fn write(at: &Path, name: &str, lines: &[[i64; 5]]) {
    let mut text = "x,y,z,intensity,classification\n".to_owned();
    for [x, y, z, intensity, class] in lines {
        writeln!(text, "{x},{y},{z}.5,{intensity},{class}").unwrap();
    }
    fs::write(at.join(name), text).unwrap();
}

/// Numbers that look random.
fn random(seed: &mut u64, below: u64) -> i64 {
    *seed = seed.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
    ((*seed >> 33) % below) as i64
}

#[test]
fn scans_with_the_same_records_are_the_same_whatever_their_format() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    done(at, &["synth", "part", "-n", "20k", "-o", "scan.laz"]);
    for (name, compared) in [
        ("copy.laz", "bytes"),
        ("copy.las", "bytes"),
        ("copy.ply", "values"),
        ("copy.csv", "values"),
        ("copy.pcd", "values"),
    ] {
        done(at, &["convert", "scan.laz", "-o", name, "--quiet"]);
        let told = records(at, "scan.laz", name);
        assert_eq!(told["same"], true, "{name}: {told:#}");
        assert_eq!((&told["same_order"], &told["compared"]), (&true.into(), &compared.into()));
        assert_eq!(told["second_in_first"], "in-order");
        assert_eq!(told["only_first"]["count"], 0);
    }
    // Other steps, which hold the same places: 12.345 is 12345 of them, or 123450.
    done(at, &["convert", "scan.laz", "-o", "cm.las", "--scale", "0.01", "--quiet"]);
    let finer = ["--scale", "0.0001", "--offset", "1.5,2,3"];
    done(at, &[&["convert", "cm.las", "-o", "fine.las", "--quiet"], &finer[..]].concat());
    let told = records(at, "cm.las", "fine.las");
    assert_eq!((&told["same_order"], &told["compared"]), (&true.into(), &"values".into()));
    let said = done(at, &["compare", "scan.laz", "copy.laz"]);
    assert!(said.contains("records    the same, in the same order\n"), "{said}");
    assert_eq!(done(at, &["compare", "scan.laz", "copy.laz", "-q"]), "");
}

#[test]
fn an_other_order_and_parts_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut seed = 3;
    let all: Vec<[i64; 5]> = (0..4000)
        .map(|n| [n % 50, random(&mut seed, 40), random(&mut seed, 3), n % 7, n % 3])
        .collect();
    write(at, "all.csv", &all);
    let mut turned = all.clone();
    turned.swap(1200, 3100);
    write(at, "turned.csv", &turned);
    let told = records(at, "all.csv", "turned.csv");
    assert_eq!((&told["same"], &told["same_order"]), (&true.into(), &false.into()));
    let [x, y, z] = [0, 1, 2].map(|axis| all[1200][axis] as f64);
    assert_eq!(told["order_differs"]["number"], 1200);
    assert_eq!(told["order_differs"]["at"], serde_json::json!([x, y, z + 0.5]));
    assert_eq!(told["first_in_second"], "in-another-order");

    let part: Vec<[i64; 5]> = all.iter().copied().step_by(3).collect();
    write(at, "part.csv", &part);
    let told = records(at, "all.csv", "part.csv");
    assert_eq!(told["second_in_first"], "in-order", "{told:#}");
    assert_eq!((&told["first_in_second"], &told["same"]), (&"no".into(), &false.into()));
    assert_eq!(told["only_first"]["count"], all.len() - part.len());
    assert_eq!(told["only_second"]["count"], 0);
    let other = records(at, "part.csv", "all.csv");
    assert_eq!(other["first_in_second"], "in-order");
    assert_eq!(other["only_second"], told["only_first"]);
    let back: Vec<[i64; 5]> = part.iter().rev().copied().collect();
    write(at, "back.csv", &back);
    let told = records(at, "all.csv", "back.csv");
    assert_eq!(told["second_in_first"], "in-another-order", "{told:#}");
    for (rules, code) in
        [("subset", 0), ("ordered-subset", 3), ("same", 3), ("subset, same-order", 3)]
    {
        assert_eq!(told_code(at, &["all.csv", "back.csv", "--accept", rules]), code, "{rules}");
    }
    assert_eq!(told_code(at, &["all.csv", "turned.csv", "--accept", "same,subset"]), 0);
    assert_eq!(told_code(at, &["all.csv", "turned.csv", "--accept", "same-order"]), 3);
}

fn told_code(at: &Path, arguments: &[&str]) -> i32 {
    told(at, arguments).0
}

/// What either scan has more often than the other, and pairs of these at one position.
fn by_counting(first: &[[i64; 5]], second: &[[i64; 5]]) -> (u64, u64, u64) {
    let mut counts = BTreeMap::<[i64; 5], i64>::new();
    first.iter().for_each(|line| *counts.entry(*line).or_default() += 1);
    second.iter().for_each(|line| *counts.entry(*line).or_default() -= 1);
    let mut places = BTreeMap::<[i64; 3], [u64; 2]>::new();
    for ([x, y, z, ..], count) in &counts {
        let place = places.entry([*x, *y, *z]).or_default();
        place[usize::from(*count < 0)] += count.unsigned_abs();
    }
    let sum = |side: usize| places.values().map(|place| place[side]).sum();
    (sum(0), sum(1), places.values().map(|[a, b]| a.min(b)).sum())
}

#[test]
fn what_differs_is_counted_as_by_counting_every_record() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut seed = 11;
    for round in 0..12 {
        // From scans of copies at a few positions to such with hardly any.
        let wide = [2, 3, 10, 40][round % 4];
        let mut scan = |count: usize| -> Vec<[i64; 5]> {
            let mut line = || [wide, wide, 2, 4, 3].map(|below| random(&mut seed, below));
            (0..count).map(|_| line()).collect()
        };
        let (first, mut second) = (scan(300 + 10 * round), scan(200));
        second.extend(&first[50..50 + 20 * round]);
        write(at, "first.csv", &first);
        write(at, "second.csv", &second);
        let told = records(at, "first.csv", "second.csv");
        let counted = |name: &str| told[name]["count"].as_u64().unwrap();
        let pairs = told["changed"]["pairs"].as_u64().unwrap();
        let found = (counted("only_first"), counted("only_second"), pairs);
        assert_eq!(found, by_counting(&first, &second), "{round}: {told:#}");
        let is_new = |line: &[i64; 5], of: &[[i64; 5]]| !of.contains(line);
        let first_new = first.iter().position(|line| is_new(line, &second));
        let place = told["only_first"]["places"][0]["number"].as_u64();
        assert!(place.unwrap() as usize <= first_new.unwrap_or(usize::MAX), "{told:#}");
    }
}

#[test]
fn changed_records_say_which_dimensions_differ() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    done(at, &["synth", "als", "-n", "20k", "-o", "scan.laz"]);
    let change = "read scan.laz ! assign 'Intensity = Intensity + 1' where='Classification == 2' ! \
                  assign 'UserData = 7' where='Classification == 2 and ReturnNumber > 1' ! \
                  write other.laz";
    done(at, &["run", change]);
    let count = |condition: &str| {
        let line = format!("read scan.laz ! filter where='{condition}' ! write count.laz");
        done(at, &["run", &line]);
        let info: Value =
            serde_json::from_str(&done(at, &["info", "count.laz", "--json"])).unwrap();
        info["points"].as_u64().or(info[0]["points"].as_u64()).unwrap()
    };
    let ground = count("Classification == 2");
    let further = count("Classification == 2 and ReturnNumber > 1");
    assert!(ground > 100, "{ground}");
    let told = records(at, "scan.laz", "other.laz");
    assert_eq!(told["changed"]["pairs"], ground, "{told:#}");
    let mut expected = vec![serde_json::json!({ "name": "Intensity", "pairs": ground })];
    if further > 0 {
        expected.push(serde_json::json!({ "name": "UserData", "pairs": further }));
    }
    assert_eq!(told["changed"]["dimensions"], Value::Array(expected));
    let place = &told["changed"]["places"][0];
    assert_eq!(place["first"], place["second"]);
    assert_eq!(told["only_first"]["places"][0]["number"], place["first"]);
    let said = done(at, &["compare", "scan.laz", "other.laz"]);
    assert!(said.contains("at the same position with other values: number "), "{said}");
}

/// The coordinates of a text.
fn points(at: &Path, name: &str) -> Vec<[f64; 3]> {
    let text = fs::read_to_string(at.join(name)).unwrap();
    let rows = text.lines().skip(1);
    rows.map(|row| {
        let mut numbers = row.split(',').map(|number| number.parse().unwrap());
        [0; 3].map(|_| numbers.next().unwrap())
    })
    .collect()
}

/// Mean, root of mean squares, median and largest of the distances to the nearest, and the place.
fn by_kiddo(from: &[[f64; 3]], to: &[[f64; 3]]) -> ([f64; 4], [f64; 3]) {
    let tree = ImmutableKdTree::<f64, 3>::new_from_slice(to);
    let far = |p: &[f64; 3]| tree.nearest_one::<SquaredEuclidean>(p).distance.sqrt();
    let mut all: Vec<(f64, [f64; 3])> = from.iter().map(|p| (far(p), *p)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let count = all.len() as f64;
    let mean = all.iter().map(|(d, _)| d).sum::<f64>() / count;
    let rms = (all.iter().map(|(d, _)| d * d).sum::<f64>() / count).sqrt();
    let (max, at) = *all.last().unwrap();
    ([mean, rms, all[all.len().div_ceil(2) - 1].0, max], at)
}

#[test]
fn distances_are_those_of_another_search() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    done(at, &["synth", "part", "-n", "40k", "--noise", "0.02", "-o", "part.csv", "-q"]);
    done(at, &["synth", "part", "-n", "7k", "--seed", "4", "-o", "other.csv", "-q"]);
    done(at, &["run", "read other.csv ! transform translate=[300,0,2] ! write far.csv", "-q"]);
    done(at, &["run", "read part.csv ! sample every=9 ! write thin.csv", "-q"]);
    for (first, second) in
        [("part.csv", "other.csv"), ("part.csv", "far.csv"), ("part.csv", "thin.csv")]
    {
        let (code, all) = told(at, &[first, second, "--distances"]);
        assert_eq!(code, 0);
        let few = [first, second, "--distances", "--threads", "1", "--memory", "80MiB"];
        assert_eq!(told(at, &few).1, all);
        let distances = &all["distances"];
        let scans = [points(at, first), points(at, second)];
        let mut largest = 0f64;
        for (direction, from, to) in [("first_to_second", 0, 1), ("second_to_first", 1, 0)] {
            let nearest = &distances[direction]["nearest"];
            let (expected, place) = by_kiddo(&scans[from], &scans[to]);
            assert_eq!(nearest["points"], scans[from].len());
            for (name, expected) in ["mean", "rms", "p50", "max"].into_iter().zip(expected) {
                let found = nearest[name].as_f64().unwrap();
                // Percentiles are upper edges of bins of 1 %.
                let slack = if name == "p50" { 1.011 } else { 1.0 + 1e-6 };
                let is_right = found >= expected * (1.0 - 1e-6) && found <= expected * slack + 1e-9;
                assert!(is_right, "{first} {second} {direction} {name}: {found} {expected}");
            }
            if expected[3] > 0.0 {
                let found: Vec<f64> = serde_json::from_value(nearest["at"].clone()).unwrap();
                let off = found.iter().zip(place).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(off < 1e-6, "{direction}: {found:?} {place:?}");
            }
            largest = largest.max(expected[3]);
            let plane = distances[direction]["plane"]["mean"].as_f64().unwrap();
            assert!(plane <= nearest["mean"].as_f64().unwrap(), "{distances:#}");
        }
        let hausdorff = distances["hausdorff"].as_f64().unwrap();
        assert!((hausdorff - largest).abs() <= 1e-6 * largest, "{hausdorff} {largest}");
    }
    let moved = told(at, &["part.csv", "part.csv", "--distances"]).1;
    assert_eq!(moved["distances"]["hausdorff"], 0.0);
}

#[test]
fn distances_to_planes_are_those_to_the_plane_that_points_lie_in() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let grid = |height: i64, half: i64| {
        let line = move |n: i64| [2 * (n % 60) + half, 2 * (n / 60) + half, height, 0, 0];
        (0..3600).map(line).collect::<Vec<_>>()
    };
    write(at, "low.csv", &grid(4, 0));
    write(at, "high.csv", &grid(7, 1));
    let (code, all) =
        told(at, &["low.csv", "high.csv", "--accept", "max <= 3.4, rms < 3.4, subset"]);
    assert_eq!(code, 3, "no subset");
    let rules: Vec<bool> = all["accept"]["rules"]
        .as_array()
        .unwrap()
        .iter()
        .map(|rule| rule["passed"].as_bool().unwrap())
        .collect();
    assert_eq!(rules, [true, true, false]);
    let first = &all["distances"]["first_to_second"];
    assert_eq!(first["plane"]["max"], 3.0, "{first:#}");
    assert_eq!(first["nearest"]["p50"], first["nearest"]["max"]);
    assert!((first["nearest"]["max"].as_f64().unwrap() - 11f64.sqrt()).abs() < 1e-6);
    let (code, said, error) =
        pointmill(at, &["compare", "low.csv", "high.csv", "--accept", "max <= 3, p99 < 4"]);
    assert_eq!(code, 3);
    assert!(
        said.contains("accept     FAIL  max <= 3, and it is 3.32\n           PASS  "),
        "{said}"
    );
    assert!(error.contains("not accepted: max <= 3, and it is 3.32"), "{error}");
}

#[test]
fn rules_that_are_none_are_told_with_what_would_be() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(at, "a.csv", &[[1, 2, 3, 4, 5]]);
    for (rules, told) in [
        ("sam", "did you mean `same`?"),
        ("max", "`max` needs a bound"),
        ("max >= 1", "from above"),
        ("same = 1", "`same` has no bound"),
        ("kept >= 1", "there is no rule `kept`"),
        ("max <= 5mm", "write a number: `max <= 0.005`"),
    ] {
        fails(at, &["compare", "a.csv", "a.csv", "--accept", rules], 2, &[told, "--accept"]);
    }
    fails(at, &["compare", "a.csv", "a.csv", "--report", "r.json"], 2, &["--report"]);
    fails(at, &["compare", "a.csv", "none.csv"], 1, &["none.csv"]);
}

#[test]
fn points_that_are_nowhere_and_scans_of_a_few_get_an_answer() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\n\
                  property double z\nend_header\n";
    fs::write(at.join("a.ply"), format!("{header}nan 0 0\n1 2 3\n4 5 6\n")).unwrap();
    fs::write(at.join("b.ply"), format!("{header}nan 0 0\n4 5 6\n1 2 7\n")).unwrap();
    let told_of = records(at, "a.ply", "b.ply");
    assert_eq!(
        (&told_of["only_first"]["count"], &told_of["only_second"]["count"]),
        (&1.into(), &1.into())
    );
    assert_eq!(records(at, "a.ply", "a.ply")["same_order"], true);
    fails(at, &["compare", "a.ply", "b.ply", "--distances"], 1, &["not finite", "--nonfinite"]);
    let (code, all) = told(at, &["a.ply", "b.ply", "--distances", "--nonfinite", "drop"]);
    assert_eq!((code, &all["distances"]["hausdorff"]), (0, &4.0.into()));
    assert_eq!(all["records"]["first"], 2);

    fs::write(at.join("none.csv"), "x,y,z,intensity,classification\n").unwrap();
    write(at, "one.csv", &[[1, 2, 3, 4, 5]]);
    write(at, "two.csv", &[[1, 2, 3, 4, 5], [1, 2, 5, 4, 5]]);
    let (code, all) = told(at, &["one.csv", "two.csv", "--distances", "--accept", "max <= 2"]);
    assert_eq!((code, &all["distances"]["hausdorff"]), (0, &2.0.into()));
    assert_eq!(all["records"]["first_in_second"], "in-order");
    let (code, all) = told(at, &["one.csv", "one.csv", "--distances", "--accept", "same"]);
    assert_eq!((code, &all["distances"]["hausdorff"]), (0, &0.0.into()));
    let empty = header.replace("vertex 3", "vertex 0");
    fs::write(at.join("none.ply"), &empty).unwrap();
    let (code, all) = told(at, &["none.ply", "a.ply", "--distances", "--nonfinite", "drop"]);
    assert_eq!((code, &all["distances"]["hausdorff"]), (0, &Value::Null));
    assert_eq!(all["records"]["first_in_second"], "in-order", "{all:#}");
    let (code, all) = told(at, &["none.ply", "none.ply", "--accept", "same"]);
    assert_eq!((code, &all["records"]["first"]), (0, &0.into()));
}

#[test]
fn noise_is_compared_and_not_measured_unless_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let ground: Vec<[i64; 5]> = (0..400).map(|n| [n % 20, n / 20, 0, 1, 2]).collect();
    let noisy = [&ground[..], &[[3, 3, 90, 1, 7], [4, 4, 80, 1, 18]]].concat();
    write(at, "ground.csv", &ground);
    write(at, "noisy.csv", &noisy);
    let of = |more: &[&str]| {
        let (code, all) =
            told(at, &[&["ground.csv", "noisy.csv", "--distances", "--depth"], more].concat());
        assert_eq!(code, 0);
        let largest = all["distances"]["hausdorff"].as_f64().unwrap();
        let seen = all["depth"]["second"]["points"].as_u64().unwrap();
        (all["records"]["only_second"]["count"].as_u64().unwrap(), largest, seen)
    };
    assert_eq!(of(&[]), (2, 0.0, 400));
    assert_eq!(of(&["--noise", "drop"]), (0, 0.0, 400));
    assert_eq!(of(&["--noise", "keep"]), (2, 90.0, 402));
}

#[test]
fn depth_images_are_compared_where_they_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    done(at, &["synth", "plane", "-n", "5k", "-o", "scan.ply"]);
    done(at, &["run", "read scan.ply ! transform translate=[0,0,2] ! write up.ply"]);
    assert_eq!(told(at, &["scan.ply", "up.ply"]).1["depth"], Value::Null);
    for asked in [&["--depth"][..], &["--pixels", "64"], &["--axis", "z"]] {
        let depth = &told(at, &[&["scan.ply", "up.ply"], asked].concat()).1["depth"];
        assert!((depth["rms"].as_f64().unwrap() - 2.0).abs() < 1e-6, "{asked:?} {depth:#}");
    }
    let said = done(at, &["compare", "scan.ply", "up.ply", "--depth"]);
    assert!(said.contains("\ndepth      SSD ") && said.starts_with("points     "), "{said}");
}
