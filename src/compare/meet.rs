//! Every record of the original is looked for in the reduced scan, as it streams by.

use std::sync::Arc;

use super::records::Comparison;
use super::reduced::Reduced;
use crate::Result;
use crate::point::PointBatch;
use crate::report::Tally;
use crate::stage::{Needs, Transform};

/// Meets every record of the original.
pub(super) struct MeetRecords {
    pub reduced: Arc<Reduced>,
    pub comparison: Comparison,
}

impl Transform for MeetRecords {
    fn needs(&self) -> Needs {
        Needs::none().reads_whole_records()
    }

    fn apply(&self, batch: &mut PointBatch, _: &mut Tally) -> Result<()> {
        for record in batch.iter() {
            self.reduced.meet(self.comparison.of_original(record));
        }
        Ok(())
    }
}
