//! The angle between the normal of a point and that of the nearest point of another scan.
//!
//! Normals are what is kept of records beside the sorted places. Which point is nearest is found
//! for a stretch of points first; their normals are then read together, as records lie in another
//! order.

use std::f64::consts::PI;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::measured::MeasuredKind;
use crate::Result;
use crate::point::{
    Dimension, Endian, Layout, PointBatch, Position, Scalar, Schema, names::NORMAL,
};
use crate::store::{Fetch, SealedTiles, first_of_each, morton_cmp};

/// Bytes of a normal: three numbers of single precision.
pub const NORMAL_BYTES: usize = NORMAL.len() * size_of::<f32>();
/// Normals that are read together.
const AT_ONCE: usize = 4096;

/// The normals of the records of a scan.
pub struct RecordNormals<'a>([&'a Dimension; 3], Endian);

impl<'a> RecordNormals<'a> {
    /// The normals of records of `schema`; None if they have none.
    pub fn of(schema: &'a Schema) -> Option<RecordNormals<'a>> {
        let [x, y, z] = NORMAL.map(|name| schema.find(name));
        Some(RecordNormals([x?, y?, z?], schema.endian))
    }

    /// Appends the normal of a record as it is stored.
    pub fn store(&self, record: &[u8], into: &mut Vec<u8>) {
        let axes = self.0.map(|axis| axis.world(record, self.1) as f32);
        into.extend(axes.iter().flat_map(|v| v.to_le_bytes()));
    }
}

/// What is known of the angles of a scan's normals, in degrees.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasuredNormals {
    /// Without their signs: 0 to 90.
    pub angles: MeasuredKind,
    /// Points of which the normal points away from the other by more than 90 degrees.
    pub opposed: u64,
    /// Points without an angle: one of both has no normal.
    pub without: u64,
}

impl MeasuredNormals {
    /// Adds the angles of other points.
    pub fn merge(&mut self, other: &MeasuredNormals) {
        self.angles.merge(&other.angles);
        self.opposed += other.opposed;
        self.without += other.without;
    }

    /// Adds the angle between two normals, at so many points.
    fn add(&mut self, [one, other]: [[f64; 3]; 2], position: Position, copies: u32) {
        let dot: f64 = one.iter().zip(other).map(|(a, b)| a * b).sum();
        let part = |i: usize, j: usize| one[i] * other[j] - one[j] * other[i];
        let [x, y, z] = [part(1, 2), part(2, 0), part(0, 1)];
        let cross = (x * x + y * y + z * z).sqrt();
        if !dot.is_finite() || !cross.is_finite() || dot == 0.0 && cross == 0.0 {
            self.without += u64::from(copies);
            return;
        }
        self.opposed += if dot < 0.0 { u64::from(copies) } else { 0 };
        // Exact for small angles, which an arc cosine is not.
        let angle = libm::atan2(cross, dot.abs()) * (180.0 / PI);
        self.angles.add(angle, position, copies);
    }
}

/// A point that asks and its nearest one, by the numbers of their first records.
#[derive(Debug, Clone, Copy)]
struct NormalPair {
    own: u64,
    other: u64,
    position: Position,
    copies: u32,
}

/// The pairs of a stretch of points; one a thread.
pub struct NormalPairs {
    pub measured: MeasuredNormals,
    /// Numbers of the first records of the positions that are loaded to be asked.
    pub near: Vec<u64>,
    /// Who asks, in Morton order: number of the first record, number of records.
    asking: Vec<(Position, u64, u32)>,
    pairs: Vec<NormalPair>,
    fetch: Fetch,
    batch: PointBatch,
}

impl NormalPairs {
    /// Bytes that it holds, for so many positions that are loaded and so many that ask.
    pub fn bytes(loaded: usize, asking: usize) -> u64 {
        let each = size_of::<(Position, u64, u32)>() + size_of::<NormalPair>();
        let own = (loaded + asking) * size_of::<u64>() + asking * each;
        own as u64 + Fetch::bytes(AT_ONCE as u64, NORMAL_BYTES).0 + (NORMAL_BYTES * AT_ONCE) as u64
    }

