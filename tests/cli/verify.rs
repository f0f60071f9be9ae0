//! `verify`: what it finds in reductions that are right, and in those that were tampered with.

use std::path::Path;

use crate::support::command::{done, pointmill};
use serde_json::Value;

/// A scan, and its reduction to a tolerance in `thin.las`.
fn reduced() -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    done(at.path(), &["synth", "part", "-n", "30k", "--noise", "0.02", "-o", "scan.las"]);
    let to = ["--tolerance", "0.3", "--max-spacing", "10"];
    done(at.path(), &[&["reduce", "scan.las", "-o", "thin.las"], &to[..]].concat());
    at
}

/// The exit code and what is said of `file` as a reduction of the scan.
fn verified(at: &Path, file: &str) -> (i32, Value) {
    let asked = ["--tolerance", "0.3", "--max-spacing", "10", "--json"];
    let (code, told, error) = pointmill(at, &[&["verify", "scan.las", file], &asked[..]].concat());
    assert_eq!(code != 0, error.contains("does not hold"), "{error}");
    (code, serde_json::from_str(&told).unwrap_or_else(|_| panic!("{told}{error}")))
}

/// The same of what the stages `line` make of the reduction.
fn tampered(at: &Path, line: &str) -> (i32, Value) {
    done(at, &["run", &format!("read thin.las ! {line} ! write other.las")]);
    verified(at, "other.las")
}

#[test]
fn a_reduction_to_a_tolerance_holds() {
    let at = reduced();
    let (code, told) = verified(at.path(), "thin.las");
    assert_eq!((code, &told["foreign"], &told["original"]), (0, &0.into(), &30_000.into()));
    let kept = told["reduced"].as_u64().unwrap();
    let exceptions = told["exceptions"].as_u64().unwrap();
    assert!(kept > 500 && kept < 20_000 && exceptions > 0, "{told:#}");
    assert!(told["surface"]["max"].as_f64().unwrap() <= 0.3, "{told:#}");
    assert!(told["coverage"]["max"].as_f64().unwrap() <= 10.0, "{told:#}");
    assert_eq!(told["surface"]["positions"].as_u64().unwrap(), 30_000 - kept);
    // Whatever the memory, the threads and the tiles are.
    let of = |more: &[&str]| {
        let all = [&["verify", "scan.las", "thin.las", "--json"], more].concat();
        pointmill(at.path(), &all).1
    };
    let told = of(&[]);
    assert_eq!(of(&["--memory", "80MiB", "--threads", "1"]), told);
    let said = done(at.path(), &["verify", "scan.las", "thin.las"]);
    assert!(said.contains("all are of the original") && said.contains("\nholds: "), "{said}");
    let said = done(at.path(), &["verify", "scan.las", "thin.las", "--tolerance", "0.3", "-q"]);
    assert_eq!(said, "");
}

#[test]
fn a_scan_that_is_not_the_original_is_told_at_once_however_far_away_it_is() {
    let at = reduced();
    let at = at.path();
    done(at, &["synth", "als", "-n", "20k", "-o", "far.las"]);
    done(at, &["synth", "part", "-n", "20k", "--seed", "9", "-o", "near.las"]);
    done(at, &["reduce", "scan.las", "-o", "few.las", "--keep", "300"]);
    for original in ["far.las", "near.las"] {
        for thin in ["thin.las", "few.las"] {
            let (code, told, error) = pointmill(at, &["verify", original, thin, "--json"]);
            let told: Value = serde_json::from_str(&told).unwrap();
            assert!(code == 1 && error.contains("does not hold"), "{error}");
            assert_eq!(told["foreign"], told["reduced"]);
            assert_eq!(told["surface"]["positions"], 20_000, "{told:#}");
        }
    }
}

