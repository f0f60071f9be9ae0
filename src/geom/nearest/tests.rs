use std::cmp::Ordering;

use proptest::prelude::*;

use super::exact::Neighbor;
use super::own::Nearest;
use super::tree::{BoxNode, BoxTree, EXACT};
use super::walk::Work;
use super::{refine, tree};
use crate::geom::simd::Simd;
use crate::point::{Position, distance2};

/// A sequence of pseudo-random numbers (splitmix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    fn below(&mut self, end: i64) -> i64 {
        (self.next() % end as u64) as i64
    }
}

fn morton(a: &Position, b: &Position) -> Ordering {
    let differ = |axis: usize| (a[axis] ^ b[axis]) as u64;
    let axis = (0..3).max_by_key(|&axis| (differ(axis).checked_ilog2(), axis)).unwrap();
    a[axis].cmp(&b[axis])
}

/// Distinct positions in Morton order.
fn set(positions: impl IntoIterator<Item = Position>) -> Vec<Position> {
    let mut set: Vec<Position> = positions.into_iter().collect();
    set.sort_by(morton);
    set.dedup();
    set
}

/// All others by exact distance, ties by index.
fn brute_force(positions: &[Position], query: usize) -> Vec<Neighbor> {
    let mut others: Vec<Neighbor> = (0..positions.len())
        .filter(|&i| i != query)
        .map(|i| (distance2(positions[query], positions[i]), i as u32))
        .collect();
    others.sort_unstable();
    others
}

/// What a comparison with brute force met on its way.
#[derive(Debug, Default, PartialEq)]
struct Met {
    compared: usize,
    /// Points whose k-th and next neighbour are equally far.
    ties: usize,
    redone: u64,
    work: Work,
}

/// Searches all of `positions` by every instruction set and compares about `sample` of them with
/// brute force; all do the same.
fn compare(positions: &[Position], k: usize, sample: usize) -> Met {
    let mut all = Simd::all().map(|simd| compare_by(simd, positions, k, sample));
    let portable = all.next().unwrap();
    all.for_each(|met| assert_eq!(met, portable));
    portable
}

fn compare_by(simd: Simd, positions: &[Position], k: usize, sample: usize) -> Met {
    let mut nearest = Nearest::with(simd);
    nearest.build(positions);
    let every = positions.len().div_ceil(sample).max(1);
    let mut met = Met::default();
    let mut seen = vec![0; positions.len()];
    nearest.search(
        positions,
        k,
        |_| true,
        |i, neighbors, distance2| {
            seen[i] += 1;
            if i % every != 0 {
                return;
            }
            let expected = brute_force(positions, i);
            let kept = k.min(expected.len());
            let ranks: Vec<u32> = expected[..kept].iter().map(|&(_, rank)| rank).collect();
            assert_eq!(neighbors, ranks, "neighbours of {i} at {:?}, k = {k}", positions[i]);
            assert_eq!(distance2, expected[..kept].last().map_or(0, |last| last.0));
            met.compared += 1;
            met.ties += usize::from(
                kept > 0 && expected.len() > k && expected[kept - 1].0 == expected[k].0,
            );
        },
    );
    assert!(seen.iter().all(|&visits| visits == 1), "every index is visited once");
    met.redone = nearest.redone();
    met.work = nearest.work();
    met
}

const KS: [usize; 7] = [1, 6, 10, 16, 20, 30, 64];

fn uniform(n: usize, extent: i64, seed: u64) -> Vec<Position> {
    let mut random = Random(seed);
    set((0..n).map(|_| std::array::from_fn(|_| random.below(extent))))
}

/// Terrain of `n` points about `spacing` steps apart.
fn surface(n: usize, spacing: i64, seed: u64) -> Vec<Position> {
    let mut random = Random(seed);
    let side = ((n as f64).sqrt() * spacing as f64) as i64;
    set((0..n).map(|_| {
        let (x, y) = (random.below(side), random.below(side));
        let phase = x as f64 / side as f64 * 20.0;
        let z = (phase.sin() + (y as f64 / side as f64 * 13.0).cos()) * spacing as f64 * 9.0;
        [x, y, z as i64 + random.below(spacing / 8 + 1)]
    }))
}

fn grid(side: i64, step: i64) -> Vec<Position> {
    set((0..side.pow(3)).map(|i| [i % side * step, i / side % side * step, i / side.pow(2) * step]))
}

fn moved(positions: &[Position], by: Position) -> Vec<Position> {
    set(positions.iter().map(|p| std::array::from_fn(|axis| p[axis] + by[axis])))
}

#[test]
fn random_sets_of_any_size_have_their_nearest() {
    for n in [0, 1, 2, 10, 11, 12, 17, 255, 256, 257, 300, 5000] {
        for (i, extent) in
            [40, 5_000, 1 << 20, 1 << 24, 1 << 31, 1 << 40, 1 << 62].into_iter().enumerate()
        {
            let positions = uniform(n, extent, n as u64 + extent as u64);
            // All pairings on small sets, every k and every extent on large ones.
            for k in
                KS.into_iter().skip(if n < 1000 { 0 } else { i }).take(if n < 1000 { 7 } else { 1 })
            {
                compare(&positions, k, 60);
            }
        }
    }
}

