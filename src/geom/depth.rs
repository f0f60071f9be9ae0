//! A scan seen as a depth image: along one axis, in square pixels; and transforms of such images.
//!
//! All bits are the same on every machine: sums are of whole numbers, transforms are additions and
//! multiplications in a fixed order, and sines come from `libm`. That is why the Fourier transform
//! is here and not from a library: those take what the processor and the platform have.

use std::f64::consts::PI;

use crate::point::{Bounds, Position};

/// Where the pixels of an image of `side` × `side` lie, in lattice steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Raster {
    /// Pixels along each side.
    pub side: usize,
    /// The axis that one looks along: 0, 1 or 2.
    pub axis: usize,
    /// The corner of the first pixel.
    pub lo: Position,
    /// Side of a pixel.
    pub pixel: u64,
}

impl Raster {
    /// The smallest pixels for which the image holds the box `bounds`.
    pub fn over(bounds: &Bounds, axis: usize, side: usize) -> Raster {
        let extent = bounds.extent();
        let across = |by: usize| extent[(axis + by) % 3];
        let longest = across(1).max(across(2));
        Raster { side, axis, lo: bounds.lo, pixel: longest / side as u64 + 1 }
    }

    /// Column and row of a position, which is in the box.
    fn place(&self, p: Position) -> [usize; 2] {
        [1, 2].map(|by| {
            let axis = (self.axis + by) % 3;
            (p[axis].wrapping_sub(self.lo[axis]) as u64 / self.pixel) as usize
        })
    }

    /// The number of a position's pixel, row after row.
    pub fn pixel_of(&self, p: Position) -> usize {
        let [x, y] = self.place(p);
        y * self.side + x
    }

    /// How deep a position lies, in steps from the corner.
    pub fn depth(&self, p: Position) -> u64 {
        p[self.axis].wrapping_sub(self.lo[self.axis]) as u64
    }

    /// The squared distance in the image's plane of a position from a place in pixels.
    pub fn distance2(&self, p: Position, [x, y]: [f64; 2]) -> f64 {
        let off = |by: usize, at: f64| {
            let axis = (self.axis + by) % 3;
            p[axis].wrapping_sub(self.lo[axis]) as u64 as f64 - at * self.pixel as f64
        };
        let (x, y) = (off(1, x), off(2, y));
        x * x + y * y
    }
}

/// Mean depths of the pixels of an image, while positions come by.
#[derive(Debug, Clone)]
pub struct DepthSums {
    sums: Vec<u128>,
    counts: Vec<u32>,
}

impl DepthSums {
    /// Bytes that they take for each pixel.
    pub const BYTES: usize = size_of::<u128>() + size_of::<u32>();

    /// Of an image of so many pixels.
    pub fn new(pixels: usize) -> Self {
        DepthSums { sums: vec![0; pixels], counts: vec![0; pixels] }
    }

    /// Adds a depth to a pixel.
    pub fn add(&mut self, pixel: usize, depth: u64) {
        self.sums[pixel] += u128::from(depth);
        self.counts[pixel] = self.counts[pixel].saturating_add(1);
    }

    /// The mean of each pixel; NaN where there is none.
    pub fn means(&self) -> Vec<f64> {
        let mean = |(&sum, &count): (&u128, &u32)| match count {
            0 => f64::NAN,
            count => {
                let (whole, rest) = (sum / u128::from(count), sum % u128::from(count));
                whole as f64 + rest as f64 / f64::from(count)
            }
        };
        self.sums.iter().zip(&self.counts).map(mean).collect()
    }
}

