//! The places where a reduction is farthest off: the worst report tiles, of those near each other
//! the worst alone.

use crate::report::TileFigures;

/// Places that a page shows.
pub(super) const PLACES: usize = 10;
/// Tiles that may become one of them; all others are forgotten.
const CANDIDATES: usize = 256;

/// A tile's largest deviation and where it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WorstPlace {
    /// In world units.
    pub deviation: f64,
    /// World coordinates.
    pub at: [f64; 3],
}

/// The worst tiles so far.
#[derive(Debug, Default)]
pub(super) struct WorstTiles(Vec<WorstPlace>);

impl WorstTiles {
    /// Adds the next tile. Of equally bad ones the first stays first.
    pub fn add(&mut self, tile: &TileFigures) {
        let Some(deviation) = tile.deviation.filter(|deviation| deviation.max > 0.0) else {
            return;
        };
        let worse = |place: &WorstPlace| place.deviation >= deviation.max;
        let at = self.0.partition_point(worse);
        if at < CANDIDATES {
            self.0.insert(at, WorstPlace { deviation: deviation.max, at: deviation.at });
            self.0.truncate(CANDIDATES);
        }
    }

    /// The worst places, none nearer than `apart` to a worse one.
    pub fn places(&self, apart: f64) -> Vec<WorstPlace> {
        let mut places: Vec<WorstPlace> = Vec::new();
        for place in &self.0 {
            let distance2 = |other: &WorstPlace| -> f64 {
                (0..3).map(|axis| (other.at[axis] - place.at[axis]).powi(2)).sum()
            };
            if places.len() < PLACES && places.iter().all(|p| distance2(p) >= apart * apart) {
                places.push(*place);
            }
        }
        places
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{DeviationFigures, Pair};

    fn tile(max: f64, x: f64) -> TileFigures {
        TileFigures {
            corner: [x, 0.0, 0.0],
            points: Pair { before: 10, after: 1 },
            plane: Pair { before: None, after: None },
            deviation: Some(DeviationFigures { points: 9, rms: 0.0, max, at: [x, 0.0, 0.0] }),
        }
    }

    #[test]
    fn places_are_the_worst_and_apart() {
        let mut tiles = WorstTiles::default();
        for (max, x) in [(1.0, 0.0), (3.0, 10.0), (2.9, 10.5), (2.0, 20.0), (2.0, 30.0), (0.0, 9.0)]
        {
            tiles.add(&tile(max, x));
        }
        tiles.add(&TileFigures { deviation: None, ..tile(9.0, 50.0) });
        let places: Vec<f64> = tiles.places(1.0).iter().map(|place| place.at[0]).collect();
        assert_eq!(places, [10.0, 20.0, 30.0, 0.0]);
    }

    #[test]
    fn only_so_many_tiles_are_held_and_the_worst_stay() {
        let mut tiles = WorstTiles::default();
        (0..10_000).for_each(|n| tiles.add(&tile(f64::from(n % 5_000), f64::from(n) * 10.0)));
        assert_eq!(tiles.0.len(), CANDIDATES);
        let places = tiles.places(1.0);
        let worst: Vec<f64> = places.iter().map(|place| place.deviation).collect();
        assert_eq!((places.len(), worst[0], worst[1], worst[2]), (10, 4999.0, 4999.0, 4998.0));
        assert_eq!((places[0].at[0], places[1].at[0]), (49_990.0, 99_990.0));
    }
}
