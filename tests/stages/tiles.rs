//! The tile store against brute force: every position once, canonical order, exact neighbours.

use std::path::PathBuf;
use std::sync::Arc;

use pointmill::internals::{
    Budget, Fetch, Folder, Intake, Loader, Reader, SealedTiles, Sieve, SpillArea, Tag, Threads,
    TileStore, morton_cmp, seal, take_unproven,
};
use pointmill::point::{
    Dimension, Endian, Layout, PointBatch, Position, Scalar, Schema, distance2, names,
};
use pointmill::stage::Lattice;

use crate::support::random::Random;

/// A surface on a coarse grid (ties), a dense clump, copies by the hundred, a sparse halo and one
/// point far from all others.
fn awkward_scan(n: usize, seed: u64) -> Vec<Position> {
    let mut random = Random(seed);
    let mut scan: Vec<Position> = vec![[900_000_007, -5, 3], [-40, -40, -40]];
    while scan.len() < n {
        let p = match random.coordinate(10) {
            0..=5 => [
                random.coordinate(90) * 10 - 300,
                random.coordinate(90) * 10 - 450,
                random.coordinate(3) * 10,
            ],
            6 => [random.coordinate(40), random.coordinate(40), random.coordinate(40)],
            7 => scan[random.coordinate(scan.len() as u64) as usize],
            8 => [17, 17, 17],
            _ => [
                random.coordinate(20_000) - 9_000,
                random.coordinate(20_000) - 9_000,
                random.coordinate(900),
            ],
        };
        scan.push(p);
    }
    scan
}

fn schema() -> Arc<Schema> {
    let [x, y, z] = names::XYZ;
    Arc::new(Schema {
        layout: Layout::plain("PLY"),
        endian: Endian::Little,
        stride: 28,
        dimensions: vec![
            Dimension::new(x, Scalar::F64, 0),
            Dimension::new(y, Scalar::F64, 8),
            Dimension::new(z, Scalar::F64, 16),
            Dimension::new("tag", Scalar::U32, 24),
        ],
    })
}

fn record(p: Position, tag: u32) -> Vec<u8> {
    let mut bytes: Vec<u8> = p.iter().flat_map(|&v| (v as f64).to_le_bytes()).collect();
    bytes.extend(tag.to_le_bytes());
    bytes
}

#[derive(Debug)]
struct Scratch(tempfile::TempDir);

impl Folder for Scratch {
    fn file(&self, name: &str) -> pointmill::Result<PathBuf> {
        Ok(self.0.path().join(name))
    }
}

fn sealed(
    scan: &[Position],
    threads: usize,
    run: usize,
    memory: u64,
) -> (Arc<SealedTiles>, u64, usize) {
    let budget = Budget::new(1 << 30);
    let folder = Box::new(Scratch(tempfile::tempdir().unwrap()));
    let area = SpillArea::new(budget.clone(), memory, folder);
    let store = TileStore::new(&area, &budget, schema().stride, false);
    let fill = |thread: usize| {
        let mut intake = Intake::new(&store, run);
        for (i, &p) in scan.iter().enumerate().skip(thread).step_by(threads) {
            intake.push(p, &record(p, (i % 3) as u32), Tag::default())?;
        }
        intake.flush()
    };
    let each =
        |all: Threads<'_>| all.items(threads, || {}).run(|| (), |(), n| fill(n), |()| {}, Ok);
    Threads::start(threads, each).unwrap();
    let runs = store.runs();
    let tiles = Threads::start(threads, |all| seal(store, all, &|_| Ok(())));
    (Arc::new(tiles.unwrap()), area.written(), runs)
}

fn distinct(scan: &[Position]) -> Vec<Position> {
    let mut distinct = scan.to_vec();
    distinct.sort_by(morton_cmp);
    distinct.dedup();
    distinct
}

fn nearest_by_brute_force(all: &[Position], p: Position, k: usize) -> Vec<Position> {
    let mut others: Vec<(u128, usize)> = all
        .iter()
        .enumerate()
        .filter(|(_, q)| **q != p)
        .map(|(rank, &q)| (distance2(p, q), rank))
        .collect();
    others.sort_unstable();
    let mut ranks: Vec<usize> = others.into_iter().take(k).map(|(_, rank)| rank).collect();
    ranks.sort_unstable();
    ranks.into_iter().map(|rank| all[rank]).collect()
}

#[test]
fn sealing_gives_every_position_once_and_every_record_in_canonical_order() {
    let scan = awkward_scan(30_000, 1);
    let mut expected: Vec<(Position, Vec<u8>)> =
        scan.iter().enumerate().map(|(i, &p)| (p, record(p, (i % 3) as u32))).collect();
    expected.sort_by(|a, b| morton_cmp(&a.0, &b.0).then_with(|| a.1.cmp(&b.1)));
    for (threads, run, memory) in
        [(1, 100_000, 1 << 24), (2, 3_000, 1 << 24), (3, 1_100, 0), (1, 977, 100_000)]
    {
        let (tiles, spilled, runs) = sealed(&scan, threads, run, memory);
        assert_eq!(tiles.points(), scan.len() as u64);
        assert_eq!(spilled > 0, memory < 1 << 20, "memory {memory} decides the spill");
        assert!(run > scan.len() || runs > 4, "{runs} runs");
        let mut reader = Reader::default();
        let mut positions = Vec::new();
        let mut numbers = Vec::new();
        for b in 0..tiles.blocks() {
            assert_eq!(tiles.block(b).first_position, positions.len() as u64);
            let mut number = tiles.block(b).first_record;
            let (block, copies) = tiles.read(b, &mut reader).unwrap();
            positions.extend_from_slice(block);
            for &n in copies {
                numbers.extend(number..number + u64::from(n));
                number += u64::from(n);
            }
        }
        assert_eq!(positions, distinct(&scan));
        let mut batch = PointBatch::new(schema(), scan.len());
        tiles.fetch(&numbers, &mut Fetch::default(), &mut batch).unwrap();
        assert!(batch.iter().zip(&expected).all(|(got, (_, want))| got == want.as_slice()));
        assert_eq!(batch.len(), expected.len());
    }
}

