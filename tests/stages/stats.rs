//! `stats` and `tap` say what comes by, once for each point, however it comes.

#![allow(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use pointmill::report::StatsFigures;
use pointmill::{Overrides, Quiet};

use crate::support::case::{Case, execute};

/// Points on two slopes; the number of a point is its class, so to speak.
fn points() -> Vec<([f64; 3], u32)> {
    let at = |n: u32| [f64::from(n % 90) * 0.1, f64::from(n / 90) * 0.1, f64::from(n % 17) * 0.25];
    (0..4000).map(|n| (at(n), n)).collect()
}

fn stats(run: &str, stages: &str) -> Vec<StatsFigures> {
    let case = Case::new();
    case.ply(&points());
    let done = case.run(run, stages, "").unwrap();
    let stats = done.report.result.stats;
    let report = std::fs::read_to_string(case.path("report.json")).unwrap();
    assert!(report.contains(&serde_json::to_string(&stats).unwrap()), "they are in the report");
    stats
}

fn named<'a>(stats: &'a [StatsFigures], name: &str) -> &'a StatsFigures {
    stats.iter().find(|stats| stats.name == name).unwrap()
}

const TILED: &str = "tile_points = 100\nspill = 'always'\nthreads = 2\nmemory = '800MiB'\n";

#[test]
fn figures_are_those_of_the_points_that_come_by() {
    let stages = "[[stage]]\nkind = 'stats'\n\
                  [[stage]]\nkind = 'filter'\nwhere = 'tag % 2 == 0'\n\
                  [[stage]]\nkind = 'stats'\nname = 'even'\ndimensions = ['Z', 'tag']\n\
                  [[stage]]\nkind = 'stats'\nwhere = 'Z > 2'\ndimensions = ['Z']\n\
                  [[stage]]\nkind = 'tap'\nname = 'end'\n";
    let all = stats("", stages);
    let names: Vec<&str> = all.iter().map(|stats| stats.name.as_str()).collect();
    assert_eq!(names, ["end", "even", "stats", "stats.2"]);
    assert_eq!((all[0].points, all[0].dimensions.len()), (2000, 0));
    let [z, tag] = &named(&all, "even").dimensions[..] else { panic!("two dimensions") };
    let even: Vec<f64> = points().iter().step_by(2).map(|(p, _)| p[2]).collect();
    let mean = even.iter().sum::<f64>() / 2000.0;
    let variance = even.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 2000.0;
    assert_eq!((z.0.as_str(), z.1.count, z.1.min, z.1.max), ("Z", 2000, Some(0.0), Some(4.0)));
    assert!((z.1.mean.unwrap() - mean).abs() < 1e-12, "{z:?}");
    assert!((z.1.deviation.unwrap() - variance.sqrt()).abs() < 1e-12, "{z:?}");
    assert_eq!((tag.1.min, tag.1.max, tag.1.mean), (Some(0.0), Some(3998.0), Some(1999.0)));
    let histogram = z.1.histogram.as_ref().unwrap();
    for (n, count) in histogram.counts.iter().enumerate() {
        let low = histogram.from + histogram.width * n as f64;
        let within = even.iter().filter(|v| (low..low + histogram.width).contains(v)).count();
        assert_eq!(*count, within as u64, "from {low}");
    }
    let high = points().iter().step_by(2).filter(|(p, _)| p[2] > 2.0).count() as u64;
    assert_eq!(named(&all, "stats.2").points, high, "the others pass by");
    assert_eq!(named(&all, "stats").dimensions.len(), 4, "all that records have");
    // Where points go by tiles, the figures are the same.
    let canonical = format!("{stages}[[stage]]\nkind = 'grid'\nside = 0.01\n");
    assert_eq!(stats(TILED, &canonical), all);
}

#[test]
fn columns_are_counted_behind_tiles_once_for_each_point() {
    let stages = "[[stage]]\nkind = 'normals'\nneighbors = 8\n\
                  [[stage]]\nkind = 'grid'\nside = 0.3\n\
                  [[stage]]\nkind = 'stats'\ndimensions = ['NormalZ', 'Z']\n\
                  [[stage]]\nkind = 'assign'\nset = 'tag = 7'\nwhere = 'NormalZ is nan'\n\
                  [[stage]]\nkind = 'tap'\nwhere = 'tag != 7'\n";
    let tiled = stats(TILED, stages);
    assert_eq!(tiled, stats("threads = 1\n", stages));
    let [of_stats, of_tap] = [named(&tiled, "stats"), named(&tiled, "tap")];
    let normal = &of_stats.dimensions[0].1;
    assert!(normal.count > 100 && normal.count + normal.not_finite == of_stats.points);
    assert!(normal.min >= Some(-1.0) && normal.max <= Some(1.0));
    assert!(of_tap.points.abs_diff(normal.count) <= 1, "the one that is 7 from the start");
}

#[test]
fn names_that_are_not_there_and_classes_that_are_not_are_told() {
    let case = Case::new();
    case.ply(&points());
    for (stage, told) in [
        ("dimensions = ['Z', 'tug']", "`dimensions`: there is no dimension `tug`"),
        ("dimensions = ['Z', 'Z']", "Z stands twice"),
        ("by_class = true", "`stats` needs Classification, which nothing before it gives"),
    ] {
        let error = case.run("", &format!("[[stage]]\nkind = 'stats'\n{stage}\n"), "");
        let error = error.unwrap_err().to_string();
        assert!(error.contains(told), "{error}");
    }
}

#[test]
fn a_pipeline_that_only_looks_ends_in_discard_and_writes_nothing() {
    let case = Case::new();
    case.ply(&[([0.0; 3], 1), ([1.0, 2.0, 3.0], 2)]);
    let text = |stages: &str| {
        format!(
            "[[stage]]\nkind = 'read'\npath = '{}'\n{stages}[[stage]]\nkind = 'stats'\n\
             [[stage]]\nkind = 'discard'\n",
            case.path("in.ply").display()
        )
    };
    for stages in ["", "[[stage]]\nkind = 'grid'\nside = 0.5\n"] {
        let report = execute(&text(stages), &Overrides::default(), &Quiet).unwrap().report;
        assert_eq!(report.result.ledger.kept, 2);
        assert_eq!(report.result.stats[0].points, 2);
        assert_eq!(report.run.outputs[0].points, 2);
        assert_eq!(case.left(), ["in.ply"]);
    }
}
