//! Parts of a cell by several sites at once.

use std::ops::Range;

use super::division::{CellPart, Division, Survey};
use super::settings::MOST_SEEDS;
use crate::geom::angle::{cosine, dominant_axis, outer_sum, sine2};
use crate::point::{Position, distance2};

impl Division<'_> {
    /// Parts the members by which of the sites is nearest; equally near ones go to the first, which
    /// has the smaller angle. Normals on one cone about the axis have one angle, and one site: they
    /// are bisected.
    pub(super) fn part_among(
        &mut self,
        part: &mut [u32],
        turned: &[bool],
        survey: &Survey,
        child: impl Fn(Range<usize>) -> CellPart,
    ) {
        let (positions, sites) = (self.positions, self.sites(part, turned));
        if sites.len() < 2 {
            return self.bisect(part, turned, survey, child);
        }
        let nearest = |i: u32| {
            let far = |n: &usize| distance2(positions[i as usize], sites[*n]);
            (0..sites.len()).min_by_key(far).unwrap_or(0)
        };
        self.distribute::<{ MOST_SEEDS + 1 }>(part, nearest, child);
    }

    /// The members at the quantiles of the angles, smallest and largest among them, by ascending
    /// angle, of equal ones the first in Morton order.
    fn sites(&self, part: &[u32], turned: &[bool]) -> Vec<Position> {
        let normal = |i: u32| self.normals[i as usize];
        // What grows with the angle: its cosine turned, or its squared sine up to a right angle.
        let mut angles: Vec<(f64, u32)> = match self.rule.reference {
            Some(reference) => {
                let each = part.iter().zip(turned);
                each.map(|(&i, &turned)| (-cosine(reference, normal(i), turned), i)).collect()
            }
            None => {
                let axis = dominant_axis(outer_sum(part.iter().map(|&i| normal(i))));
                part.iter().map(|&i| (sine2(axis, normal(i)), i)).collect()
            }
        };
        angles.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let (last, count) = (angles.len() - 1, self.rule.seeds.min(angles.len()));
        let first = |n: usize| {
            let angle = angles[n * last / (count - 1).max(1)].0;
            angles[angles.partition_point(|other| other.0 < angle)].1
        };
        let mut sites: Vec<u32> = (0..count).map(first).collect();
        sites.dedup();
        sites.into_iter().map(|i| self.positions[i as usize]).collect()
    }
}