#[test]
fn a_spacing_that_is_asked_for_holds_or_is_refused() {
    let at = reduced();
    let at = at.path();
    for spacing in ["3", "0.5", "0.001"] {
        let asked = ["reduce", "scan.las", "-o", "o.las", "--keep", "1%", "--max-spacing", spacing];
        let (code, _, error) = pointmill(at, &asked);
        assert!(code != 0 && error.contains("takes more than the 300 points"), "{error}");
        assert!(error.contains("--max-spacing") && error.contains("--keep"), "{error}");
    }
    // Where the number is free it follows.
    for spacing in ["8", "2"] {
        let said = done(at, &["reduce", "scan.las", "-o", "o.las", "--max-spacing", spacing]);
        assert!(said.contains("chosen "), "{said}");
        done(at, &["verify", "scan.las", "o.las", "--max-spacing", spacing]);
    }
    done(at, &["reduce", "scan.las", "-o", "o.las", "--keep", "20%", "--max-spacing", "4"]);
    done(at, &["verify", "scan.las", "o.las", "--max-spacing", "4"]);
}

#[test]
fn what_was_tampered_with_does_not_hold() {
    let at = reduced();
    let at = at.path();
    let (_, right) = verified(at, "thin.las");
    let exceptions = right["exceptions"].as_u64().unwrap();
    // Every exception is one as the surface is farther away than the tolerance.
    let (code, told) = tampered(at, "filter where=\"KeepRank < 65535\"");
    assert_eq!((code, told["beyond_tolerance"].as_u64()), (1, Some(exceptions)), "{told:#}");
    // One record changed, moved by a step, twice; all of a corner left out.
    let first = "sample every=1000000";
    done(at, &["run", &format!("read thin.las ! {first} ! write one.las")]);
    let with_one = |stages: &str| {
        done(at, &["run", &format!("read one.las ! {stages} ! write changed.las")]);
        done(at, &["run", "read [thin.las,changed.las] ! write other.las"]);
        verified(at, "other.las")
    };
    for change in
        ["assign set=\"Intensity = 4321\"", "transform translate=[0.00001,0,0]", "tap name=same"]
    {
        let (code, told) = with_one(change);
        assert_eq!((code, told["foreign"].as_u64()), (1, Some(1)), "{change}: {told:#}");
        assert!(told["first_foreign"]["number"].is_u64(), "{told:#}");
    }
    let (code, told) = tampered(at, "filter where=\"X < 10 or Y < 10\"");
    let far = told["beyond_spacing"].as_u64().unwrap() + told["beyond_tolerance"].as_u64().unwrap();
    assert!(code == 1 && far > 100 && told["foreign"] == 0, "{told:#}");
}

#[test]
fn points_that_a_stage_moved_are_told_from_others() {
    let at = reduced();
    let at = at.path();
    done(at, &["run", "read scan.las ! sample every=10 ! smooth neighbors=8 ! write moved.las"]);
    let (code, told) = verified(at, "moved.las");
    let [foreign, synthetic] =
        ["foreign", "foreign_synthetic"].map(|name| told[name].as_u64().unwrap());
    assert!(code == 1 && foreign > 2_000 && synthetic == foreign, "{told:#}");
    let (_, said, _) = pointmill(at, &["verify", "scan.las", "moved.las"]);
    let line = said.lines().find(|line| line.starts_with("records ")).unwrap();
    assert!(line.contains(" synthetic, as points that a stage moved; the first is"), "{line}");
    // Places have the digits of the lattice, and no noise of binary fractions.
    for line in said.lines().filter(|line| line.contains(" at (")) {
        let (_, place) = line.rsplit_once(" at (").unwrap();
        assert!(place.len() < 40, "{line}");
    }
    // Of records that were changed otherwise none is synthetic.
    let (_, told) = tampered(at, "assign set=\"Intensity = 4321\"");
    assert_eq!(told["foreign_synthetic"], 0);
}

#[test]
fn other_formats_are_compared_by_what_they_have() {
    let at = reduced();
    let at = at.path();
    // The note of the run that made it has no place in PLY, and that is said.
    pointmill(at, &["convert", "thin.las", "-o", "thin.ply"]);
    let (code, told) = verified(at, "thin.ply");
    assert_eq!((code, told["foreign"].as_u64()), (0, Some(0)), "{told:#}");
    pointmill(at, &["convert", "thin.las", "-o", "less.ply", "--drop", "Intensity"]);
    let (code, told) = verified(at, "less.ply");
    assert_eq!((code, &told["not_compared"]), (0, &serde_json::json!(["Intensity"])), "{told:#}");
}

