//! Every record of the original is looked for in the reduced scan, as it streams by.

use std::sync::Arc;

use super::records::RecordKeys;
use super::reduced::Reduced;
use crate::Result;
use crate::point::PointBatch;
use crate::report::Tally;
use crate::stage::{Needs, Transform};

/// Meets every record of the original.
pub(super) struct MeetRecords {
    pub reduced: Arc<Reduced>,
    /// What records of the original are known by.
    pub original: RecordKeys,
}

impl Transform for MeetRecords {
    fn needs(&self) -> Needs {
        Needs::none().reads_whole_records()
    }

    fn apply(&self, batch: &mut PointBatch, _: &mut Tally) -> Result<()> {
        self.reduced.meet(&self.original, batch.iter());
        Ok(())
    }
}
