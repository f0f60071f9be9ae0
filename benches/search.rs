//! Normals of a whole scan within the process, as the mill computes them: positions in memory are
//! sorted and merged, tiles cut and loaded, neighbours searched, normals estimated. One thread; CPU
//! seconds, the median of some rounds; the last line is JSON.
//!
//! `cargo bench --bench search` makes an airborne scan of 2 million points;
//! `cargo bench --bench search -- SCAN.laz` takes a scan of yours;
//! after it may stand `pca` or `varady` (both), `shuffled` (the scan's order), `k=10`, `rounds=3`,
//! `avx512`, `avx2` or `portable` (the best), in any order.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints and may fail")]

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use pointmill::internals::{
    Budget, Folder, Intake, Loader, SealedTiles, Sieve, Simd, SpillArea, Tag, Threads, TileStore,
    compute_by, cpu_seconds, seal,
};
use pointmill::io::{las, ply};
use pointmill::ops::normals::{Method, Normals};
use pointmill::point::{NORMAL, PointBatch, Position};
use pointmill::quantity::Setting;
use pointmill::report::Tally;
use pointmill::stage::{Lattice, OpenSource, Source, TileOp};
use pointmill::synth::{Scene, Synthetic};

/// Records of a run, positions of a tile's cube, and of a tile with its rim, as a plan of ample memory
/// has them.
const RUN: usize = 1 << 19;
const TILE: u64 = 400_000;
const CAPACITY: usize = 800_000;

struct Settings {
    scan: Option<PathBuf>,
    methods: Vec<Method>,
    shuffled: bool,
    neighbors: usize,
    rounds: usize,
    simd: Simd,
}

fn settings() -> Settings {
    let mut settings = Settings {
        scan: None,
        methods: Vec::new(),
        shuffled: false,
        neighbors: 10,
        rounds: 3,
        simd: Simd::best(),
    };
    // `cargo bench` passes `--bench` on.
    for word in std::env::args().skip(1).filter(|word| word != "--bench") {
        let number = |key: &str| word.strip_prefix(key).map(|n| n.parse().unwrap());
        if let Some(simd) = Simd::all().find(|simd| simd.level().name() == word) {
            settings.simd = simd;
        } else if let Some(k) = number("k=") {
            settings.neighbors = k;
        } else if let Some(rounds) = number("rounds=") {
            settings.rounds = rounds;
        } else {
            match &*word {
                "pca" => settings.methods.push(Method::Pca),
                "varady" => settings.methods.push(Method::Varady),
                "shuffled" => settings.shuffled = true,
                _ => settings.scan = Some(word.into()),
            }
        }
    }
    if settings.methods.is_empty() {
        settings.methods = vec![Method::Pca, Method::Varady];
    }
    settings
}

fn main() {
    let settings = settings();
    let mut positions = read(settings.scan.as_deref());
    if settings.shuffled {
        shuffle(&mut positions);
    }
    let points = positions.len() as f64;
    for &method in &settings.methods {
        let mut stage = Normals::default();
        stage.neighbors = Setting::Given(settings.neighbors);
        stage.method = method;
        let mut rounds: Vec<[f64; 4]> =
            (0..settings.rounds).map(|_| normals(&positions, &stage, settings.simd)).collect();
        rounds.sort_by(|a, b| (a[0] + a[1]).total_cmp(&(b[0] + b[1])));
        let [merged, milled, wall, normals] = rounds[settings.rounds / 2];
        let cpu = merged + milled;
        println!(
            "{method:?} by {}: {points} points, {normals} normals, {:.0} ns a point to sort and merge \
             + {:.0} ns to load, search and estimate = {:.2} Mpts a CPU second",
            settings.simd.level().name(),
            merged / points * 1e9,
            milled / points * 1e9,
            points / cpu / 1e6
        );
        println!("{{\"cpu_seconds\": {cpu}, \"wall_seconds\": {wall}}}");
    }
}

/// CPU seconds to sort and to mill, wall seconds of both, and how many normals there are.
fn normals(positions: &[Position], stage: &Normals, simd: Simd) -> [f64; 4] {
    let (start, wall) = (cpu_seconds(), Instant::now());
    let tiles = sealed(positions);
    let merged = cpu_seconds();
    let keys = tiles.cut(TILE, TILE, 0, (0, 0)).unwrap();
    let sieve = Sieve { computed: stage.needs().writes, ..Sieve::default() };
    let mut loader = Loader::new(&tiles, &sieve, CAPACITY);
    compute_by(loader.tile().0, simd);
    let mut count = 0;
    for key in keys {
        let tile = loader.load(key, 0, stage.needs().neighbors).unwrap();
        stage.run(tile, &mut Tally::default()).unwrap();
        let normals = tile.columns.get(&NORMAL).unwrap();
        count += normals[tile.core.clone()].iter().filter(|n| !n[0].is_nan()).count();
    }
    let end = cpu_seconds();
    [merged - start, end - merged, wall.elapsed().as_secs_f64(), count as f64]
}

/// Nothing is spilled.
#[derive(Debug)]
struct InMemory;

impl Folder for InMemory {
    fn file(&self, name: &str) -> pointmill::Result<PathBuf> {
        unreachable!("{name} is not needed: the budget is ample")
    }
}

/// The positions as tiles, each record an empty one.
fn sealed(positions: &[Position]) -> Arc<SealedTiles> {
    let budget = Budget::new(1 << 40);
    let area = SpillArea::new(budget.clone(), 1 << 36, Box::new(InMemory));
    let store = TileStore::new(&area, &budget, 4, false);
    let mut intake = Intake::new(&store, RUN);
    for positions in positions.chunks(8192) {
        let (records, tags) = (vec![0; positions.len() * 4], vec![Tag::default(); positions.len()]);
        intake.take(positions, &records, &tags).unwrap();
    }
    intake.flush().unwrap();
    drop(intake);
    Arc::new(Threads::start(1, |threads| seal(store, threads, &|_| Ok(()))).unwrap())
}

fn read(scan: Option<&Path>) -> Vec<Position> {
    let source: Box<dyn Source> = match scan {
        None => Synthetic {
            scene: Scene::Als,
            points: 2_000_000,
            seed: 1,
            noise: None,
            ..Synthetic::default()
        }
        .open(),
        Some(path) if path.extension().is_some_and(|e| e == "ply") => ply::open(&[path.into()]),
        Some(path) => las::open(&[path.into()]),
    }
    .unwrap();
    let lattice = Lattice::of(source.schema(), None).unwrap();
    let mut batch = PointBatch::new(source.schema().clone(), 8192);
    let mut positions = Vec::new();
    for index in 0..source.parts() {
        let mut part = source.part(index).unwrap();
        loop {
            part.read(&mut batch).unwrap();
            if batch.is_empty() {
                break;
            }
            let place = |_, position| positions.push(position);
            lattice.place(source.schema(), batch.records(), place, |_, why| panic!("{why:?}"));
        }
    }
    positions
}

/// Fisher and Yates with a multiplicative generator.
fn shuffle(positions: &mut [Position]) {
    let mut state = 7u64;
    for i in (1..positions.len()).rev() {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        positions.swap(i, ((u128::from(state) * (i as u128 + 1)) >> 64) as usize);
    }
}