/// Gives pixels without a depth the mean of the smallest square of the quadtree around them that
/// has one; `side` is a power of two. An image without any is 0 everywhere.
pub fn fill(image: &mut [f64], side: usize) {
    let mut levels = Vec::new();
    let mut means: Vec<(f64, f64)> =
        image.iter().map(|v| if v.is_nan() { (0.0, 0.0) } else { (*v, 1.0) }).collect();
    let mut width = side;
    while width > 1 {
        let half = width / 2;
        let mut coarser = Vec::with_capacity(half * half);
        for y in 0..half {
            for x in 0..half {
                let at = 2 * y * width + 2 * x;
                let four = [at, at + 1, at + width, at + width + 1].map(|n| means[n]);
                let sum = four.iter().fold((0.0, 0.0), |s, m| (s.0 + m.0 * m.1, s.1 + m.1));
                coarser.push(if sum.1 > 0.0 { (sum.0 / sum.1, 1.0) } else { (0.0, 0.0) });
            }
        }
        levels.push((std::mem::replace(&mut means, coarser), width));
        width = half;
    }
    while let Some((mut finer, width)) = levels.pop() {
        for (at, mean) in finer.iter_mut().enumerate() {
            if mean.1 == 0.0 {
                let (x, y) = (at % width, at / width);
                *mean = means[y / 2 * (width / 2) + x / 2];
            }
        }
        means = finer;
    }
    image.iter_mut().zip(means).for_each(|(pixel, mean)| *pixel = mean.0);
}

/// The places of the four that one step of the Haar transform works on: squares of `size` (a power
/// of two from 2 on) keep their mean at their first pixel, and three details at those half a square
/// to the right, down, and both.
pub fn square(side: usize, size: usize, x: usize, y: usize) -> [usize; 4] {
    let (at, half) = (y * size * side + x * size, size / 2);
    [at, at + half, at + half * side, at + half * side + half]
}

/// The Haar wavelet transform, or back if `inverse`; orthonormal, its own inverse step by step.
pub fn haar(image: &mut [f64], side: usize, inverse: bool) {
    let levels = side.trailing_zeros();
    for step in 0..levels {
        let level = if inverse { levels - step } else { step + 1 };
        let size = 1 << level;
        for y in 0..side / size {
            for x in 0..side / size {
                let places = square(side, size, x, y);
                let [a, b, c, d] = places.map(|n| image[n]);
                let (left, right, down, up) = (a + c, b + d, c + d, a + b);
                let four = [up + down, left - right, up - down, (a + d) - (b + c)];
                places.iter().zip(four).for_each(|(n, v)| image[*n] = v / 2.0);
            }
        }
    }
}

/// Leaves those frequencies of an image that do not exceed `most` waves along a side.
pub fn low_pass(image: &mut [f64], side: usize, most: usize) {
    let wave = Wave::of(side);
    let mut values: Vec<[f64; 2]> = image.iter().map(|v| [*v, 0.0]).collect();
    let mut line = vec![[0.0; 2]; side];
    let lines = |values: &mut [[f64; 2]], line: &mut [[f64; 2]], inverse: bool| {
        for n in 0..side {
            wave.transform(&mut values[n * side..(n + 1) * side], inverse);
        }
        for x in 0..side {
            (0..side).for_each(|y| line[y] = values[y * side + x]);
            wave.transform(line, inverse);
            (0..side).for_each(|y| values[y * side + x] = line[y]);
        }
    };
    lines(&mut values, &mut line, false);
    let is_low = |n: usize| n.min(side - n) <= most;
    for (at, value) in values.iter_mut().enumerate() {
        if !is_low(at % side) || !is_low(at / side) {
            *value = [0.0; 2];
        }
    }
    lines(&mut values, &mut line, true);
    image.iter_mut().zip(values).for_each(|(pixel, value)| *pixel = value[0]);
}

/// The fast Fourier transform of lines of one length, a power of two.
struct Wave {
    /// Cosine and sine of each of half the turns.
    turns: Vec<[f64; 2]>,
}

impl Wave {
    fn of(length: usize) -> Wave {
        let turn = |n: usize| -2.0 * PI * n as f64 / length as f64;
        let turns = (0..length / 2).map(|n| [libm::cos(turn(n)), libm::sin(turn(n))]);
        Wave { turns: turns.collect() }
    }

