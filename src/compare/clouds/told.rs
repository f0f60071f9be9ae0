//! How far two scans are from each other.

use std::fmt;

use serde::Serialize;

use super::measured::MeasuredKind;
use super::walk::MeasuredCloud;
use crate::report::{Coordinate, Grouped, Long};
use crate::stage::Lattice;

/// How far the points of two scans are from each other, both ways, in the unit of the scans.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CloudDistances {
    /// Of the points of the first scan; None where one of the scans has no point.
    pub first_to_second: Option<CloudDirection>,
    /// Of the points of the second scan; None where one of the scans has no point.
    pub second_to_first: Option<CloudDirection>,
    /// The larger of both largest distances to the nearest point: the Hausdorff distance.
    pub hausdorff: Option<f64>,
    /// The sign of the unit of all lengths, where the scans say it.
    pub unit: Option<&'static str>,
    /// Step of the lattice that distances are measured on: coordinates are rounded to it.
    pub step: f64,
    /// The step that places are told to.
    #[serde(skip)]
    pub(super) told_to: f64,
}

/// How far the points of one scan are from another.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CloudDirection {
    /// From the nearest point of the other scan.
    pub nearest: CloudFigures,
    /// From the least-squares plane of the 8 nearest points of the other scan; where these are
    /// fewer than 5 or almost on a line, from the nearest. A point that the other scan has, too, is
    /// on its surface.
    pub plane: CloudFigures,
}

/// Distances in the scan's unit, or angles in degrees. Percentiles are upper edges of bins of 1 %.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CloudFigures {
    /// Of how many points.
    pub points: u64,
    /// Their mean.
    pub mean: f64,
    /// Root of their mean square.
    pub rms: f64,
    /// The median.
    pub p50: f64,
    /// What 95 of 100 are no farther than.
    pub p95: f64,
    /// What 99 of 100 are no farther than.
    pub p99: f64,
    /// The largest.
    pub max: f64,
    /// World coordinates of the point that has it.
    pub at: [f64; 3],
}

impl CloudFigures {
    fn of(measured: &MeasuredKind, lattice: &Lattice) -> Option<CloudFigures> {
        CloudFigures::scaled(measured, lattice, lattice.step)
    }

    /// The figures in units of which what was measured is so many.
    pub(super) fn scaled(
        measured: &MeasuredKind,
        lattice: &Lattice,
        unit: f64,
    ) -> Option<CloudFigures> {
        let deviations = &measured.deviations.deviations;
        let (max, at) = deviations.largest()?;
        let length = |figure: f64| figure * unit;
        let deviation = |percent| measured.deviations.percentile(percent).map(f64::from);
        let percentile = |percent| deviation(percent).map(length);
        let points = deviations.count();
        Some(CloudFigures {
            points,
            mean: length(measured.sum.value() / points as f64),
            rms: length(deviations.rms()?),
            p50: percentile(50)?,
            p95: percentile(95)?,
            p99: percentile(99)?,
            max: length(f64::from(max)),
            at: lattice.world(at),
        })
    }
}

impl CloudDirection {
    pub(super) fn of(measured: &MeasuredCloud, lattice: &Lattice) -> Option<CloudDirection> {
        let nearest = CloudFigures::of(&measured.nearest, lattice)?;
        Some(CloudDirection { nearest, plane: CloudFigures::of(&measured.plane, lattice)? })
    }
}

impl CloudDistances {
    /// The larger of a figure of both directions, as it is called in rules.
    pub(in crate::compare) fn larger(&self, of: impl Fn(&CloudFigures) -> f64) -> Option<f64> {
        let [a, b] = [self.first_to_second?, self.second_to_first?];
        Some(of(&a.nearest).max(of(&b.nearest)))
    }

    fn line(&self, f: &mut fmt::Formatter<'_>, name: &str, figures: &CloudFigures) -> fmt::Result {
        let long = |length: f64| Long(length, self.unit);
        write!(
            f,
            "  {name:<9}mean {}, RMS {}, 50 % ≤ {}, 95 % ≤ {}, 99 % ≤ {}, max {}",
            long(figures.mean),
            long(figures.rms),
            long(figures.p50),
            long(figures.p95),
            long(figures.p99),
            long(figures.max),
        )?;
        if figures.max == 0.0 {
            return writeln!(f);
        }
        let [x, y, z] = figures.at.map(|at| Coordinate { at, step: self.told_to });
        writeln!(f, " at ({x}, {y}, {z})")
    }
}

impl fmt::Display for CloudDistances {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let directions = [
            ("first", "second", &self.first_to_second),
            ("second", "first", &self.second_to_first),
        ];
        for (one, other, direction) in directions {
            let Some(CloudDirection { nearest, plane }) = direction else { continue };
            let points = Grouped(nearest.points);
            writeln!(f, "distances  of {points} points of the {one} from those of the {other}")?;
            self.line(f, "nearest", nearest)?;
            self.line(f, "plane", plane)?;
        }
        match self.hausdorff {
            Some(hausdorff) => write!(f, "Hausdorff  {}", Long(hausdorff, self.unit)),
            None => write!(f, "distances  none: a scan without points is nowhere"),
        }
    }
}
