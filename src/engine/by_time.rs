//! The order of records within a chunk of a compressed output: a scanner's own, as far as it is
//! told.
//!
//! Chunks are cut by rank in canonical order. Within one the records may have any order that is a
//! function of the points alone. Neighbours in Morton order differ in all fields and neighbours in
//! time in few, which is what LAZ makes use of: the files are smaller, and nothing but a sort of
//! one chunk is paid for it.

use crate::point::{Dimension, PointBatch, Schema, ascending, names};
use crate::store::RecordState;

/// What records of a schema are ordered by.
pub(crate) struct ByTime {
    time: Dimension,
    return_number: Option<Dimension>,
}

impl ByTime {
    /// The order of records of `schema`; none if they have no time.
    pub fn of(schema: &Schema) -> Option<ByTime> {
        let time = schema.find(names::GPS_TIME)?.clone();
        Some(ByTime { time, return_number: schema.find(names::RETURN_NUMBER).cloned() })
    }

    /// Orders records with their states and columns by time, then return number, then as they came.
    pub fn sort(&self, batch: &mut PointBatch, states: &mut [RecordState]) {
        let schema = batch.schema().clone();
        let (endian, stride) = (schema.endian, schema.stride);
        let key = |record: &[u8]| {
            let number = self.return_number.as_ref().map(|d| d.get(record, endian).as_f64());
            (ascending(self.time.get(record, endian).as_f64()), number.unwrap_or(0.0) as u8)
        };
        let keys = batch.iter().map(key);
        let mut order: Vec<((u64, u8), u32)> = keys.zip(0u32..).collect();
        if order.is_sorted() {
            return;
        }
        order.sort_unstable();
        let order: Vec<u32> = order.into_iter().map(|(_, at)| at).collect();
        let records = batch.records_mut();
        put_in_order(&order, |a, b| {
            let (left, right) = records.split_at_mut(b * stride);
            left[a * stride..(a + 1) * stride].swap_with_slice(&mut right[..stride]);
        });
        put_in_order(&order, |a, b| states.swap(a, b));
        put_in_order(&order, |a, b| batch.columns.swap(a, b));
    }
}

/// Calls `swap` with pairs of places, the lower first, until at each place `i` is what was at
/// `order[i]`.
fn put_in_order(order: &[u32], mut swap: impl FnMut(usize, usize)) {
    for i in 0..order.len() {
        // What was there and has been taken for a place before lies where that place's was.
        let mut from = order[i] as usize;
        while from < i {
            from = order[from] as usize;
        }
        if from > i {
            swap(i, from);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn swaps_bring_any_order_about() {
        let mut state = 7u64;
        for n in 0..60u32 {
            let mut order: Vec<u32> = (0..n).collect();
            for i in (1..order.len()).rev() {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(99);
                order.swap(i, (state >> 33) as usize % (i + 1));
            }
            let mut items: Vec<u32> = (100..100 + n).collect();
            put_in_order(&order, |a, b| {
                assert!(a < b);
                items.swap(a, b);
            });
            assert!(items.iter().zip(&order).all(|(item, from)| *item == 100 + from), "{order:?}");
        }
    }
}
