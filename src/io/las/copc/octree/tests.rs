use std::collections::BTreeMap;

use proptest::prelude::*;

use super::*;
use crate::geom::morton::morton_cmp;

/// A position and a number, as a record has them.
type Numbered = (Position, u64);

/// The pieces of all nodes, of records that hold a position and a number each, of an octree whose
/// open nodes have at most so many bytes, if that is not what it has by itself; and whether one was
/// stored before it had as many records as a piece.
fn pieces(
    points: &[Position],
    most_held: Option<usize>,
) -> (RootCube, BTreeMap<VoxelKey, Vec<Vec<Numbered>>>, bool) {
    let folder = tempfile::tempdir().unwrap();
    let mut points = points.to_vec();
    points.sort_by(morton_cmp);
    let root = RootCube::around(&Bounds::of(points.iter().copied()));
    let mut octree = Octree::new(root, 32, Overflow::at(&folder.path().join("nodes")));
    octree.most_held = most_held.unwrap_or(octree.most_held);
    let most_held = octree.most_held;
    let (mut found, mut stored) = (BTreeMap::new(), false);
    let mut keep = |octree: &mut Octree| {
        for node in octree.ripe() {
            let words = |record: &[u8]| -> [i64; 4] {
                std::array::from_fn(|n| {
                    i64::from_le_bytes(record[8 * n..8 * n + 8].try_into().unwrap())
                })
            };
            let numbered = |record: &[u8]| {
                let [x, y, z, n] = words(record);
                ([x, y, z], n as u64)
            };
            let records = |piece: NodePiece| {
                let (len, records) = (piece.len(), piece.records().unwrap());
                assert_eq!(records.len(), len);
                records.chunks_exact(32).map(numbered).collect()
            };
            let all: Vec<Vec<Numbered>> = node.pieces.into_iter().map(records).collect();
            assert!(found.insert(node.key, all).is_none(), "{:?} twice", node.key);
        }
    };
    for (n, p) in points.iter().enumerate() {
        let record: Vec<u8> =
            p.iter().copied().chain([n as i64]).flat_map(i64::to_le_bytes).collect();
        octree.push(*p, rank(None, *p), &record).unwrap();
        let held: usize = octree.open.iter().map(OpenNode::held).sum();
        assert!(held <= most_held, "{held} bytes are held");
        let early = |node: &OpenNode| node.own.held() == 0 && !node.own.is_empty();
        stored |= octree.open.iter().any(early);
        keep(&mut octree);
    }
    octree.finish().unwrap();
    keep(&mut octree);
    (root, found, stored)
}

/// The records of all nodes.
fn nodes(points: &[Position]) -> (RootCube, BTreeMap<VoxelKey, Vec<Numbered>>) {
    let (root, pieces, _) = pieces(points, None);
    (root, pieces.into_iter().map(|(key, pieces)| (key, pieces.concat())).collect())
}

/// What must hold of any points.
fn check(points: &[Position]) {
    let (root, nodes) = nodes(points);
    let mut numbers: Vec<u64> = nodes.values().flatten().map(|(_, n)| *n).collect();
    numbers.sort_unstable();
    assert!(numbers.into_iter().eq(0..points.len() as u64), "every point once");
    let deepest = nodes.keys().map(|key| key.level).max().unwrap();
    for (key, points) in &nodes {
        assert!(key.level == 0 || nodes.contains_key(&key.parent()), "{key:?} hangs in the air");
        let exponent = root.exponent - key.level as u32;
        for (p, _) in points {
            assert_eq!(root.key(exponent, *p), *key, "{p:?}");
        }
        let inner = nodes.keys().any(|other| other.parent() == *key && other.level > 0);
        assert!(inner || !points.is_empty(), "{key:?} is an empty leaf");
        assert!(
            inner
                || points.len() <= LEAF_POINTS
                || exponent == root.exponent - DEEPEST.min(key.level as u32)
        );
    }
    // The levels down to any one have a point in each cell of that level that has one.
    for level in 0..=deepest {
        let cell = root.exponent - level as u32 - CELLS;
        let cells = |nodes: &mut dyn Iterator<Item = &Vec<(Position, u64)>>| {
            let all = nodes.flatten().map(|(p, _)| p.map(|at| at >> cell));
            all.collect::<std::collections::BTreeSet<_>>()
        };
        let all = cells(&mut nodes.values());
        let drawn = cells(&mut nodes.iter().filter(|(k, _)| k.level <= level).map(|(_, p)| p));
        assert_eq!(all, drawn, "level {level}");
    }
}