#[test]
fn surfaces_in_millimetres_are_proven_in_floats() {
    for k in KS {
        let met = compare(&surface(5000, 300, 5), k, 300);
        assert!(met.compared >= 250);
        assert_eq!(met.redone, 0);
    }
}

#[test]
fn an_extent_beyond_floats_is_still_proven_where_points_are_near() {
    // Two patches 2^40 steps apart, each in millimetres.
    let patch = surface(3000, 300, 8);
    let both = set(patch.iter().copied().chain(moved(&patch, [1 << 40, -(1 << 39), 77])));
    let met = compare(&both, 10, 300);
    assert!(met.redone < 600, "{met:?}");
}

#[test]
fn ties_on_a_surface_lattice_go_to_the_smaller_index() {
    let mut random = Random(3);
    let lattice = set(
        (0..6000).map(|_| [random.below(90) * 10, random.below(90) * 10, random.below(2) * 10])
    );
    for k in KS {
        let met = compare(&lattice, k, 400);
        assert!(met.ties > met.compared / 4, "{met:?}");
        assert_eq!(met.redone, 0);
    }
}

#[test]
fn ties_in_a_full_grid_go_to_the_smaller_index() {
    for (step, inexact) in
        [(1, false), (1000, false), (5001, true), (1 << 30, true), (1 << 55, true)]
    {
        for k in KS {
            let met = compare(&grid(17, step), k, 120);
            assert!(met.ties > 20, "{met:?}");
            if inexact {
                assert!(met.redone > 1000, "ties that floats cannot prove, step {step}: {met:?}");
            }
        }
    }
}

#[test]
fn points_on_a_line_have_their_nearest() {
    for direction in [[1, 0, 0], [0, 0, 1], [3, -2, 7], [1 << 30, 1 << 29, 5]] {
        let line = set((-700..700).map(|i| direction.map(|d: i64| d * i)));
        for k in KS {
            let met = compare(&line, k, 100);
            assert!(k % 2 == 0 || met.ties > 50, "{met:?}");
        }
    }
}

#[test]
fn two_clusters_far_apart_keep_to_themselves() {
    let cluster = uniform(900, 4000, 4);
    for apart in [1 << 25, 1 << 45, 1 << 60] {
        let both = set(cluster.iter().copied().chain(moved(&cluster, [apart, 5, apart])));
        for k in KS {
            let met = compare(&both, k, 150);
            // A few leaves span the gap; who meets them is redone, not everyone.
            assert!(met.work.leaves < 1800 * 64, "{met:?}");
        }
    }
}

#[test]
fn a_small_cluster_takes_neighbours_from_a_far_one() {
    let few = uniform(7, 40, 4);
    let both = set(few.iter().copied().chain(moved(&uniform(2000, 3000, 9), [0, 1 << 58, 3])));
    for k in KS {
        assert!(compare(&both, k, 2007).compared > 1900);
    }
}

#[test]
fn one_point_at_the_end_of_the_world_spoils_nothing() {
    for far in [1 << 32, 1 << 61] {
        let mut tile = surface(5000, 300, 12);
        tile.extend([[far, far, far], [-far, far, 5], [900, -far, 0]]);
        let tile = set(tile);
        for k in [6, 10, 30] {
            let met = compare(&tile, k, 300);
            assert!(met.redone < tile.len() as u64 / 4, "{met:?}");
        }
    }
}

#[test]
fn the_place_in_the_world_changes_nothing() {
    let here = uniform(1000, 100_000, 6);
    for by in [[1 << 61, -(1 << 61), 1 << 61], [-(1 << 61) - 12_345, 1 << 40, 3]] {
        for k in [1, 10, 30] {
            let met = compare(&moved(&here, by), k, 200);
            assert!(met.compared > 190);
        }
    }
}

#[test]
fn coordinates_that_floats_round_are_redone_until_right() {
    let mut redone = 0;
    // A centimetre grid in binary fractions of a metre: nearly ties that only integers tell apart.
    let step = (1u64 << 30) as f64 / 100.0;
    let mut random = Random(21);
    let cloud = set((0..5000).map(|_| {
        std::array::from_fn(|_| ((random.below(60) as f64 - 30.0) * step).round_ties_even() as i64)
    }));
    for k in KS {
        redone += compare(&cloud, k, 200).redone;
    }
    assert!(redone > 5000, "{redone}");
}

#[test]
fn a_binary_lattice_is_mostly_proven() {
    let met = compare(&surface(5000, 300 << 20, 31), 10, 300);
    assert!(met.redone < 100, "{met:?}");
}

