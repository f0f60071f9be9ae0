//! The experiment of the paper that the method comes from: squares projected on the front of a test
//! object, one point for the centre of each. Of the object and the noise the paper says nothing;
//! what they are says a [`SquaresProjection`]. A pixel is a tenth of a millimetre.

use super::front::SquaresProjection;
use super::random::{Random, key};
use super::record::{STRIDE, SceneRecord, stored};

/// World units (millimetres) of a stored step, and of a pixel.
pub const SCALE: f64 = 1e-4;
const PER_UNIT: f64 = 1e4;
const PIXEL: f64 = 0.1;

/// The projection window and the side of a square in pixels.
const WINDOW: [u64; 2] = [1200, 1600];
const SQUARE: u64 = 60;
/// Whole squares of a run, along x and along y: 520, with 40 pixels left at the bottom. (The paper
/// has 533, which is the window's area by that of a square.)
const COLUMNS: u64 = WINDOW[0] / SQUARE;
const ROWS: u64 = WINDOW[1] / SQUARE;
/// Pixels from one run to the next, and the runs after which squares meet their neighbours' places.
const SHIFT: u64 = 2;
const SHIFTS: u64 = SQUARE / SHIFT;

/// Where the squares are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pattern {
    /// Anywhere in the window, whole.
    Random,
    /// On a grid in runs, each 2 pixels further in x than the run before.
    Uniform,
}

pub struct SquaresScene {
    pattern: Pattern,
    key: u64,
    noise: f64,
    projection: SquaresProjection,
}

impl SquaresScene {
    pub fn new(pattern: Pattern, seed: u64, noise: f64, projection: SquaresProjection) -> Self {
        SquaresScene { pattern, key: key(seed, 0x72), noise, projection }
    }

    /// Makes the points from number `first` on.
    pub fn fill(&self, first: u64, records: &mut [u8]) {
        for (bytes, index) in records.chunks_exact_mut(STRIDE).zip(first..) {
            let mut random = Random::new(self.key, index);
            let (pixels, run) = match self.pattern {
                Pattern::Random => (anywhere(&mut random), 0),
                Pattern::Uniform => on_the_grid(index),
            };
            let plan = pixels.map(|v| v * PIXEL);
            let (face, position) = self.projection.point(plan, self.noise, &mut random);
            SceneRecord {
                intensity: 1000,
                user_data: face,
                point_source_id: run + 1,
                ..SceneRecord::single(stored(position, PER_UNIT), index as f64 * 1e-6)
            }
            .store(bytes);
        }
    }
}

/// The centre of a square that is wholly in the window, in pixels from its lower left corner.
fn anywhere(random: &mut Random) -> [f64; 2] {
    let half = SQUARE as f64 / 2.0;
    WINDOW.map(|side| random.between(half, side as f64 - half))
}

/// The centre of square `index` in pixels, and the number of its run from 0 to 899. The first run
/// starts in the upper left corner (2, 1600), as in the paper's figure 5; each is row after row
/// downward. What leaves the window at its right side comes in at its left. After 30 runs, x begins
/// again 2 pixels lower, and after 30 of these, the whole.
fn on_the_grid(index: u64) -> ([f64; 2], u16) {
    let (run, square) = (index / (COLUMNS * ROWS), index % (COLUMNS * ROWS));
    let (column, row) = (square % COLUMNS, square / COLUMNS);
    let run = run % (SHIFTS * SHIFTS);
    let (right, down) = (SHIFT * (run % SHIFTS + 1), SHIFT * (run / SHIFTS));
    let x = (SQUARE / 2 + SQUARE * column + right) % WINDOW[0];
    let y = WINDOW[1] - SQUARE / 2 - SQUARE * row - down; // 12 at least
    ([x as f64, y as f64], run as u16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn places(indices: std::ops::Range<u64>) -> BTreeSet<[u64; 2]> {
        indices.map(|i| on_the_grid(i).0.map(|v| v as u64)).collect()
    }

    #[test]
    fn a_run_is_520_squares_60_pixels_apart() {
        let run = places(0..520);
        assert_eq!((COLUMNS, ROWS, run.len()), (20, 26, 520));
        for &[x, y] in &run {
            assert_eq!((x % 60, y % 60), (32, 1570 % 60));
        }
        assert_eq!(on_the_grid(0).0, [32.0, 1570.0]);
        assert_eq!(on_the_grid(1).0, [92.0, 1570.0]);
        assert_eq!(on_the_grid(20).0, [32.0, 1510.0]);
    }

    #[test]
    fn a_further_run_is_2_pixels_to_the_right() {
        for index in 0..520 * 29 {
            let ([[x, y], [next, same]], [run, further]) = (
                [index, index + 520].map(|i| on_the_grid(i).0),
                [index, index + 520].map(|i| on_the_grid(i).1),
            );
            assert_eq!((next, same), ((x + 2.0) % 1200.0, y));
            assert_eq!(run + 1, further);
        }
    }

    #[test]
    fn no_place_repeats_before_all_were_taken() {
        let all = 520 * 900;
        assert_eq!(places(0..all).len() as u64, all);
        assert_eq!(places(all..2 * all), places(0..all));
        for [x, y] in places(0..all) {
            assert!(x < 1200 && (12..1600).contains(&y), "{x} {y}");
        }
    }
}
