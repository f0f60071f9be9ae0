//! What a lattice of rounded positions hides: coordinates that differ and share a position.
//!
//! Decisions are made on integers, so points closer than a step are one position to every stage.
//! That is right for scans whose format has such steps, and a loss for those with numbers of any
//! size. It is measured and told, instead of being avoided by a finer lattice for all, which would
//! not reach far enough from the origin.

use std::sync::Arc;

use super::survey::apart_code;
use crate::Result;
use crate::geom::lattice::Lattice;
use crate::point::{PointBatch, Schema};
use crate::report::{Apart, Tally};
use crate::store::{FATE_BYTES, Fetch, SealedTiles};

/// Records compared at once.
const AT_ONCE: usize = 1024;

/// Finds positions whose records have unequal coordinates; one a thread.
pub(crate) struct Rounded<'a> {
    tiles: &'a SealedTiles,
    fetch: Fetch,
    batch: PointBatch,
    lattice: &'a Lattice,
}

impl<'a> Rounded<'a> {
    pub fn new(tiles: &'a SealedTiles, lattice: &'a Lattice, schema: &Arc<Schema>) -> Self {
        let batch = PointBatch::new(schema.clone(), AT_ONCE);
        Rounded { tiles, fetch: Fetch::default(), batch, lattice }
    }

    /// Enters how far records of unequal coordinates are from each other into `fates`, which are
    /// those of the positions given by their first record and number of records: where one of them
    /// is kept, the others are not on it. Counts such positions in `tally`.
    pub fn enter(
        &mut self,
        positions: &[(u64, u32)],
        fates: &mut [u8],
        tally: &mut Tally,
    ) -> Result<()> {
        let mut unequal = 0;
        let fates = fates.as_chunks_mut::<FATE_BYTES>().0;
        for (&(first, records), fate) in positions.iter().zip(fates) {
            let apart = if records > 1 { self.apart(first, records)? } else { None };
            if let Some(apart) = apart {
                unequal += 1;
                *fate = apart_code(*fate, apart.farthest / self.lattice.step);
                tally.apart = Some(tally.apart.map_or(apart, |all| all.with(apart)));
            }
        }
        tally.count("unequal_coordinates", unequal);
        Ok(())
    }

    /// How far apart the records of a position are: the least difference from the first in one
    /// coordinate, and the diagonal of the box around all; None where all are equal.
    fn apart(&mut self, first: u64, records: u32) -> Result<Option<Apart>> {
        let schema = self.batch.schema().clone();
        let Some(axes) = schema.coordinates() else { return Ok(None) };
        let mut of_first: Option<[f64; 3]> = None;
        let (mut lo, mut hi, mut nearest) = ([f64::MAX; 3], [f64::MIN; 3], f64::INFINITY);
        let end = first + u64::from(records);
        for start in (first..end).step_by(AT_ONCE) {
            let numbers: Vec<u64> = (start..end.min(start + AT_ONCE as u64)).collect();
            self.batch.clear();
            self.tiles.fetch(&numbers, &mut self.fetch, &mut self.batch)?;
            for record in self.batch.iter() {
                let mut at = axes.map(|d| d.world(record, schema.endian));
                at[2] *= self.lattice.z_scale();
                let from = *of_first.get_or_insert(at);
                let mut off = 0.0;
                for axis in 0..3 {
                    off = f64::max(off, (at[axis] - from[axis]).abs());
                    lo[axis] = lo[axis].min(at[axis]);
                    hi[axis] = hi[axis].max(at[axis]);
                }
                if off > 0.0 {
                    nearest = nearest.min(off);
                }
            }
        }
        let square = (0..3).map(|axis| (hi[axis] - lo[axis]).powi(2)).sum::<f64>();
        let farthest = square.sqrt();
        Ok(nearest.is_finite().then_some(Apart { nearest, farthest }))
    }
}
