//! Structured bad luck: all points in one place, on a line, on a lattice twice over, in clusters on
//! both sides of the world, in degrees and in millimetres. What is right is known for each.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use crate::support::assert_same;
use crate::support::random::Random;
use crate::support::runs::{Memory, Settings, run};
use crate::support::scan::Scan;
use pointmill::internals::{
    Budget, Folder, Intake, Loader, Sieve, SpillArea, Tag, Threads, TileStore, morton_cmp, seal,
    take_unproven,
};
use pointmill::point::{
    Dimension, Endian, Layout, Metadata, Position, Scalar, Schema, distance2, names,
};
use pointmill::synth::Scene;
use serde_json::Value;

/// A landscape's records, each moved to where `place` says.
fn las(points: usize, place: impl Fn(usize, [i32; 3]) -> [i32; 3]) -> Scan {
    let mut scan = Scan::synthetic(Scene::Als, points as u64, 7);
    for (i, record) in scan.records.chunks_exact_mut(scan.schema.stride).enumerate() {
        let stored = record[..12].as_chunks_mut::<4>().0;
        let p = place(i, std::array::from_fn(|axis| i32::from_le_bytes(stored[axis])));
        stored.iter_mut().zip(p).for_each(|(bytes, v)| *bytes = v.to_le_bytes());
    }
    scan
}

/// Points with a number each, in doubles.
fn ply(points: impl Iterator<Item = [f64; 3]>) -> Scan {
    let axes = names::XYZ.into_iter().zip([0, 8, 16]);
    let mut dimensions: Vec<Dimension> =
        axes.map(|(name, at)| Dimension::new(name, Scalar::F64, at)).collect();
    dimensions.push(Dimension::new("tag", Scalar::U32, 24));
    let mut records = Vec::new();
    for (p, tag) in points.zip(0u32..) {
        p.iter().for_each(|v| records.extend(v.to_le_bytes()));
        records.extend(tag.to_le_bytes());
    }
    let schema =
        Schema { layout: Layout::plain("PLY"), endian: Endian::Little, stride: 28, dimensions };
    Scan { schema: Arc::new(schema), metadata: Metadata::default(), records }
}

/// The stored coordinates of a scan in doubles.
fn world(scan: &Scan) -> Vec<[f64; 3]> {
    let axes = scan.schema.coordinates().unwrap();
    let place = |i| axes.map(|axis| axis.world(scan.record(i), scan.schema.endian));
    (0..scan.points()).map(place).collect()
}

/// The same stored numbers in units of other lengths.
fn scaled(scan: &Scan, scale: [f64; 3]) -> Scan {
    let mut schema = (*scan.schema).clone();
    for (name, scale) in names::XYZ.into_iter().zip(scale) {
        let axis = schema.dimensions.iter_mut().find(|d| d.name == name).unwrap();
        axis.origin = (axis.origin / axis.scale).round() * scale;
        axis.scale = scale;
    }
    Scan { schema: Arc::new(schema), ..scan.clone() }
}

/// What a reduction left, the same in every configuration.
struct Reduced {
    scan: Scan,
    result: Value,
}

impl Reduced {
    fn removed(&self, reason: &str) -> u64 {
        let entries = self.result["ledger"]["removed"].as_array().unwrap();
        let of = entries.iter().filter(|entry| entry["reason"] == reason);
        of.map(|entry| entry["records"].as_u64().unwrap()).sum()
    }

    /// Kept positions in Morton order, each once.
    fn positions(&self) -> Vec<Position> {
        let positions = self.scan.positions();
        let ascend = positions.windows(2).all(|pair| morton_cmp(&pair[0], &pair[1]).is_lt());
        assert!(ascend, "each position once, in canonical order");
        positions
    }
}

