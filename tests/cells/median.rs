//! The selection: which point of a cell stays, and what the ledger says of the others.

use super::scene::*;
use pointmill::ops::{Cells, Median, Split};
use pointmill::point::Position;
use pointmill::report::Tally;
use pointmill::stage::TileOp;
use pointmill::tile::Fate;

const UP: [f32; 3] = [0.0, 0.0, 1.0];

/// θ of about 90° − `tilt` radians to x.
fn tilted(tilt: f64) -> [f32; 3] {
    [tilt as f32, 0.0, (1.0 - tilt * tilt).sqrt() as f32]
}

fn one_cell() -> Cells {
    cells(1e9, 3.1, Split::Voronoi)
}

fn removed(outcome: &Outcome, reason: &'static str) -> u64 {
    outcome.tally.removed.get(&("median".to_owned(), reason.into())).copied().unwrap_or(0)
}

#[test]
fn the_lower_median_of_the_angles_stays() {
    for (tilts, kept) in [
        (vec![0.5, 0.1, 0.3], 2),
        // θ ascends as the tilt falls: 0.4, 0.3, 0.2, 0.1; index 1 is the lower median.
        (vec![0.1, 0.2, 0.3, 0.4], 2),
        (vec![0.2, 0.1], 0),
    ] {
        let points = tilts.iter().enumerate().map(|(i, &t)| ([i as i64, 0, 0], tilted(t), 1));
        let scan = scan(points);
        assert_eq!(run_whole(one_cell(), &scan).kept(), [[kept, 0, 0]], "{tilts:?}");
    }
}

#[test]
fn of_equal_angles_the_nearest_to_the_center_of_mass_stays() {
    let at = |xs: &[i64], far: i64| {
        let scan = scan(xs.iter().map(|&x| ([far + x, 0, 0], UP, 1)));
        run_whole(one_cell(), &scan).kept()[0][0] - far
    };
    for far in [0, 1 << 60, -(1 << 61)] {
        assert_eq!(at(&[0, 1, 2, 3, 100], far), 3, "the mean is 21.2");
        assert_eq!(at(&[0, 2], far), 0, "equally far: the Morton-first");
        assert_eq!(at(&[0, 10, 20, 30], far), 10);
    }
}

#[test]
fn copies_weigh_as_one_position() {
    let scan = scan([
        ([0, 0, 0], tilted(0.3), 50),
        ([1, 0, 0], tilted(0.2), 2),
        ([2, 0, 0], tilted(0.1), 1),
    ]);
    let outcome = run_whole(one_cell(), &scan);
    assert_eq!(outcome.kept(), [[1, 0, 0]]);
    assert_eq!(outcome.fates[1].1, Fate::KeptOnce);
    assert_eq!((removed(&outcome, "represented"), removed(&outcome, "coincident")), (51, 1));
}

#[test]
fn a_position_without_normal_keeps_one_record() {
    let scan = scan([([0, 0, 0], NONE, 3), ([1, 0, 0], NONE, 1), ([2, 0, 0], UP, 1)]);
    let outcome = run_whole(one_cell(), &scan);
    let fates: Vec<Fate> = outcome.fates.iter().map(|f| f.1).collect();
    assert_eq!(fates, [Fate::KeptOnce, Fate::Kept, Fate::Kept]);
    assert_eq!((removed(&outcome, "represented"), removed(&outcome, "coincident")), (0, 2));
}

#[test]
fn a_normal_with_any_component_missing_is_none() {
    let broken = [[f32::NAN, 0.0, 1.0], [0.0, f32::NAN, 1.0], [0.0, 0.0, f32::INFINITY]];
    let points = broken.iter().enumerate().map(|(i, &n)| ([i as i64, 0, 0], n, 2));
    let scan = scan(points.chain([([3, 0, 0], UP, 1), ([4, 0, 0], UP, 1)]));
    let outcome = run_whole(one_cell(), &scan);
    assert_eq!(outcome.kept(), [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]);
    assert_eq!((removed(&outcome, "represented"), removed(&outcome, "coincident")), (1, 3));
}

#[test]
fn deviations_are_distances_to_the_plane_of_the_point_that_stays() {
    let positions: [Position; 5] = [[0, 0, 0], [4, 0, 0], [-4, 0, 0], [0, 4, 3], [0, -4, -2]];
    let scan = scan(positions.map(|p| (p.map(|v| v + (1 << 60) + 32), UP, 1)));
    let outcome = run_whole(cells(64.0, 3.1, Split::Voronoi), &scan);
    let mut deviations: Vec<f32> = outcome
        .fates
        .iter()
        .filter_map(|f| match f.1 {
            Fate::Represented { deviation } => Some(deviation),
            _ => None,
        })
        .collect();
    deviations.sort_by(f32::total_cmp);
    assert_eq!(deviations, [0.0, 0.0, 2.0, 3.0], "[0, 0, 0] is nearest to the centre");
}

#[test]
fn a_second_median_removes_nothing_more() {
    let points = (0..500i64)
        .map(|i| ([i % 20, i / 20, 0], tilted((i % 7) as f64 / 20.0), 1 + (i % 4 == 0) as u32));
    let scan = scan(points);
    let stage = settle(cells(5.0, 0.1, Split::Voronoi), &scan);
    let mut tile = tile(&scan, whole(&scan).cube(), 5);
    let mut first = Tally::default();
    stage.run(&mut tile, &mut first).unwrap();
    Median::default().run(&mut tile, &mut first).unwrap();
    let fates = tile.fates.clone();
    let mut second = Tally::default();
    Median::default().run(&mut tile, &mut second).unwrap();
    assert_eq!(tile.fates, fates);
    assert!(second.removed.is_empty());
    let records: u64 = scan.iter().map(|p| u64::from(p.copies)).sum();
    let kept: u64 = fates
        .iter()
        .zip(&tile.copies)
        .map(|(fate, &copies)| match fate {
            Fate::Kept => u64::from(copies),
            Fate::KeptOnce => 1,
            Fate::Removed | Fate::Represented { .. } => 0,
        })
        .sum();
    assert_eq!(records, kept + first.removed.values().sum::<u64>(), "the ledger balances");
    assert!(kept < records / 2);
}

#[test]
fn by_option_the_nearest_to_the_center_of_mass_stays_whatever_the_angles() {
    for far in [0, 1 << 60, -(1 << 61)] {
        let xs = [0i64, 1, 2, 3, 100];
        // The median angle is that of the first.
        let tilts = [0.3, 0.5, 0.4, 0.1, 0.2];
        let scan = scan(xs.iter().zip(tilts).map(|(&x, t)| ([far + x, 0, 0], tilted(t), 1)));
        let stage = settle(one_cell(), &scan);
        let kept = |pick: &str| {
            let median: Median =
                serde_json::from_value(serde_json::json!({ "pick": pick })).unwrap();
            let mut tile = tile(&scan, whole(&scan).cube(), 5);
            let mut tally = Tally::default();
            stage.run(&mut tile, &mut tally).unwrap();
            median.run(&mut tile, &mut tally).unwrap();
            let is_kept = |fate: &Fate| matches!(fate, Fate::Kept | Fate::KeptOnce);
            let at = tile.fates.iter().position(is_kept).unwrap();
            (tile.positions[at][0] - far, tile.fates.iter().filter(|f| is_kept(f)).count())
        };
        assert_eq!(kept("median"), (0, 1));
        assert_eq!(kept("center"), (3, 1), "the mean is 21.2");
    }
}
