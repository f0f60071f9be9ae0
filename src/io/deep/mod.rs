//! What all points of a file come to, for `info --deep`: each is looked at once, by several
//! threads, and what they count is the same however they share the points out.

mod cells;
mod spread;

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{describe, sniff};
use crate::expression::NamedField;
use crate::point::{Dimension, PointBatch, Schema, names};
use crate::report::{DimensionFigures, StatsTally, StoredNumbers, class_name};
use crate::stage::{Formats, PointWalk, ReadKeys, Source};
use crate::{Error, Result};
use cells::{CELL_BYTES, OccupiedCells};
use spread::{SPREAD_BYTES, ValueSpread};

/// Returns that a point can be one of, 0 included.
const RETURNS: usize = 16;
/// Shares of points of which quantiles tell, 0 to 1.
const QUANTILES: [f64; 9] = [0.0, 0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1.0];

/// What all points of a file come to.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DeepFigures {
    /// How many there are.
    pub points: u64,
    /// How dense they are, as seen from above; none where they are too few to tell, or have no
    /// place.
    pub density: Option<DensityFigures>,
    /// What the numbers of each dimension come to, in world units, in the order of the records.
    pub dimensions: Vec<DeepDimension>,
    /// Points by return number and by number of returns, where they have them.
    pub returns: Vec<ReturnCount>,
    /// Points by class, where they have one.
    pub classes: Vec<ClassCount>,
    /// Of heights and intensities, the shares below which points are.
    pub quantiles: Vec<QuantileFigures>,
}

/// How dense points are, as seen from above.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DensityFigures {
    /// Points in a square of one unit, of the squares that have points.
    pub points_per_square: f64,
    /// The square root of the area of a point.
    pub spacing: f64,
    /// The sign of the unit; none where the reference system does not tell it.
    pub unit: Option<&'static str>,
    /// Side of the squares that were counted.
    pub cell: f64,
    /// How many of these have points.
    pub cells: u64,
}

/// What the numbers of a dimension come to.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DeepDimension {
    /// Its name.
    pub name: String,
    /// Smallest, largest and mean; none without finite numbers.
    pub min: Option<f64>,
    /// See `min`.
    pub max: Option<f64>,
    /// See `min`.
    pub mean: Option<f64>,
    /// Standard deviation.
    pub deviation: Option<f64>,
    /// How many values there are, of dimensions of whole numbers near each other.
    pub distinct: Option<u64>,
    /// How many points have the flag, of dimensions of one bit.
    pub set: Option<u64>,
    /// Points whose number is not finite.
    pub not_finite: u64,
}

/// Points by return.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ReturnCount {
    /// The number.
    pub number: usize,
    /// Points that are this return of their pulse.
    pub points: u64,
    /// Points whose pulse has so many returns.
    pub of_pulses: u64,
}

/// Points of a class.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ClassCount {
    /// The class.
    pub class: u8,
    /// Its name, if the LAS specification has one.
    pub name: Option<&'static str>,
    /// How many.
    pub points: u64,
}

/// The shares of points below values of a dimension.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct QuantileFigures {
    /// The dimension.
    pub name: &'static str,
    /// Shares, 0 to 1, and the values below which so many points are.
    pub values: Vec<[f64; 2]>,
}

/// Reads all points of the file at `path` and says what they come to; which of `formats` it is, its
/// first bytes tell.
///
/// ```
/// use pointmill::stage::PointWalk;
/// use pointmill::{Registry, io};
///
/// let path = std::env::temp_dir().join(format!("pointmill-deep-{}.csv", std::process::id()));
/// std::fs::write(&path, "x,y,z\n0,0,1\n1,0,2\n0,1,6\n")?;
/// let figures = io::deep(&path, Registry::builtin().formats(), &PointWalk::default())?;
/// assert_eq!((figures.points, figures.dimensions[2].mean), (3, Some(3.0)));
/// # std::fs::remove_file(&path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// A file of no format among `formats`, points that cannot be read, a memory that does not do.
pub fn deep(path: &Path, formats: &Formats, walk: &PointWalk<'_>) -> Result<DeepFigures> {
    let format = describe::format_of(path, formats)?;
    let told = |error| sniff::told(error, &**format, formats);
    let files: [PathBuf; 1] = [path.to_owned()];
    let source = format.open(&files, &ReadKeys::default()).map_err(told)?;
    look(&*source, walk)
}

/// What a thread counted.
#[derive(Debug, Default)]
struct DeepSeen {
    stats: StatsTally,
    cells: OccupiedCells,
    height: ValueSpread,
    intensity: ValueSpread,
    /// Return numbers, numbers of returns.
    returns: [[u64; RETURNS]; 2],
    classes: Vec<u64>,
    failed: Option<Error>,
}

fn look(source: &dyn Source, walk: &PointWalk<'_>) -> Result<DeepFigures> {
    let schema = source.schema();
    let own = CELL_BYTES + 2 * SPREAD_BYTES + 4096 * schema.dimensions.len() as u64;
    let seen = walk.each_batch(
        source,
        &[],
        own,
        DeepSeen::default,
        |seen, _, _, batch| {
            if let Err(error) = seen.see(batch) {
                seen.failed.get_or_insert(error);
            }
        },
        |_, _, error| Err(error),
    )?;
    let mut all = DeepSeen::default();
    for one in seen {
        match one.failed {
            Some(error) => return Err(error),
            None => all.merge(one),
        }
    }
    Ok(all.figures(schema, source.metadata().units.sign()))
}