/// Reduces `scan` whole in memory and, shuffled, in small tiles from scratch files, in at least
/// `tiles` of them; asserts that all give the same bytes and a ledger that balances.
fn reduce(scan: &Scan, cells: &str, write: &str, tiles: u64) -> Reduced {
    let stages = format!(
        "[[stage]]\nkind = \"normals\"\n[[stage]]\nkind = \"cells\"\n{cells}\n\
         [[stage]]\nkind = \"median\"\n"
    );
    let folder = tempfile::tempdir().unwrap();
    let files = scan.write_split(folder.path(), 1, &mut Random(0));
    let plain = run(folder.path(), &files, &stages, write, Settings::PLAIN).unwrap();
    let (bytes, reduced) = (plain.bytes(), Scan::read(&plain.output, usize::MAX));
    let report: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("report.json")).unwrap()).unwrap();
    let result = report["result"].clone();
    let mut random = Random(9);
    for (threads, tile_points) in [(1, 300), (3, 700)] {
        let settings = Settings {
            tile_points: Some(tile_points),
            memory: Memory::Least(0),
            threads,
            spill: "always",
            ..Settings::PLAIN
        };
        let folder = tempfile::tempdir().unwrap();
        let mut order: Vec<usize> = (0..scan.points()).collect();
        random.shuffle(&mut order);
        let files = scan.pick(&order).write_split(folder.path(), 2, &mut random);
        let ran = run(folder.path(), &files, &stages, write, settings).unwrap();
        let what = format!("{settings:?} {cells}");
        assert_same(&bytes, &ran.bytes(), &what);
        assert_same(&plain.result, &ran.result, &what);
        assert!(ran.count("tiles") >= tiles, "{what}: {} tiles", ran.count("tiles"));
        assert!(ran.spilled > 0 && ran.count("runs") > 1, "{what}: {} runs", ran.count("runs"));
    }
    let reduced = Reduced { scan: reduced, result };
    let kept = reduced.scan.points() as u64;
    assert_eq!(reduced.result["ledger"]["read"], scan.points());
    assert_eq!(reduced.result["ledger"]["kept"], kept);
    let removed = reduced.removed("coincident") + reduced.removed("represented");
    assert_eq!(kept + removed, scan.points() as u64, "the ledger balances");
    reduced
}

/// The distinct positions of a scan with the smallest record of each.
fn distinct(scan: &Scan) -> BTreeMap<Position, &[u8]> {
    let mut distinct = BTreeMap::new();
    for (i, p) in scan.positions().into_iter().enumerate() {
        let smallest = distinct.entry(p).or_insert(scan.record(i));
        *smallest = scan.record(i).min(*smallest);
    }
    distinct
}

#[derive(Debug)]
struct Scratch(tempfile::TempDir);

impl Folder for Scratch {
    fn file(&self, name: &str) -> pointmill::Result<PathBuf> {
        Ok(self.0.path().join(name))
    }
}

/// Asserts for a sample of positions, in small tiles with small rims, that the 10 nearest are those
/// of brute force; gives how many of all had to be searched for in the whole scan.
fn neighbors_are_exact(scan: &Scan) -> u64 {
    const K: usize = 10;
    let positions = scan.positions();
    let budget = Budget::new(1 << 30);
    let folder = Box::new(Scratch(tempfile::tempdir().unwrap()));
    let area = SpillArea::new(budget.clone(), 0, folder);
    let store = TileStore::new(&area, &budget, scan.schema.stride, false);
    let fill = |thread: usize| {
        let mut intake = Intake::new(&store, 900);
        for (i, &p) in positions.iter().enumerate().skip(thread).step_by(2) {
            intake.push(p, scan.record(i), Tag::default())?;
        }
        intake.flush()
    };
    Threads::start(2, |all| all.items(2, || {}).run(|| (), |(), n| fill(n), |()| {}, Ok)).unwrap();
    let tiles = Threads::start(2, |threads| seal(store, threads, &|_| Ok(())));
    let tiles = Arc::new(tiles.unwrap());
    let mut all = positions;
    all.sort_unstable_by(morton_cmp);
    all.dedup();
    let keys = tiles.cut(200, 400, 0, (0, 0)).unwrap();
    assert!(keys.len() >= 8, "{} tiles", keys.len());
    let mut loader = Loader::new(&tiles, &Sieve::default(), 1_000);
    loader.limit_rim(260);
    let (mut seen, mut checked, mut unproven) = (0, 0, 0);
    for key in keys {
        let tile = loader.load(key, 0, K).unwrap();
        let (positions, core) = (tile.positions.clone(), tile.core.clone());
        tile.each_neighborhood(K, |i, neighbors| {
            seen += 1;
            // The first and the last of a tile lie at its faces.
            if i != core.start && i + 1 != core.end && i % 37 != 0 {
                return;
            }
            checked += 1;
            let p = positions[i];
            let mut others: Vec<(u128, usize)> = (0..all.len())
                .filter(|&rank| all[rank] != p)
                .map(|rank| (distance2(p, all[rank]), rank))
                .collect();
            others.sort_unstable();
            let mut ranks: Vec<usize> = others.iter().take(K).map(|other| other.1).collect();
            ranks.sort_unstable();
            let mut found: Vec<Position> = neighbors
                .offsets()
                .iter()
                .map(|o| std::array::from_fn(|axis| p[axis] + o[axis]))
                .collect();
            found.sort_unstable_by(morton_cmp);
            let expected: Vec<Position> = ranks.into_iter().map(|rank| all[rank]).collect();
            assert_eq!(found, expected, "of {p:?}");
        })
        .unwrap();
        unproven += take_unproven(tile);
    }
    assert_eq!(seen, all.len());
    assert!(checked >= 60, "{checked} checked");
    unproven
}

