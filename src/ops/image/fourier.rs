//! The stage `fourier`: what a depth image is without its high frequencies.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::wavelet::{moves, pixels};
use super::{Axis, Blocks, Pixels, Transformed, build};
use crate::Result;
use crate::geom::depth::low_pass;
use crate::ops::cells::{Keep, KeepGiven};
use crate::stage::{Role, RoleName, StageKind, StagePlace};

/// Reduction by the discrete Fourier transform, as the paper describes it: the high frequencies of
/// a depth image are dropped, and the rest is transformed back.
///
/// The image is that of [`wavelet`](wavelet.md). An image of so many waves along a side is told by
/// as many numbers, so it is divided into a grid of as many cells: of each with points one stays,
/// the nearest to its centre, moved along the axis to the depth that the image has there. There are
/// as many waves as leave no more than `keep` points; the report tells them as `waves`, and as
/// deviation how far points that went are from the image.
///
/// A Fourier transform takes the image as one that repeats: where its opposite borders differ, and
/// at steps, the depths of the rest swing.
///
/// With `moves = false` points stay where they were, each byte of them. Else they have their
/// synthetic flag set where the format has one, the report counts them as `fourier_moved`, and no
/// stage that works on tiles can stand behind this one, as behind `smooth`.
///
/// Image and positions are in memory at once, 32 bytes a pixel and 40 a position; a scan that is
/// too large for the run's memory is refused before any work.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fourier {
    /// How many points stay at most: a number, or a share of those there are, such as "10%".
    #[schemars(with = "KeepGiven")]
    pub keep: Keep,
    /// The axis that one looks along.
    #[serde(default)]
    pub axis: Axis,
    /// Pixels along each side of the image: a power of two from 16 to 8192.
    #[serde(default = "pixels")]
    pub pixels: Pixels,
    /// True if points go to the depth that the image has.
    #[serde(default = "moves")]
    pub moves: bool,
}

impl StageKind for Fourier {
    const KIND: &'static str = "fourier";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Keeps what a depth image is without its high frequencies.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        build::<LowWaves>(at, (self.keep, self.axis, self.pixels, self.moves))
    }
}

/// The discrete Fourier transform.
struct LowWaves;

impl Transformed for LowWaves {
    const KIND: &'static str = "fourier";
    const MOVED: &'static str = "fourier_moved";

    fn reduce(image: &mut [f64], side: usize, is_there: &[bool], most: u64) -> Blocks {
        let cells = cells(side, is_there, most);
        low_pass(image, side, cells / 2);
        let cell = |n: usize| (n % side * cells / side) + (n / side * cells / side) * cells;
        let of_pixel = (0..side * side).map(|n| cell(n) as u32).collect();
        let width = side as f64 / cells as f64;
        let center = move |block: u32| {
            let at = [block as usize % cells, block as usize / cells];
            at.map(|n| (n as f64 + 0.5) * width)
        };
        let decisions = vec![("waves".into(), (cells / 2).into()), ("cells".into(), cells.into())];
        Blocks { of_pixel, center: Box::new(center), decisions }
    }
}

/// Cells along a side of the finest grid, between powers of two that do and do not, that has no
/// more than `most` cells with points.
fn cells(side: usize, is_there: &[bool], most: u64) -> usize {
    let does = |cells: usize| {
        let mut occupied = vec![false; cells * cells];
        for n in (0..is_there.len()).filter(|&n| is_there[n]) {
            occupied[(n / side * cells / side) * cells + n % side * cells / side] = true;
        }
        occupied.iter().filter(|is| **is).count() as u64 <= most
    };
    let mut enough = 1;
    while 2 * enough <= side && does(2 * enough) {
        enough *= 2;
    }
    let mut too_many = (2 * enough).min(side + 1);
    while enough + 1 < too_many {
        let between = enough.midpoint(too_many);
        if does(between) { enough = between } else { too_many = between }
    }
    enough
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_cells_as_points_may_stay() {
        let side = 64;
        for (most, expected) in [(1, 1), (100, 10), (99, 9), (4096, 64), (u64::MAX, 64)] {
            assert_eq!(cells(side, &vec![true; side * side], most), expected, "{most}");
        }
        let strip: Vec<bool> = (0..side * side).map(|n| n / side == 0).collect();
        assert_eq!(cells(side, &strip, 20), 20);
    }

    #[test]
    fn what_is_left_is_low_and_cells_have_their_centres() {
        let side = 32;
        let wave = |waves: f64, at: usize| {
            (2.0 * std::f64::consts::PI * waves * at as f64 / side as f64).cos()
        };
        let mut image: Vec<f64> =
            (0..side * side).map(|n| wave(2.0, n % side) + wave(12.0, n / side)).collect();
        let blocks = LowWaves::reduce(&mut image, side, &vec![true; side * side], 100);
        assert!((0..side * side).all(|n| (image[n] - wave(2.0, n % side)).abs() < 1e-9));
        assert_eq!((blocks.center)(0), [1.6, 1.6]);
        assert_eq!(blocks.of_pixel[side * side - 1], 99);
    }
}
