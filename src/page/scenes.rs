//! What is drawn of the scans before and after: both from above and from a side, and the worst
//! places.

use super::bits::Image;
use super::source::PageSource;
use super::words;
use super::worst::WorstPlace;
use crate::Result;
use crate::picture::{DrawnPlace, View, draw_several};
use crate::report::{Coordinate, Outcome};
use crate::stage::Source;

/// Pixels that a picture of both scans is wide.
const WIDTH: u32 = 1208;
/// Spacings of kept points that a cut-out shows to each side of its middle, and as many times the
/// deviation there.
const SPACINGS: f64 = 5.0;
const DEVIATIONS: f64 = 3.0;

/// A picture of both scans.
pub(super) struct SceneView {
    pub title: &'static str,
    pub image: Image,
    pub told: String,
}

/// A worst place.
pub(super) struct PlaceView {
    pub number: usize,
    pub deviation: String,
    pub at: String,
    pub wide: String,
    /// From above and as a slice; none where it is not drawn.
    pub images: Vec<Image>,
}

/// Draws what can be drawn; what cannot is added to what is `missing`, with the reason.
pub(super) fn draw(
    source: &PageSource<'_>,
    (worst, spacing): (&[WorstPlace], f64),
    missing: &mut Vec<String>,
) -> (Vec<SceneView>, Vec<PlaceView>) {
    let result = &source.report.result;
    let places: Vec<DrawnPlace> =
        worst.iter().map(|w| DrawnPlace { at: w.at, half: half_side(w, spacing) }).collect();
    let after = match &source.after {
        Ok(after) if after.points() > 0 => Some(&**after),
        Ok(_) => None,
        Err(why) => {
            missing.push(format!("Pictures of what was written: {why}."));
            None
        }
    };
    let drawn = both(source, after, &places);
    let (scenes, cut_outs) = drawn.unwrap_or_else(|error| {
        missing.push(format!("Pictures: {error}."));
        (Vec::new(), Vec::new())
    });
    if source.is_moved && !places.is_empty() {
        missing.push("Pictures of the worst places: stages moved the points.".to_owned());
    }
    let mut cut_outs = cut_outs.into_iter();
    let each = worst.iter().zip(&places).enumerate();
    let views = each.map(|(n, (worst, place))| {
        let images = cut_outs.next().filter(|_| !source.is_moved).unwrap_or_default();
        PlaceView {
            number: n + 1,
            deviation: words::length(worst.deviation, source.unit),
            at: coordinates(worst.at, result),
            wide: words::length(2.0 * place.half, source.unit),
            images,
        }
    });
    (scenes, views.collect())
}

/// Half the side of what is shown around a place.
fn half_side(worst: &WorstPlace, spacing: f64) -> f64 {
    (SPACINGS * spacing).max(DEVIATIONS * worst.deviation)
}

fn both(
    source: &PageSource<'_>,
    after: Option<&dyn Source>,
    places: &[DrawnPlace],
) -> Result<(Vec<SceneView>, Vec<Vec<Image>>)> {
    let views = [View::Above, View::South];
    let size = (WIDTH, source.threads);
    let (pictures, cut_outs) = draw_several(source.before, after, &views, places, size)?;
    let titles = ["From above", "From the south"];
    let scenes = pictures.iter().zip(titles).map(|(picture, title)| {
        let told = told(picture.range, picture.pixel, source.unit);
        let image = Image::of([picture.width, picture.height], &picture.pixels)?;
        Ok(SceneView { title, image, told })
    });
    let scenes = scenes.collect::<Result<Vec<SceneView>>>()?;
    let images = |pixels: &[Vec<u8>; 2], size| -> Result<Vec<Image>> {
        pixels.iter().map(|pixels| Image::of(size, pixels)).collect()
    };
    let cut_outs = cut_outs.iter().map(|cut_out| images(&cut_out.pixels, cut_out.size));
    Ok((scenes, cut_outs.collect::<Result<_>>()?))
}

/// What the colours and the pixels of a picture mean.
fn told(range: Option<[f64; 2]>, pixel: f64, unit: Option<&str>) -> String {
    let unit_name = unit.map_or(String::new(), |unit| format!(" {unit}"));
    let colors = range.map_or(String::new(), |[low, high]| {
        format!("heights from {low:.1} (blue) to {high:.1}{unit_name} (red), ")
    });
    format!("{colors}a pixel is {} wide", words::length(pixel, unit))
}

/// World coordinates in the digits that mean something.
pub(super) fn coordinates(at: [f64; 3], result: &Outcome) -> String {
    let step = result.lattice.map_or(0.0, |lattice| lattice.step);
    let [x, y, z] = at.map(|at| Coordinate { at, step });
    format!("{x}, {y}, {z}")
}