#[test]
fn of_coincident_points_the_smallest_record_stays_and_the_others_are_in_the_ledger() {
    for p in [[123_456, -654_321, 7], [0, 0, 0], [i32::MIN, i32::MAX, -1]] {
        let scan = las(60_000, |_, _| p);
        let reduced = reduce(&scan, "", "las", 1);
        assert_eq!(reduced.removed("coincident"), 59_999);
        let smallest = scan.records.chunks_exact(scan.schema.stride).min().unwrap();
        assert_eq!(reduced.scan.records, smallest);
    }
}

#[test]
fn points_on_a_line_have_no_normal_and_each_position_stays_once() {
    for direction in [[3, 0, 0], [0, -1, 0], [3, -2, 1], [70_000, 70_000, 70_000]] {
        // Every seventh position twice, once of all.
        let place = |i: usize, _| direction.map(|d: i32| d * (i as i32 * 7 % 26_000));
        let scan = las(30_000, place);
        let reduced = reduce(&scan, "", "las", 20);
        let expected = distinct(&scan);
        assert_eq!(expected.len(), 26_000);
        assert_eq!(reduced.positions().len(), expected.len());
        for (i, p) in reduced.positions().into_iter().enumerate() {
            assert_eq!(reduced.scan.record(i), expected[&p], "{p:?}");
        }
        assert_eq!(reduced.result["counts"]["no_normal"], 26_000);
        assert_eq!(reduced.removed("coincident"), 4_000);
        neighbors_are_exact(&las(6_000, place));
    }
}

type Lattice = fn(usize) -> [i32; 3];

#[test]
fn a_lattice_of_which_every_point_is_there_twice_reduces_as_if_it_were_there_once() {
    let solid: Lattice = |i| [i % 20, i / 20 % 20, i / 400].map(|v| v as i32 * 50);
    let plane: Lattice = |i| [(i % 100) as i32 * 50, (i / 100) as i32 * 50, 0];
    for (lattice, n, cells) in [
        (solid, 8_000, ""),
        (solid, 8_000, "side = 0.11\nsplit = \"octant\""),
        (plane, 10_000, ""),
        (plane, 10_000, "side = 0.77"),
    ] {
        let (once, twice) =
            (las(n, |i, _| lattice(i)), las(2 * n, |i, _| lattice(i * 7919 % (2 * n) / 2)));
        let expected = distinct(&twice);
        assert_eq!(expected.len(), n);
        let [single, double] = [&once, &twice].map(|scan| reduce(scan, cells, "las", 2));
        assert_eq!(single.positions(), double.positions(), "{cells}");
        for (i, p) in double.positions().into_iter().enumerate() {
            assert_eq!(double.scan.record(i), expected[&p], "{p:?}");
        }
        assert_eq!(double.removed("represented"), 2 * single.removed("represented"));
        assert_eq!(double.removed("coincident"), single.scan.points() as u64);
        assert_eq!(double.result["counts"], single.result["counts"]);
    }
    assert!(neighbors_are_exact(&las(16_000, |i, _| solid(i / 2))) > 0, "all were proven");
}

/// A landscape of so many points as doubles, with its middle `east` of the origin.
fn landscape(points: usize, seed: u64, east: f64) -> Vec<[f64; 3]> {
    let scan = Scan::synthetic(Scene::Als, points as u64, seed);
    world(&scan).into_iter().map(|[x, y, z]| [x + east, y, z]).collect()
}

