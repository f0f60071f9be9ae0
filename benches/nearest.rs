//! Times the neighbour search on an airborne-like tile, build and search apart, on one core:
//! `cargo bench --bench nearest [-- points k repeats]`. CPU time on Linux, so that a busy machine
//! does not count; wall time elsewhere.

#![allow(clippy::print_stdout, reason = "a bench prints what it measured")]

use std::hint::black_box;
use std::time::{Duration, Instant};

use pointmill::internals::{Nearest, morton_cmp};
use pointmill::point::Position;

fn main() {
    let numbers: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let number = |i: usize, default| numbers.get(i).copied().unwrap_or(default);
    let (points, k, repeats) = (number(0, 300_000), number(1, 10), number(2, 5));
    let millimetres = airborne(points, 1000.0);
    time("airborne, 1 mm", &millimetres, k, repeats);
    time("airborne, 2^-30 m", &airborne(points, (1u64 << 30) as f64), k, repeats);
    let centimetres = sorted(millimetres.iter().map(|p| p.map(|v| v / 10 * 10)).collect());
    time("airborne, 1 cm in mm", &centimetres, k, repeats);
    let rounded = |v: i64| (v as f64 / 1000.0 * (1u64 << 30) as f64).round_ties_even() as i64;
    let ties = sorted(centimetres.iter().map(|p| p.map(|v| rounded(v / 100 * 100))).collect());
    time("airborne, 10 cm in 2^-30 m", &ties, k, repeats);
}

fn time(name: &str, positions: &[Position], k: usize, repeats: usize) {
    let mut nearest = Nearest::new();
    nearest.reserve(positions.len());
    let origin = Instant::now();
    let (mut build, mut search) = (Duration::MAX, Duration::MAX);
    for _ in 0..repeats.max(1) {
        let start = spent(origin);
        nearest.build(positions);
        let built = spent(origin);
        build = build.min(built - start);
        nearest.search(
            positions,
            k,
            |_| true,
            |i, neighbors, distance2| {
                black_box((i, neighbors, distance2));
            },
        );
        search = search.min(spent(origin) - built);
    }
    let n = positions.len() as f64;
    let each = |time: Duration| time.as_secs_f64() / n * 1e9;
    let work = nearest.work();
    println!(
        "{name}: {n} points, k = {k}: build {:.0} + search {:.0} ns a point = {:.2} Mpts/s; \
         {:.2} nodes and {:.2} leaves a point, {:.3} % redone",
        each(build),
        each(search),
        1e3 / (each(build) + each(search)),
        work.nodes as f64 / n,
        work.leaves as f64 / n,
        work.redone as f64 / n * 100.0,
    );
}

/// CPU time of this process, else wall time since `origin`.
fn spent(origin: Instant) -> Duration {
    let stat = std::fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    let nanoseconds = stat.split_whitespace().next().and_then(|ns| ns.parse().ok());
    nanoseconds.map_or_else(|| origin.elapsed(), Duration::from_nanos)
}

/// Terrain with gabled roofs and trees, 10 points a square metre in scan lines with noise.
fn airborne(points: usize, per_metre: f64) -> Vec<Position> {
    let side = (points as f64 / 10.0).sqrt();
    let mut random = Random(7);
    let positions = (0..points).map(|i| {
        let along = i as f64 / points as f64 * side;
        let (x, y) = (random.fraction() * side, along + random.fraction() * 0.3);
        let mut z = 30.0 * (x / 140.0).sin() * (y / 190.0).cos() + random.fraction() * 0.05;
        let (in_x, in_y) = (x.rem_euclid(45.0), y.rem_euclid(38.0));
        if in_x < 14.0 && in_y < 11.0 {
            z += 6.0 + (7.0 - (in_x - 7.0).abs()) * 0.6;
        } else if x.rem_euclid(9.0) < 4.0 && y.rem_euclid(11.0) < 4.0 && random.fraction() < 0.8 {
            z += 4.0 + 9.0 * random.fraction();
        }
        [x, y, z].map(|v| (v * per_metre).round() as i64)
    });
    sorted(positions.collect())
}

fn sorted(mut positions: Vec<Position>) -> Vec<Position> {
    positions.sort_unstable_by(morton_cmp);
    positions.dedup();
    positions
}

struct Random(u64);

impl Random {
    fn fraction(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}
