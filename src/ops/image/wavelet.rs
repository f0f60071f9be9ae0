//! The stage `wavelet`: what a depth image is without its small wavelet coefficients.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Axis, Blocks, PIXELS, Pixels, Transformed, build};
use crate::Result;
use crate::geom::depth::{haar, square};
use crate::ops::cells::{Keep, KeepGiven};
use crate::stage::{Role, RoleName, StageKind, StagePlace};

/// Thresholding of wavelet coefficients, as the paper describes it: the transform of a depth image
/// is calculated, "the coefficients that are smaller than a certain value are removed", and the
/// rest is transformed back.
///
/// The scan is seen along `axis`, as a square image of `pixels` times `pixels` from the smallest
/// corner of its box on; a pixel's depth is the mean of the positions in it. A square of the
/// quadtree has the mean of its quarters that have a depth, and pixels without any take that of the
/// smallest square around them that has one. The transform is Haar's, orthonormal in the plane.
/// Without a coefficient in it a square of the image is flat, so one number tells all of it: of
/// each largest such square one point stays, the nearest to its centre, moved along the axis to the
/// depth that the image has there. The certain value is the smallest for which no more than `keep`
/// points stay, and what does not exceed it goes; the report tells it as `threshold` (in steps of
/// the lattice times pixels, as the transform is orthonormal), how many are left as `coefficients`,
/// and as deviation how far points that went are from the image.
///
/// With `moves = false` points stay where they were, each byte of them. Else they have their
/// synthetic flag set where the format has one, the report counts them as `wavelet_moved`, and no
/// stage that works on tiles can stand behind this one, as behind `smooth`.
///
/// One looks at a surface from one side: what lies behind other points becomes one depth with them.
/// Image and positions are in memory at once, 32 bytes a pixel and 40 a position; a scan that is
/// too large for the run's memory is refused before any work.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wavelet {
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

pub(super) fn pixels() -> Pixels {
    PIXELS
}

pub(super) fn moves() -> bool {
    true
}

impl StageKind for Wavelet {
    const KIND: &'static str = "wavelet";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str =
        "Keeps what a depth image is without its small wavelet coefficients.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        build::<Haar>(at, (self.keep, self.axis, self.pixels, self.moves))
    }
}

/// Haar's transform.
struct Haar;

/// A square of the quadtree: the largest coefficient in it and below, and how many of its quarters
/// have points.
#[derive(Debug, Clone, Copy, Default)]
struct Quad {
    largest: f64,
    quarters: u8,
}

impl Transformed for Haar {
    const KIND: &'static str = "wavelet";
    const MOVED: &'static str = "wavelet_moved";

    fn reduce(image: &mut [f64], side: usize, is_there: &[bool], most: u64) -> Blocks {
        haar(image, side, false);
        let levels = quads(image, side, is_there);
        let threshold = threshold(&levels, most);
        let (of_pixel, sizes) = leaves(&levels, side, threshold);
        let mut left = 0u64;
        for_each_square(side, |_, places| {
            for at in &places[1..] {
                match image[*at].abs() > threshold {
                    true => left += 1,
                    false => image[*at] = 0.0,
                }
            }
        });
        haar(image, side, true);
        let center = move |block: u32| {
            let (at, half) = (block as usize, f64::from(1u32 << sizes[block as usize]) / 2.0);
            [at % side, at / side].map(|corner| corner as f64 + half)
        };
        // Above all coefficients none is left, and no number says how far.
        let told = threshold.is_finite().then_some(threshold);
        let decisions =
            vec![("threshold".into(), told.into()), ("coefficients".into(), left.into())];
        Blocks { of_pixel, center: Box::new(center), decisions }
    }
}

/// Calls `visit` for all squares of two pixels and more, the smallest first, with the level of each
/// and its places.
fn for_each_square(side: usize, mut visit: impl FnMut(usize, [usize; 4])) {
    for level in 1..=side.trailing_zeros() as usize {
        let across = side >> level;
        for n in 0..across * across {
            visit(level, square(side, 1 << level, n % across, n / across));
        }
    }
}

/// The squares of each level from two pixels on, row after row.
fn quads(image: &[f64], side: usize, is_there: &[bool]) -> Vec<Vec<Quad>> {
    let mut levels: Vec<Vec<Quad>> = Vec::new();
    for level in 1..=side.trailing_zeros() as usize {
        let across = side >> level;
        let quad = |n: usize| {
            let (x, y) = (n % across, n / across);
            let places = square(side, 1 << level, x, y);
            let own = places[1..].iter().map(|at| image[*at].abs());
            let largest = own.fold(0.0, f64::max);
            let finer = 2 * across;
            let corner = 2 * y * finer + 2 * x;
            let quarters = [corner, corner + 1, corner + finer, corner + finer + 1];
            quarters.iter().fold(Quad { largest, quarters: 0 }, |quad, &at| {
                let (below, has_points) = match levels.last() {
                    None => (0.0, is_there[at]),
                    Some(finer) => (finer[at].largest, finer[at].quarters > 0),
                };
                let quarters = quad.quarters + u8::from(has_points);
                Quad { largest: quad.largest.max(below), quarters }
            })
        };
        let quads = (0..across * across).map(quad).collect();
        levels.push(quads);
    }
    levels
}

