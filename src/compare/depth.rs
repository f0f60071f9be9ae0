//! Two scans as depth images, pixel beside pixel: the paper's equations 4 and 5.
//!
//! Each scan streams by twice, for its box and for the mean depths of its pixels, so two scans of
//! any size need no more memory than two images. Sums are of whole numbers: the figures are the
//! same in whatever order points come.

use std::fmt;
use std::sync::{Arc, Mutex};

use serde::Serialize;

use super::left_out::looked_at;
use crate::engine::Watch;
use crate::geom::depth::{DepthSums, Raster};
use crate::graph::{Graph, Nonfinite, Overrides, RunSettings};
use crate::host::lock;
use crate::host::process::default_memory;
use crate::io::ends::{Discard, Read};
use crate::language::Registry;
use crate::ops::Axis;
use crate::point::{Bounds, PointBatch, Position, Selection};
use crate::report::{Grouped, Short, Tally};
use crate::stage::{Needs, Role, Transform};
use crate::{Error, ErrorKind, Result};

/// Parts of a unit that coordinates are rounded to: 2^-24.
const PARTS: f64 = 16_777_216.0;
/// Most pixels along a side of an image.
pub const MOST_PIXELS: usize = 1 << 15;

/// How two scans are seen.
#[derive(Debug, Clone)]
pub struct DepthSettings {
    /// The axis that one looks along.
    pub axis: Axis,
    /// Pixels along the longer side of the box of both scans, 1 to 32,768.
    pub pixels: usize,
    /// Memory, threads; and which points are not to be looked at, being noise or withheld.
    pub run: RunSettings,
}

/// What two depth images differ by, in units of the scans.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DepthErrors {
    /// The axis that one looked along.
    pub axis: Axis,
    /// Side of a pixel.
    pub pixel: f64,
    /// Points of the first scan, and pixels that have some.
    pub first: DepthCounts,
    /// The same of the second.
    pub second: DepthCounts,
    /// Pixels that both have points in: the XY of the paper.
    pub both: u64,
    /// Sum of the squared differences of their mean depths (equation 4).
    pub ssd: f64,
    /// √(SSD / XY) (equation 5).
    pub rms: f64,
    /// Mean of the differences without their signs.
    pub mean: f64,
    /// The largest of these.
    pub max: f64,
}

/// What there is of one image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct DepthCounts {
    /// Points that were looked at.
    pub points: u64,
    /// Pixels that have points.
    pub pixels: u64,
}

/// Compares two scans as depth images: the sum of the squared differences of their depths, and the
/// root of their mean square (the paper's equations 4 and 5).
///
/// Both are seen along an axis, in square pixels of which `pixels` cover the longer side of the box
/// of both. A pixel's depth is the mean coordinate, along the axis, of the points in it; what has
/// no points of one of the scans plays no part, and is counted. Coordinates are rounded to 2^-24
/// units.
///
/// ```
/// use pointmill::compare::{DepthSettings, depth_errors};
/// use pointmill::ops::Axis;
/// use pointmill::{Graph, Overrides, Quiet, Registry};
///
/// let at = std::env::temp_dir().join(format!("pointmill-depth-{}", std::process::id()));
/// std::fs::create_dir_all(&at)?;
/// let path = |name: &str| at.join(name).to_str().unwrap().to_owned();
/// let (scan, up) = (path("scan.ply"), path("up.ply"));
/// let registry = Registry::builtin();
/// for line in [
///     format!("synth scene=plane points=5000 ! write path=\"{scan}\""),
///     format!("read path=\"{scan}\" ! transform translate=[0,0,2] ! write path=\"{up}\""),
/// ] {
///     Graph::parse_line(&line, &registry)?.plan(&Overrides::default())?.run(&Quiet)?;
/// }
/// let settings = DepthSettings { axis: Axis::Z, pixels: 64, run: Default::default() };
/// let errors = depth_errors(&[scan], &[up], &settings, &registry, &Quiet)?;
/// assert!((errors.rms - 2.0).abs() < 1e-6);
/// assert_eq!(errors.both, errors.first.pixels);
/// std::fs::remove_dir_all(&at)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// Files that cannot be read, coordinates beyond 2^38 units, a number of pixels out of bounds, and
/// a memory that two images do not fit in.
pub fn depth_errors(
    first: &[String],
    second: &[String],
    settings: &DepthSettings,
    registry: &Registry,
    watch: &dyn Watch,
) -> Result<DepthErrors> {
    let side = settings.pixels;
    if !(1..=MOST_PIXELS).contains(&side) {
        let told = format!("`compare.pixels` must be 1 to {MOST_PIXELS}, not {side}");
        return Err(Error::pipeline(told));
    }
    let run = leftover(&settings.run, side)?;
    let see = |paths: &[String], pass: DepthPass| -> Result<SeenDepths> {
        let seen = Arc::new(Mutex::new(SeenDepths::new(pass)));
        let open = Read { path: paths.to_vec(), ..Read::default() }.source(registry.formats())?;
        let mut graph = Graph::new(run.clone());
        let source = graph.add("read", Role::Source(open), &[]);
        let looked = looked_at(run.noise, Some(run.withheld));
        let stage = See { seen: seen.clone(), pass, looked, nonfinite: run.nonfinite };
        let stage = graph.add("compare", Role::Transform(Box::new(stage)), &[source]);
        graph.add("discard", Role::Sink(Box::new(Discard {})), &[stage]);
        graph.plan(&Overrides::default())?.run(watch)?;
        let seen = std::mem::replace(&mut *lock(&seen), SeenDepths::new(DepthPass::ForBounds));
        Ok(seen)
    };
    let boxes = [see(first, DepthPass::ForBounds)?, see(second, DepthPass::ForBounds)?];
    let corners = boxes.iter().filter(|seen| !seen.bounds.is_empty());
    let bounds = Bounds::of(corners.flat_map(|seen| [seen.bounds.lo, seen.bounds.hi]));
    let raster = Raster::over(&bounds, settings.axis as usize, side);
    let images = [see(first, DepthPass::At(raster))?, see(second, DepthPass::At(raster))?];
    difference(&images, &raster, settings.axis).ok_or_else(|| {
        let told = "no pixel has points of both scans: there is nothing to compare";
        Error::new(ErrorKind::Data, told).help("give two scans of one place, or fewer pixels")
    })
}