#[test]
fn clusters_ten_thousand_kilometres_apart_reduce_as_each_does_alone() {
    let clusters = [landscape(9_000, 1, -5e6), landscape(7_000, 2, 5e6)];
    let write = "ply\ndimensions = [\"NormalX\", \"NormalY\", \"NormalZ\"]";
    for cells in ["side = 1.5", "side = 1.5\nsplit = \"octant\""] {
        let both = ply(clusters.iter().flatten().copied());
        let both = reduce(&both, cells, write, 20);
        let mut alone: Vec<(Position, Vec<u8>)> = Vec::new();
        for (first, cluster) in [(0, &clusters[0]), (9_000, &clusters[1])] {
            // Numbered as they are in the scan of both.
            let padded = ply(std::iter::repeat_n([0.0; 3], first).chain(cluster.iter().copied()));
            let cluster = padded.pick(&(first..padded.points()).collect::<Vec<_>>());
            let reduced = reduce(&cluster, cells, write, 15).scan;
            let record = |(i, p)| (p, reduced.record(i).to_vec());
            alone.extend(reduced.positions().into_iter().enumerate().map(record));
        }
        alone.sort_by(|a, b| morton_cmp(&a.0, &b.0));
        let records: Vec<u8> = alone.into_iter().flat_map(|(_, record)| record).collect();
        assert!(!records.is_empty());
        assert_same(&records, &both.scan.records, "records with their normals");
    }
}

#[test]
fn a_few_points_find_their_neighbors_on_the_other_side_of_the_world() {
    let few = [[0.25, 0.5, 0.0], [0.5, 0.25, 0.0], [0.25, 0.25, 1e-3], [0.25, 0.5, 4e6]];
    let few = few.map(|[x, y, z]| [x + 5e6, y, z]);
    let scan = ply(landscape(3_000, 3, -5e6).into_iter().chain(few));
    assert!(neighbors_are_exact(&scan) >= 4, "the few have to look beyond their tiles");
    let reduced = reduce(&scan, "", "ply", 5);
    assert!(reduced.scan.points() > 4);
}

#[test]
fn millimetres_and_degrees_reduce_as_metres_do() {
    let metres = Scan::synthetic(Scene::Als, 20_000, 5);
    let in_metres = reduce(&metres, "", "las", 15);
    // Of a LAS file only the unit differs: what is stored and what it means to the lattice is the
    // same in millimetres, and in degrees of which a step is a millimetre, or nearly.
    for scale in [1.0, 1e-8, 0.5, 1e-3 / 1024.0] {
        let reduced = reduce(&scaled(&metres, [scale; 3]), "", "las", 15);
        assert_same(&in_metres.scan.records, &reduced.scan.records, &format!("scale {scale}"));
        assert_eq!(in_metres.result["counts"], reduced.result["counts"], "scale {scale}");
    }
}

#[test]
fn a_scan_of_doubles_reduces_alike_in_units_that_are_powers_of_two_of_one_another() {
    // Whole 1024ths of a metre are positions of the lattice in each of these units.
    // National coordinates in millimetres would lie beyond it.
    let here = landscape(15_000, 6, 0.0);
    let metres: Vec<[f64; 3]> = here
        .iter()
        .map(|p| std::array::from_fn(|a| ((p[a] - here[0][a]) * 1024.0).round() / 1024.0))
        .collect();
    let numbers = |unit: f64| {
        let scan = ply(metres.iter().map(|p| p.map(|v| v * unit)));
        let reduced = reduce(&scan, "", "ply", 10).scan;
        let tag = |i| u32::from_le_bytes(reduced.record(i)[24..28].try_into().unwrap());
        (0..reduced.points()).map(tag).collect::<Vec<u32>>()
    };
    let in_metres = numbers(1.0);
    assert!(in_metres.len() > 1_000);
    for (name, unit) in [("millimetres", 1024.0), ("degrees", f64::powi(0.5, 17))] {
        assert_eq!(numbers(unit), in_metres, "{name}, nearly");
    }
}

#[test]
fn degrees_beside_metres_of_height_are_reduced_the_same_way_every_time() {
    // 1e-7 degrees east and north, millimetres up: a lattice of 1e-7, of which the heights use
    // every ten-thousandth step, and the scan is a needle 300 times as high as it is wide.
    let to_degrees = |_, [x, y, z]: [i32; 3]| {
        let steps = |v: i32| (f64::from(v) / 11.132).round() as i32;
        [steps(x), steps(y), z]
    };
    let scan = scaled(&las(20_000, to_degrees), [1e-7, 1e-7, 1e-3]);
    let reduced = reduce(&scan, "", "las", 15);
    assert!(reduced.positions().len() > 100);
    neighbors_are_exact(&scaled(&las(6_000, to_degrees), [1e-7, 1e-7, 1e-3]));
}
