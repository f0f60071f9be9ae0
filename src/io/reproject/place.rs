//! Where a scan is, before and after it is reprojected.

use super::operation::PointTransform;
use crate::Result;
use crate::point::PointBatch;
use crate::stage::{BATCH, Source};

/// Parts that are looked at where headers do not say where the points are.
const LOOKS: usize = 64;
/// Points along an edge of a box whose image is looked for.
const ALONG: usize = 32;
/// What is added to an image on each side, in parts of its length: edges bulge between the points.
const BULGE: f64 = 0.02;

/// The box of a scan: what headers claim, where the first points lie in it; else that of the first
/// points of some of its parts. None of a scan without points.
pub fn place_of(source: &dyn Source) -> Result<Option<[[f64; 3]; 2]>> {
    let claimed = source.claimed_box();
    let is_box = |[lo, hi]: &[[f64; 3]; 2]| {
        (0..3).all(|axis| lo[axis] <= hi[axis] && (hi[axis] - lo[axis]).is_finite())
    };
    let claimed = claimed.filter(is_box);
    let mut found = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    if let Some([lo, hi]) = claimed {
        look(source, 0, &mut found)?;
        let is_in = |axis: usize| found[0][axis] >= lo[axis] && found[1][axis] <= hi[axis];
        if found[0][0] > found[1][0] || (0..3).all(is_in) {
            return Ok(claimed);
        }
    }
    let parts = source.parts();
    for look_at in 0..parts.min(LOOKS) {
        look(source, look_at * parts / parts.min(LOOKS), &mut found)?;
    }
    Ok((found[0][0] <= found[1][0]).then_some(found))
}

/// Widens a box by the first points of a part.
fn look(source: &dyn Source, part: usize, found: &mut [[f64; 3]; 2]) -> Result<()> {
    let Some(axes) = source.schema().coordinates() else { return Ok(()) };
    if part >= source.parts() {
        return Ok(());
    }
    let mut batch = PointBatch::new(source.schema().clone(), BATCH);
    source.part(part)?.read(&mut batch)?;
    for record in batch.iter() {
        let at = axes.map(|axis| axis.world(record, source.schema().endian));
        if at.iter().all(|at| at.is_finite()) {
            for (axis, at) in at.into_iter().enumerate() {
                found[0][axis] = found[0][axis].min(at);
                found[1][axis] = found[1][axis].max(at);
            }
        }
    }
    Ok(())
}

/// The box of what a box becomes. None where no point of its faces has an image.
pub fn image(transform: &PointTransform, [lo, hi]: [[f64; 3]; 2]) -> Option<[[f64; 3]; 2]> {
    let mut found = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    let at =
        |axis: usize, part: usize| lo[axis] + (hi[axis] - lo[axis]) * (part as f64 / ALONG as f64);
    for (x, y, z) in edges() {
        let Ok(image) = transform.apply([at(0, x), at(1, y), at(2, z)]) else { continue };
        for (axis, image) in image.into_iter().enumerate() {
            found[0][axis] = found[0][axis].min(image);
            found[1][axis] = found[1][axis].max(image);
        }
    }
    let [mut low, mut high] = found;
    let changed = if transform.keeps_heights() { 2 } else { 3 };
    for (low, high) in low.iter_mut().zip(&mut high).take(changed) {
        let more = (*high - *low) * BULGE;
        (*low, *high) = (*low - more, *high + more);
    }
    (low[0] <= high[0]).then_some([low, high])
}

/// Points of a box of [`ALONG`] steps on each axis: those of its sides, at the top and the bottom.
fn edges() -> impl Iterator<Item = (usize, usize, usize)> {
    let sides = (0..=ALONG).flat_map(|i| [(i, 0), (i, ALONG), (0, i), (ALONG, i)]);
    sides.flat_map(|(x, y)| [(x, y, 0), (x, y, ALONG)])
}

/// By how many degrees north turns in the middle of a box, clockwise.
pub fn turn(
    transform: &PointTransform,
    [lo, hi]: [[f64; 3]; 2],
    is_in_degrees: [bool; 2],
) -> Option<f64> {
    let middle: [f64; 3] = std::array::from_fn(|axis| f64::midpoint(lo[axis], hi[axis]));
    let step = if is_in_degrees[0] { 1e-5 } else { 1.0 };
    let north = [middle[0], middle[1] + step, middle[2]];
    let [here, there] = [middle, north].map(|at| transform.apply(at).ok());
    let (here, there) = (here?, there?);
    let shrink = if is_in_degrees[1] { here[1].to_radians().cos() } else { 1.0 };
    Some(((there[0] - here[0]) * shrink).atan2(there[1] - here[1]).to_degrees())
}