    /// None yet.
    pub fn new() -> NormalPairs {
        let axis = |(n, name)| Dimension::new(name, Scalar::F32, n * size_of::<f32>());
        let schema = Schema {
            layout: Layout::plain("normals"),
            endian: Endian::Little,
            stride: NORMAL_BYTES,
            dimensions: NORMAL.into_iter().enumerate().map(axis).collect(),
        };
        NormalPairs {
            measured: MeasuredNormals::default(),
            near: Vec::new(),
            asking: Vec::new(),
            pairs: Vec::new(),
            fetch: Fetch::default(),
            batch: PointBatch::new(Arc::new(schema), AT_ONCE),
        }
    }

    /// Begins a stretch.
    pub fn begin(&mut self) {
        self.asking.clear();
        self.pairs.clear();
    }

    /// Has the positions of a block ask, whose first record has this number.
    pub fn ask(&mut self, positions: &[Position], copies: &[u32], record: u64) {
        let numbers = first_of_each(record, copies);
        let each = positions.iter().zip(numbers).zip(copies);
        self.asking.extend(each.map(|((p, number), copies)| (*p, number, *copies)));
    }

    /// Enters the nearest of one that asks, by the number of its first record.
    pub fn enter(&mut self, p: Position, other: u64) {
        if let Ok(at) = self.asking.binary_search_by(|(q, ..)| morton_cmp(q, &p)) {
            let (position, own, copies) = self.asking[at];
            self.pairs.push(NormalPair { own, other, position, copies });
        }
    }

    /// Measures the pairs of the stretch.
    pub fn measure(&mut self, asking: &SealedTiles, asked: &SealedTiles) -> Result<()> {
        let mut pairs = std::mem::take(&mut self.pairs);
        for pairs in pairs.chunks_mut(AT_ONCE) {
            pairs.sort_unstable_by_key(|pair| pair.own);
            let own = self.normals(asking, pairs.iter().map(|pair| pair.own))?;
            let mut order: Vec<(u64, usize)> =
                pairs.iter().enumerate().map(|(i, pair)| (pair.other, i)).collect();
            order.sort_unstable();
            let others = self.normals(asked, order.iter().map(|(other, _)| *other))?;
            for ((_, i), other) in order.iter().zip(others) {
                let NormalPair { position, copies, .. } = pairs[*i];
                self.measured.add([own[*i], other], position, copies);
            }
        }
        self.pairs = pairs;
        Ok(())
    }

    /// The normals of the records with these numbers, which ascend.
    fn normals(
        &mut self,
        scan: &SealedTiles,
        numbers: impl Iterator<Item = u64>,
    ) -> Result<Vec<[f64; 3]>> {
        let numbers: Vec<u64> = numbers.collect();
        self.batch.clear();
        scan.fetch(&numbers, &mut self.fetch, &mut self.batch)?;
        let axes = |record: &[u8]| {
            let axis = |n: usize| f32::from_le_bytes(std::array::from_fn(|i| record[4 * n + i]));
            [0, 1, 2].map(|n| f64::from(axis(n)))
        };
        Ok(self.batch.iter().map(axes).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_have_no_sign_and_opposed_ones_are_counted() {
        let mut all = MeasuredNormals::default();
        let tilted = [0.0, 1e-3f64.sin(), 1e-3f64.cos()];
        all.add([[0.0, 0.0, 2.0], tilted], [1, 1, 1], 2);
        all.add([[0.0, 0.0, -1.0], [0.0, 3.0, 3.0]], [2, 2, 2], 1);
        all.add([[0.0; 3], [1.0, 0.0, 0.0]], [3, 3, 3], 5);
        all.add([[f64::NAN, 0.0, 1.0], [1.0, 0.0, 0.0]], [3, 3, 3], 1);
        assert_eq!((all.opposed, all.without), (1, 6));
        let deviations = &all.angles.deviations.deviations;
        assert_eq!((deviations.count(), deviations.largest()), (3, Some((45.0, [2, 2, 2]))));
        let mean = all.angles.sum.value() / 3.0;
        assert!((mean - (45.0 + 2.0 * 0.18 / PI) / 3.0).abs() < 1e-6, "{mean}");
    }
}
