//! A panel: for each pixel the nearest point's nearness and colour, in one number.

use std::sync::atomic::{AtomicU64, Ordering};

use super::color::Shade;
use super::look::{Frame, each_point};
use super::settings::Settings;
use crate::Result;
use crate::stage::Source;

/// How dark the foot of a step is, by its height in pixels.
const STEEPEST: f64 = 6.0;
const DARKEST: f64 = 0.55;
const PAPER: Shade = [255; 3];

/// A panel to draw on, from several threads at once.
pub(super) struct Canvas {
    size: [u32; 2],
    /// Pixels that a point is wide.
    dot: u32,
    /// 0 where there is nothing; else the nearness in the upper 32 bits, so that of two points the
    /// nearer has the larger number, and the colour below.
    cells: Vec<AtomicU64>,
}

impl Canvas {
    /// An empty panel.
    pub fn new(size: [u32; 2], dot: u32) -> Self {
        let cells = size[0] as usize * size[1] as usize;
        Canvas { size, dot, cells: (0..cells).map(|_| AtomicU64::new(0)).collect() }
    }

    /// Pixels across and down.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Draws all points of `source`; returns how many there are, and how many of them lie outside
    /// of the frame.
    pub fn draw(
        &self,
        source: &dyn Source,
        settings: &Settings,
        frame: &Frame,
        range: [f64; 2],
    ) -> Result<(u64, u64)> {
        let by = settings.by;
        let counts = each_point(
            source,
            by,
            settings.threads,
            || (0, 0),
            |(points, outside), _, point, values| {
                let seen = settings.view.seen(point);
                *points += 1;
                *outside += u64::from(!self.point(seen, frame, by.color(values, range)));
            },
            |_| {},
        )?;
        Ok(counts.into_iter().fold((0, 0), |all, one| (all.0 + one.0, all.1 + one.1)))
    }

    /// Draws a point as seen; false if it lies outside of the frame.
    pub fn point(&self, seen: [f64; 3], frame: &Frame, color: Shade) -> bool {
        let Some(at) = frame.place(seen) else { return false };
        // Steps of a pixel, so that a single precision number holds what shading asks.
        self.dot(at, self.dot, ((seen[2] / frame.pixel) as f32, color));
        true
    }

    /// Draws a square of so many pixels around a pixel.
    pub fn dot(&self, [x, y]: [u32; 2], wide: u32, (near, [r, g, b]): (f32, Shade)) {
        let key = u64::from(ordered(near)) << 32 | u64::from(u32::from_be_bytes([0, r, g, b]));
        let span = |at: u32, end: u32| {
            let from = at.saturating_sub((wide - 1) / 2);
            from..(from + wide).min(end)
        };
        for row in span(y, self.size[1]) {
            for column in span(x, self.size[0]) {
                let cell = row as usize * self.size[0] as usize + column as usize;
                self.cells[cell].fetch_max(key, Ordering::Relaxed);
            }
        }
    }

    /// Red, green and blue of each pixel, row by row from the top.
    pub fn pixels(&self) -> Vec<u8> {
        let [wide, high] = self.size;
        let rows = (0..high).flat_map(|y| (0..wide).map(move |x| (x, y)));
        rows.flat_map(|(x, y)| self.shaded(x, y)).collect()
    }

    /// The colour of a pixel, darker below its neighbours: that shows walls, trees and holes as a
    /// viewer sees them, for which colour alone is too flat.
    pub fn shaded(&self, x: u32, y: u32) -> Shade {
        let Some((near, color)) = self.cell(x, y) else { return PAPER };
        let reach = self.dot.max(1);
        let around = [
            (x.checked_sub(reach), Some(y)),
            (x.checked_add(reach).filter(|&x| x < self.size[0]), Some(y)),
            (Some(x), y.checked_sub(reach)),
            (Some(x), y.checked_add(reach).filter(|&y| y < self.size[1])),
        ];
        let step = |(x, y): (Option<u32>, Option<u32>)| {
            let (other, _) = self.cell(x?, y?)?;
            Some(f64::from(other - near).clamp(0.0, STEEPEST))
        };
        let steps: f64 = around.into_iter().filter_map(step).sum();
        let light = 1.0 - DARKEST * (steps / (4.0 * STEEPEST)).sqrt();
        color.map(|v| (f64::from(v) * light).round() as u8)
    }

    /// The nearness and the colour of a pixel, where there is a point.
    fn cell(&self, x: u32, y: u32) -> Option<(f32, Shade)> {
        let key =
            self.cells[y as usize * self.size[0] as usize + x as usize].load(Ordering::Relaxed);
        let [_, r, g, b] = (key as u32).to_be_bytes();
        (key != 0).then(|| (single((key >> 32) as u32), [r, g, b]))
    }
}

/// Numbers above 0 that compare as the figures do.
fn ordered(figure: f32) -> u32 {
    let bits = figure.to_bits();
    if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
}

/// The figure that has this number.
fn single(ordered: u32) -> f32 {
    f32::from_bits(if ordered >> 31 == 1 { ordered & !(1 << 31) } else { !ordered })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_compare_as_figures_do_and_give_them_back() {
        let figures = [f32::MIN, -1.5, -1e-30, 0.0, 1e-30, 1.5, f32::MAX];
        assert!(figures.map(ordered).is_sorted_by(|a, b| 0 < *a && a < b));
        assert_eq!(figures.map(|f| single(ordered(f))), figures);
    }
}