#[test]
fn only_the_wanted_are_visited() {
    let positions = surface(3000, 200, 2);
    let mut nearest = Nearest::new();
    nearest.build(&positions);
    let mut visited = Vec::new();
    nearest.search(
        &positions,
        10,
        |i| i % 7 == 3,
        |i, neighbors, _| {
            let expected: Vec<u32> = brute_force(&positions, i)[..10].iter().map(|n| n.1).collect();
            assert_eq!(neighbors, expected);
            visited.push(i);
        },
    );
    visited.sort_unstable();
    let wanted: Vec<usize> = (0..positions.len()).filter(|i| i % 7 == 3).collect();
    assert!(wanted.len() > 400);
    assert_eq!(visited, wanted);
}

/// Nodes and leaves visited per point of a lattice, which must be full of ties.
fn boxes_visited(lattice: &[Position]) -> f64 {
    let met = compare(lattice, 10, 20);
    assert!(met.ties > 5, "{met:?}");
    (met.work.leaves + met.work.nodes) as f64 / lattice.len() as f64
}

#[test]
fn ties_without_end_stay_linear() {
    let (small, large) = (boxes_visited(&grid(24, 10)), boxes_visited(&grid(40, 10)));
    assert!(large < small * 1.4 && large < 4.0, "{small} and {large} boxes a point");
    let flat = |side: i64| set((0..side * side).map(|i| [i % side * 250, i / side * 250, 0]));
    let (small, large) = (boxes_visited(&flat(64)), boxes_visited(&flat(256)));
    assert!(large < small * 1.5 && large < 1.5, "{small} and {large} boxes a point");
}

#[test]
fn building_again_within_the_reserve_allocates_nothing() {
    let mut nearest = Nearest::new();
    for points in [1, 16, 17, 256, 257, 4097, 70_000] {
        let bytes = BoxTree::bytes(points);
        assert!(
            bytes <= points * Nearest::BYTES_PER_POINT + Nearest::FIXED_BYTES,
            "{points}: {bytes}"
        );
        assert!(BoxTree::bytes(points - 1) <= bytes);
        for k in KS {
            assert!(Nearest::bytes(points, k) - bytes <= k * 256 + 1024);
        }
        nearest.reserve(points);
        let sizes = [size_of::<refine::Leaf>(), size_of::<BoxNode>(), 48];
        let allocated: usize =
            nearest.tree.capacity().iter().zip(sizes).map(|(n, size)| n * size).sum();
        assert_eq!(allocated, bytes, "what is promised is what is held");
        let held = nearest.tree.capacity();
        for n in [points, points / 2, 0, points.min(3)] {
            nearest.build(&uniform(n, 1 << 20, 1));
            assert_eq!(nearest.tree.capacity(), held);
        }
    }
}

#[test]
fn kiddo_agrees_where_nothing_ties() {
    let positions = surface(4000, 5000, 77);
    let mut tree: kiddo::KdTree<f64, 3> = kiddo::KdTree::new();
    for (i, p) in positions.iter().enumerate() {
        tree.add(&p.map(|v| v as f64), i as u64);
    }
    let mut nearest = Nearest::new();
    nearest.build(&positions);
    let mut compared = 0;
    nearest.search(
        &positions,
        10,
        |_| true,
        |i, neighbors, distance2| {
            let found = tree.nearest_n::<kiddo::SquaredEuclidean>(
                &positions[i].map(|v| v as f64),
                12.try_into().unwrap(),
            );
            if found.windows(2).any(|pair| pair[0].distance == pair[1].distance) {
                return;
            }
            let expected: Vec<u32> = found[1..11].iter().map(|n| n.item as u32).collect();
            assert_eq!(neighbors, expected);
            assert_eq!(distance2 as f64, found[10].distance);
            compared += 1;
        },
    );
    assert!(compared > 3500, "{compared}");
}

fn coordinate(bits: u32) -> impl Strategy<Value = i64> {
    let end = 1i64 << bits;
    -end..=end
}

/// Sets of every kind of extent: crowded, sparse, clusters within clusters.
fn any_set() -> impl Strategy<Value = Vec<Position>> {
    let position = prop_oneof![
        prop::array::uniform3(coordinate(3)),
        prop::array::uniform3(coordinate(12)),
        prop::array::uniform3(coordinate(26)),
        prop::array::uniform3(coordinate(40)),
        prop::array::uniform3(coordinate(61)),
        (coordinate(4), coordinate(4), coordinate(4)).prop_map(|(x, y, z)| [
            x << 28,
            y << 28,
            z << 28
        ]),
        (coordinate(2), coordinate(3), coordinate(2)).prop_map(|(x, y, z)| [
            (x << 59) + y,
            (z << 58) - y,
            y
        ]),
    ];
    prop::collection::vec(position, 0..700).prop_map(set)
}

#[test]
fn floats_are_rounded_outward() {
    for v in [0, 1, EXACT, EXACT + 1, EXACT + 3, (1 << 40) + 1, (1 << 62) - 1, i64::MAX] {
        for v in [v, -v] {
            let (below, above) = (tree::below(v), tree::above(v));
            assert!(below as i128 <= i128::from(v) && i128::from(v) <= above as i128, "{v}");
            assert!(below == above || below.next_up() == above, "{v}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn any_set_has_its_exact_nearest(positions in any_set(), k in 1usize..40) {
        compare(&positions, k, 80);
    }
}