impl DeepSeen {
    fn see(&mut self, batch: &PointBatch) -> Result<()> {
        let schema = batch.schema();
        self.stats.points += batch.len() as u64;
        for (number, dimension) in schema.dimensions.iter().enumerate() {
            let field = NamedField::find(&dimension.name, batch)?;
            let ([scale, origin], whole) = (field.units(), field.is_whole());
            let stats = self.stats.dimension(number, &dimension.name);
            field.each(batch, |stored| stats.add(StoredNumbers { stored, scale, origin, whole }));
        }
        let find = |name| schema.find(name);
        let (number, of) = (find(names::RETURN_NUMBER), find(names::NUMBER_OF_RETURNS));
        let (class, intensity) = (find(names::CLASSIFICATION), find(names::INTENSITY));
        let axes = schema.coordinates();
        for record in batch.iter() {
            let value = |dimension: &Dimension| dimension.world(record, schema.endian);
            if let Some([x, y, z]) = axes.map(|axes| axes.map(value)) {
                if x.is_finite() && y.is_finite() {
                    self.cells.add(x, y);
                }
                spread(&mut self.height, z);
            }
            if let Some(intensity) = intensity {
                spread(&mut self.intensity, value(intensity));
            }
            for (counts, field) in self.returns.iter_mut().zip([number, of]) {
                if let Some(field) = field {
                    counts[(value(field).max(0.0) as usize).min(RETURNS - 1)] += 1;
                }
            }
            if let Some(class) = class {
                self.classes.resize(256, 0);
                self.classes[usize::from(value(class) as u8)] += 1;
            }
        }
        Ok(())
    }

    fn merge(&mut self, other: DeepSeen) {
        self.stats.merge(&other.stats);
        self.cells.merge(other.cells);
        self.height.merge(other.height);
        self.intensity.merge(other.intensity);
        for (mine, theirs) in
            self.returns.as_flattened_mut().iter_mut().zip(other.returns.as_flattened())
        {
            *mine += theirs;
        }
        self.classes.resize(self.classes.len().max(other.classes.len()), 0);
        self.classes.iter_mut().zip(&other.classes).for_each(|(mine, theirs)| *mine += theirs);
    }

    fn figures(&self, schema: &Schema, unit: Option<&'static str>) -> DeepFigures {
        let points = self.stats.points;
        let density = self.cells.counted(points).map(|(cell, cells)| {
            let area = cells as f64 * cell * cell;
            let points_per_square = points as f64 / area;
            DensityFigures {
                points_per_square,
                spacing: (1.0 / points_per_square).sqrt(),
                unit,
                cell,
                cells,
            }
        });
        let figures = self.stats.figures("").dimensions;
        let dimensions = figures.into_iter().zip(&schema.dimensions);
        let [numbers, of] = &self.returns;
        let returns = (0..RETURNS)
            .map(|n| ReturnCount { number: n, points: numbers[n], of_pulses: of[n] })
            .filter(|count| count.points + count.of_pulses > 0);
        let classes = (0..=u8::MAX).zip(&self.classes).filter(|(_, points)| **points > 0);
        let quantiles = |name, spread: &ValueSpread| {
            let values = spread.quantiles(&QUANTILES)?;
            let values = QUANTILES.into_iter().zip(values).map(|(share, value)| [share, value]);
            Some(QuantileFigures { name, values: values.collect() })
        };
        let spreads = [(names::XYZ[2], &self.height), (names::INTENSITY, &self.intensity)];
        DeepFigures {
            points,
            density,
            dimensions: dimensions.map(|((_, figures), own)| of_dimension(own, figures)).collect(),
            returns: returns.collect(),
            classes: classes
                .map(|(class, points)| ClassCount {
                    class,
                    name: class_name(class),
                    points: *points,
                })
                .collect(),
            quantiles: spreads.into_iter().filter_map(|(n, spread)| quantiles(n, spread)).collect(),
        }
    }
}

fn spread(spread: &mut ValueSpread, value: f64) {
    if value.is_finite() {
        spread.add(value);
    }
}

fn of_dimension(dimension: &Dimension, figures: DimensionFigures) -> DeepDimension {
    let values = figures.histogram.as_ref().filter(|bins| bins.width == 1.0);
    let is_whole =
        !dimension.scalar.is_float() && (dimension.scale, dimension.origin) == (1.0, 0.0);
    let distinct = values.filter(|_| is_whole);
    let distinct = distinct.map(|bins| bins.counts.iter().filter(|n| **n > 0).count() as u64);
    let is_flag = is_whole && dimension.bits.is_some_and(|bits| bits.width == 1);
    let set = values.filter(|_| is_flag).map(|bins| match bins.counts[..] {
        [_] if bins.from == 0.0 => 0,
        _ => bins.counts.last().copied().unwrap_or(0),
    });
    DeepDimension {
        name: dimension.name.clone(),
        min: figures.min,
        max: figures.max,
        mean: figures.mean,
        deviation: figures.deviation,
        distinct,
        set,
        not_finite: figures.not_finite,
    }
}
