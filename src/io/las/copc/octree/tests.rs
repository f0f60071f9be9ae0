use std::collections::BTreeMap;

use proptest::prelude::*;

use super::*;
use crate::geom::morton::morton_cmp;

/// The positions of all nodes, of records that hold a position and a number each.
fn nodes(points: &[Position]) -> (RootCube, BTreeMap<VoxelKey, Vec<(Position, u64)>>) {
    let folder = tempfile::tempdir().unwrap();
    let mut points = points.to_vec();
    points.sort_by(morton_cmp);
    let root = RootCube::around(&Bounds::of(points.iter().copied()));
    let mut octree = Octree::new(root, 32, Overflow::at(&folder.path().join("nodes")));
    let mut found = BTreeMap::new();
    let mut keep = |octree: &mut Octree| {
        for node in octree.ripe() {
            let records: Vec<u8> =
                node.pieces.into_iter().flat_map(|piece| piece.records().unwrap()).collect();
            let words = |record: &[u8]| -> [i64; 4] {
                std::array::from_fn(|n| {
                    i64::from_le_bytes(record[8 * n..8 * n + 8].try_into().unwrap())
                })
            };
            let all = records.chunks_exact(32).map(words);
            let all = all.map(|[x, y, z, n]| ([x, y, z], n as u64)).collect();
            assert!(found.insert(node.key, all).is_none(), "{:?} twice", node.key);
        }
    };
    for (n, p) in points.iter().enumerate() {
        let record: Vec<u8> =
            p.iter().copied().chain([n as i64]).flat_map(i64::to_le_bytes).collect();
        octree.push(*p, rank(None, *p), &record).unwrap();
        keep(&mut octree);
    }
    octree.finish().unwrap();
    keep(&mut octree);
    (root, found)
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