/// The settings of the runs, with the memory that two images leave.
fn leftover(run: &RunSettings, side: usize) -> Result<RunSettings> {
    let memory = run.memory.unwrap_or_else(default_memory);
    let images = (side * side * 2 * (DepthSums::BYTES + size_of::<f64>())) as u64;
    let left = memory.checked_sub(images).ok_or_else(|| {
        let told = format!("two images of {side} x {side} pixels need {} MiB", (images >> 20) + 1);
        let help = format!("give `run.memory = \"{}MiB\"` or more", (images >> 20) + 64);
        Error::memory(told).help(help)
    })?;
    Ok(RunSettings { memory: Some(left), ..run.clone() })
}

/// What a scan is streamed by for.
#[derive(Debug, Clone, Copy)]
enum DepthPass {
    ForBounds,
    At(Raster),
}

/// What was seen of a scan.
struct SeenDepths {
    points: u64,
    bounds: Bounds,
    depths: Option<DepthSums>,
}

impl SeenDepths {
    fn new(pass: DepthPass) -> Self {
        let depths = match pass {
            DepthPass::ForBounds => None,
            DepthPass::At(raster) => Some(DepthSums::new(raster.side * raster.side)),
        };
        SeenDepths { points: 0, bounds: Bounds::EMPTY, depths }
    }
}

/// Sees the points that stream by.
struct See {
    seen: Arc<Mutex<SeenDepths>>,
    pass: DepthPass,
    /// The points that are looked at.
    looked: Selection,
    /// What becomes of points that are not finite.
    nonfinite: Nonfinite,
}

impl Transform for See {
    fn needs(&self) -> Needs {
        let needs = Needs::none().looks_at(crate::point::names::XYZ);
        needs.looks_at_if_there(self.looked.names())
    }

    fn apply(&self, batch: &mut PointBatch, _: &mut Tally) -> Result<()> {
        let schema = batch.schema();
        let axes = schema.coordinates().ok_or_else(|| Error::internal("no coordinates"))?;
        let mut positions: Vec<Position> = Vec::with_capacity(batch.len());
        let chosen = self.looked.of(schema);
        for record in batch.iter().filter(|record| chosen.holds(record)) {
            let world = axes.map(|axis| axis.world(record, schema.endian));
            if world.iter().all(|v| v.is_finite()) {
                positions.push(rounded(world)?);
            } else if self.nonfinite == Nonfinite::Refuse {
                let told = format!("the point {world:?} is not finite");
                let help = "`run.nonfinite = \"drop\"` leaves such points out";
                return Err(Error::new(ErrorKind::Data, told).help(help));
            }
        }
        let mut seen = lock(&self.seen);
        seen.points += positions.len() as u64;
        match (self.pass, &mut seen.depths) {
            (DepthPass::At(raster), Some(depths)) => {
                positions.iter().for_each(|&p| depths.add(raster.pixel_of(p), raster.depth(p)));
            }
            _ => positions.iter().for_each(|&p| seen.bounds.add(p)),
        }
        Ok(())
    }
}

