//! Stages that are limited by conditions over dimensions and columns, and stages that keep, drop
//! and assign by expressions: against runs in which the records are told apart beforehand.

#![allow(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use std::collections::BTreeSet;
use std::fs;

use crate::support::case::Case;
use crate::support::random::Random;

const TILED: &str =
    "tile_points = 100\nspill = 'always'\nthreads = 2\nmemory = '800MiB'\nlattice = 0.001\n";
const WHOLE: &str = "threads = 1\nlattice = 0.001\n";
const NORMALS: &str = "[[stage]]\nkind = 'normals'\nneighbors = 8\n";

/// A floor, a wall and a slope, each with noise, some positions twice and three times; each record
/// has its number.
fn scene() -> Vec<([f64; 3], u32)> {
    let mut random = Random(7);
    let mut points = Vec::new();
    for n in 0..7000u32 {
        // Denser at one corner: tiles of several sizes.
        let (a, b) = (random.unit().powi(3) * 8.0, random.unit().powi(2) * 8.0);
        let noise = random.signed(0.01);
        let p = match n % 3 {
            0 => [a, b, noise],
            1 => [noise, a, b + 0.1],
            _ => [a + 9.0, b, a / 2.0 + noise],
        };
        let p = p.map(|v| (v * 1000.0).round() / 1000.0);
        (0..1 + u32::from(n % 50 == 0) + u32::from(n % 100 == 0)).for_each(|_| {
            points.push((p, points.len() as u32));
        });
    }
    points
}

fn case() -> Case {
    let case = Case::new();
    case.ply(&scene());
    case
}

fn numbers(case: &Case) -> BTreeSet<u32> {
    case.written().into_iter().map(|(_, number)| number).collect()
}

/// The numbers that are left by `stages`.
fn left(case: &Case, run: &str, stages: &str) -> BTreeSet<u32> {
    case.run(run, stages, "").unwrap();
    numbers(case)
}

fn filter(condition: &str) -> String {
    format!("[[stage]]\nkind = 'filter'\nwhere = '{condition}'\n")
}

/// Stages limited by `condition` leave what they leave of its records alone, and all others.
fn is_limited(above: &str, stages: &str, condition: &str, run: &str) {
    let case = case();
    let alone = left(&case, run, &format!("{above}{}{stages}", filter(condition)));
    let others = left(&case, run, &format!("{above}{}", filter(&format!("not ({condition})"))));
    assert!(alone.is_disjoint(&others), "{condition}");
    let limited = format!("{above}{stages}where = '{condition}'\n");
    let done = case.run(run, &limited, "").unwrap();
    let both = numbers(&case);
    assert_eq!(both, &alone | &others, "{limited}");
    let all = case.written().len() as u64;
    assert!(all < scene().len() as u64, "something is removed");
    assert_eq!(done.report.result.ledger.kept, all);
    let work = done.report.run.work;
    assert!(run == WHOLE || work["tiles"] >= 30 && work["tile_levels"] >= 2, "{work:?}");
}

#[test]
fn a_stage_limited_by_a_condition_works_on_its_records_alone() {
    let grid = "[[stage]]\nkind = 'grid'\nside = 0.5\n";
    let outliers = "[[stage]]\nkind = 'outliers'\nneighbors = 6\n";
    for run in [WHOLE, TILED] {
        for condition in ["tag % 2 == 0", "X in 0.5..3 and tag > 100", "not (Z > 1) or tag < 9"] {
            is_limited("", grid, condition, run);
            is_limited("", outliers, condition, run);
        }
        for condition in ["abs(NormalZ) > 0.9", "abs(NormalX) < 0.5 and tag % 3 != 1"] {
            is_limited(NORMALS, grid, condition, run);
            is_limited(NORMALS, outliers, condition, run);
        }
    }
}

#[test]
fn a_choice_by_columns_is_the_same_in_every_tile_and_made_anew_for_each_stage() {
    let stages = format!(
        "{NORMALS}[[stage]]\nkind = 'outliers'\nneighbors = 6\nwhere = 'abs(NormalZ) > 0.8'\n\
         [[stage]]\nkind = 'grid'\nside = 0.4\nwhere = 'abs(NormalX) > 0.8'\n\
         [[stage]]\nkind = 'filter'\nwhere = 'NormalY is not nan'\n"
    );
    let bytes = |run: &str| {
        let case = case();
        case.run(run, &stages, "").unwrap();
        fs::read(case.path("out.ply")).unwrap()
    };
    assert!(bytes(WHOLE) == bytes(TILED), "tiles change nothing");
    let case = case();
    let floor = "abs(NormalZ) > 0.8";
    let rest = left(&case, WHOLE, &format!("{NORMALS}{}", filter(&format!("not ({floor})"))));
    let by_hand = {
        let first = format!("[[stage]]\nkind = 'outliers'\nneighbors = 6\nwhere = '{floor}'\n");
        left(&case, WHOLE, &format!("{NORMALS}{first}"))
    };
    assert!(rest.is_subset(&by_hand));
    let both = left(&case, WHOLE, &stages);
    assert!(both.is_subset(&by_hand) && both.len() < by_hand.len());
}

