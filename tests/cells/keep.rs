//! A number of records instead of an angle: met exactly, whatever the ties and the tiles.

use super::scene::*;
use pointmill::ops::{Cells, Keep, Measure, Side, Split};
use pointmill::point::{Bounds, Position};
use pointmill::report::Tally;
use pointmill::stage::{Gathered, Role, ScanOp, StageKind, StagePlace, Summary, TileOp};
use pointmill::{ErrorKind, Result};
use proptest::prelude::*;

/// What was gathered of every tile, as it is stored.
struct Found {
    tiles: Vec<Vec<u8>>,
    records: u64,
}

impl<S: Summary> Gathered<S> for Found {
    fn each(&self, visit: &mut dyn FnMut(S) -> Result<()>) -> Result<()> {
        self.tiles.iter().try_for_each(|tile| visit(S::load(tile)?))
    }

    fn records(&self) -> u64 {
        self.records
    }
}

fn target(stage: &Cells, keep: Keep) -> Cells {
    let mut stage = stage.clone();
    (stage.max_angle, stage.keep) = (None, Some(keep));
    stage
}

fn angle(stage: &Cells, max_angle: Option<f64>) -> Cells {
    let mut stage = stage.clone();
    stage.max_angle = max_angle.and_then(radians);
    stage
}

/// Settles the stage and runs its first phase over the tiles of `cubes`.
fn gather(stage: Cells, scan: &[Point], cubes: &[Bounds]) -> (Cells, Found) {
    let stage = settle(stage, scan);
    let side = stage.gather_needs().cell_side;
    let records = scan.iter().map(|p| u64::from(p.copies)).sum();
    let tiles = cubes.iter().map(|cube| {
        let mut found = Vec::new();
        let gathered = stage.gather(&mut tile(scan, *cube, side), &mut Tally::default()).unwrap();
        gathered.store(&mut found);
        found
    });
    let tiles = tiles.collect();
    (stage, Found { tiles, records })
}

/// Both phases; the stage after the first, and what the second did.
fn reduce(stage: Cells, scan: &[Point], cubes: &[Bounds]) -> (Cells, Outcome) {
    let (mut stage, found) = gather(stage, scan, cubes);
    stage.conclude(&found).unwrap();
    let outcome = run(&stage, scan, cubes);
    (stage, outcome)
}

fn decided(stage: &Cells, name: &str) -> Option<f64> {
    stage.decisions().iter().find(|d| d.0 == name).map(|d| d.1.as_f64().unwrap())
}

fn sorted(mut groups: Vec<Vec<Position>>) -> Vec<Vec<Position>> {
    groups.sort_unstable();
    groups
}

/// True if every group of `fine` is within one of `coarse`.
fn refines(fine: &[Vec<Position>], coarse: &[Vec<Position>]) -> bool {
    let home = |p: &Position| coarse.iter().position(|group| group.contains(p));
    fine.iter().all(|group| {
        let first = home(&group[0]);
        first.is_some() && group.iter().all(|p| home(p) == first)
    })
}

fn any_stage() -> impl Strategy<Value = Cells> {
    let side = prop::sample::select(vec![5i64, 7, 8, 13, 16, 40]);
    let split = prop::sample::select(vec![Split::Voronoi, Split::Octant, Split::Dirichlet]);
    let measure = prop::sample::select(vec![Measure::Axis, Measure::Cone]);
    let bounds =
        prop::sample::select(vec![(None, None), (Some(2.0), Some(6.0)), (None, Some(4.0))]);
    (side, split, measure, bounds, 1usize..3).prop_map(|(side, split, measure, bounds, least)| {
        let mut stage = cells(side as f64, 0.1, split);
        stage.min_spacing = bounds.0.map(length).map(spacing);
        stage.max_side = bounds.1.map(length);
        (stage.measure, stage.min_points) = (measure, least.try_into().unwrap());
        stage
    })
}

/// Fewest and most records that the stage can leave.
fn reach(stage: &Cells, scan: &[Point]) -> (u64, u64) {
    let kept = |max_angle| run_whole(angle(stage, Some(max_angle)), scan).kept().len() as u64;
    (kept(std::f64::consts::PI), kept(0.0))
}

