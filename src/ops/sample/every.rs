//! Records that stay by their number in the input.

use std::num::NonZeroU64;

use crate::point::{PointBatch, Schema};
use crate::report::Tally;
use crate::stage::{Needs, Transform};
use crate::{Error, Result};

/// `sample` by `every`.
#[derive(Debug)]
pub(super) struct EveryNth(pub NonZeroU64);

impl Transform for EveryNth {
    fn needs(&self) -> Needs {
        Needs::none().reads_record_numbers().removes(None)
    }

    fn idle(&self, _: &Schema) -> Vec<String> {
        vec![format!("`sample.every = {}` leaves no point out", self.0)]
    }

    fn removes_by(&self) -> Vec<&'static str> {
        vec!["sample.every"]
    }

    fn apply(&self, batch: &mut PointBatch, _tally: &mut Tally) -> Result<()> {
        let numbers = batch
            .record_numbers()
            .map(<[u64]>::to_vec)
            .ok_or_else(|| Error::internal("records have no numbers, though a stage reads them"))?;
        batch.retain(|i, _| numbers[i].is_multiple_of(self.0.get()));
        Ok(())
    }
}
