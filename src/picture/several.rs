//! Several pictures of a scan and of what became of it, for one decode of each scan to look and one
//! to draw: both from several sides, and cut-outs of places.

use super::look::{Frame, Look, each_point};
use super::paint::Canvas;
use super::settings::{ColorBy, Settings, View};
use super::{GAP, Picture};
use crate::Result;
use crate::stage::Source;

/// A place of a scan that is drawn by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DrawnPlace {
    /// World coordinates of its middle.
    pub at: [f64; 3],
    /// Half the side of the cube around it that is drawn, in the scan's unit.
    pub half: f64,
}

/// A place with the points of both scans.
#[derive(Debug)]
pub(crate) struct CutOut {
    /// Pixels across and down of each picture.
    pub size: [u32; 2],
    /// From above, and a slice seen from the south: red, green and blue of each pixel.
    pub pixels: [Vec<u8>; 2],
}

/// Pixels that a point is wide at most, where both scans are shown.
const MOST_DOT: u32 = 4;
/// Pixels of the picture of a place.
const PLACE: [u32; 2] = [320, 240];
/// Part of the cube around a place that a slice is thick.
const SLICE: f64 = 0.2;
/// How points of a place are drawn: those of the first scan, of the second above them, and the
/// middle above all. Nearness that differs by so little casts no shadow.
const FIRST: (u32, (f32, [u8; 3])) = (2, (0.0, [168, 174, 184]));
const SECOND: (u32, (f32, [u8; 3])) = (4, (1e-4, [37, 99, 190]));
const MIDDLE: (u32, (f32, [u8; 3])) = (8, (2e-4, [214, 62, 48]));

/// A place while points come by.
struct OpenPlace {
    place: DrawnPlace,
    views: [(View, Frame, Canvas); 2],
}

impl OpenPlace {
    fn new(place: DrawnPlace) -> Self {
        let views = [View::Above, View::South].map(|view| {
            let pixel = 2.0 * place.half / f64::from(PLACE[1]);
            (view, Frame::around(view.seen(place.at), PLACE, pixel), Canvas::new(PLACE, 1))
        });
        let open = OpenPlace { place, views };
        open.draw(place.at, MIDDLE);
        open
    }

    fn draw(&self, point: [f64; 3], (wide, near): (u32, (f32, [u8; 3]))) {
        let DrawnPlace { at, half } = self.place;
        // Pictures are wider than high.
        let reach = half * f64::from(PLACE[0]) / f64::from(PLACE[1]);
        let off: [f64; 3] = std::array::from_fn(|axis| (point[axis] - at[axis]).abs());
        if off[0] > reach || off[1] > half || off[2] > half {
            return;
        }
        for (view, frame, canvas) in &self.views {
            let is_sliced = *view != View::Above && off[1] > half * SLICE;
            if let Some(place) = frame.place(view.seen(point)).filter(|_| !is_sliced) {
                canvas.dot(place, wide, near);
            }
        }
    }

    fn close(self) -> CutOut {
        CutOut { size: PLACE, pixels: self.views.map(|(_, _, canvas)| canvas.pixels()) }
    }
}

/// Draws a scan beside what became of it from all `views`, and `places` with the points of both.
/// Without an `after` there is one panel.
///
/// # Errors
///
/// Those of the sources; scans without coordinates or without points.
pub(crate) fn draw_several(
    before: &dyn Source,
    after: Option<&dyn Source>,
    views: &[View],
    places: &[DrawnPlace],
    (width, threads): (u32, usize),
) -> Result<(Vec<Picture>, Vec<CutOut>)> {
    let by = ColorBy::Height;
    let sources: Vec<&dyn Source> = std::iter::once(before).chain(after).collect();
    let looks = sources.iter().map(|source| Look::from(*source, views, by, threads));
    let looks = looks.collect::<Result<Vec<Vec<Look>>>>()?;
    let mut drawn = Vec::new();
    for (n, &view) in views.iter().enumerate() {
        let looks: Vec<Look> = looks.iter().map(|of| of[n].clone()).collect();
        // As wide as half of the picture also where it is alone.
        let wide = (width - GAP) / 2;
        let frame = Frame::of(&looks, [wide, wide])?;
        // Points of a panel about cover it, however few they are.
        let dots = looks.iter().map(|look| frame.dot(look.points).min(MOST_DOT));
        let canvases: Vec<Canvas> = dots.map(|dot| Canvas::new(frame.size, dot)).collect();
        let picture = Picture::blank(&frame, &looks, by);
        let settings = Settings { view, by, width, threads };
        drawn.push((settings, frame, by.range(&looks), canvases, picture));
    }
    let open: Vec<OpenPlace> = places.iter().copied().map(OpenPlace::new).collect();
    for (n, source) in sources.iter().enumerate() {
        let visit = |outside: &mut Vec<u64>, _: u64, point: [f64; 3], values: &[f64]| {
            for (out, (settings, frame, range, canvases, _)) in outside.iter_mut().zip(&drawn) {
                let (seen, color) = (settings.view.seen(point), by.color(values, *range));
                *out += u64::from(!canvases[n].point(seen, frame, color));
            }
            open.iter().for_each(|place| place.draw(point, if n == 0 { FIRST } else { SECOND }));
        };
        let nothing = || vec![0u64; views.len()];
        let outside = each_point(*source, by, threads, nothing, visit, |_| {})?;
        for (v, (_, frame, _, canvases, picture)) in drawn.iter_mut().enumerate() {
            let outside = outside.iter().map(|each| each[v]).sum();
            picture.panels.push((looks[n][v].points, outside));
            picture.place(&canvases[n], n as u32 * (frame.size[0] + GAP));
        }
    }
    let pictures = drawn.into_iter().map(|(_, _, _, _, picture)| picture).collect();
    Ok((pictures, open.into_iter().map(OpenPlace::close).collect()))
}