    fn transform(&self, line: &mut [[f64; 2]], inverse: bool) {
        let length = line.len();
        if length < 2 {
            return;
        }
        let bits = length.trailing_zeros();
        for n in 0..length {
            let other = n.reverse_bits() >> (usize::BITS - bits);
            if n < other {
                line.swap(n, other);
            }
        }
        let mut size = 2;
        while size <= length {
            for start in (0..length).step_by(size) {
                for n in 0..size / 2 {
                    let [cos, sin] = self.turns[n * (length / size)];
                    let sin = if inverse { -sin } else { sin };
                    let [a, b] = [line[start + n], line[start + n + size / 2]];
                    let turned = [b[0] * cos - b[1] * sin, b[0] * sin + b[1] * cos];
                    line[start + n] = [a[0] + turned[0], a[1] + turned[1]];
                    line[start + n + size / 2] = [a[0] - turned[0], a[1] - turned[1]];
                }
            }
            size *= 2;
        }
        if inverse {
            let by = 1.0 / length as f64;
            line.iter_mut().for_each(|v| *v = [v[0] * by, v[1] * by]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::hash::of_position;

    fn noise(side: usize) -> Vec<f64> {
        (0..side * side).map(|n| (of_position(n as u64, [0; 3]) % 1000) as f64 / 10.0).collect()
    }

    #[test]
    fn a_raster_holds_its_box_whatever_its_size() {
        for (lo, hi) in
            [([0; 3], [0; 3]), ([-5, 3, 9], [250, 70, 9]), ([-(1 << 61); 3], [1 << 61; 3])]
        {
            let bounds = Bounds { lo, hi };
            for axis in 0..3 {
                let raster = Raster::over(&bounds, axis, 64);
                assert_eq!(raster.pixel_of(lo), 0);
                assert!(raster.pixel_of(hi) < 64 * 64, "{lo:?} to {hi:?}");
                assert_eq!(raster.depth(hi), hi[axis].abs_diff(lo[axis]));
            }
        }
    }

    #[test]
    fn means_are_of_whole_numbers_and_empty_pixels_take_the_next_square() {
        let mut sums = DepthSums::new(16);
        for depth in [1, 2, 4] {
            sums.add(0, depth);
        }
        sums.add(5, u64::MAX);
        let mut image = sums.means();
        assert_eq!(image[0], 7.0 / 3.0);
        assert!(image[1].is_nan() && image[5] == u64::MAX as f64);
        image[5] = 8.0;
        fill(&mut image, 4);
        let near = (7.0 / 3.0 + 8.0) / 2.0;
        assert_eq!((image[0], image[5], image[1], image[15]), (7.0 / 3.0, 8.0, near, near));
        let mut none = vec![f64::NAN; 16];
        fill(&mut none, 4);
        assert_eq!(none, [0.0; 16]);
    }

    #[test]
    fn the_haar_transform_keeps_lengths_and_goes_back() {
        for side in [1, 2, 16] {
            let image = noise(side);
            let mut there = image.clone();
            haar(&mut there, side, false);
            let squares = |of: &[f64]| of.iter().map(|v| v * v).sum::<f64>();
            assert!((squares(&there) - squares(&image)).abs() < 1e-9 * squares(&image));
            let mean = image.iter().sum::<f64>() / image.len() as f64;
            assert!((there[0] - mean * side as f64).abs() < 1e-9, "the mean is first");
            haar(&mut there, side, true);
            assert!(there.iter().zip(&image).all(|(a, b)| (a - b).abs() < 1e-9));
        }
    }

    #[test]
    fn a_low_pass_leaves_the_waves_that_are_low() {
        let side = 32;
        let wave = |waves: f64, at: usize| (2.0 * PI * waves * at as f64 / side as f64).cos();
        let of =
            |x: usize, y: usize| 3.0 + wave(2.0, x) + wave(9.0, x) * wave(1.0, y) + wave(5.0, y);
        let image: Vec<f64> = (0..side * side).map(|n| of(n % side, n / side)).collect();
        let mut low = image.clone();
        low_pass(&mut low, side, 5);
        for (n, value) in low.iter().enumerate() {
            let expected = 3.0 + wave(2.0, n % side) + wave(5.0, n / side);
            assert!((value - expected).abs() < 1e-9, "pixel {n}: {value}, not {expected}");
        }
        let mut all = image.clone();
        low_pass(&mut all, side, side / 2);
        assert!(all.iter().zip(&image).all(|(a, b)| (a - b).abs() < 1e-9));
    }
}
