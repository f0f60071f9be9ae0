//! Where a scan is, before and after it is reprojected.

use super::operation::PointTransform;
use crate::Result;
use crate::point::PointBatch;
use crate::point::names::XYZ;
use crate::stage::{BATCH, Source};

/// Parts of which the first points are held against the box that headers claim, and how many.
const LOOKS: usize = 4096;
const LOOK_POINTS: usize = 64;
/// Bytes of records that are read at once, at most.
const READ_BYTES: usize = 1 << 20;
/// How far a point may lie outside of what a header claims, in steps: some writers take the box
/// before they round.
const SLACK: f64 = 1.0;
/// Steps along an edge of a box whose image is looked for.
const ALONG: usize = 32;
/// What is added to an image on each side, in parts of its length: it bulges between the points.
const BULGE: f64 = 0.02;

/// Where a scan is.
#[derive(Debug, Clone, Copy)]
pub struct ScanPlace {
    /// The smallest and the largest coordinates.
    pub corners: [[f64; 3]; 2],
    /// True if headers claim so, and the points that were looked at do not refute it.
    pub is_claimed: bool,
}

/// Where a scan is: as headers claim, if the first points of some parts lie there; else all points
/// are read for it. None of a scan without points that have a place.
pub fn place_of(source: &dyn Source) -> Result<Option<ScanPlace>> {
    let is_box = |[lo, hi]: &[[f64; 3]; 2]| {
        (0..3).all(|axis| lo[axis] <= hi[axis] && (hi[axis] - lo[axis]).is_finite())
    };
    let parts = source.parts();
    if let Some(corners) = source.claimed_box().filter(is_box) {
        let [lo, hi] = corners;
        let mut found = NOWHERE;
        for look in 0..parts.min(LOOKS) {
            widen(source, look * parts / parts.min(LOOKS), false, &mut found)?;
        }
        let slack = source.schema().coordinates().map_or([0.0; 3], |axes| {
            [0, 1, 2].map(|n: usize| {
                let largest = lo[n].abs().max(hi[n].abs());
                SLACK * axes[n].scale.abs() + 4.0 * f64::EPSILON * largest
            })
        });
        let is_in = |n: usize| found[0][n] >= lo[n] - slack[n] && found[1][n] <= hi[n] + slack[n];
        if (0..3).all(is_in) {
            return Ok(Some(ScanPlace { corners, is_claimed: true }));
        }
    }
    let mut corners = NOWHERE;
    for part in 0..parts {
        widen(source, part, true, &mut corners)?;
    }
    let is_there = corners[0][0] <= corners[1][0];
    Ok(is_there.then_some(ScanPlace { corners, is_claimed: false }))
}

const NOWHERE: [[f64; 3]; 2] = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];

/// Widens a box by the first points of a part, or by all of them.
fn widen(source: &dyn Source, part: usize, all: bool, corners: &mut [[f64; 3]; 2]) -> Result<()> {
    let schema = source.schema();
    let Some(axes) = schema.coordinates() else { return Ok(()) };
    let names = schema.dimensions.iter().map(|dimension| dimension.name.clone());
    let unread: Vec<String> = names.filter(|name| !XYZ.contains(&name.as_str())).collect();
    let most = if all { BATCH } else { LOOK_POINTS };
    let points = (READ_BYTES / schema.stride.max(1)).clamp(1, most);
    let mut batch = PointBatch::new(schema.clone(), points);
    let mut reader = source.part_without(part, &unread)?;
    loop {
        reader.read(&mut batch)?;
        for record in batch.iter() {
            let mut at = axes.map(|axis| axis.world(record, schema.endian));
            // A point without z is somewhere all the same.
            if !at[2].is_finite() {
                at[2] = 0.0;
            }
            if !at.iter().all(|at| at.is_finite()) {
                continue;
            }
            for (axis, at) in at.into_iter().enumerate() {
                corners[0][axis] = corners[0][axis].min(at);
                corners[1][axis] = corners[1][axis].max(at);
            }
        }
        if batch.is_empty() || !all {
            return Ok(());
        }
    }
}

/// The box of what a box becomes. None where no point of it has an image.
pub fn image(transform: &PointTransform, [lo, hi]: [[f64; 3]; 2]) -> Option<[[f64; 3]; 2]> {
    let [mut low, mut high] = NOWHERE;
    let at =
        |axis: usize, part: usize| lo[axis] + (hi[axis] - lo[axis]) * (part as f64 / ALONG as f64);
    let each = (0..=ALONG).flat_map(|x| (0..=ALONG).flat_map(move |y| [(x, y, 0), (x, y, ALONG)]));
    for (x, y, z) in each {
        let Ok(image) = transform.apply([at(0, x), at(1, y), at(2, z)]) else { continue };
        for (axis, image) in image.into_iter().enumerate() {
            (low[axis], high[axis]) = (low[axis].min(image), high[axis].max(image));
        }
    }
    let changed = if transform.heights().is_none() { 2 } else { 3 };
    for (low, high) in low.iter_mut().zip(&mut high).take(changed) {
        let more = (*high - *low) * BULGE;
        (*low, *high) = (*low - more, *high + more);
    }
    (low[0] <= high[0]).then_some([low, high])
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
