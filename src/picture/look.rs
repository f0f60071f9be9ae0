//! The first look at a scan: its points, its extent as seen from somewhere, and the range of what
//! it is coloured by; and the frame that follows from it.

use super::settings::{ColorBy, NARROWEST, Settings, View};
use crate::point::{Dimension, PointBatch, names};
use crate::stage::{PointWalk, Source};
use crate::{Error, ErrorKind, Result};

/// Points of which the middle range of figures is found, about.
const SAMPLE: u64 = 100_000;
/// Times the extent of what was looked at that a header's box is at most, to be believed.
const BELIEVED: f64 = 1.5;
/// Pixels that a point is wide at most.
const MOST_DOT: u32 = 5;

/// Calls `visit` with every point of `source` that is somewhere: its number in its part, its world
/// coordinates, and the values that it is coloured by; and `nowhere` for each of the others. Each
/// thread has a state of its own; all are returned.
pub(super) fn each_point<S: Send>(
    source: &dyn Source,
    by: ColorBy,
    threads: usize,
    begin: impl Fn() -> S + Sync,
    visit: impl Fn(&mut S, u64, [f64; 3], &[f64]) + Sync,
    nowhere: impl Fn(&mut S) + Sync,
) -> Result<Vec<S>> {
    let schema = source.schema();
    let no_place = || Error::pipeline("the scan has no coordinates");
    let axes = schema.coordinates().ok_or_else(no_place)?;
    let fields: Vec<&Dimension> = by.dimensions(schema)?;
    let look = |(state, values): &mut (S, Vec<f64>), _, before: u64, batch: &PointBatch| {
        for (number, record) in (before..).zip(batch.iter()) {
            let point = axes.map(|a| a.world(record, schema.endian));
            if point.iter().all(|v| v.is_finite()) {
                for (value, field) in values.iter_mut().zip(&fields) {
                    *value = field.world(record, schema.endian);
                }
                visit(state, number, point, values);
            } else {
                nowhere(state);
            }
        }
    };
    let is_read = |d: &Dimension| {
        names::XYZ.contains(&&*d.name) || fields.iter().any(|field| field.name == d.name)
    };
    let unread = schema.dimensions.iter().filter(|d| !is_read(d));
    let unread: Vec<String> = unread.map(|d| d.name.to_string()).collect();
    let walk = PointWalk { threads, memory: u64::MAX, progress: None };
    let begin = || (begin(), vec![0.0; fields.len()]);
    let states = walk.each_batch(source, &unread, 0, begin, look, |_, _, error| Err(error))?;
    Ok(states.into_iter().map(|(state, _)| state).collect())
}

/// A range that holds nothing.
const NOTHING: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

/// What the first look found.
#[derive(Debug, Clone)]
pub(super) struct Look {
    pub points: u64,
    /// Points that are nowhere: a coordinate is no finite number.
    pub nowhere: u64,
    /// Smallest and largest to the right and up.
    extent: [[f64; 2]; 2],
    /// Smallest and largest value of any of the dimensions that colour.
    pub values: [f64; 2],
    /// Of about [`SAMPLE`] points, in no order: to the right, up, and the first value.
    sample: Vec<[f64; 3]>,
}

impl Look {
    const NOTHING: Look =
        Look { points: 0, nowhere: 0, extent: [NOTHING; 2], values: NOTHING, sample: Vec::new() };

    /// Looks at all points.
    pub fn at(source: &dyn Source, settings: &Settings) -> Result<Look> {
        let looks = Look::from(source, &[settings.view], settings.by, settings.threads)?;
        Ok(looks.into_iter().next().unwrap_or(Look::NOTHING))
    }

    /// Looks at all points from several sides at once: a look for each of the `views`.
    pub fn from(
        source: &dyn Source,
        views: &[View],
        by: ColorBy,
        threads: usize,
    ) -> Result<Vec<Look>> {
        let every = (source.points() / SAMPLE).max(1);
        let nothing = || vec![Look::NOTHING; views.len()];
        let visit = |looks: &mut Vec<Look>, number: u64, point: [f64; 3], values: &[f64]| {
            for (look, view) in looks.iter_mut().zip(views) {
                look.see(view.seen(point), values, number.is_multiple_of(every));
            }
        };
        let nowhere = |looks: &mut Vec<Look>| looks.iter_mut().for_each(|look| look.nowhere += 1);
        let all = each_point(source, by, threads, nothing, visit, nowhere)?;
        let mut whole = nothing();
        for looks in all {
            whole.iter_mut().zip(looks).for_each(|(whole, look)| whole.merge(look));
        }
        Ok(whole)
    }

    fn see(&mut self, [right, up, _]: [f64; 3], values: &[f64], is_sampled: bool) {
        self.points += 1;
        for (range, at) in self.extent.iter_mut().zip([right, up]) {
            *range = wider(*range, [at; 2]);
        }
        self.values = values.iter().fold(self.values, |range, &v| wider(range, [v; 2]));
        if is_sampled {
            self.sample.push([right, up, values.first().copied().unwrap_or(0.0)]);
        }
    }