/// World coordinates in parts of a unit.
fn rounded(world: [f64; 3]) -> Result<Position> {
    let parts = world.map(|v| (v * PARTS).round_ties_even());
    match parts.iter().all(|v| v.abs() < 2f64.powi(62)) {
        true => Ok(parts.map(|v| v as i64)),
        false => {
            let told = format!("the point {world:?} is farther than 2^38 units away");
            Err(Error::new(ErrorKind::Data, told))
        }
    }
}

/// None where no pixel has points of both.
fn difference(
    [first, second]: &[SeenDepths; 2],
    raster: &Raster,
    axis: Axis,
) -> Option<DepthErrors> {
    let means = |seen: &SeenDepths| seen.depths.as_ref().map_or(Vec::new(), DepthSums::means);
    let (f, g) = (means(first), means(second));
    let pixels = |of: &[f64]| of.iter().filter(|v| !v.is_nan()).count() as u64;
    let (mut both, mut ssd, mut sum, mut max) = (0, 0.0, 0.0, 0f64);
    for (f, g) in f.iter().zip(&g).filter(|(f, g)| !f.is_nan() && !g.is_nan()) {
        let far = (f - g).abs() / PARTS;
        both += 1;
        ssd += far * far;
        sum += far;
        max = max.max(far);
    }
    (both > 0).then(|| DepthErrors {
        axis,
        pixel: raster.pixel as f64 / PARTS,
        first: DepthCounts { points: first.points, pixels: pixels(&f) },
        second: DepthCounts { points: second.points, pixels: pixels(&g) },
        both,
        ssd,
        rms: (ssd / both as f64).sqrt(),
        mean: sum / both as f64,
        max,
    })
}

impl fmt::Display for DepthErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axis = ["x", "y", "z"][self.axis as usize];
        writeln!(f, "image      along {axis}, pixels of {}", Short(self.pixel))?;
        for (name, of) in [("first ", self.first), ("second", self.second)] {
            let (points, pixels) = (Grouped(of.points), Grouped(of.pixels));
            writeln!(f, "{name}     {points} points in {pixels} pixels")?;
        }
        writeln!(f, "both       {} pixels have points of both", Grouped(self.both))?;
        let [ssd, rms, mean, max] = [self.ssd, self.rms, self.mean, self.max].map(Short);
        write!(f, "depth      SSD {ssd}, RMS {rms}, mean {mean}, max {max}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(raster: Raster, points: &[Position]) -> SeenDepths {
        let mut seen = SeenDepths::new(DepthPass::At(raster));
        seen.points = points.len() as u64;
        let depths = seen.depths.as_mut().unwrap();
        points.iter().for_each(|&p| depths.add(raster.pixel_of(p), raster.depth(p)));
        seen
    }

    #[test]
    fn pixels_of_both_are_compared_by_the_equations_of_the_paper() {
        let unit = PARTS as i64;
        let bounds = Bounds { lo: [0; 3], hi: [4 * unit - 1, 4 * unit - 1, 100 * unit] };
        let raster = Raster::over(&bounds, 2, 4);
        let at = |x: i64, z: i64| [x * unit, 0, z * unit];
        let first = seen(raster, &[at(0, 1), at(0, 3), at(1, 5), at(2, 9)]);
        let second = seen(raster, &[at(0, 5), at(1, 1), at(3, 7)]);
        let errors = difference(&[first, second], &raster, Axis::Z).unwrap();
        // (2 - 5)² + (5 - 1)² over two pixels.
        assert_eq!((errors.both, errors.ssd, errors.max), (2, 25.0, 4.0));
        assert_eq!(errors.rms, 12.5f64.sqrt());
        assert_eq!((errors.first.pixels, errors.second.pixels), (3, 3));
        let none = difference(&[seen(raster, &[at(0, 1)]), seen(raster, &[])], &raster, Axis::Z);
        assert_eq!(none, None);
    }

    #[test]
    fn what_lies_too_far_away_is_told() {
        assert!(rounded([0.0, 2f64.powi(38), 0.0]).is_err());
        assert_eq!(rounded([1.0, -0.5, 0.0]).unwrap(), [1 << 24, -(1 << 23), 0]);
    }
}
