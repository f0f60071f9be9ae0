//! The stages `wavelet` and `fourier`: the scan as a depth image, and of it what a transform keeps.
//!
//! Both make blocks of pixels: the squares in which no coefficient is left, and the cells of as
//! many waves as are left. A block is told by one number, so one point of it stays, and goes to the
//! depth that the image has without the rest. What differs is [`Transformed`]; all else is here.

mod fourier;
mod wavelet;

use serde_json::Value;

use super::cells::Keep;
use super::removal::{keep_once, represent_at};
use super::whole::Rows;
use crate::geom::depth::{DepthSums, Raster, fill};
use crate::point::{Bounds, Position, SHIFT, names};
use crate::quantity::{Axis, Whole};
use crate::report::{Grouped, Tally};
use crate::stage::{Gathered, Needs, Role, ScanFacts, ScanOp, StagePlace, TileOp};
use crate::tile::Tile;
use crate::{Error, Result};

pub use fourier::Fourier;
pub use wavelet::Wavelet;

/// Fewest and most pixels along a side.
const FEWEST_PIXELS: u64 = 16;
const MOST_PIXELS: u64 = 8192;
/// Pixels along a side where nothing is said.
const PIXELS: Pixels = Whole::of(1024);
/// Bytes that a position of the scan takes while the image is looked at, and then.
const HELD_BYTES: usize = size_of::<Position>() + size_of::<Decided>();
/// Bytes of a pixel while the most is held of it: its depth, whether it has points, and the means
/// of the squares around it, a third more than pixels.
const PIXEL_BYTES: usize = 32;

/// How many pixels an image has along its side.
pub type Pixels = Whole<FEWEST_PIXELS, MOST_PIXELS>;

/// A transform of a depth image, which says what of it is left.
trait Transformed: Send + Sync {
    const KIND: &'static str;
    /// The count of records that it moves, in the report.
    const MOVED: &'static str;

    /// Transforms an image, of whose pixels those that `is_there` have points; drops of the
    /// transform what must go for `most` blocks with points, and transforms it back.
    fn reduce(image: &mut [f64], side: usize, is_there: &[bool], most: u64) -> Blocks;
}

/// What is told by one number each.
struct Blocks {
    /// The block of each pixel.
    of_pixel: Vec<u32>,
    /// Where the centres of blocks are, in pixels, found by a block's number.
    center: Box<dyn Fn(u32) -> [f64; 2]>,
    /// What was decided, for the report.
    decisions: Vec<(String, Value)>,
}

/// A stage by transform `T`.
struct ImageReduction<T> {
    keep: Keep,
    axis: Axis,
    /// Pixels along a side, a power of two.
    side: usize,
    moves: bool,
    bounds: Bounds,
    step: f64,
    found: Option<Rows<Decided>>,
    decisions: Vec<(String, Value)>,
    transform: std::marker::PhantomData<fn() -> T>,
}

/// What becomes of a position, in steps.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Decided {
    /// How far it is from the depth that is left of it; NaN if it stays.
    deviation: f64,
    /// How far it goes along the axis, if it stays.
    shift: f64,
}

/// The stage with these keys; names the key to blame.
fn build<T: Transformed + 'static>(
    at: &StagePlace,
    (keep, axis, pixels, moves): (Keep, Axis, Pixels, bool),
) -> Result<Role> {
    let kind = T::KIND;
    keep.check_given(kind, at)?;
    let side = pixels.get() as usize;
    if !side.is_power_of_two() {
        let told = format!("`{kind}.pixels` must be a power of two, not {side}");
        let (less, more) = (side.next_power_of_two() / 2, side.next_power_of_two());
        let error = Error::pipeline(told).help(format!("write {less} or {more}"));
        return Err(at.blame("pixels", error));
    }
    let transform = std::marker::PhantomData;
    let (bounds, step, found) = (Bounds::EMPTY, 1.0, None);
    let decisions = Vec::new();
    let stage =
        ImageReduction::<T> { keep, axis, side, moves, bounds, step, found, decisions, transform };
    Ok(Role::ScanOp(Box::new(stage)))
}

impl<T: Transformed> TileOp for ImageReduction<T> {
    fn needs(&self) -> Needs {
        let needs = Needs::none().looks_at(names::XYZ).removes(None).measures();
        if self.moves { needs.moves() } else { needs }
    }