    /// Widens the extent to the `corners` that a header claims, where points of coarse levels are
    /// all that was looked at: a few of the others lie beyond these. A header that claims much more
    /// is not believed.
    pub fn widen(&mut self, corners: [[f64; 3]; 2], view: View) {
        let [one, two] = corners.map(|corner| view.seen(corner));
        for (axis, range) in self.extent.iter_mut().enumerate() {
            let claimed = wider([one[axis]; 2], [two[axis]; 2]);
            let holds = claimed[0] <= range[0] && claimed[1] >= range[1];
            if holds && claimed[1] - claimed[0] <= BELIEVED * (range[1] - range[0]) {
                *range = claimed;
            }
        }
    }

    fn merge(&mut self, other: Look) {
        self.points += other.points;
        self.nowhere += other.nowhere;
        for (mine, theirs) in self.extent.iter_mut().zip(other.extent) {
            *mine = wider(*mine, theirs);
        }
        self.values = wider(self.values, other.values);
        self.sample.extend(other.sample);
    }

    /// The range of the middle 98 of 100 values of the sample.
    pub fn middle_values(&self) -> [f64; 2] {
        middle(self.sample.iter().map(|s| s[2]), 0.01)
    }
}

fn wider(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// The range of `figures` without this share of them at either end.
fn middle(figures: impl Iterator<Item = f64>, share: f64) -> [f64; 2] {
    let mut sorted: Vec<f64> = figures.filter(|v| v.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return NOTHING };
    let cut = (last as f64 * share) as usize;
    [sorted[cut], sorted[last - cut]]
}

/// Where on the picture a point is.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    /// Pixels of a panel.
    pub size: [u32; 2],
    /// Side of a pixel in the scan's unit.
    pub pixel: f64,
    /// What is at the left and at the top edge.
    corner: [f64; 2],
}

impl Frame {
    /// The frame of so many pixels around a point as seen, each so wide.
    pub fn around([right, up, _]: [f64; 3], size: [u32; 2], pixel: f64) -> Frame {
        let half = size.map(|pixels| f64::from(pixels) / 2.0 * pixel);
        Frame { size, pixel, corner: [right - half[0], up + half[1]] }
    }

    /// The frame of all that was looked at, in at most so many pixels, and in no fewer than
    /// [`NARROWEST`] where there is room: what has no width, as a line of points, is in the middle.
    /// A few points far from all others are left outside.
    pub fn of(looks: &[Look], most: [u32; 2]) -> Result<Frame> {
        if looks.iter().all(|look| look.points == 0) {
            let nowhere: u64 = looks.iter().map(|look| look.nowhere).sum();
            let told = match nowhere {
                0 => "there is no point to draw".to_owned(),
                all => {
                    format!("there is no point to draw: {all} have coordinates that are not finite")
                }
            };
            return Err(Error::new(ErrorKind::Data, told));
        }
        let ranges = [0, 1].map(|axis| {
            let whole = looks.iter().map(|look| look.extent[axis]).fold(NOTHING, wider);
            let sample = looks.iter().flat_map(|look| look.sample.iter().map(|s| s[axis]));
            let middle = middle(sample, 0.005);
            let margin = 0.1 * (middle[1] - middle[0]);
            let near = [middle[0] - margin, middle[1] + margin];
            match whole[1] - whole[0] > 3.0 * (near[1] - near[0]) {
                true => [near[0].max(whole[0]), near[1].min(whole[1])],
                false => whole,
            }
        });
        let sides = ranges.map(|range| range[1] - range[0]);
        let steps = most.map(|pixels| f64::from(pixels.max(2)) - 1.0);
        let pixel = (sides[0] / steps[0]).max(sides[1] / steps[1]);
        let pixel = if pixel > 0.0 && pixel.is_finite() { pixel } else { 1.0 };
        let filled = sides.map(|side| (side / pixel).round() as u32 + 1);
        let size = [0, 1].map(|axis| filled[axis].max(NARROWEST.min(most[axis])));
        let margin = [0, 1].map(|axis| f64::from((size[axis] - filled[axis]) / 2) * pixel);
        Ok(Frame { size, pixel, corner: [ranges[0][0] - margin[0], ranges[1][1] + margin[1]] })
    }

    /// The pixel of a point, from the left and from the top; none outside.
    pub fn place(&self, [right, up, _]: [f64; 3]) -> Option<[u32; 2]> {
        let at = [(right - self.corner[0]) / self.pixel, (self.corner[1] - up) / self.pixel];
        let inside = |axis: usize| at[axis] >= 0.0 && at[axis] < f64::from(self.size[axis]);
        (inside(0) && inside(1)).then(|| at.map(|v| v as u32))
    }

    /// Pixels of a panel.
    pub fn pixels(&self) -> u64 {
        u64::from(self.size[0]) * u64::from(self.size[1])
    }

    /// Pixels that a point is wide, so that this many about cover a panel.
    pub fn dot(&self, points: u64) -> u32 {
        ((self.pixels() as f64 / points.max(1) as f64).sqrt().round() as u32).clamp(1, MOST_DOT)
    }
}
