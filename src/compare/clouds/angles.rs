//! What angles the normals of two scans have.

use std::fmt;

use serde::Serialize;

use super::normals::MeasuredNormals;
use super::told::CloudFigures;
use crate::report::{Coordinate, Grouped, Short};
use crate::stage::Lattice;

/// The angles between the normals of points and those of the nearest point of the other scan, both
/// ways.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct NormalAngles {
    /// Of the points of the first scan; None where one of the scans has no point.
    pub first_to_second: Option<NormalDirection>,
    /// Of the points of the second scan; None where one of the scans has no point.
    pub second_to_first: Option<NormalDirection>,
    /// The step that places are told to.
    #[serde(skip)]
    pub(super) told_to: f64,
}

/// What angles the normals of one scan have with those of another. Of points that share a position
/// the first in canonical order tells the normal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct NormalDirection {
    /// In degrees from 0 to 90: as the signs of normals are arbitrary where nothing oriented them,
    /// they play no part. None where no point has an angle.
    pub angles_deg: Option<CloudFigures>,
    /// Points whose normal points to the other side than that of the nearest point, by more than 90
    /// degrees: 0 where both scans are oriented alike, about half of all where one is not oriented.
    pub opposed: u64,
    /// Points without an angle, since their normal or that of the nearest point is 0 or no number.
    pub without: u64,
}

impl NormalDirection {
    pub(super) fn of(measured: &MeasuredNormals, lattice: &Lattice) -> NormalDirection {
        NormalDirection {
            angles_deg: CloudFigures::scaled(&measured.angles, lattice, 1.0),
            opposed: measured.opposed,
            without: measured.without,
        }
    }
}

impl NormalAngles {
    /// The larger of a figure of both directions, in degrees.
    pub(in crate::compare) fn larger(&self, of: impl Fn(&CloudFigures) -> f64) -> Option<f64> {
        let [a, b] = [self.first_to_second?, self.second_to_first?];
        Some(of(&a.angles_deg?).max(of(&b.angles_deg?)))
    }

    /// Of how many points of both scans, and how many of them have no angle.
    pub(in crate::compare) fn without(&self) -> [u64; 2] {
        let both = [self.first_to_second, self.second_to_first];
        let counts = both.iter().flatten().map(|direction| {
            let points = direction.angles_deg.map_or(0, |figures| figures.points);
            [points + direction.without, direction.without]
        });
        counts.fold([0; 2], |[all, without], [more, none]| [all + more, without + none])
    }

    fn lines(&self, f: &mut fmt::Formatter<'_>, direction: &NormalDirection) -> fmt::Result {
        let (opposed, without) = (Grouped(direction.opposed), Grouped(direction.without));
        if let Some(figures) = &direction.angles_deg {
            let CloudFigures { mean, rms, p50, p95, p99, max, at, .. } = *figures;
            let [mean, rms, p50, p95, p99, max] = [mean, rms, p50, p95, p99, max].map(Short);
            let [x, y, z] = at.map(|at| Coordinate { at, step: self.told_to });
            write!(
                f,
                "\n  angles   mean {mean}°, RMS {rms}°, 50 % ≤ {p50}°, 95 % ≤ {p95}°, \
                 99 % ≤ {p99}°, max {max}° at ({x}, {y}, {z})"
            )?;
        }
        write!(f, "\n  sides    {opposed} point to the other side")?;
        match direction.without {
            0 => Ok(()),
            _ => write!(f, ", {without} have no angle, as a normal is missing"),
        }
    }
}

impl fmt::Display for NormalAngles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let directions = [
            ("first", "second", &self.first_to_second),
            ("second", "first", &self.second_to_first),
        ];
        let mut before = "";
        for (one, other, direction) in directions {
            let Some(direction) = direction else { continue };
            let points = direction.angles_deg.map_or(0, |figures| figures.points);
            let points = Grouped(points + direction.without);
            write!(
                f,
                "{before}normals    of {points} points of the {one} and the nearest of the {other}"
            )?;
            self.lines(f, direction)?;
            before = "\n";
        }
        match before {
            "" => write!(f, "normals    none: a scan without points has none"),
            _ => Ok(()),
        }
    }
}
