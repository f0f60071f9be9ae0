//! Outliers against brute force, over whole scans however they are cut into tiles.

use crate::support::random::Random;
use crate::support::tiles::*;
use pointmill::Result;
use pointmill::internals::{RadiusOutliers, StatisticalOutliers, morton_cmp};
use pointmill::point::{Bounds, Mark, Position};
use pointmill::quantity::Length;
use pointmill::report::Tally;
use pointmill::stage::{Gathered, ScanOp, TileOp};
use pointmill::tile::Fate;
use proptest::prelude::*;

/// A rough sheet and positions far above and below it.
fn scene(planted: &[i64]) -> Vec<Position> {
    let mut random = Random(7);
    let sheet: Vec<Position> = (0..900)
        .map(|i| {
            [
                i % 30 * 10 + random.coordinate(7),
                i / 30 * 10 + random.coordinate(7),
                random.coordinate(5),
            ]
        })
        .collect();
    let planted = planted.iter().enumerate().map(|(i, &z)| [i as i64 * 37 - 50, 150, z]);
    sorted(sheet.into_iter().chain(planted))
}

/// What was gathered of every tile.
struct Summaries<S>(Vec<S>);

impl<S: Clone> Gathered<S> for Summaries<S> {
    fn each(&self, visit: &mut dyn FnMut(S) -> Result<()>) -> Result<()> {
        self.0.iter().try_for_each(|summary| visit(summary.clone()))
    }

    fn records(&self) -> u64 {
        0
    }
}

/// Both phases over tiles, as an engine does them.
fn statistical(
    mut stage: StatisticalOutliers,
    scan: &[Position],
    cubes: &[Bounds],
    copies: &dyn Fn(Position) -> u32,
) -> (Vec<(Position, Fate)>, Tally, StatisticalOutliers) {
    settle(&mut stage, scan, 0.25);
    let (mut gathered, mut tally) = (Vec::new(), Tally::default());
    let mut tiles: Vec<_> = cubes.iter().map(|cube| tile(scan, *cube, 0)).collect();
    for tile in &mut tiles {
        tile.copies = tile.positions.iter().map(|&p| copies(p)).collect();
        tile.columns.add(&stage.gather_needs().writes, tile.positions.len());
        gathered.push(stage.gather(tile, &mut tally).unwrap());
    }
    stage.conclude(&Summaries(gathered)).unwrap();
    let mut all = Vec::new();
    for tile in &mut tiles {
        stage.run(tile, &mut tally).unwrap();
        all.extend(fates(tile));
    }
    all.sort_by(|a, b| morton_cmp(&a.0, &b.0));
    (all, tally, stage)
}

/// Mean distance to the k nearest others.
fn plain_figures(scan: &[Position], k: usize) -> Vec<f64> {
    scan.iter()
        .map(|p| {
            let mut others: Vec<&Position> = scan.iter().filter(|q| *q != p).collect();
            others.sort_by(|a, b| far2(*p, **a).cmp(&far2(*p, **b)).then(morton_cmp(a, b)));
            others.truncate(k);
            others.iter().map(|q| (far2(*p, **q) as f64).sqrt()).sum::<f64>() / others.len() as f64
        })
        .collect()
}

#[test]
fn statistical_outliers_are_those_of_brute_force_however_the_scan_is_cut() {
    let planted = [400, -300, 900, 60, 35, 30, 28, -26];
    let scan = scene(&planted);
    for (k, multiplier) in [(10, 2.0), (1, 1.0), (64, 0.5)] {
        let figures = plain_figures(&scan, k);
        let n = scan.len() as f64;
        let mean = figures.iter().sum::<f64>() / n;
        let sigma = (figures.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / n).sqrt();
        let threshold = mean + multiplier * sigma;
        assert!(figures.iter().all(|f| (f - threshold).abs() > 1e-3), "too near to tell");
        let expected: Vec<bool> = figures.iter().map(|f| *f > threshold).collect();
        let count = expected.iter().filter(|out| **out).count();
        assert!((1..scan.len() / 2).contains(&count));

        let mut decisions = Vec::new();
        for (most, fewest) in [(scan.len(), 1), (300, 4), (25, 30)] {
            let cubes = cubes(&scan, most);
            assert!(cubes.len() >= fewest, "{}", cubes.len());
            let stage = StatisticalOutliers::new(k, multiplier, None).unwrap();
            let (fates, tally, stage) = statistical(stage, &scan, &cubes, &|_| 1);
            let out: Vec<bool> = fates.iter().map(|f| f.1 == Fate::Removed).collect();
            assert_eq!(out, expected, "k = {k}, {} tiles", cubes.len());
            assert_eq!(removed(&tally, "outliers", "outlier"), count as u64);
            decisions.push(stage.decisions());
        }
        assert!(decisions.windows(2).all(|pair| pair[0] == pair[1]), "{decisions:?}");
        let named = |name| {
            let of = decisions[0].iter().find(|d| d.0 == name).unwrap();
            of.1.as_f64().unwrap()
        };
        for (name, steps) in [("mean_distance", mean), ("sigma", sigma), ("threshold", threshold)] {
            assert!((named(name) - steps * 0.25).abs() < 1e-4, "{name} is in world units");
        }
    }
}

