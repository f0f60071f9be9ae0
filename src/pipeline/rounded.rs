//! What a lattice of rounded positions hides: coordinates that differ and share a position.

use std::sync::Arc;

use crate::Result;
use crate::point::{PointBatch, Schema};
use crate::tile::{Fetch, SealedTiles};

/// Records compared at once.
const AT_ONCE: usize = 1024;

/// Finds positions whose records have unequal coordinates; one a thread.
pub(super) struct Rounded<'a> {
    tiles: &'a SealedTiles,
    fetch: Fetch,
    batch: PointBatch,
}

impl<'a> Rounded<'a> {
    pub fn new(tiles: &'a SealedTiles, schema: &Arc<Schema>) -> Self {
        let batch = PointBatch::new(schema.clone(), AT_ONCE);
        Rounded { tiles, fetch: Fetch::default(), batch }
    }

    /// How many of the positions, given by their first record and number of records, hold records
    /// with unequal coordinates.
    pub fn count(&mut self, positions: impl Iterator<Item = (u64, u32)>) -> Result<u64> {
        let mut unequal = 0;
        for (first, records) in positions.filter(|&(_, records)| records > 1) {
            unequal += u64::from(self.differ(first, records)?);
        }
        Ok(unequal)
    }

    fn differ(&mut self, first: u64, records: u32) -> Result<bool> {
        let schema = self.batch.schema().clone();
        let Some(axes) = schema.coordinates() else { return Ok(false) };
        let at = |record: &[u8]| axes.map(|d| d.world(record, schema.endian));
        let mut of_first = None;
        let end = first + u64::from(records);
        for start in (first..end).step_by(AT_ONCE) {
            let numbers: Vec<u64> = (start..end.min(start + AT_ONCE as u64)).collect();
            self.batch.clear();
            self.tiles.fetch(&numbers, &mut self.fetch, &mut self.batch)?;
            for record in self.batch.iter() {
                if at(record) != *of_first.get_or_insert_with(|| at(record)) {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }
}
