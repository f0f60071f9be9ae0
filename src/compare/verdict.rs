//! What a check came to.

use std::fmt;

use serde::Serialize;

use crate::report::deviations::MeasuredDeviations;
use crate::report::{Coordinate, Grouped, Long};
use crate::stage::Lattice;

/// What is known of a reduced scan beside its original.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Verification {
    /// Records of the original that are measured, and of the reduced scan.
    pub original: u64,
    /// See [`original`](Verification::original).
    pub reduced: u64,
    /// Kept points that are no part of the surface.
    pub exceptions: u64,
    /// Records of the reduced scan that the original does not have, or not as often.
    pub foreign: u64,
    /// Those of them that have the synthetic flag, as points have that a stage moved.
    pub foreign_synthetic: u64,
    /// The first of them in the file.
    pub first_foreign: Option<ForeignRecord>,
    /// Dimensions that were not compared, as the reduced scan does not have them.
    pub not_compared: Vec<String>,
    /// DistanceFigures of removed positions to the surface of the kept points.
    pub surface: Option<DistanceFigures>,
    /// DistanceFigures of removed positions to the nearest kept point that is a part of the
    /// surface.
    pub coverage: Option<DistanceFigures>,
    /// In the scan's unit; what no removed position may be farther from the surface than.
    pub tolerance: Option<f64>,
    /// How many are.
    pub beyond_tolerance: u64,
    /// In the scan's unit; what no removed position may be farther from the nearest kept point
    /// than.
    pub max_spacing: Option<f64>,
    /// How many are.
    pub beyond_spacing: u64,
    /// The sign of the unit of all lengths, where the scan says it.
    pub unit: Option<&'static str>,
    /// Step of the lattice: coordinates are told to it.
    #[serde(skip)]
    pub(super) step: f64,
}

/// A record that is in the reduced scan alone.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ForeignRecord {
    /// Its number in the file, from 0.
    pub number: u64,
    /// World coordinates.
    pub at: [f64; 3],
}

/// DistanceFigures in the scan's unit. Percentiles are upper edges of bins of 1 %.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DistanceFigures {
    /// How many.
    pub positions: u64,
    /// Root of their mean square.
    pub rms: f64,
    /// The median.
    pub p50: f64,
    /// See [`DistanceFigures`].
    pub p95: f64,
    /// See [`DistanceFigures`].
    pub p99: f64,
    /// The largest.
    pub max: f64,
    /// World coordinates of the position that has it.
    pub at: [f64; 3],
}

impl DistanceFigures {
    pub(super) fn of(measured: &MeasuredDeviations, lattice: &Lattice) -> Option<DistanceFigures> {
        let deviations = &measured.deviations;
        let (max, at) = deviations.largest()?;
        let length = |steps: f64| steps * lattice.step;
        let percentile = |percent: u32| Some(length(f64::from(measured.percentile(percent)?)));
        Some(DistanceFigures {
            positions: deviations.count(),
            rms: length(deviations.rms()?),
            p50: percentile(50)?,
            p95: percentile(95)?,
            p99: percentile(99)?,
            max: length(f64::from(max)),
            at: lattice.world(at),
        })
    }
}

impl Verification {
    /// True if every kept record is one of the original, and all removed positions are within the
    /// tolerance and the spacing that were asked for.
    pub fn holds(&self) -> bool {
        self.foreign == 0 && self.beyond_tolerance == 0 && self.beyond_spacing == 0
    }
}

impl Verification {
    /// A place in the digits that tell it from others.
    fn place(&self, at: [f64; 3]) -> String {
        let [x, y, z] = at.map(|at| Coordinate { at, step: self.step });
        format!("({x}, {y}, {z})")
    }

    fn record_lines(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.first_foreign {
            None => writeln!(f, "records    all are of the original")?,
            Some(first) => {
                let (foreign, at) = (Grouped(self.foreign), self.place(first.at));
                let number = first.number;
                write!(f, "records    {foreign} are not of the original")?;
                if self.foreign_synthetic > 0 {
                    let moved = Grouped(self.foreign_synthetic);
                    write!(f, ", {moved} of them synthetic, as points that a stage moved")?;
                }
                writeln!(f, "; the first is number {number} at {at}")?;
            }
        }
        match self.not_compared.is_empty() {
            true => Ok(()),
            false => writeln!(f, "           not compared: {}", self.not_compared.join(", ")),
        }
    }
}

impl fmt::Display for Verification {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = 100.0 * self.reduced as f64 / self.original.max(1) as f64;
        writeln!(
            f,
            "points     {} of {} ({share:.1} %), {} of them exceptions",
            Grouped(self.reduced),
            Grouped(self.original),
            Grouped(self.exceptions)
        )?;
        self.record_lines(f)?;
        let long = |length: f64| Long(length, self.unit);
        for (name, distances) in [("surface ", &self.surface), ("coverage", &self.coverage)] {
            let Some(d) = distances else { continue };
            writeln!(
                f,
                "{name}   RMS {}, 50 % ≤ {}, 95 % ≤ {}, 99 % ≤ {}, max {} at {}",
                long(d.rms),
                long(d.p50),
                long(d.p95),
                long(d.p99),
                long(d.max),
                self.place(d.at)
            )?;
        }
        for (asked, beyond, of) in [
            (self.tolerance, self.beyond_tolerance, "from the surface"),
            (self.max_spacing, self.beyond_spacing, "from the nearest kept point"),
        ] {
            let Some(asked) = asked else { continue };
            let (beyond, asked) = (Grouped(beyond), long(asked));
            writeln!(f, "beyond     {beyond} removed positions are more than {asked} {of}")?;
        }
        let is_bounded = self.tolerance.is_some() || self.max_spacing.is_some();
        f.write_str(match (self.holds(), is_bounded) {
            (true, true) => "holds",
            (true, false) => "holds: the records, since no tolerance or spacing was asked for",
            (false, _) => "does not hold",
        })
    }
}