#[test]
fn what_is_cut_off_is_what_is_reduced_to_as_many() {
    let at = reduced();
    let at = at.path();
    let reduce = |keep: &str, to: &str| {
        done(at, &["reduce", "scan.las", "-o", to, "--keep", keep, "--ranks"]);
    };
    let points = |name: &str| {
        let bytes = std::fs::read(at.join(name)).unwrap();
        let begin = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
        bytes[begin..].to_vec()
    };
    reduce("20%", "ranked.las");
    for keep in ["1", "777", "3000", "6k"] {
        reduce(keep, "direct.las");
        done(at, &["cut", "ranked.las", "--keep", keep, "-o", "cut.las"]);
        assert!(points("cut.las") == points("direct.las"), "{keep}");
    }
    // Several numbers in one read.
    let cut = |keep: &str, to: &str| {
        let cut = format!("[[stage]]\nkind='cut'\nkeep='{keep}'\nfrom='all'\n");
        format!("{cut}[[stage]]\nkind='write'\npath='{to}'\n")
    };
    let read = "[[stage]]\nkind='read'\nname='all'\npath='ranked.las'\n";
    // By a length: what was kept at that distance, which is a number like any other.
    let points_of = |keep: &[&str]| {
        let cut = [&["cut", "ranked.las", "-o", "cut.las"], keep].concat();
        let told = done(at, &cut);
        told.split(" in, ").nth(1).unwrap().split(' ').next().unwrap().replace(',', "")
    };
    let (coarse, fine) = (points_of(&["--spacing", "10"]), points_of(&["--spacing", "4"]));
    assert!(coarse.parse::<u64>().unwrap() * 3 < fine.parse::<u64>().unwrap(), "{coarse} {fine}");
    reduce(&fine, "direct.las");
    assert!(points("cut.las") == points("direct.las"), "{fine}");
    let (code, _, told) = pointmill(at, &["cut", "ranked.las", "--keep", "2mm", "-o", "o.las"]);
    assert!(code == 2 && told.contains("--spacing: has a unit"), "{told}");
    assert!(told.contains("if they are in metres, give `--spacing 0.002`"), "{told}");
    let (code, _, told) = pointmill(at, &["cut", "ranked.las", "--spacing", "1e6", "-o", "o.las"]);
    assert!(code == 1 && told.contains("no points were kept as far as"), "{told}");
    let both = format!("{read}{}{}", cut("10%", "a.las"), cut("50", "b.las"));
    std::fs::write(at.join("both.toml"), both).unwrap();
    done(at, &["run", "both.toml"]);
    for (keep, name) in [("600", "a.las"), ("50", "b.las")] {
        reduce(keep, "direct.las");
        assert!(points(name) == points("direct.las"), "{name}");
    }
    let (code, _, told) = pointmill(at, &["cut", "scan.las", "--keep", "10", "-o", "o.las"]);
    assert!(code == 2 && told.contains("KeepRank"), "{told}");
    let (code, _, told) = pointmill(at, &["cut", "ranked.las", "--keep", "auto", "-o", "o.las"]);
    assert!(code == 2 && told.contains("it takes a share or a number"), "{told}");
}

#[test]
fn what_cannot_be_verified_is_told() {
    let at = reduced();
    let at = at.path();
    let told = |arguments: &[&str]| {
        let (code, _, told) = pointmill(at, &[&["verify"], arguments].concat());
        (code, told)
    };
    let (code, error) = told(&["scan.las"]);
    assert!(code == 2 && error.contains("one file is given"), "{error}");
    let (code, error) = told(&["scan.las", "none.las"]);
    assert!(code == 1 && error.contains("none.las"), "{error}");
    let (code, error) = told(&["scan.las", "thin.las", "--tolerance", "thin"]);
    assert!(code == 2 && error.contains("a length above 0"), "{error}");
    let (code, error) = told(&["scan.las", "thin.las", "--tolerance", "5mm"]);
    assert!(code != 0 && error.contains("--tolerance"), "{error}");
    let (code, error) = told(&["scan.las", "thin.las", "--report", "r.json"]);
    assert_eq!(code, 2, "{error}");
    let (code, error) = told(&["scan.las", "thin.las", "--memory", "1MiB"]);
    assert!(code == 1 && error.contains("--memory"), "{error}");
}
