//! What a source says besides its points.

use std::any::Any;
use std::sync::Arc;

use super::column::ComputedDimension;
use super::note::RunNote;
use super::units::Units;

/// What the values of `GpsTime` count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum GpsTime {
    /// Seconds of the GPS week.
    Week,
    /// Seconds of GPS time minus 1e9, as LAS has it.
    AdjustedStandard,
}

/// What a file says besides its points and that outputs carry on.
#[derive(Clone, Default)]
#[non_exhaustive]
pub struct Metadata {
    /// Coordinate reference system as text (WKT where the file has one).
    pub crs: Option<String>,
    /// Units of the coordinates, as far as that says them.
    pub units: Units,
    /// What GPS times count, where the source knows.
    pub gps_time: Option<GpsTime>,
    /// What the records went through, as outputs say it: the stages as one line of JSON. None where
    /// every record comes as it is.
    pub pipeline: Option<Arc<str>>,
    /// What the output says of the run that it comes out of, if it is to say it.
    pub note: Option<Arc<RunNote>>,
    /// The dimensions that stages computed and the output is to have.
    pub computed: Vec<ComputedDimension>,
    /// True if the points were moved, so that offsets and the reference system that the records of
    /// an input's file name are not theirs any more.
    pub moved: bool,
    /// Free text lines, such as the comments of a PLY header.
    pub comments: Vec<String>,
    /// The format's own header and records, known to sources and sinks of that format alone.
    pub native: Option<Arc<dyn Any + Send + Sync>>,
}

impl std::fmt::Debug for Metadata {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Metadata")
            .field("crs", &self.crs)
            .field("units", &self.units)
            .field("gps_time", &self.gps_time)
            .field("pipeline", &self.pipeline)
            .field("note", &self.note)
            .field("computed", &self.computed)
            .field("moved", &self.moved)
            .field("comments", &self.comments)
            .field("native", &self.native.is_some())
            .finish()
    }
}