fn random(seed: &mut u64) -> u64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    rank(None, [*seed as i64, 0, 0])
}

#[test]
fn every_level_of_a_dense_scan_covers_what_the_whole_covers() {
    let mut seed = 1;
    let mut at = |size: u64| random(&mut seed) as i64 % size as i64;
    // A surface across 0, dense in one corner, with trees; and a lump of copies.
    let mut points = Vec::new();
    for n in 0..400_000i64 {
        let (x, y) = if n % 2 == 0 { (at(60_000), at(60_000)) } else { (at(3_000), at(3_000)) };
        let z = x / 7 + if n % 9 == 0 { at(20_000).abs() } else { 0 };
        points.push([x, y, z]);
    }
    points.extend((0..80_000).map(|_| [12_345, -54_321, 7]));
    check(&points);
}

#[test]
fn a_point_that_was_kept_earlier_comes_first() {
    let places = [[0, 0, 0], [-5, 9, 1 << 40]];
    for (one, two) in places.into_iter().flat_map(|p| places.map(|q| (p, q))) {
        assert!(rank(Some(3), one) < rank(Some(4), two));
        assert!(rank(Some(u16::MAX - 1), one) < rank(Some(u16::MAX), two));
    }
}

#[test]
fn few_points_are_one_node() {
    for points in [vec![[5, -6, 7]], vec![[0, 0, 0]; 100], vec![[-1, 0, 0], [1 << 40, 3, 3]]] {
        let (_, nodes) = nodes(&points);
        assert_eq!(nodes.len(), 1);
        check(&points);
    }
}

#[test]
fn more_copies_than_are_held_are_stored_and_found_again() {
    let mut points = vec![[77, 78, 79]; 3 * LEAF_POINTS + 5];
    points.push([1 << 50, 0, -(1 << 50)]);
    check(&points);
}

/// Points that are as dense around a scanner on every level: each shell, twice as wide as the one
/// inside, has as many.
fn around_a_scanner(shells: u32, each: usize) -> Vec<Position> {
    let mut seed = 7;
    let mut at = |half: i64| random(&mut seed).cast_signed().rem_euclid(2 * half) - half;
    let mut points = Vec::new();
    for shell in 0..shells {
        let half = 1i64 << (CELLS + shell);
        let begin = points.len();
        while points.len() < begin + each {
            let p = [at(half), at(half), at(half)];
            // Off the corner of all cubes, so that the dense part lies within open nodes.
            let is_outside = p.iter().any(|v| v.abs() >= half / 2);
            if is_outside {
                points.push(p.map(|v| v + (1i64 << (CELLS + shells)) / 3));
            }
        }
    }
    points
}

#[test]
fn a_scan_that_fills_all_levels_is_held_within_bounds_and_becomes_the_same_nodes() {
    let points = around_a_scanner(14, 45_000);
    let (_, own, stored) = pieces(&points, None);
    assert!(stored, "what is held by itself does for all");
    assert!(own.keys().map(|key| key.level).max() >= Some(10));
    let (_, unbounded, stored) = pieces(&points, Some(usize::MAX));
    assert!(!stored && own == unbounded, "what is held plays a part");
    let (_, little, stored) = pieces(&points, Some(LEAF_POINTS * 16));
    assert!(stored && own == little, "what is held plays a part");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn the_root_is_not_much_larger_than_the_points(
        lo in prop::array::uniform3(-1i64 << 40..1 << 40),
        size in prop::array::uniform3(0i64..1 << 36),
    ) {
        let hi = [lo[0] + size[0], lo[1] + size[1], lo[2] + size[2]];
        let root = RootCube::around(&Bounds { lo, hi });
        let extent = size.into_iter().max().unwrap_or(0);
        prop_assert!((1i64 << root.exponent) <= 4 * extent.max(1 << CELLS));
        for corner in [lo, hi] {
            prop_assert_eq!(root.key(root.exponent, corner), super::super::hierarchy::ROOT);
        }
    }
}