proptest! {
    #[test]
    fn the_number_is_met_and_more_only_refines(
        stage in any_stage(), most in 8usize..60,
        scan in prop_oneof![any_scan(0, 24, 140), any_scan(1 << 40, 60, 120), any_scan(-7, 12, 140)],
    ) {
        let (least, all) = reach(&stage, &scan);
        let cubes = tiles(&scan, most);
        let mut before: Option<Outcome> = None;
        let targets: Vec<u64> = (0..=12).map(|i| least + (all - least) * i / 12).collect();
        for k in targets {
            let keep = target(&stage, Keep::Records(k));
            let (one, whole) = reduce(keep.clone(), &scan, &[whole(&scan).cube()]);
            let kept = whole.kept().len() as u64;
            match stage.split {
                Split::Voronoi => prop_assert_eq!(kept, k),
                // Four sites make three parts more.
                Split::Dirichlet => {
                    prop_assert!(kept <= k && k < kept + 3, "{} for {}", kept, k);
                }
                Split::Octant => prop_assert!(kept <= k && k < kept + 7, "{} for {}", kept, k),
            }
            prop_assert_eq!(decided(&one, "kept"), Some(kept as f64));
            prop_assert_eq!(decided(&one, "kept_target"), Some(k as f64));
            // However the scan is cut.
            let (other, cut) = reduce(keep, &scan, &cubes);
            prop_assert_eq!(one.decisions(), other.decisions());
            prop_assert_eq!(&whole.fates, &cut.fates);
            prop_assert_eq!(&whole.tally.counts, &cut.tally.counts);
            if let Some(before) = &before {
                prop_assert!(refines(&whole.groups, &before.groups));
            }
            // The angle that was found leaves as many but for those of exactly that range.
            let plain = run_whole(angle(&stage, decided(&one, "max_angle")), &scan);
            prop_assert!(refines(&whole.groups, &plain.groups));
            if plain.kept().len() as u64 == kept {
                prop_assert_eq!(sorted(plain.groups), sorted(whole.groups.clone()));
                // The angle is a rounded one: whether a cell is of exactly that range, which is no
                // reason to count it as one that its length alone keeps whole, it does not tell.
                let counts = |tally: &Tally| {
                    let counts = tally.counts.clone().into_iter();
                    let counts = counts.filter(|(name, _)| &**name != "cells_by_min_spacing");
                    counts.collect::<Vec<_>>()
                };
                prop_assert_eq!(counts(&plain.tally), counts(&whole.tally));
            }
            before = Some(whole);
        }
    }

    #[test]
    fn what_is_found_comes_in_the_same_order_from_every_cut(
        stage in any_stage(), scan in any_scan(3, 30, 200), most in 5usize..40,
    ) {
        let stage = target(&stage, Keep::Records(1));
        let order = |cubes: &[Bounds]| {
            let (_, found) = gather(stage.clone(), &scan, cubes);
            let words = |bytes: &[u8]| -> Vec<u64> {
                bytes.as_chunks().0.iter().map(|word| u64::from_ne_bytes(*word)).collect()
            };
            // A sum, the number of cells, four words for each, then the divisions.
            let (mut sum, mut cells, mut divisions) = (0, Vec::new(), Vec::new());
            for tile in found.tiles.iter().map(|tile| words(tile)) {
                let (own, rest) = tile[2..].split_at(4 * tile[1] as usize);
                sum += tile[0];
                cells.extend_from_slice(own);
                divisions.extend_from_slice(rest);
            }
            (sum, cells, divisions)
        };
        prop_assert_eq!(order(&[whole(&scan).cube()]), order(&tiles(&scan, most)));
    }
}

/// A bumpy sheet without two equal ranges of angles.
fn sheet() -> Vec<Point> {
    scan((0..60 * 60i64).map(|i| {
        let (x, y) = ((i % 60) as f64, (i / 60) as f64);
        let (a, b) = (0.3 * (x * 0.21 + y * 0.007).sin(), 0.2 * (y * 0.17 - x * 0.011).cos());
        let length = (a * a + b * b + 1.0).sqrt();
        let normal = [a / length, b / length, 1.0 / length].map(|v| v as f32);
        ([i % 60, i / 60, (3.0 * a) as i64], normal, 1 + (i % 5 == 0) as u32)
    }))
}

#[test]
fn without_ties_the_angle_found_leaves_the_same_points() {
    let scan = sheet();
    let mut equal = 0;
    for percent in [1u64, 2, 5, 10, 20, 40] {
        for measure in [Measure::Axis, Measure::Cone] {
            let mut stage = cells(16.0, 0.1, Split::Voronoi);
            stage.measure = measure;
            let keep = target(&stage, Keep::Share(percent * 1_000_000));
            let (keep, outcome) = reduce(keep, &scan, &[whole(&scan).cube()]);
            let records: u64 = scan.iter().map(|p| u64::from(p.copies)).sum();
            assert_eq!(outcome.kept().len() as u64, (records * percent + 50) / 100, "{percent} %");
            let plain = run_whole(angle(&stage, decided(&keep, "max_angle")), &scan);
            let difference = outcome.groups.len() - plain.groups.len();
            assert!(difference < 50, "{percent} % {measure:?}: {difference} of one range");
            equal += usize::from(sorted(plain.groups) == sorted(outcome.groups));
        }
    }
    assert!(equal >= 3, "{equal} of 12 without ties");
}

