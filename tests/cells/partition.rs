//! The partition into cells: against the plain version, and what the words of the method promise.

use std::num::NonZeroUsize;

use super::scene::*;
use pointmill::ops::{Cells, Measure, Reference, Split};
use pointmill::point::{Bounds, Position};
use pointmill::report::Tally;
use pointmill::stage::TileOp;
use proptest::prelude::*;

const UP: [f32; 3] = [0.0, 0.0, 1.0];

fn sorted(mut groups: Vec<Vec<Position>>) -> Vec<Vec<Position>> {
    groups.sort_unstable();
    groups
}

fn any_split() -> impl Strategy<Value = Split> {
    prop::sample::select(vec![Split::Voronoi, Split::Octant, Split::Dirichlet])
}

fn any_measure() -> impl Strategy<Value = Measure> {
    prop::sample::select(vec![Measure::Axis, Measure::Cone])
}

fn any_reference() -> impl Strategy<Value = Reference> {
    // Their largest components are powers of two: scaled by them they are what the plain version
    // has.
    let [a, b] = [[0.0, 0.0, 2.0], [1.0, -1.0, 0.5]].map(Reference::Vector);
    prop::sample::select(vec![Reference::X, Reference::Y, Reference::Z, a, b])
}

/// A least spacing and a largest side, in this order.
fn any_lengths() -> impl Strategy<Value = (Option<f64>, Option<f64>)> {
    let steps = || 1i64..30;
    (any::<bool>(), any::<bool>(), steps(), steps()).prop_map(|(has_least, has_most, a, b)| {
        let (least, most) = (a.min(b) as f64, a.max(b) as f64);
        (has_least.then_some(least), has_most.then_some(most))
    })
}

/// A grid of `n` × `n` positions 10 steps apart.
fn grid(n: i64, normal: impl Fn(i64, i64) -> [f32; 3]) -> Vec<Point> {
    scan((0..n * n).map(|i| ([i % n * 10, i / n * 10, 0], normal(i % n, i / n), 1)))
}