#[test]
fn tiles_share_the_scan_out_and_their_neighborhoods_are_those_of_the_whole_scan() {
    let scan = awkward_scan(12_000, 2);
    let all = distinct(&scan);
    let (tiles, _, _) = sealed(&scan, 2, 2_000, 50_000);
    for (capacity, reach, k) in [(300, 0, 10), (1_500, 12, 7)] {
        let keys = tiles.cut(capacity, capacity, reach, (3, 3)).unwrap();
        let levels: std::collections::BTreeSet<u32> = keys.iter().map(|key| key.level).collect();
        assert!(keys.len() >= 30 && levels.len() >= 2, "{} tiles, levels {levels:?}", keys.len());
        let mut loader = Loader::new(&tiles, &Sieve::default(), 2 * capacity as usize);
        let (mut cores, mut checked, mut unproven, mut ties) = (Vec::new(), 0, 0, 0);
        for key in keys {
            let tile = loader.load(key, reach, k).unwrap();
            assert!(tile.positions.len() <= 2 * capacity as usize);
            cores.extend_from_slice(&tile.positions[tile.core.clone()]);
            let positions = tile.positions.clone();
            let zone = tile.zone;
            let mut seen = 0;
            tile.each_neighborhood(k, |i, neighbors| {
                seen += 1;
                let p = positions[i];
                let at_face = (0..3)
                    .any(|a| p[a].abs_diff(zone.lo[a]) < 20 || zone.hi[a].abs_diff(p[a]) < 20);
                if !at_face && seen % 16 != 0 {
                    return;
                }
                checked += 1;
                let mut found: Vec<Position> = neighbors
                    .offsets()
                    .iter()
                    .map(|o| std::array::from_fn(|a| p[a] + o[a]))
                    .collect();
                found.sort_unstable_by(morton_cmp);
                assert_eq!(found, nearest_by_brute_force(&all, p, k), "of {p:?}");
                let mut distances: Vec<u128> = found.iter().map(|&q| distance2(p, q)).collect();
                distances.sort_unstable();
                ties += u64::from(distances.windows(2).any(|pair| pair[0] == pair[1]));
            })
            .unwrap();
            assert_eq!(seen, positions.iter().filter(|p| zone.contains(**p)).count());
            unproven += take_unproven(tile);
        }
        assert_eq!(cores, all, "cores in tile order are the scan");
        assert!(checked >= 1_000 && unproven > 0 && ties > 100, "{checked} {unproven} {ties}");
    }
}

#[test]
fn a_cube_that_cannot_be_cut_is_named_with_its_count() {
    let scan: Vec<Position> = (0..4_000).map(|i| [i % 16, i / 16 % 16, i / 256]).collect();
    let (tiles, _, _) = sealed(&scan, 1, 1_000, 1 << 20);
    match tiles.cut(50, 100, 0, (4, 4)) {
        Err(pointmill::internals::CutError::TooHeavy { key, positions }) => {
            assert_eq!((key.corner, key.level, positions), ([0; 3], 4, 4_000));
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn of_several_cubes_too_heavy_the_heaviest_is_named() {
    // Four cubes of side 16 in a row; the third holds twice as many as the others.
    let thin = |x: i64| (0..100).map(move |i| [x * 16 + i % 10, i / 10, 0]);
    let more = (0..100).map(|i| [32 + i % 10, i / 10, 5]);
    let scan: Vec<Position> = (0..4).flat_map(thin).chain(more).collect();
    let (tiles, _, _) = sealed(&scan, 1, 1_000, 1 << 20);
    match tiles.cut(50, 90, 0, (4, 4)) {
        Err(pointmill::internals::CutError::TooHeavy { key, positions }) => {
            assert_eq!((key.corner, positions), ([32, 0, 0], 200));
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(tiles.cut(50, 200, 0, (4, 4)).unwrap().len(), 4);
}

#[test]
fn an_empty_scan_has_no_tiles() {
    let (tiles, _, _) = sealed(&[], 2, 10, 0);
    assert_eq!((tiles.positions(), tiles.blocks()), (0, 0));
    assert!(tiles.cut(10, 10, 5, (0, 0)).unwrap().is_empty());
}

#[test]
fn the_lattice_of_these_records_is_the_binary_one() {
    let lattice = Lattice::of(&schema(), None).unwrap();
    assert_eq!(lattice.world([1 << 30, 0, -(1 << 31)]), [1.0, 0.0, -2.0]);
}
