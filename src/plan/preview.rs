//! Several pipelines on the same points of a scan, before any of them is run on all of it.

use std::collections::BTreeMap;

use serde::Serialize;

use super::fitted::Plan;
use super::prediction::Prediction;
use super::trial::TrialPoints;
use super::trial_reading::TrialSize;
use crate::engine::Watch;
use crate::graph::Graph;
use crate::report::DeviationTotals;
use crate::{Error, Result};

/// Squares that pipelines are tried on: several, since a scan is not everywhere the same, each of
/// so many records, since kept points at the border of a square lack neighbours, which counts more
/// the smaller it is.
const SPOTS: usize = 6;
const RECORDS_OF_SPOT: usize = 25_000;

/// What a pipeline is expected to come to, by a trial on some points of the scan.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Preview {
    /// What its run is expected to use and to leave.
    pub prediction: Prediction,
    /// How far the removed ones of the tried points are from the surface, in world units; None
    /// where nothing was removed or no stage measures it.
    pub deviation: Option<DeviationTotals>,
    /// Of the tried points that the stages saw, how many stayed.
    pub kept: u64,
    /// What stages counted of them, by name.
    pub counts: BTreeMap<String, u64>,
}

impl Plan {
    /// Takes some points of the sources of `again`, which is the pipeline of this plan once more,
    /// to try pipelines on: about so many, all those in a few squares along its two widest axes,
    /// of any height, or all of a scan that has hardly more.
    ///
    /// # Errors
    ///
    /// Those of reading, a source that has no points or gives them once, and
    /// [`ErrorKind::Interrupted`](crate::ErrorKind::Interrupted) where `watch` asked to stop.
    pub fn trial_points(
        &self,
        again: &Graph,
        about: usize,
        watch: &dyn Watch,
    ) -> Result<TrialPoints> {
        match self.no_trial() {
            Some(why) => Err(Error::pipeline(why)),
            None => {
                let spots = (about / RECORDS_OF_SPOT).clamp(1, SPOTS);
                self.read_some(again, TrialSize::of(about, spots), watch)
            }
        }
    }

    /// The same, or none where there can be no trial: why not is for the run to tell, or to do
    /// without.
    #[cfg(feature = "cli")]
    pub(crate) fn trial_points_if_any(
        &self,
        again: &Graph,
        about: usize,
        watch: &dyn Watch,
    ) -> Result<Option<TrialPoints>> {
        match self.trial_points(again, about, watch) {
            Err(error) if error.kind() == crate::ErrorKind::Interrupted => Err(error),
            points => Ok(points.ok()),
        }
    }

    /// Tries `other` on these points: a pipeline of the same sources whose stages may differ from
    /// those of this plan. Keys that count records of the whole scan count those of the share that
    /// is tried: give numbers and no shares, since of a scan whose points are in no order of places
    /// the tried ones may be a part of those that are there. What a run on the whole scan comes to
    /// differs by what is elsewhere in it.
    ///
    /// # Errors
    ///
    /// As [`Graph::plan`] and [`Plan::run`].
    pub fn preview(
        &self,
        points: &TrialPoints,
        other: Graph,
        watch: &dyn Watch,
    ) -> Result<Preview> {
        let density = points.density();
        let tried = self.tried_as(points, density, other, watch)?;
        let deviation = tried.outcome.totals.as_ref().and_then(|totals| totals.deviation);
        let (kept, counts) = (tried.outcome.ledger.kept, tried.outcome.counts.clone());
        let prediction = self.prediction(&Ok(tried))?;
        Ok(Preview { prediction, deviation, kept, counts })
    }
}