proptest! {
    #[test]
    fn groups_and_medians_equal_the_plain_version(
        scan in prop_oneof![any_scan(0, 14, 90), any_scan(1 << 30, 200, 60), any_scan(-1000, 40, 60), any_scan(99, 1 << 39, 60)],
        side in prop_oneof![5 => 1i64..40, 2 => (1i64 << 36) - 3..(1 << 40) + 3, 1 => Just(1 << 38)], delta in prop::sample::select(vec![0.0, 0.05, 0.1, 0.7, 2.0, 3.1]),
        split in any_split(), min_points in 1usize..6, measure in any_measure(), reference in any_reference(),
        bounds in prop_oneof![Just((None, None)), any_lengths()],
    ) {
        let mut stage = cells(side as f64, delta, split);
        stage.min_points = NonZeroUsize::new(min_points).unwrap();
        stage.measure = measure;
        stage.reference = (measure == Measure::Axis).then_some(reference);
        stage.min_spacing = bounds.0.map(length).map(spacing);
        stage.max_side = bounds.1.map(length);
        let plain = plain_groups(&scan, &stage, side);
        let outcome = run_whole(stage.clone(), &scan);
        let positions = |g: &Vec<Point>| g.iter().map(|p| p.at).collect::<Vec<_>>();
        // Equal as lists: members of both are in Morton order.
        prop_assert_eq!(sorted(outcome.groups.clone()), sorted(plain.iter().map(positions).collect()));
        let mut kept = outcome.kept();
        kept.sort_unstable();
        let mut expected: Vec<Position> = plain.iter().map(|g| plain_median(g, &stage)).collect();
        expected.extend(scan.iter().filter(|p| p.normal[0].is_nan()).map(|p| p.at));
        expected.sort_unstable();
        prop_assert_eq!(kept, expected);
        prop_assert_eq!(outcome.count("cells"), plain.len() as u64);
    }

    #[test]
    fn every_position_with_a_normal_is_in_exactly_one_group(
        scan in any_scan(5, 30, 120), side in 1i64..20, split in any_split(),
    ) {
        // One octant of the scan is the tile: cells cross its faces.
        let Some(children) = whole(&scan).children() else { return Ok(()) };
        let stage = settle(cells(side as f64, 0.1, split), &scan);
        for child in children {
            let mut tile = tile(&scan, child.cube(), side);
            stage.run(&mut tile, &mut Tally::default()).unwrap();
            let corner = |p: Position| p.map(|v| v.div_euclid(side));
            let with_normal: Vec<&Point> = scan.iter().filter(|p| !p.normal[0].is_nan()).collect();
            let in_core = |p: &Point| child.cube().contains(p.at);
            let mut expected: Vec<Position> = with_normal
                .iter()
                .filter(|p| with_normal.iter().any(|q| in_core(q) && corner(q.at) == corner(p.at)))
                .map(|p| p.at)
                .collect();
            let mut members: Vec<Position> = groups(&tile).concat();
            expected.sort_unstable();
            members.sort_unstable();
            prop_assert_eq!(members, expected);
            prop_assert_eq!(tile.cells.turned.len(), tile.cells.members.len());
        }
    }

    /// The paper: "when this parameter is decreased, the number of output data points is extremely
    /// reduced". As printed the algorithm does the opposite for the angle δ; read as the density β,
    /// fewer points stay as it *grows*. Both hold for any data, as neither changes where a cell
    /// would be divided.
    #[test]
    fn smaller_angles_keep_more_and_larger_density_thresholds_keep_fewer(
        scan in any_scan(0, 40, 150), split in any_split(), side in 5i64..60,
    ) {
        let kept = |max_angle: f64, min_points: usize| {
            let mut stage = cells(side as f64, max_angle, split);
            stage.min_points = NonZeroUsize::new(min_points).unwrap();
            run_whole(stage, &scan).kept().len()
        };
        let by_angle: Vec<usize> = [0.0, 0.01, 0.1, 0.5, 1.5, std::f64::consts::PI].map(|d| kept(d, 1)).into();
        prop_assert!(by_angle.is_sorted_by(|a, b| a >= b), "{by_angle:?}");
        let by_density: Vec<usize> = [1, 2, 4, 8, 16, 1000].map(|b| kept(0.0, b)).into();
        prop_assert!(by_density.is_sorted_by(|a, b| a >= b), "{by_density:?}");
        // Nothing is said of scans in which no cell has two normals.
        prop_assume!(by_angle[0] > by_angle[5] && by_density[0] > by_density[5]);
    }
}

#[test]
fn a_gable_is_divided_at_its_ridge() {
    // The ridge runs along y between columns 15 and 16; signs are as random as an estimate's.
    let scan = grid(32, |x, y| {
        let s = if x < 16 { -0.6 } else { 0.6 };
        if (x * 7 + y * 3) % 5 < 2 { [-s, 0.0, -0.8] } else { [s, 0.0, 0.8] }
    });
    for (split, side) in [(Split::Voronoi, 1000.0), (Split::Octant, 1000.0), (Split::Voronoi, 77.0)]
    {
        let outcome = run_whole(cells(side, 0.1, split), &scan);
        assert!(outcome.groups.len() >= 2);
        for group in &outcome.groups {
            let left = group.iter().filter(|p| p[0] < 160).count();
            assert!(left == 0 || left == group.len(), "{split:?}: a group has both sides");
        }
        assert!(outcome.groups.len() < 200, "{split:?}: {} groups", outcome.groups.len());
    }
}

#[test]
fn a_plane_is_one_group_whatever_the_signs_of_its_normals() {
    let plane = grid(20, |_, _| UP);
    let outcome = run_whole(cells(1e6, 0.0, Split::Voronoi), &plane);
    assert_eq!((outcome.groups.len(), outcome.kept().len()), (1, 1));
    for normal in [UP, [0.6, 0.0, 0.8], [1.0, 0.0, 0.0], [0.36, -0.48, 0.8]] {
        let mixed = grid(20, |x, y| if (x ^ y) & 1 == 0 { normal } else { normal.map(|v| -v) });
        let outcome = run_whole(cells(1e6, 0.0, Split::Octant), &mixed);
        assert_eq!(outcome.groups.len(), 1, "{normal:?}");
    }
}

