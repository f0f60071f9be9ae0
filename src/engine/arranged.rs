//! Where the points of one of several files are, for outputs that arrange them in space.
//!
//! Of one output for all that is known when the scan is sealed. Which points one of several files
//! gets is known behind the last of them, so those of a file are looked through once before they
//! are written: the file is then what a run over its points alone would write, and points of other
//! files play no part in it.

use std::sync::Mutex;

use super::job::Job;
use crate::Result;
use crate::geom::lattice::Lattice;
use crate::host::lock;
use crate::point::{Bounds, Metadata, PointBatch};
use crate::stage::{CreateSink, Encode, Encoded, Extent};

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
        let Some(lattice) = &job.task.lattice else { return Ok(None) };
        let arranged = create.arranged(lattice, job.task.schema(), metadata)?;
        let bounds = Mutex::new(Bounds::EMPTY);
        Ok(arranged.map(|_| FileExtent { lattice: lattice.clone(), bounds }))
    }

    /// Adds records that go to the file. Those that have no place are told when it is written.
    pub fn add(&self, batch: &PointBatch) {
        let mut bounds = lock(&self.bounds);
        self.lattice.place(batch.schema(), batch.records(), |_, at| bounds.add(at), |_, _| {});
    }

    /// What its sink is told.
    pub fn told(&self) -> Extent {
        Extent::new(self.lattice.clone(), *lock(&self.bounds))
    }
}

/// In the place of the encoder of the file.
impl Encode for FileExtent {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        self.add(batch);
        Ok(Encoded::default())
    }
}
