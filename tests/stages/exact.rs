//! Neighbours and normals of a real scan are those of brute force over all of it, above all where
//! tiles meet.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

use crate::support::random::Random;
use crate::support::runs::{Memory, Settings, run};
use crate::support::scan::Scan;
use crate::support::scans;
use pointmill::internals::{
    Budget, Estimate, Estimator, Folder, Intake, Loader, SealedTiles, Sieve, SpillArea, Tag,
    Threads, TileStore, morton_cmp, seal, take_unproven,
};
use pointmill::ops::normals::Method;
use pointmill::point::{Bounds, Position, distance2, names};

/// Tiles that both tests cut: small, and cut where the pipeline cuts them.
const TILE_POINTS: usize = 400;

/// A piece of a city on a grid of a centimetre, with copies, sparse places and one point far away.
fn city() -> Scan {
    let city = Scan::read(&scans().join("big/marblemm_city_10M.laz"), 400_000).crop(30_000);
    let kept: Vec<usize> = (0..city.points()).filter(|i| i % 4000 < 3000 || i % 97 == 0).collect();
    city.pick(&kept).with_copies_and_an_outlier(4)
}

#[derive(Debug)]
struct Scratch(tempfile::TempDir);

impl Folder for Scratch {
    fn file(&self, name: &str) -> pointmill::Result<PathBuf> {
        Ok(self.0.path().join(name))
    }
}

/// The scan decoded by three threads in small runs, all of it spilled.
fn sealed(scan: &Scan, positions: &[Position]) -> Arc<SealedTiles> {
    let budget = Budget::new(1 << 30);
    let folder = Box::new(Scratch(tempfile::tempdir().unwrap()));
    let area = SpillArea::new(budget.clone(), 0, folder);
    let store = TileStore::new(&area, &budget, scan.schema.stride, false);
    let fill = |thread: usize| {
        let mut intake = Intake::new(&store, 1500);
        for (i, &p) in positions.iter().enumerate().skip(thread).step_by(3) {
            intake.push(p, scan.record(i), Tag::default())?;
        }
        intake.flush()
    };
    Threads::start(3, |all| all.items(3, || {}).run(|| (), |(), n| fill(n), |()| {}, Ok)).unwrap();
    assert!(store.runs() > 10);
    let tiles = Threads::start(3, |threads| seal(store, threads, &|_| Ok(())));
    let tiles = Arc::new(tiles.unwrap());
    assert!(area.written() > scan.records.len() as u64, "all is spilled");
    tiles
}

/// The distinct positions of a scan, in Morton order.
fn distinct(positions: &[Position]) -> Vec<Position> {
    let mut all = positions.to_vec();
    all.sort_unstable_by(morton_cmp);
    all.dedup();
    all
}

/// The `k` nearest of `all` (distinct, in Morton order) to `p` other than itself, by exact
/// distance, ties by Morton order; in Morton order. The bool is true if Morton order chose the last
/// one.
fn nearest(all: &[Position], p: Position, k: usize) -> (Vec<Position>, bool) {
    let mut others: Vec<(u128, usize)> = all
        .iter()
        .enumerate()
        .filter(|(_, q)| **q != p)
        .map(|(rank, &q)| (distance2(p, q), rank))
        .collect();
    others.select_nth_unstable(k);
    others[..=k].sort_unstable();
    let tied = others[k - 1].0 == others[k].0;
    let mut ranks: Vec<usize> = others[..k].iter().map(|&(_, rank)| rank).collect();
    ranks.sort_unstable();
    (ranks.into_iter().map(|rank| all[rank]).collect(), tied)
}

