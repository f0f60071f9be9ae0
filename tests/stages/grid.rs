//! The grid against brute force, over whole scans however they are cut into tiles.

use std::collections::BTreeMap;

use crate::support::tiles::*;
use pointmill::internals::morton_cmp;
use pointmill::ops::{Grid, Pick};
use pointmill::point::{Bounds, NORMAL, Position};
use pointmill::quantity::Length;
use pointmill::report::Tally;
use pointmill::stage::TileOp;
use pointmill::tile::{Fate, Tile};
use proptest::prelude::*;

const PICKS: [Pick; 3] = [Pick::Center, Pick::Median, Pick::First];

fn settled(side: f64, pick: Pick, scan: &[Position], step: f64) -> Grid {
    let mut stage = Grid::new(Length::of(side).unwrap(), pick);
    settle(&mut stage, scan, step);
    stage
}

/// The stage over tiles; `dress` gives each its copies and normals.
fn run(
    stage: &Grid,
    scan: &[Position],
    cubes: &[Bounds],
    dress: &dyn Fn(&mut Tile),
) -> (Vec<(Position, Fate)>, Tally) {
    let (mut all, mut tally) = (Vec::new(), Tally::default());
    for cube in cubes {
        let mut tile = tile(scan, *cube, stage.needs().cell_side);
        dress(&mut tile);
        stage.run(&mut tile, &mut tally).unwrap();
        all.extend(fates(&tile));
    }
    all.sort_by(|a, b| morton_cmp(&a.0, &b.0));
    (all, tally)
}

/// The positions that stay, written plainly.
fn plain(scan: &[Position], side: i64, pick: Pick) -> Vec<Position> {
    let mut cubes: BTreeMap<Position, Vec<Position>> = BTreeMap::new();
    for p in scan {
        cubes.entry(p.map(|v| v.div_euclid(side) * side)).or_default().push(*p);
    }
    let median = |of: &[Position], axis: usize| {
        let mut values: Vec<i64> = of.iter().map(|p| p[axis]).collect();
        values.sort_unstable();
        values[(values.len() - 1) / 2]
    };
    let kept = cubes.iter().map(|(corner, of)| {
        let far = |p: &Position| match pick {
            Pick::First => 0,
            Pick::Center => far2(p.map(|v| 2 * v), corner.map(|v| 2 * v + side)),
            Pick::Median => far2(*p, [0, 1, 2].map(|axis| median(of, axis))),
            other => panic!("there is no oracle of {other:?}"),
        };
        *of.iter().min_by(|a, b| far(a).cmp(&far(b)).then(morton_cmp(a, b))).unwrap()
    });
    sorted(kept)
}

fn kept(fates: &[(Position, Fate)]) -> Vec<Position> {
    let kept = fates.iter().filter(|f| matches!(f.1, Fate::Kept | Fate::KeptOnce));
    kept.map(|f| f.0).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn a_grid_keeps_what_brute_force_keeps_however_the_scan_is_cut(
        points in prop::collection::vec(prop::array::uniform3(-20i64..20), 1..150),
        side in 1i64..12,
    ) {
        let scan = sorted(points);
        for pick in PICKS {
            let expected = plain(&scan, side, pick);
            let stage = settled(side as f64, pick, &scan, 1.0);
            for most in [150, 40, 6] {
                let (fates, tally) = run(&stage, &scan, &cubes(&scan, most), &|_| ());
                prop_assert_eq!(kept(&fates), &expected[..], "{:?}, {}", pick, most);
                prop_assert_eq!(tally.counts["grid_cubes"], expected.len() as u64);
                let gone = (scan.len() - expected.len()) as u64;
                prop_assert_eq!(removed(&tally, "grid", "represented"), gone);
            }
        }
    }
}

#[test]
fn the_side_is_rounded_to_steps_and_told() {
    let scan = sorted([[0, 0, 0], [9, 0, 0]]);
    let stage = settled(0.249, Pick::Center, &scan, 0.01);
    let named = |name: &str| stage.decisions().into_iter().find(|d| d.0 == name).unwrap().1;
    assert_eq!((named("side"), named("side_steps")), (0.25.into(), 25.into()));
    assert_eq!((stage.needs().cell_side, stage.needs().cell_aligned), (25, false));
    let stage = settled(0.32, Pick::Center, &scan, 0.01);
    assert_eq!((stage.needs().cell_side, stage.needs().cell_aligned), (32, true));
    let stage = settled(1e-9, Pick::Center, &scan, 0.01);
    assert_eq!(stage.needs().cell_side, 1, "no side is less than a step");
}