#[test]
fn equally_far_positions_go_with_the_smallest_angle() {
    // θ to x: smallest at 0, largest at 4; 2 is equally far from both.
    let scan = scan([
        ([0, 0, 0], [0.6, 0.0, 0.8], 1),
        ([2, 0, 0], UP, 1),
        ([4, 0, 0], [-0.6, 0.0, 0.8], 1),
    ]);
    let outcome = run_whole(cells(8.0, 1.0, Split::Voronoi), &scan);
    assert_eq!(outcome.groups, [vec![[0, 0, 0], [2, 0, 0]], vec![[4, 0, 0]]]);
}

#[test]
fn of_equal_angles_the_morton_first_is_the_site() {
    // Both 0 and 30 have the smallest angle, both 10 and 18 the largest: sites are 0 and 10.
    let (small, large) = ([0.6, 0.0, 0.8], [-0.6, 0.0, 0.8]);
    let scan = scan(
        [0, 10, 18, 30].map(|x| ([x, 0, 0], if x == 0 || x == 30 { small } else { large }, 1)),
    );
    let outcome = run_whole(cells(64.0, 0.5, Split::Voronoi), &scan);
    assert_eq!(outcome.groups[0], [[0, 0, 0]]);
    assert_eq!(sorted(outcome.groups)[1..], [vec![[10, 0, 0], [18, 0, 0]], vec![[30, 0, 0]]]);
}

#[test]
fn cells_of_min_points_are_not_divided() {
    let four = scan(
        [0, 1, 2, 3]
            .map(|x| ([x, 0, 0], if x % 2 == 0 { [0.6, 0.0, 0.8] } else { [-0.6, 0.0, 0.8] }, 1)),
    );
    let groups = |min_points: usize| {
        let mut stage = cells(4.0, 0.1, Split::Voronoi);
        stage.min_points = NonZeroUsize::new(min_points).unwrap();
        run_whole(stage, &four).groups.len()
    };
    assert_eq!([1, 3, 4].map(groups), [4, 2, 1]);
}

#[test]
fn one_point_and_none_are_cells_too() {
    let one = scan([([-3, 7, 9], UP, 1)]);
    assert_eq!(run_whole(Cells::default(), &one).kept(), [[-3, 7, 9]]);
    let none = scan([([-3, 7, 9], NONE, 1)]);
    let outcome = run_whole(Cells::default(), &none);
    assert_eq!((outcome.groups.len(), outcome.kept().len()), (0, 1));
    let stage = settle(cells(3.0, 0.1, Split::Voronoi), &one);
    let empty = Bounds { lo: [100; 3], hi: [200; 3] };
    assert!(run(&stage, &one, &[empty]).groups.is_empty());
}

#[test]
fn automatic_sides_are_powers_of_two_with_32_positions_a_cube() {
    let scan = grid(64, |_, _| UP);
    let stage = settle(Cells::default(), &scan);
    let needs = stage.needs();
    assert!(needs.cell_aligned);
    assert_eq!(needs.cell_side, 64, "6.4 × 6.4 positions; half of it would hold 10");
    assert_eq!(stage.decisions()[0], ("side".to_owned(), 64.0.into()));
    let given = settle(cells(63.0, 0.1, Split::Voronoi), &scan);
    assert!(!given.needs().cell_aligned);
    assert_eq!(given.needs().cell_side, 63);
}

#[test]
fn no_data_makes_the_division_quadratic() {
    // The angles swing less and less along a line: each bisection cuts one position off.
    let n = 60_000;
    let line = scan((0..n).map(|i| {
        let swing = 0.6 - 0.4 * i as f64 / n as f64;
        let x = if i % 2 == 0 { swing } else { -swing };
        ([i, 0, 0], [x as f32, 0.0, (1.0 - x * x).sqrt() as f32], 1)
    }));
    let outcome = run_whole(cells(1e9, 0.1, Split::Voronoi), &line);
    assert_eq!(outcome.count("cells_cut_deep"), 1);
    assert_eq!(outcome.count("cells"), outcome.groups.len() as u64);
    assert_eq!(outcome.groups.concat().len(), n as usize);
    for group in &outcome.groups {
        assert_eq!(group.len(), 1, "neighbours differ by more than the angle");
    }
}