#[test]
fn what_is_seen_follows_the_condition() {
    let stages = |sees: &str| {
        format!("[[stage]]\nkind = 'outliers'\nneighbors = 6\nwhere = 'tag % 40 == 0'\n{sees}\n")
    };
    let case = case();
    let alone = left(&case, TILED, &stages("")).len();
    let among = left(&case, TILED, &stages("sees = 'all'")).len();
    assert!(alone != among, "{alone} {among}");
}

#[test]
fn filter_and_drop_are_each_others_opposite() {
    let case = case();
    for above in ["", NORMALS] {
        for condition in ["tag % 7 < 3 and Y > 2", "X is nan"] {
            let drop = format!("{above}[[stage]]\nkind = 'drop'\nwhere = '{condition}'\n");
            let kept = left(&case, TILED, &format!("{above}{}", filter(condition)));
            let dropped = left(&case, TILED, &drop);
            assert!(kept.is_disjoint(&dropped));
            assert_eq!(kept.len() + dropped.len(), scene().len());
        }
    }
}

#[test]
fn assigned_values_are_seen_by_whatever_streams_behind() {
    let case = case();
    let assign = |set: &str| format!("[[stage]]\nkind = 'assign'\nset = {set}\n");
    // In the decode, where a stage that works on tiles sees them.
    let stages = format!("{}{}", assign("'tag = tag / 2 * 2 + 1'"), filter("tag % 2 == 1"));
    assert!(left(&case, WHOLE, &stages).iter().all(|number| number % 2 == 1));
    // Behind tiles, by a column, for some records, and looked at by a later stage behind others.
    let marked = format!("{}where = 'abs(NormalZ) > 0.9'\n", assign("['tag = tag + 1000000']"));
    let grid = "[[stage]]\nkind = 'grid'\nside = 0.5\n";
    let stages = format!("{NORMALS}{marked}{grid}{}", filter("tag >= 1_000_000"));
    for run in [WHOLE, TILED] {
        let far = left(&case, run, &stages);
        assert!(!far.is_empty() && far.iter().all(|number| *number >= 1_000_000), "{far:?}");
        let plain = left(&case, run, &format!("{NORMALS}{}", filter("abs(NormalZ) > 0.9")));
        assert!(far.iter().all(|number| plain.contains(&(number - 1_000_000))));
        let kept = left(&case, run, &format!("{NORMALS}{grid}{}", filter("abs(NormalZ) > 0.9")));
        assert_eq!(far.len(), kept.len());
    }
}

#[test]
fn limits_that_cannot_be_are_told_where_they_are_written() {
    let case = case();
    let told = |stages: &str| case.run(WHOLE, stages, "").unwrap_err().to_string();
    let grid = "[[stage]]\nkind = 'grid'\nside = 0.5\n";
    for (stages, parts) in [
        (
            format!("{grid}where = 'tagg > 3'\n"),
            &["test.toml:12:10: `where`: there is no dimension `tagg`", "|          ^^^^"][..],
        ),
        (format!("{grid}where = 'tag > 3'\nclasses = [2]\n"), &["which the input does not have"]),
        (
            format!("{grid}where = 'NormalZ > 3'\n"),
            &["there is no dimension `NormalZ`", "put a `normals` stage above"],
        ),
        (format!("{}sees = 'all'\n", filter("tag > 1")), &["has no key `sees`"]),
        (
            "[[stage]]\nkind = 'assign'\nset = 'tag = 1'\nsees = 'all'\n".to_owned(),
            &["`sees` is for stages that work on tiles"],
        ),
        (
            "[[stage]]\nkind = 'assign'\nset = ['tag = 1', 'tog = 2 +']\n".to_owned(),
            &["test.toml:11:29: `set`: the expression ends too early"],
        ),
        (
            format!("{NORMALS}{}{NORMALS}", filter("NormalZ > 0")),
            &["`normals` computes Normal anew, which `filter` looks at"],
        ),
        (
            format!("{}{grid}{}{grid}where = 'tag > 3'\n", NORMALS, {
                "[[stage]]\nkind = 'assign'\nset = 'tag = 1'\n"
            }),
            &["`grid` works by tag as it is read, and `assign` changes it"],
        ),
        ("[[stage]]\nkind = 'drop'\n".to_owned(), &["would remove every point"]),
        (
            format!("{}{grid}where = 'Zed > 1'\n", filter("Tag > 1")),
            &["2 mistakes", "did you mean `tag`?", "no dimension `Zed`"],
        ),
    ] {
        let told = told(&stages);
        parts.iter().for_each(|part| assert!(told.contains(part), "{part}\n in {told}"));
    }
}
