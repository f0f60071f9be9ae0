//! Nanoseconds a normal, by method, on neighbourhoods of ten: `cargo bench --bench normals`.

use std::hint::black_box;
use std::time::Instant;

use pointmill::ops::normals::{Estimator, Method};

const NEIGHBORHOODS: usize = 4096;
const ROUNDS: usize = 100;

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
                (0..10)
                    .map(|_| {
                        let (x, y) = (random(400) - 200, random(400) - 200);
                        [x, y, x / 3 + random(20) + 1].map(|v| v * step)
                    })
                    .collect()
            })
            .collect();
        for method in [Method::Varady, Method::Pca] {
            let mut estimator = Estimator::new(method);
            let mut best = f64::INFINITY;
            for _ in 0..ROUNDS {
                let start = Instant::now();
                for offsets in &neighborhoods {
                    black_box(estimator.estimate(black_box(offsets)));
                }
                best = best.min(start.elapsed().as_secs_f64());
            }
            let nanoseconds = best / NEIGHBORHOODS as f64 * 1e9;
            println!("{method:?}, steps of {lattice}: {nanoseconds:.0} ns a normal");
        }
    }
}