#[test]
fn the_centre_of_a_cube_is_that_of_the_world() {
    // The cube of 4 steps ends where the next begins: its centre is at 2.
    let scan = sorted([[1, 2, 2], [2, 2, 2], [3, 2, 2]]);
    let (fates, _) = run(&settled(4.0, Pick::Center, &scan, 1.0), &scan, &cubes(&scan, 9), &|_| ());
    assert_eq!(kept(&fates), [[2, 2, 2]]);
    // That of 3 steps at 1.5, between two positions: the Morton-first.
    let scan = sorted([[1, 0, 0], [2, 0, 0]]);
    let (fates, _) = run(&settled(3.0, Pick::Center, &scan, 1.0), &scan, &cubes(&scan, 9), &|_| ());
    assert_eq!(kept(&fates), [[1, 0, 0]]);
}

#[test]
fn copies_weigh_as_one_and_are_coincident() {
    let scan = sorted([[0, 0, 0], [2, 2, 2], [3, 3, 3]]);
    let dress = |tile: &mut Tile| tile.copies = vec![50, 3, 2];
    let stage = settled(4.0, Pick::Median, &scan, 1.0);
    let (fates, tally) = run(&stage, &scan, &cubes(&scan, 9), &dress);
    assert_eq!(fates[1], ([2, 2, 2], Fate::KeptOnce));
    assert_eq!(removed(&tally, "grid", "coincident"), 2);
    assert_eq!(removed(&tally, "grid", "represented"), 52);
}

#[test]
fn positions_that_are_only_seen_are_in_no_cube() {
    let scan = sorted([[0, 0, 0], [2, 2, 2], [3, 3, 3], [8, 8, 8]]);
    let dress = |tile: &mut Tile| tile.copies = vec![1, 0, 1, 0];
    for (pick, stays) in [(Pick::Center, [3, 3, 3]), (Pick::First, [0, 0, 0])] {
        let stage = settled(4.0, pick, &scan, 1.0);
        let (fates, tally) = run(&stage, &scan, &cubes(&scan, 9), &dress);
        let mut gone = fates.iter().filter(|f| f.1 == Fate::Removed);
        assert!(gone.next().is_some_and(|f| f.0 != stays) && gone.next().is_none(), "{fates:?}");
        assert_eq!(removed(&tally, "grid", "represented"), 1);
        assert_eq!(tally.counts["grid_cubes"], 1);
    }
}

#[test]
fn with_normals_the_deviation_is_from_the_plane_of_the_point_that_stays() {
    let scan = sorted([[2, 2, 2], [0, 0, 3], [3, 3, 1], [9, 9, 9]]);
    let dress = |tile: &mut Tile| tile.columns.set(&NORMAL, &[[0.0, 0.0, -1.0]; 4]);
    let stage = settled(4.0, Pick::Center, &scan, 1.0);
    let (fates, _) = run(&stage, &scan, &cubes(&scan, 9), &dress);
    for (p, fate) in fates {
        let expected = match p {
            [0, 0, 3] | [3, 3, 1] => Fate::Represented { deviation: 1.0 },
            _ => Fate::Kept,
        };
        assert_eq!(fate, expected, "{p:?}");
    }
}

#[test]
fn without_normals_the_deviation_is_from_the_least_squares_plane_of_the_cube() {
    // On x + z = 7 but for one, which is above; the cube around 12 has too few, that around 20 a
    // line.
    let plane = [[0, 0, 7], [7, 0, 0], [0, 7, 7], [7, 7, 0], [3, 3, 4], [4, 4, 3]];
    let line = [[20, 20, 20], [21, 21, 21], [22, 22, 22], [23, 23, 23]];
    let few = [[12, 12, 12], [13, 12, 12], [12, 13, 12]];
    let scan = sorted(plane.into_iter().chain(line).chain(few));
    let stage = settled(8.0, Pick::Center, &scan, 1.0);
    let (fates, tally) = run(&stage, &scan, &cubes(&scan, 99), &|_| ());
    assert_eq!(removed(&tally, "grid", "represented"), 5 + 3 + 2);
    for (p, fate) in &fates {
        match fate {
            Fate::Represented { deviation } => {
                assert!(plane.contains(p) && *deviation < 1e-6, "{p:?}: {deviation}");
            }
            Fate::Removed => assert!(!plane.contains(p), "{p:?}"),
            _ => {}
        }
    }
    let measured = fates.iter().filter(|f| matches!(f.1, Fate::Represented { .. })).count();
    assert_eq!(measured, 5, "of a line and of three positions no deviation is known");
    // One of them 3 above the plane: what is not the plane is not called 0.
    let bent = sorted(plane.map(|p| if p == [7, 7, 0] { [7, 7, 3] } else { p }));
    let (fates, _) = run(&settled(8.0, Pick::First, &bent, 1.0), &bent, &cubes(&bent, 99), &|_| ());
    let far =
        |f: &(Position, Fate)| matches!(f.1, Fate::Represented { deviation } if deviation > 0.3);
    assert!(fates.iter().any(far), "{fates:?}");
}

#[test]
fn a_grid_without_a_side_is_told_so() {
    let told = refusal("kind = 'grid'");
    assert!(told.contains("side"), "{told}");
    let told = refusal("kind = 'grid'\nside = -2.0");
    assert!(told.contains("p.toml:8") && told.contains("above 0"), "{told}");
}