#[test]
fn ties_end_in_the_order_of_the_cells() {
    // Eight cells along x, each of two positions whose normals differ by the same angle.
    let scan = scan((0..16i64).map(|i| {
        let s = if i % 2 == 0 { 0.6 } else { -0.6 };
        ([i / 2 * 8 + i % 2, 0, 0], [s, 0.0, 0.8], 1)
    }));
    for more in 0..=8 {
        let stage = target(&cells(8.0, 0.1, Split::Voronoi), Keep::Records(8 + more));
        let (_, outcome) = reduce(stage, &scan, &tiles(&scan, 5));
        let divided: Vec<i64> =
            outcome.groups.iter().filter(|g| g.len() == 1).map(|g| g[0][0] / 8).collect();
        let first: Vec<i64> = (0..more as i64).flat_map(|cell| [cell, cell]).collect();
        assert_eq!(divided, first, "{more} divisions");
    }
}

#[test]
fn a_target_beyond_reach_keeps_all_that_can_be() {
    let scan = sheet();
    let stage = cells(16.0, 0.1, Split::Octant);
    let (_, all) = reach(&stage, &scan);
    let (keep, outcome) =
        reduce(target(&stage, Keep::Records(1 << 40)), &scan, &[whole(&scan).cube()]);
    assert_eq!(outcome.kept().len() as u64, all);
    assert_eq!(decided(&keep, "kept_at_most"), Some(all as f64));
    assert_eq!(decided(&keep, "max_angle"), Some(0.0));
}

#[test]
fn a_target_below_the_cells_is_refused_with_the_number_that_would_do() {
    let scan =
        scan((0..64i64).map(|i| ([i * 4, 0, 0], if i < 4 { NONE } else { [0.0, 0.0, 1.0] }, 1)));
    let (mut stage, found) = gather(
        target(&cells(16.0, 0.1, Split::Voronoi), Keep::Share(20_000_000)),
        &scan,
        &tiles(&scan, 9),
    );
    let error = stage.conclude(&found).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Pipeline);
    assert!(error.to_string().contains("20%, which is 13 records, and 19 stay"), "{error}");
    assert!(error.remedy().unwrap().contains("keep 19 or more, or give a larger `cells.side`"));
    let (mut stage, found) = gather(
        target(&cells(16.0, 0.1, Split::Voronoi), Keep::Records(19)),
        &scan,
        &tiles(&scan, 9),
    );
    assert!(stage.conclude(&found).is_ok());
}

#[test]
fn a_small_target_has_large_cells() {
    let scan = sheet();
    let side = |stage: Cells| settle(stage, &scan).needs().cell_side;
    let auto = Cells::default();
    assert_eq!(auto.side, Side::Auto);
    assert_eq!(side(auto.clone()), 8);
    assert_eq!(side(target(&auto, Keep::Records(1000))), 8);
    assert_eq!(side(target(&auto, Keep::Records(70))), 16, "16 cubes at most 35, not 64");
    assert_eq!(side(target(&auto, Keep::Records(4))), 64, "a side of 32 has 4 cubes");
    for k in [4, 70, 1000] {
        let (_, outcome) = reduce(target(&auto, Keep::Records(k)), &scan, &[whole(&scan).cube()]);
        assert_eq!(outcome.kept().len() as u64, k);
    }
}

#[test]
fn keep_has_two_phases_and_stands_alone() {
    let place = || StagePlace::new("p.toml", 1);
    let role = |text: &str| toml::from_str::<Cells>(text).unwrap().build(&place());
    assert!(matches!(role("").unwrap(), Role::TileOp(_)));
    assert!(matches!(role("keep = '10%'").unwrap(), Role::ScanOp(_)));
    let refused = |text: &str, part: &str| {
        let error = role(text).err().expect(text);
        assert!(error.to_string().contains(part), "{text}: {error}");
    };
    refused("keep = '10%'\nmax_angle = 0.1", "`cells.max_angle` gives it");
    refused("max_side = 1\nmin_spacing = 2", "less than `cells.min_spacing`");
    let json = |text: &str| serde_json::to_value(toml::from_str::<Cells>(text).unwrap()).unwrap();
    assert_eq!(json("")["max_angle"], 0.1);
    assert!(json("keep = '10%'")["max_angle"].is_null());
    assert_eq!(json("keep = '5M'")["keep"], 5_000_000);
    let unsettled = settle(target(&cells(4.0, 0.1, Split::Voronoi), Keep::Records(9)), &sheet());
    let mut tile = tile(&sheet(), whole(&sheet()).cube(), 4);
    assert!(unsettled.run(&mut tile, &mut Tally::default()).is_err(), "nothing was found yet");
}