#[test]
fn copies_are_no_neighbours_and_go_together() {
    let scan = scene(&[500]);
    let far = |p: Position| p[2] == 500;
    let stage = || StatisticalOutliers::new(10, 2.0, None).unwrap();
    let cubes = cubes(&scan, 200);
    let (once, _, of_one) = statistical(stage(), &scan, &cubes, &|_| 1);
    let copies = |p: Position| if far(p) { 20 } else { 1 + (p[0] % 3 == 0) as u32 };
    let (many, tally, of_many) = statistical(stage(), &scan, &cubes, &copies);
    assert_eq!(once, many);
    assert_eq!(of_one.decisions(), of_many.decisions());
    let gone = once.iter().filter(|(_, fate)| *fate == Fate::Removed);
    let records: u64 = gone.map(|(p, _)| u64::from(copies(*p))).sum();
    assert_eq!(removed(&tally, "outliers", "outlier"), records);
    assert!(once.contains(&([-50, 150, 500], Fate::Removed)) && records >= 20);
}

#[test]
fn positions_that_are_only_seen_are_neighbours_but_have_no_figure() {
    // Those of the sheet are only seen: the mean is that of three planted ones.
    let scan = scene(&[40, 41, 900]);
    let seen = |p: Position| u32::from(p[2] >= 40);
    let stage = StatisticalOutliers::new(3, 1.0, None).unwrap();
    let (fates, tally, _) = statistical(stage, &scan, &cubes(&scan, 60), &seen);
    let out: Vec<Position> = fates.iter().filter(|f| f.1 == Fate::Removed).map(|f| f.0).collect();
    assert_eq!(out, [[24, 150, 900]]);
    assert_eq!(removed(&tally, "outliers", "outlier"), 1);
}

#[test]
fn a_lattice_of_equal_distances_and_single_points_have_no_outlier() {
    let even = sorted((0..512).map(|i| [i % 8 * 3, i / 8 % 8 * 3, i / 64 * 3]));
    for (scan, k) in [(even, 3), (vec![[5, 5, 5]], 10), (sorted([[0, 0, 0], [9, 9, 9]]), 10)] {
        let stage = StatisticalOutliers::new(k, 0.0, None).unwrap();
        let (fates, tally, stage) = statistical(stage, &scan, &cubes(&scan, 200), &|_| 1);
        assert!(fates.len() == scan.len() && fates.iter().all(|f| f.1 == Fate::Kept));
        assert!(tally.removed.is_empty());
        assert_eq!(stage.decisions()[1], ("sigma".to_owned(), 0.0.into()));
    }
}

#[test]
fn a_mark_is_counted_and_enters_no_ledger() {
    let scan = scene(&[500, -500]);
    let out = |mark| {
        let stage = StatisticalOutliers::new(10, 2.0, mark).unwrap();
        assert_eq!((stage.needs().mark, stage.needs().removes), (mark, mark.is_none()));
        statistical(stage, &scan, &cubes(&scan, 200), &|_| 2)
    };
    let ((removed_fates, ledger, _), (fates, tally, _)) = (out(None), out(Some(Mark::Class(7))));
    assert_eq!(fates, removed_fates);
    assert!(tally.removed.is_empty() && ledger.counts.is_empty());
    let records = removed(&ledger, "outliers", "outlier");
    assert!(records >= 4);
    assert_eq!(tally.counts.get("outliers_marked"), Some(&records));
}

fn radius(scan: &[Position], most: usize, stage: &RadiusOutliers) -> Vec<(Position, Fate)> {
    let mut all = Vec::new();
    for cube in cubes(scan, most) {
        let mut tile = tile(scan, cube, 0);
        let mut tally = Tally::default();
        stage.run(&mut tile, &mut tally).unwrap();
        let gone = tile.fates.iter().filter(|fate| **fate == Fate::Removed).count();
        assert_eq!(removed(&tally, "outliers", "outlier"), gone as u64);
        all.extend(fates(&tile));
    }
    all.sort_by(|a, b| morton_cmp(&a.0, &b.0));
    all
}

fn length(radius: f64) -> Length {
    Length::of(radius).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn radius_outliers_are_those_of_brute_force(
        points in prop::collection::vec(prop::array::uniform3(-9i64..9), 1..80),
        tenths in 1u32..60, least in 1usize..7,
    ) {
        let scan = sorted(points);
        let mut stage = RadiusOutliers::new(length(f64::from(tenths) / 10.0), least, None).unwrap();
        settle(&mut stage, &scan, 0.1);
        let within = i128::from(tenths * tenths);
        let expected: Vec<(Position, Fate)> = scan
            .iter()
            .map(|p| {
                let near = scan.iter().filter(|q| *q != p && far2(*p, **q) <= within).count();
                (*p, if near < least { Fate::Removed } else { Fate::Kept })
            })
            .collect();
        prop_assert_eq!(radius(&scan, scan.len(), &stage), &expected[..]);
        prop_assert_eq!(radius(&scan, 5, &stage), &expected[..]);
    }
}

#[test]
fn who_is_exactly_at_the_radius_counts() {
    let scan = sorted([[0, 0, 0], [3, 0, 0], [100, 0, 0], [104, 0, 0]]);
    for (within, kept) in [(0.299, 0), (0.3, 2), (0.399_999, 2), (0.4, 4)] {
        let mut stage = RadiusOutliers::new(length(within), 1, None).unwrap();
        settle(&mut stage, &scan, 0.1);
        let fates = radius(&scan, scan.len(), &stage);
        assert_eq!(fates.iter().filter(|f| f.1 == Fate::Kept).count(), kept, "{within}");
    }
}

#[test]
fn a_key_of_the_other_method_is_told_with_its_place() {
    let told = refusal("kind = 'outliers'\nmin_neighbors = 3");
    assert!(told.contains("p.toml:8") && told.contains("belongs to `outliers.method"), "{told}");
    let told = refusal("kind = 'outliers'\nmethod = 'radius'\nmin_neighbors = 3");
    assert!(told.contains("needs `outliers.radius`"), "{told}");
    let told = refusal("kind = 'outliers'\nmethod = 'radios'");
    assert!(told.contains("did you mean `radius`"), "{told}");
}