    fn for_share(&mut self, share: f64) {
        self.keep.for_share(share);
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        (self.bounds, self.step) = (scan.bounds, scan.lattice.step);
        Ok(())
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let unfound = || Error::internal(format!("the stage {} ran before its image", T::KIND));
        let rows = self.found.as_ref().ok_or_else(unfound)?;
        let mut shifts = if self.moves { Some(tile.columns.take(&SHIFT)?) } else { None };
        shifts.iter_mut().for_each(|shifts| shifts.fill([0.0; 3]));
        let (mut moved, mut coincident, mut represented) = (0, 0, 0);
        rows.each_of_core(tile, |tile, i, at| {
            let Decided { deviation, shift } = rows.values[at];
            if !deviation.is_nan() {
                represented += represent_at(tile, i, deviation as f32);
                return;
            }
            coincident += keep_once(tile, i);
            if let Some(shifts) = &mut shifts {
                shifts[i][self.axis as usize] = shift * self.step;
                moved += u64::from(shift != 0.0);
            }
        })?;
        if let Some(shifts) = shifts {
            tile.columns.put(shifts);
            tally.count(T::MOVED, moved);
        }
        tally.remove(T::KIND, "coincident", coincident);
        tally.remove(T::KIND, "represented", represented);
        Ok(())
    }

    fn decisions(&self) -> Vec<(String, Value)> {
        self.decisions.clone()
    }
}

impl<T: Transformed> ScanOp for ImageReduction<T> {
    type Summary = Rows<()>;

    fn gather_needs(&self) -> Needs {
        let pixels = (self.side * self.side * PIXEL_BYTES) as u64;
        let needs = Needs::none().looks_at(names::XYZ).bytes_per_point(2 * Rows::<()>::BYTES);
        needs.holds(HELD_BYTES).holds_besides(pixels)
    }

    fn gather(&self, tile: &mut Tile, _: &mut Tally) -> Result<Rows<()>> {
        Ok(Rows::of_core(tile, |_| ()))
    }

    fn conclude(&mut self, gathered: &dyn Gathered<Rows<()>>) -> Result<Option<String>> {
        let most = self.keep.of(gathered.records()).max(1);
        let rows = Rows::of_scan(gathered)?;
        let raster = Raster::over(&self.bounds, self.axis as usize, self.side);
        let mut image = image(&raster, &rows.positions);
        let is_there: Vec<bool> = image.iter().map(|depth| !depth.is_nan()).collect();
        fill(&mut image, self.side);
        let blocks = T::reduce(&mut image, self.side, &is_there, most);
        self.decisions = vec![("pixel".into(), (raster.pixel as f64 * self.step).into())];
        self.decisions.extend(blocks.decisions.iter().cloned());
        let decided = decide(&raster, &rows.positions, &image, &blocks, self.moves);
        let kept = decided.iter().filter(|decided| decided.deviation.is_nan()).count() as u64;
        let (kind, pixels) = (T::KIND, is_there.iter().filter(|there| **there).count() as u64);
        self.found = Some(rows.with(decided));
        Ok((pixels < most).then(|| {
            let (kept, most, pixels) = (Grouped(kept), Grouped(most), Grouped(pixels));
            format!(
                "`{kind}` keeps {kept} points, and not {most}: its image has {pixels} pixels with \
                 points; raise `{kind}.pixels`"
            )
        }))
    }
}

/// The mean depths of positions; NaN where there are none.
fn image(raster: &Raster, positions: &[Position]) -> Vec<f64> {
    let mut sums = DepthSums::new(raster.side * raster.side);
    positions.iter().for_each(|&p| sums.add(raster.pixel_of(p), raster.depth(p)));
    sums.means()
}

/// Keeps of each block the position nearest to its centre, of equally near ones the first in Morton
/// order, and measures all by the image that is left.
fn decide(
    raster: &Raster,
    positions: &[Position],
    image: &[f64],
    blocks: &Blocks,
    moves: bool,
) -> Vec<Decided> {
    const NONE: u32 = u32::MAX;
    let mut nearest = vec![NONE; image.len()];
    for (i, &p) in positions.iter().enumerate() {
        let block = blocks.of_pixel[raster.pixel_of(p)];
        let center = (blocks.center)(block);
        let best = &mut nearest[block as usize];
        let far = |p: Position| raster.distance2(p, center);
        if *best == NONE || far(p) < far(positions[*best as usize]) {
            *best = i as u32;
        }
    }
    let decided = |(i, &p): (usize, &Position)| {
        let pixel = raster.pixel_of(p);
        let to = image[pixel].round_ties_even() - raster.depth(p) as f64;
        match nearest[blocks.of_pixel[pixel] as usize] == i as u32 {
            true => Decided { deviation: f64::NAN, shift: if moves { to } else { 0.0 } },
            false => Decided { deviation: to.abs(), shift: 0.0 },
        }
    };
    positions.iter().enumerate().map(decided).collect()
}