/// The smallest size that coefficients must exceed where no more than `most` blocks with points are
/// to be.
fn threshold(levels: &[Vec<Quad>], most: u64) -> f64 {
    let divides = |quad: &&Quad| quad.quarters > 0 && quad.largest > 0.0;
    let mut quads: Vec<(f64, u8)> =
        levels.iter().flatten().filter(divides).map(|quad| (quad.largest, quad.quarters)).collect();
    quads.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
    let mut blocks = 1;
    // A square that is divided has one block for each of its quarters with points. All of one
    // largest coefficient are, or none is.
    let too_many = quads.chunk_by(|a, b| a.0 == b.0).find(|equal| {
        blocks += equal.iter().map(|(_, quarters)| u64::from(*quarters) - 1).sum::<u64>();
        blocks > most
    });
    too_many.map_or(0.0, |equal| equal[0].0)
}

/// The largest squares without a coefficient beyond `threshold`: for each pixel the first pixel
/// of its square, and there the level of it.
fn leaves(levels: &[Vec<Quad>], side: usize, threshold: f64) -> (Vec<u32>, Vec<u8>) {
    let (mut of_pixel, mut sizes) = (vec![0; side * side], vec![0; side * side]);
    let mut waiting = vec![(levels.len(), 0, 0)];
    while let Some((level, x, y)) = waiting.pop() {
        let across = side >> level;
        let is_divided = level > 0 && levels[level - 1][y * across + x].largest > threshold;
        if is_divided {
            let quarter = |n: usize| (level - 1, 2 * x + n % 2, 2 * y + n / 2);
            waiting.extend((0..4).map(quarter));
            continue;
        }
        let first = (y << level) * side + (x << level);
        sizes[first] = level as u8;
        for row in 0..1 << level {
            let start = first + row * side;
            of_pixel[start..start + (1 << level)].fill(first as u32);
        }
    }
    (of_pixel, sizes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blocks(image: &mut [f64], side: usize, most: u64) -> (Blocks, usize) {
        let blocks = Haar::reduce(image, side, &vec![true; side * side], most);
        let count = blocks.of_pixel.iter().collect::<std::collections::BTreeSet<_>>().len();
        (blocks, count)
    }

    #[test]
    fn a_step_is_told_by_few_blocks_and_nothing_is_lost_of_it() {
        let side = 16;
        let step = |n: usize| if n % side < 8 { 3.0 } else { 7.0 };
        let mut image: Vec<f64> = (0..side * side).map(step).collect();
        let (blocks, count) = blocks(&mut image, side, 4);
        assert_eq!(count, 4, "a step in the middle is one coefficient, and divides once");
        assert!(image.iter().enumerate().all(|(n, v)| (v - step(n)).abs() < 1e-12));
        assert_eq!((blocks.center)(0), [4.0, 4.0]);
    }

    #[test]
    fn a_flat_image_is_one_block_and_all_of_a_rough_one_are_kept_if_they_may_be() {
        let mut flat = vec![5.0; 256];
        let (_, count) = blocks(&mut flat, 16, 100);
        assert_eq!((count, &flat[..]), (1, &[5.0; 256][..]));
        let rough: Vec<f64> = (0..256).map(|n| f64::from(n * n % 97)).collect();
        let mut all = rough.clone();
        let (_, count) = blocks(&mut all, 16, 256);
        assert_eq!(count, 256);
        assert!(all.iter().zip(&rough).all(|(a, b)| (a - b).abs() < 1e-9));
        // A coefficient of two pixels divides all four squares around it: 13 blocks at least.
        for (most, is_divided) in [(1, false), (12, false), (128, true), (200, true)] {
            let mut some = rough.clone();
            let (_, count) = blocks(&mut some, 16, most);
            assert!(count as u64 <= most && (count > 1) == is_divided, "{count} of {most}");
        }
    }

    #[test]
    fn squares_without_points_do_not_count() {
        let side = 16;
        let mut image: Vec<f64> =
            (0..side * side).map(|n| f64::from((n * n % 89) as u32)).collect();
        let is_there: Vec<bool> = (0..side * side).map(|n| n % side < 4 && n / side < 4).collect();
        let blocks = Haar::reduce(&mut image, side, &is_there, 16);
        let with_points = (0..side * side).filter(|n| is_there[*n]).map(|n| blocks.of_pixel[n]);
        assert_eq!(with_points.collect::<std::collections::BTreeSet<_>>().len(), 16);
    }
}
