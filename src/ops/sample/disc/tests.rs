use std::collections::BTreeSet;

use super::*;
use crate::point::Bounds;
use crate::store::morton_cmp;
use crate::tile::Fate;

fn disc(steps: f64, seed: u64) -> PoissonDisc {
    let settled = Some(SettledDisc::of(steps, steps));
    PoissonDisc { settled, ..PoissonDisc::new(Length::of(steps).unwrap(), seed) }
}

/// Distinct positions in Morton order, by a generator of its own.
fn cloud(points: usize, size: [i64; 3], seed: u64) -> Vec<Position> {
    let mut state = seed * 2 + 1;
    let mut below = |n: i64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
        ((state >> 33) as i64).rem_euclid(n)
    };
    let all: BTreeSet<Position> = (0..points).map(|_| size.map(|n| below(n) - n / 2)).collect();
    let mut all: Vec<Position> = all.into_iter().collect();
    all.sort_by(morton_cmp);
    all
}

/// What stays of the whole scan, one position after the other in the order of visits.
fn plain(scan: &[Position], stage: &PoissonDisc) -> BTreeSet<Position> {
    let SettledDisc { side, apart, .. } = stage.settled.unwrap();
    let mut order: Vec<usize> = (0..scan.len()).collect();
    order.sort_by_key(|&i| {
        let color = color_of(scan[i].map(|v| v.div_euclid(side)));
        (COLORS.iter().position(|c| *c == color), stage.visited(scan[i]), i)
    });
    let mut kept: Vec<Position> = Vec::new();
    for p in order.into_iter().map(|i| scan[i]) {
        if kept.iter().all(|&q| distance2(p, q) >= apart) {
            kept.push(p);
        }
    }
    kept.into_iter().collect()
}

/// The cubes of `side`, each with the positions of its core and zone alone.
fn tiled(scan: &[Position], stage: &PoissonDisc, side: i64) -> (BTreeSet<Position>, usize) {
    let reach = stage.needs().cell_side;
    let place = |p: Position| p.map(|v| v.div_euclid(side));
    let cubes: BTreeSet<Position> = scan.iter().map(|p| place(*p)).collect();
    let mut kept = BTreeSet::new();
    for cube in &cubes {
        let lo = cube.map(|v| v * side);
        let cube = Bounds { lo, hi: lo.map(|v| v + side - 1) };
        let zone = cube.grown(reach);
        // Those of the cube in one range: what is around it comes behind.
        let (core, rim): (Vec<_>, Vec<_>) =
            scan.iter().copied().filter(|p| zone.contains(*p)).partition(|p| cube.contains(*p));
        let count = core.len();
        let mut tile = Tile::of([core, rim].concat());
        (tile.cube, tile.zone, tile.core) = (cube, zone, 0..count);
        stage.run(&mut tile, &mut Tally::default()).unwrap();
        let stays = (0..count).filter(|&i| tile.fates[i] == Fate::Kept);
        kept.extend(stays.map(|i| tile.positions[i]));
    }
    (kept, cubes.len())
}

#[test]
fn a_disc_sample_is_that_of_the_whole_scan_however_it_is_cut() {
    let (mut cut, mut gone) = (0, 0);
    for (points, size, steps) in [
        (1500, [60, 60, 1], 4.0),
        (1500, [60, 60, 60], 9.5),
        (1200, [30, 30, 30], 2.0),
        (800, [700, 90, 40], 12.25),
        (500, [30, 40, 50], 0.7),
        (600, [9, 9, 9], 3.0),
    ] {
        for seed in [0, 7] {
            let scan = cloud(points, size, seed + 1);
            let stage = disc(steps, seed);
            let expected = plain(&scan, &stage);
            for side in [1 << 12, 40, 16, 5] {
                let (kept, cubes) = tiled(&scan, &stage, side);
                assert!(kept == expected, "{size:?}, {steps} steps, cubes of {side}");
                cut = cut.max(cubes);
            }
            gone += scan.len() - expected.len();
        }
    }
    assert!(cut >= 30 && gone > 1000, "{cut} cubes, {gone} are gone");
}

#[test]
fn none_that_stay_are_too_near_and_none_goes_that_could_stay() {
    for (scan, steps) in [(cloud(3000, [90, 90, 3], 5), 5.0), (cloud(3000, [40, 40, 40], 6), 6.5)] {
        let stage = disc(steps, 3);
        let (kept, _) = tiled(&scan, &stage, 25);
        let near = |p: &Position, q: &Position| (distance2(*p, *q) as f64) < steps * steps;
        let others = |p: Position| kept.iter().filter(move |q| **q != p);
        assert!(kept.iter().all(|p| !others(*p).any(|q| near(p, q))));
        let gone = scan.iter().filter(|p| !kept.contains(*p));
        let mut left = 0;
        gone.for_each(|p| {
            assert!(kept.iter().any(|q| near(p, q)), "{p:?} could stay");
            left += 1;
        });
        assert!(kept.len() > 100 && left > 1000, "{} of {}", kept.len(), scan.len());
        assert_ne!(tiled(&scan, &disc(steps, 4), 25).0, kept, "another seed, another sample");
    }
}

#[test]
fn along_the_order_of_colours_no_index_changes_more_often_than_is_reached() {
    let all: BTreeSet<usize> = COLORS.into_iter().collect();
    assert_eq!(all.len(), 8, "each once");
    for bit in 0..3 {
        let changes = COLORS.windows(2).filter(|pair| (pair[0] ^ pair[1]) >> bit & 1 == 1);
        // And one for the rest of the cube that is reached.
        assert!((changes.count() as i64) < REACHED_CELLS);
    }
}

#[test]
fn copies_are_one_and_what_is_only_seen_neither_stays_nor_counts() {
    let mut tile = Tile::of(vec![[0, 0, 0], [1, 0, 0], [50, 0, 0]]);
    tile.copies = vec![0, 3, 2];
    let mut tally = Tally::default();
    disc(10.0, 0).run(&mut tile, &mut tally).unwrap();
    assert_eq!(tile.fates, [Fate::Kept, Fate::KeptOnce, Fate::KeptOnce]);
    assert_eq!(tally.removed.values().sum::<u64>(), 3);
}

#[test]
fn distances_as_long_as_the_lattice_do_not_overflow() {
    let far = (1 << 62) - 1;
    for steps in [1.0, (1u64 << 61) as f64, (1u64 << 62) as f64] {
        let mut tile = Tile::of(vec![[-far; 3], [far; 3]]);
        disc(steps, 0).run(&mut tile, &mut Tally::default()).unwrap();
        assert_eq!(tile.fates, [Fate::Kept; 2], "{steps}");
    }
}
