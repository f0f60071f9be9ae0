//! Estimating the normals of many neighbourhoods: several side by side, the others alone.

use super::bundle::{Bundle, in_morton_order};
use super::estimate::{Cocircular, EstimateOutcome, Method, SurfaceShape, alone};
use crate::geom::simd::Simd;
use crate::geom::star::Star;
use crate::tile::Neighborhood;

/// Estimates normals by one method; holds scratch memory, so keep one for each thread.
#[derive(Debug, Default)]
pub struct Estimator {
    method: Method,
    simd: Simd,
    star: Star,
    bundle: Bundle,
}

impl Estimator {
    /// An estimator by `method`, computing by the best instruction set of the processor.
    pub fn new(method: Method) -> Self {
        Estimator { method, ..Estimator::default() }
    }

    /// The same by the given instruction set; all give the same normals.
    pub fn with(method: Method, simd: Simd) -> Self {
        Estimator { method, simd, ..Estimator::default() }
    }

    /// The same with neighbours on the circle of a triangle as corners.
    #[must_use]
    pub fn taking(self, cocircular: Cocircular) -> Self {
        match cocircular {
            Cocircular::Out => self,
            Cocircular::In => Estimator { star: Star::with_circles(), ..self },
        }
    }

    /// The normal at a position whose neighbours are at `offsets` from it, in lattice steps: none
    /// of them 0, all distinct, in Morton order, each smaller than 2^63.
    ///
    /// The result is a function of `offsets` alone, the same bits on every platform.
    pub fn estimate(&mut self, offsets: &[[i64; 3]]) -> EstimateOutcome {
        self.estimate_with_shape(offsets).0
    }

    /// The same, and how the neighbourhood lies about its surface.
    pub(crate) fn estimate_with_shape(
        &mut self,
        offsets: &[[i64; 3]],
    ) -> (EstimateOutcome, SurfaceShape) {
        alone(self.method, &mut self.star, offsets)
    }

    /// Takes the neighbourhood of `owner` to [`estimate`](Self::estimate) it with others, which is
    /// faster; calls `settle` with owners and outcomes when there are enough.
    pub fn take(
        &mut self,
        owner: usize,
        neighborhood: &Neighborhood<'_>,
        settle: &mut impl FnMut(usize, EstimateOutcome),
    ) {
        if self.method.is_height() || !self.bundle.take(owner, neighborhood) {
            let offsets =
                in_morton_order(neighborhood.offsets().iter().copied(), neighborhood.ranks());
            settle(owner, self.estimate(&offsets));
        } else if self.bundle.is_full() {
            self.finish(settle);
        }
    }

    /// Calls `settle` for what was taken and is not settled yet.
    pub fn finish(&mut self, settle: &mut impl FnMut(usize, EstimateOutcome)) {
        self.bundle.estimate(self.method, self.simd, &mut self.star, settle);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point::distance2;
    use proptest::prelude::*;

    /// Noisy surfaces, grids full of ties and cocircular points, lines, scan lines, edges, walls,
    /// far points; most with equally many neighbours.
    fn neighborhoods() -> impl Strategy<Value = Vec<Vec<[i64; 3]>>> {
        let count = prop::sample::select(vec![1usize, 2, 3, 8, 10, 10, 10, 16, 64, 66]);
        count.prop_flat_map(|count| prop::collection::vec(neighborhood(count), 1..40))
    }

    fn neighborhood(count: usize) -> impl Strategy<Value = Vec<[i64; 3]>> {
        let width = prop::sample::select(vec![2i64, 4, 40, 1000, 1 << 21, 1 << 23, 1 << 40]);
        let height = prop::sample::select(vec![0i64, 1, 30]);
        let step = prop::sample::select(vec![1i64, 1, 12, 1 << 13]);
        // How far neighbours are to one side and to the other.
        let sides = prop::sample::select(vec![(-1i64, 1i64), (-1, 1), (0, 1), (-1, 0)]);
        let thinner = prop::sample::select(vec![1i64, 1, 10, 100]);
        let shape = (width, height, 0usize..3, step, sides, thinner);
        shape.prop_flat_map(move |(width, height, up, step, (low, high), thinner)| {
            let across = width / thinner;
            let one = (-width..=width, low * across..=high * across, -height..=height);
            prop::collection::vec(one, count).prop_map(move |offsets| {
                let mut offsets: Vec<_> = offsets.into_iter().map(|(x, y, z)| [x, y, z]).collect();
                offsets.sort_unstable();
                offsets.dedup();
                offsets.retain(|o| *o != [0; 3]);
                offsets.iter_mut().for_each(|o| o.swap(2, up));
                offsets.iter_mut().for_each(|o| *o = o.map(|v| v * step));
                offsets
            })
        })
    }

    proptest! {
        #[test]
        fn normals_estimated_together_are_those_estimated_alone(
            neighborhoods in neighborhoods(),
            method in prop::sample::select(vec![
                Method::Pca, Method::Varady, Method::Delaunay, Method::Quadric, Method::Cubic,
            ]),
        ) {
            for simd in Simd::all() {
                let mut estimator = Estimator::with(method, simd);
                let mut together = vec![None; neighborhoods.len()];
                let mut settle = |i: usize, outcome| together[i] = Some(outcome);
                for (i, offsets) in neighborhoods.iter().enumerate() {
                    // Nearest first, as a search gives them.
                    let mut ranks: Vec<u32> = (0..offsets.len() as u32).collect();
                    ranks.sort_by_key(|&rank| distance2([0; 3], offsets[rank as usize]));
                    let sorted: Vec<[i64; 3]> =
                        ranks.iter().map(|&rank| offsets[rank as usize]).collect();
                    let neighborhood = Neighborhood::of_offsets(&sorted, &ranks);
                    estimator.take(i, &neighborhood, &mut settle);
                }
                estimator.finish(&mut settle);
                for (offsets, together) in neighborhoods.iter().zip(together) {
                    let alone = estimator.estimate(offsets);
                    prop_assert_eq!(Some(alone), together, "{:?} by {:?}", offsets, simd);
                }
            }
        }
    }
}
