//! Records that stay by chance: each decides for itself, by a hash of what it is.

use crate::geom::hash::Hash;
use crate::point::{Dimension, PointBatch, Schema, Value, names};
use crate::quantity::Fraction;
use crate::report::Tally;
use crate::stage::{Needs, Transform};
use crate::{Error, Result};

/// `sample` by `fraction`.
#[derive(Debug)]
pub(super) struct RandomSample {
    fraction: Fraction,
    seed: u64,
}

impl RandomSample {
    pub fn new(fraction: Fraction, seed: u64) -> Self {
        RandomSample { fraction, seed }
    }
}

impl Transform for RandomSample {
    fn needs(&self) -> Needs {
        Needs::none().looks_at(names::XYZ).reads_whole_records().removes(None)
    }

    fn idle(&self, _: &Schema) -> Vec<String> {
        let fraction = self.fraction;
        vec![format!("chance left no point out by `sample.fraction = {fraction}`")]
    }

    fn removes_by(&self) -> Vec<&'static str> {
        vec!["sample.fraction"]
    }

    fn apply(&self, batch: &mut PointBatch, _tally: &mut Tally) -> Result<()> {
        let schema = batch.schema().clone();
        let axes = schema.coordinates().ok_or_else(|| Error::internal("no coordinates"))?;
        // A hash is below this with the probability that is asked for.
        let below = (self.fraction.value() * 2f64.powi(u64::BITS as i32)) as u128;
        let mut rest = Vec::with_capacity(schema.stride);
        batch.retain(|_, record| {
            let mut hash = Hash::of(self.seed);
            rest.clear();
            rest.extend_from_slice(record);
            for axis in axes {
                hash = hash.and(coordinate(axis, record, &schema));
                rest[axis.offset..axis.offset + axis.scalar.size()].fill(0);
            }
            let (words, bytes) = rest.as_chunks::<8>();
            let mut last = [0; 8];
            last[..bytes.len()].copy_from_slice(bytes);
            let words = words.iter().chain([&last]);
            let hash = words.fold(hash, |hash, word| hash.and(u64::from_le_bytes(*word)));
            u128::from(hash.value()) < below
        });
        Ok(())
    }
}

/// A coordinate as a word that is the same whatever offset the records are read with: offsets of
/// inputs that are read together differ by whole steps.
fn coordinate(axis: &Dimension, record: &[u8], schema: &Schema) -> u64 {
    let steps = || (axis.origin / axis.scale).round() as i64;
    match axis.get(record, schema.endian) {
        Value::Signed(stored) => stored.wrapping_add(steps()) as u64,
        Value::Unsigned(stored) => stored.wrapping_add(steps() as u64),
        // Zero has one sign.
        float => (float.as_f64() + 0.0).to_bits(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point::{Endian, Layout, Scalar};
    use std::sync::Arc;

    /// The tags of those that stay of points along a line, counted from `origin` steps.
    fn kept(origin: i32, fraction: f64, seed: u64) -> Vec<u32> {
        let axis = |(i, name)| {
            Dimension::new(name, Scalar::I32, 4 * i).scaled(0.01, f64::from(origin) * 0.01)
        };
        let mut dimensions: Vec<Dimension> = names::XYZ.into_iter().enumerate().map(axis).collect();
        dimensions.push(Dimension::new("Tag", Scalar::U32, 12));
        let layout = Layout { steps: true, ..Layout::plain("TOY") };
        let schema = Schema { layout, endian: Endian::Little, stride: 16, dimensions };
        let mut batch = PointBatch::new(Arc::new(schema), 20_000);
        for n in 0..20_000 {
            let stored = [n / 3 - origin, 7 - origin, -origin, n];
            batch.extend(stored.map(i32::to_le_bytes).as_flattened());
        }
        let sample = RandomSample::new(Fraction::of(fraction).unwrap(), seed);
        sample.apply(&mut batch, &mut Tally::default()).unwrap();
        let tag = |record: &[u8]| u32::from_le_bytes(record[12..].try_into().unwrap());
        batch.iter().map(tag).collect()
    }

    #[test]
    fn the_part_that_was_asked_for_stays_whatever_the_offset() {
        for (fraction, seed) in [(0.1, 0), (0.5, 1), (0.9, 2)] {
            let one = kept(0, fraction, seed);
            // Four standard deviations of a count of 20,000.
            let spread = 4.0 * (20_000.0 * fraction * (1.0 - fraction)).sqrt();
            assert!((one.len() as f64 - 20_000.0 * fraction).abs() < spread, "{}", one.len());
            assert_eq!(kept(-250_000, fraction, seed), one);
            assert_ne!(kept(0, fraction, seed + 1), one);
        }
        assert_eq!(kept(0, 1.0, 5).len(), 20_000);
    }

    #[test]
    fn a_smaller_part_is_of_the_larger() {
        let (more, fewer) = (kept(0, 0.4, 9), kept(0, 0.3, 9));
        assert!(fewer.len() > 5_000 && fewer.iter().all(|tag| more.contains(tag)));
    }
}
