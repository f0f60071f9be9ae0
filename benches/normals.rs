//! Nanoseconds a normal, by method, on neighbourhoods of ten: `cargo bench --bench normals`.

#![allow(clippy::print_stdout, reason = "figures are what it is for")]

use std::hint::black_box;
use std::time::Instant;

use pointmill::internals::Estimator;
use pointmill::ops::normals::Method;
use pointmill::point::distance2;
use pointmill::tile::Neighborhood;

const NEIGHBORHOODS: usize = 4096;
const CHUNK: usize = 128;
const ROUNDS: usize = 100;
const RANKS: [u32; 10] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9];

fn main() {
    let mut state = 1u64;
    let mut random = move |below: u64| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((state >> 33) % below) as i64
    };
    // A noisy surface around p, one step 1 mm; and the same on a binary lattice, 2^30 steps a metre.
    for (lattice, step) in [("1 mm", 1), ("2^-30 m", 1 << 20)] {
        let neighborhoods: Vec<Vec<[i64; 3]>> = (0..NEIGHBORHOODS)
            .map(|_| {
                let mut offsets: Vec<[i64; 3]> = (0..10)
                    .map(|_| {
                        let (x, y) = (random(400) - 200, random(400) - 200);
                        [x, y, x / 3 + random(20) + 1].map(|v| v * step)
                    })
                    .collect();
                offsets.sort_by_key(|o| distance2([0; 3], *o));
                offsets
            })
            .collect();
        for method in [Method::Varady, Method::Pca] {
            let mut estimator = Estimator::new(method);
            let nanoseconds = time(&neighborhoods, |offsets| {
                black_box(estimator.estimate(offsets));
            });
            let together = time_together(method, &neighborhoods);
            println!(
                "{method:?}, steps of {lattice}: {nanoseconds:.0} ns a normal alone, {together:.0} \
                 among others"
            );
        }
    }
}

/// Nanoseconds a normal where neighbourhoods are estimated side by side.
fn time_together(method: Method, neighborhoods: &[Vec<[i64; 3]>]) -> f64 {
    let mut estimator = Estimator::new(method);
    let chunks: Vec<&[Vec<[i64; 3]>]> = neighborhoods.chunks(CHUNK).collect();
    let each = time(&chunks, |chunk| {
        let mut settle = |owner, outcome| {
            black_box((owner, outcome));
        };
        for (i, offsets) in chunk.iter().enumerate() {
            estimator.take(i, &Neighborhood::of_offsets(offsets, &RANKS), &mut settle);
        }
        estimator.finish(&mut settle);
    });
    each / CHUNK as f64
}

/// Nanoseconds a call: each chunk's best of all rounds, so that other work on the machine does not
/// count.
fn time<T>(work: &[T], mut call: impl FnMut(&T)) -> f64 {
    let mut best = vec![f64::INFINITY; work.len().div_ceil(CHUNK)];
    for _ in 0..ROUNDS {
        for (chunk, best) in work.chunks(CHUNK).zip(&mut best) {
            let start = Instant::now();
            chunk.iter().for_each(|item| call(black_box(item)));
            *best = best.min(start.elapsed().as_secs_f64());
        }
    }
    best.iter().sum::<f64>() / work.len() as f64 * 1e9
}