/// True if `p` is nearer to a face of `cube` than most of its neighbours are: 40 cm.
fn at_face(p: Position, cube: &Bounds) -> bool {
    (0..3).any(|a| p[a].abs_diff(cube.lo[a]) < 40 || cube.hi[a].abs_diff(p[a]) < 40)
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn neighbors_at_the_faces_of_tiles_of_a_real_scan_are_those_of_all_of_it() {
    let scan = city();
    let positions = scan.positions();
    let all = distinct(&positions);
    assert!(all.len() + 2000 < positions.len(), "there are copies");
    let tiles = sealed(&scan, &positions);
    for (k, reach) in [(10, 0), (23, 37)] {
        let keys = tiles.cut(TILE_POINTS as u64, 5_000, reach, (0, 0)).unwrap();
        let levels: BTreeSet<u32> = keys.iter().map(|key| key.level).collect();
        assert!(keys.len() >= 30 && levels.len() >= 2, "{} tiles, {levels:?}", keys.len());
        let mut loader = Loader::new(&tiles, &Sieve::default(), 6_000);
        loader.limit_rim(2 * TILE_POINTS);
        let (mut cores, mut checked, mut ties, mut unproven) = (Vec::new(), 0, 0, 0);
        for key in keys {
            let tile = loader.load(key, reach, k).unwrap();
            let (zone, positions) = (tile.zone, tile.positions.clone());
            let core = tile.core.clone();
            let (mut seen, mut sample) = (0, 0);
            tile.each_neighborhood(k, |i, neighbors| {
                seen += 1;
                let p = positions[i];
                if !core.contains(&i) || !at_face(p, &key.cube()) && i % 29 != 0 {
                    return;
                }
                sample += 1;
                if sample > 40 {
                    return;
                }
                checked += 1;
                let mut found: Vec<Position> = neighbors
                    .offsets()
                    .iter()
                    .map(|o| std::array::from_fn(|a| p[a] + o[a]))
                    .collect();
                found.sort_unstable_by(morton_cmp);
                let (expected, tied) = nearest(&all, p, k);
                assert_eq!(found, expected, "neighbours of {p:?}");
                ties += usize::from(tied);
            })
            .unwrap();
            assert_eq!(seen, positions.iter().filter(|p| zone.contains(**p)).count());
            unproven += take_unproven(tile);
            cores.extend_from_slice(&tile.positions[core]);
        }
        assert!(cores == all, "the cores in their order are the scan");
        let counts = format!("{checked} checked, {unproven} unproven, {ties} ties");
        assert!(checked >= 1_000 && unproven > 0 && ties > 10, "{counts}");
    }
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn normals_written_by_a_tiled_run_are_those_of_brute_force_to_the_bit() {
    let scan = city();
    let all = distinct(&scan.positions());
    let keys = sealed(&scan, &scan.positions()).cut(TILE_POINTS as u64, 5_000, 0, (0, 0)).unwrap();
    let cubes: Vec<Bounds> = keys.iter().map(|key| key.cube()).collect();
    let folder = tempfile::tempdir().unwrap();
    let files = scan.write_split(folder.path(), 3, &mut Random(6));
    let settings = Settings {
        tile_points: Some(TILE_POINTS),
        memory: Memory::Least(0),
        threads: 2,
        spill: "always",
        ..Settings::PLAIN
    };
    for (k, method, name) in [
        (10, Method::Varady, "varady"),
        (17, Method::Pca, "pca"),
        (10, Method::Delaunay, "delaunay"),
        (12, Method::Cubic, "cubic"),
    ] {
        let stage =
            format!("[[stage]]\nkind = \"normals\"\nneighbors = {k}\nmethod = \"{name}\"\n");
        let write = "laz\ndimensions = [\"NormalX\", \"NormalY\", \"NormalZ\"]";
        let ran = run(folder.path(), &files, &stage, write, settings).unwrap();
        assert_eq!(ran.count("tiles"), cubes.len() as u64, "the run cuts as the test does");
        crate::support::runs::assert_not_empty(&ran, false, name);
        let written = Scan::read(&ran.output, usize::MAX);
        assert_eq!(written.points(), scan.points());
        let normals = normals_of(&written);
        let mut estimator = Estimator::new(method);
        let (mut checked, mut with) = (0, 0);
        for (&p, normal) in &normals {
            let Some(cube) = cubes.iter().find(|cube| cube.contains(p)) else {
                panic!("{p:?} is in no tile")
            };
            if !at_face(p, cube) {
                continue;
            }
            checked += 1;
            let (neighbors, _) = nearest(&all, p, k);
            let offsets: Vec<Position> =
                neighbors.iter().map(|q| std::array::from_fn(|a| q[a] - p[a])).collect();
            let expected = match estimator.estimate(&offsets).0 {
                Estimate::Normal(normal) => normal,
                Estimate::None => [f32::NAN; 3],
            };
            with += usize::from(!expected[0].is_nan());
            let bits = |n: [f32; 3]| n.map(f32::to_bits);
            assert_eq!(bits(*normal), bits(expected), "the normal at {p:?} by {name}");
        }
        assert!(checked >= 1_000 && with >= 1_000, "{checked} checked, {with} have a normal");
    }
}

/// Every position of a file with the normal written there; records that share a position must share
/// it.
fn normals_of(written: &Scan) -> BTreeMap<Position, [f32; 3]> {
    let axes = names::NORMAL.map(|name| written.schema.find(name).unwrap());
    let mut normals: BTreeMap<Position, [f32; 3]> = BTreeMap::new();
    for (i, p) in written.positions().into_iter().enumerate() {
        let normal =
            axes.map(|axis| axis.get(written.record(i), written.schema.endian).as_f64() as f32);
        let known = normals.entry(p).or_insert(normal);
        assert_eq!(known.map(f32::to_bits), normal.map(f32::to_bits), "records at {p:?} differ");
    }
    normals
}
