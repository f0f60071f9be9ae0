//! Where the points of one of several files are, for outputs that arrange them in space.
//!
//! Of one output for all that is known when the scan is sealed. Which points one of several files
//! gets is known behind the last of them: the file is then what a run over its points alone would
//! write, and points of other files play no part in it. Files of a split get whole records, whose
//! box grows as they are sorted (`by_split.rs`). Of a file for each input its list has numbers and
//! states of records. Where those are as they are written only they tell: stages that stream behind
//! the tiles write coordinates, too, `smooth` those of all points that it moves. So its records are
//! looked through once before they are written, through the same edits.

use std::sync::Mutex;

use super::job::Job;
use crate::Result;
use crate::geom::lattice::Lattice;
use crate::host::lock;
use crate::point::{Bounds, Metadata, PointBatch};
use crate::stage::{CreateSink, Encode, Encoded, Extent};

/// What `create` arranges its points on, if it does.
pub(crate) fn ground(
    job: &Job<'_>,
    create: &dyn CreateSink,
    metadata: &Metadata,
) -> Result<Option<Lattice>> {
    let Some(lattice) = &job.task.lattice else { return Ok(None) };
    let arranged = create.arranged(lattice, job.task.schema(), metadata)?;
    Ok(arranged.map(|_| lattice.clone()))
}

/// The box of the points of a file, as it becomes known.
pub(crate) struct FileExtent {
    lattice: Lattice,
    bounds: Mutex<Bounds>,
}

impl FileExtent {
    /// That of the file of `create`, without a point, if it arranges points.
    pub fn of(
        job: &Job<'_>,
        create: &dyn CreateSink,
        metadata: &Metadata,
    ) -> Result<Option<FileExtent>> {
        let bounds = Mutex::new(Bounds::EMPTY);
        Ok(ground(job, create, metadata)?.map(|lattice| FileExtent { lattice, bounds }))
    }

    /// What its sink is told.
    pub fn told(&self) -> Extent {
        Extent::new(self.lattice.clone(), *lock(&self.bounds))
    }
}

/// In the place of the encoder of the file. Records that have no place are told when it is written.
impl Encode for FileExtent {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let mut bounds = lock(&self.bounds);
        self.lattice.place(batch.schema(), batch.records(), |_, at| bounds.add(at), |_, _| {});
        Ok(Encoded::default())
    }
}