/// The longest side of each group's tight box.
fn lengths(outcome: &Outcome) -> Vec<u64> {
    let length = |group: &Vec<Position>| {
        Bounds::of(group.iter().copied()).extent().into_iter().max().unwrap()
    };
    outcome.groups.iter().map(length).collect()
}

#[test]
fn no_cell_longer_than_max_side_is_kept_whole() {
    let plane = grid(40, |_, _| UP);
    let mut stage = cells(1e6, 0.1, Split::Voronoi);
    stage.min_points = NonZeroUsize::new(1000).unwrap();
    assert_eq!(run_whole(stage.clone(), &plane).groups.len(), 1);
    stage.max_side = Some(length(50.0));
    let outcome = run_whole(stage.clone(), &plane);
    let groups = outcome.groups.len();
    assert!(lengths(&outcome).iter().all(|&length| length <= 50));
    assert!((64..=400).contains(&groups), "{groups} of squares of 25 to 50");
    // Of a plane every division is one for that reason; each makes two to four parts.
    let divided = outcome.count("cells_by_max_side");
    assert!(divided < groups as u64 && groups as u64 <= 3 * divided + 1, "{divided}, {groups}");
    // A part of two sides of a ridge is divided by its angles, however long.
    let ridge = grid(2, |x, _| if x == 0 { [0.6, 0.0, 0.8] } else { [-0.6, 0.0, 0.8] });
    (stage.max_side, stage.min_points) = (Some(length(9.0)), NonZeroUsize::MIN);
    let outcome = run_whole(stage, &ridge);
    assert_eq!((outcome.groups.len(), outcome.count("cells_by_max_side")), (4, 0));
}

#[test]
fn no_cell_of_min_spacing_is_divided() {
    let rough = grid(32, |x, y| if (x + y) % 2 == 0 { [0.6, 0.0, 0.8] } else { [-0.6, 0.0, 0.8] });
    let mut stage = cells(1e6, 0.1, Split::Octant);
    assert_eq!(run_whole(stage.clone(), &rough).groups.len(), 1024);
    stage.min_spacing = Some(spacing(length(70.0)));
    let outcome = run_whole(stage.clone(), &rough);
    assert!(lengths(&outcome).iter().all(|&length| length <= 70));
    assert_eq!(outcome.count("cells_by_min_spacing"), outcome.groups.len() as u64);
    assert!(outcome.groups.len() < 150, "{}", outcome.groups.len());
    // Cells that agree are not kept for that reason.
    let plane = grid(4, |_, _| UP);
    assert_eq!(run_whole(stage, &plane).count("cells_by_min_spacing"), 0);
}

#[test]
fn cones_see_what_turns_about_the_reference() {
    // Normals turn about x: their angle to it is the same everywhere.
    let roll = grid(40, |_, y| {
        let angle = (y as f64 - 19.5) * 0.02;
        [0.0, angle.sin() as f32, angle.cos() as f32]
    });
    let mut stage = cells(1e6, 0.1, Split::Voronoi);
    assert_eq!(run_whole(stage.clone(), &roll).groups.len(), 1, "blind");
    stage.reference = Some(Reference::Y);
    assert!(run_whole(stage.clone(), &roll).groups.len() >= 8);
    (stage.measure, stage.reference) = (Measure::Cone, None);
    let outcome = run_whole(stage.clone(), &roll);
    assert!((8..=40).contains(&outcome.groups.len()), "{}", outcome.groups.len());
    // Rows of one normal are 0.02 rad apart: a cone of 0.1 holds at most 6 of them.
    assert!(outcome.groups.iter().all(|g| g.iter().all(|p| (p[1] - g[0][1]).abs() <= 50)));
    // Normals that agree are in one cone even of angle 0, rounded as they are.
    stage.max_angle = radians(0.0);
    let tilted = grid(20, |x, _| {
        let n = [0.267_261_24, 0.534_522_5, 0.801_783_7f32];
        if x % 2 == 0 { n } else { n.map(|v| -v) }
    });
    assert_eq!(run_whole(stage, &tilted).groups.len(), 1);
}
