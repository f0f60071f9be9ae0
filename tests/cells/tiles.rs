//! Cells that cross the faces of tiles: every cut into tiles gives the same.

use super::scene::*;
use pointmill::ops::{Cells, Measure, Split};
use pointmill::tile::Fate;
use proptest::prelude::*;

fn bits(fates: &[(pointmill::point::Position, Fate)]) -> Vec<([i64; 3], Option<u32>, bool)> {
    let deviation = |fate: Fate| match fate {
        Fate::Represented { deviation } => Some(deviation.to_bits()),
        Fate::Kept | Fate::KeptOnce | Fate::Removed => None,
    };
    fates.iter().map(|&(p, fate)| (p, deviation(fate), fate == Fate::KeptOnce)).collect()
}

fn same_for_every_cut(stage: Cells, scan: &[Point], most: usize) -> Result<u64, TestCaseError> {
    let stage = settle(stage, scan);
    let one = run(&stage, scan, &[whole(scan).cube()]);
    let tiles = tiles(scan, most);
    let many = run(&stage, scan, &tiles);
    prop_assert!(tiles.len() >= 2);
    prop_assert_eq!(bits(&one.fates), bits(&many.fates));
    prop_assert_eq!(&one.tally.counts, &many.tally.counts);
    prop_assert_eq!(&one.tally.removed, &many.tally.removed);
    Ok(many.tally.work["crossing_cells"])
}

proptest! {
    #[test]
    fn cutting_into_tiles_changes_nothing(
        scan in prop_oneof![
            any_scan(0, 30, 200), any_scan(1000, 60, 200), any_scan((1 << 60) + 5, 40, 200),
        ],
        side in prop::sample::select(vec![3i64, 5, 6, 7, 11, 13, 20]),
        most in 5usize..60,
        split in prop::sample::select(vec![Split::Voronoi, Split::Octant, Split::Dirichlet]),
        delta in prop::sample::select(vec![0.0, 0.1, 0.8]),
        measure in prop::sample::select(vec![Measure::Axis, Measure::Cone]),
        bounds in prop::sample::select(vec![None, Some((1.0, 3.0)), Some((2.0, 2.0))]),
    ) {
        let mut stage = cells(side as f64, delta, split);
        stage.measure = measure;
        let bounds = bounds.unzip();
        stage.min_spacing = bounds.0.map(length).map(spacing);
        stage.max_side = bounds.1.map(length);
        let crossing = same_for_every_cut(stage, &scan, most)?;
        prop_assume!(crossing > 0);
    }

    #[test]
    fn tiles_smaller_than_an_aligned_cell_change_nothing(
        scan in any_scan(20, 20, 200), most in 2usize..8,
    ) {
        let crossing = same_for_every_cut(cells(8.0, 0.1, Split::Voronoi), &scan, most)?;
        prop_assume!(crossing > 0);
    }
}

#[test]
fn two_tiles_and_eight_of_a_long_scan_agree() {
    let points = (0..3000i64).map(|i| {
        let tilt = ((i * 37) % 100) as f64 / 100.0 - 0.5;
        let normal = [tilt as f32, 0.0, (1.0 - tilt * tilt).sqrt() as f32];
        ([i % 128, i / 47, i * 11 / 64 % 16], normal, 1 + (i % 3 == 0) as u32)
    });
    let scan = scan(points);
    for (most, at_least) in [(scan.len() - 1, 2), (scan.len() / 4, 8)] {
        assert!(tiles(&scan, most).len() >= at_least);
        let crossing = same_for_every_cut(cells(9.0, 0.1, Split::Voronoi), &scan, most).unwrap();
        assert!(crossing > 5);
    }
}
