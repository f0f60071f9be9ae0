//! Which positions a loader takes: all, a sample of them, or those that nothing kept is near to.
//!
//! A round that is coarse looks at few positions of a large cube. They are told as blocks are
//! unpacked, so that a tile never holds the others. That nothing kept is near takes a look into 27
//! cubes of a grid; but in Morton order a position is mostly covered by the point that covered the
//! one before, which is looked at first.

use crate::geom::hash::of_position;
use crate::point::{Position, distance2};

/// Which positions a loader takes.
#[derive(Debug, Default)]
pub(crate) enum Only {
    /// All.
    #[default]
    All,
    /// Those whose hash is at most so large.
    Sample {
        /// Of all hashes, that part.
        most: u64,
        /// See [`of_position`].
        seed: u64,
    },
    /// Those that no kept point covers.
    Uncovered(Cover),
}

impl Only {
    /// True if all are taken.
    pub fn is_all(&self) -> bool {
        matches!(self, Only::All | Only::Sample { most: u64::MAX, .. })
    }

    /// True if it takes `p`.
    #[inline]
    pub fn takes(&mut self, p: Position) -> bool {
        match self {
            Only::All => true,
            Only::Sample { most, seed } => of_position(*seed, p) <= *most,
            Only::Uncovered(cover) => !cover.covers(p),
        }
    }
}

/// Points that cover what is nearer to them than a distance.
#[derive(Debug)]
pub(crate) struct Cover {
    apart: i64,
    apart2: u128,
    /// Cube after cube.
    points: Vec<Position>,
    /// Begin of each cube in `points`, in the order of the cubes.
    cubes: Vec<([i64; 3], u32)>,
    /// Number of a cube and 1, or 0, where the hash of its place or a slot behind says.
    slots: Vec<u32>,
    last: Option<Position>,
}

impl Cover {
    /// Of fewer than 2^32 points, each of which covers what is nearer than `apart` steps.
    pub fn new(points: &[Position], apart: i64) -> Cover {
        let apart = apart.max(1);
        let place = |p: &Position| p.map(|v| v.div_euclid(apart));
        let mut points = points.to_vec();
        points.sort_unstable_by_key(|p| (place(p), *p));
        let mut cubes: Vec<([i64; 3], u32)> = Vec::new();
        for (i, p) in points.iter().enumerate() {
            let at = place(p);
            if cubes.last().is_none_or(|(last, _)| *last != at) {
                cubes.push((at, i as u32));
            }
        }
        let slots = vec![0; (2 * cubes.len()).next_power_of_two()];
        let apart2 = u128::from(apart.unsigned_abs()).pow(2);
        let mut cover = Cover { apart, apart2, points, cubes, slots, last: None };
        for number in 0..cover.cubes.len() {
            let slot = cover.find(cover.cubes[number].0).0;
            cover.slots[slot] = number as u32 + 1;
        }
        cover
    }

    /// True if a point is nearer to `p` than the distance.
    fn covers(&mut self, p: Position) -> bool {
        if self.last.is_some_and(|last| distance2(last, p) < self.apart2) {
            return true;
        }
        let at = p.map(|v| v.div_euclid(self.apart));
        // The cube of the position itself comes first.
        let around = (0..27).map(|n| [(n + 13) % 27 % 3, (n + 13) % 27 / 3 % 3, (n + 13) % 27 / 9]);
        for by in around {
            let place = std::array::from_fn(|axis| at[axis] + by[axis] - 1);
            let near = self.cube(place).iter().find(|q| distance2(**q, p) < self.apart2);
            if let Some(&near) = near {
                self.last = Some(near);
                return true;
            }
        }
        false
    }

    fn cube(&self, place: [i64; 3]) -> &[Position] {
        let Some(number) = self.find(place).1 else { return &[] };
        let begin = self.cubes[number].1 as usize;
        let end = self.cubes.get(number + 1).map_or(self.points.len(), |next| next.1 as usize);
        &self.points[begin..end]
    }

    /// The slot of the cube at `place`, or where it would be, and its number if there is one. Half
    /// of the slots are free at least.
    fn find(&self, place: [i64; 3]) -> (usize, Option<usize>) {
        let mask = self.slots.len() - 1;
        let mut slot = of_position(0, place) as usize & mask;
        loop {
            match self.slots[slot].checked_sub(1) {
                None => return (slot, None),
                Some(number) if self.cubes[number as usize].0 == place => {
                    return (slot, Some(number as usize));
                }
                Some(_) => slot = (slot + 1) & mask,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_covered_is_nearer_than_the_distance_to_a_point() {
        let mut seed = 7u64;
        let mut next = |most: u64| {
            seed = of_position(seed, [1, 2, 3]);
            (seed % most) as i64 - most as i64 / 2
        };
        for apart in [1, 2, 5, 9] {
            let points: Vec<Position> = (0..40).map(|_| [next(60), next(60), next(20)]).collect();
            let mut only = Only::Uncovered(Cover::new(&points, apart));
            let mut counts = [0, 0];
            for _ in 0..3000 {
                let p = [next(70), next(70), next(30)];
                let near = points.iter().any(|q| distance2(*q, p) < (apart * apart) as u128);
                assert_eq!(only.takes(p), !near, "{p:?} {apart}");
                counts[usize::from(near)] += 1;
            }
            assert!(counts[0] > 0 && (counts[1] > 0 || apart == 1), "{counts:?}");
        }
        assert!(Only::Uncovered(Cover::new(&[], 3)).takes([0; 3]));
    }
}
