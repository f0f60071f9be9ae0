//! Maps of the report tiles from above: columns of tiles, joined to larger ones while there are too
//! many of them for a page.

use std::collections::BTreeMap;

use super::bits::Image;
use crate::Result;
use crate::picture::mixed;
use crate::report::TileFigures;

/// Columns along x or y at most.
const SIDE: i64 = 192;
/// Occupied columns at most.
const COLUMNS: usize = 1 << 14;

/// What the tiles of a column come to.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct TileColumn {
    left: u64,
    deviation: Option<f64>,
}

/// Columns of tiles.
#[derive(Debug)]
pub(super) struct TileMap {
    /// Side of a tile, and the x and y where tiles begin.
    side: f64,
    origin: [f64; 2],
    /// A column is 2^`joined` tiles wide.
    joined: u32,
    columns: BTreeMap<[i64; 2], TileColumn>,
    /// Smallest and largest column along x and y.
    extent: Option<[[i64; 2]; 2]>,
}

/// A map and its scale.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DrawnMap {
    /// A pixel a column.
    pub image: Image,
    /// What the last colour stands for, and more than that.
    pub most: f64,
}

/// Colours from nothing to the most.
const ERRORS: [[u8; 3]; 4] = [[238, 241, 244], [250, 214, 140], [233, 132, 70], [158, 32, 38]];
const DENSITIES: [[u8; 3]; 4] = [[236, 243, 246], [150, 200, 214], [46, 132, 166], [16, 52, 96]];
const PAPER: [u8; 3] = [255; 3];

impl TileMap {
    /// Of tiles of this side, one of which has a corner at `origin`.
    pub fn new(side: f64, origin: [f64; 2]) -> Self {
        TileMap { side, origin, joined: 0, columns: BTreeMap::new(), extent: None }
    }

    /// Adds a tile.
    pub fn add(&mut self, tile: &TileFigures) {
        let place = [0, 1].map(|axis| {
            let steps = (tile.corner[axis] - self.origin[axis]) / self.side;
            steps.round() as i64 >> self.joined
        });
        let column = TileColumn {
            left: tile.points.after,
            deviation: tile.deviation.map(|deviation| deviation.max),
        };
        self.put(place, column);
        while self.columns.len() > COLUMNS || self.size().iter().any(|side| *side > SIDE) {
            self.join();
        }
    }

    fn put(&mut self, place: [i64; 2], with: TileColumn) {
        let [low, high] = self.extent.unwrap_or([place; 2]);
        let least = [0, 1].map(|axis| low[axis].min(place[axis]));
        let most = [0, 1].map(|axis| high[axis].max(place[axis]));
        self.extent = Some([least, most]);
        let column = self.columns.entry(place).or_default();
        column.left += with.left;
        column.deviation = match (column.deviation, with.deviation) {
            (Some(one), Some(other)) => Some(one.max(other)),
            (one, other) => one.or(other),
        };
    }

    /// Joins four columns to one.
    fn join(&mut self) {
        let columns = std::mem::take(&mut self.columns);
        self.extent = None;
        self.joined += 1;
        for (place, column) in columns {
            self.put(place.map(|at| at >> 1), column);
        }
    }

    /// Columns along x and y.
    fn size(&self) -> [i64; 2] {
        let [low, high] = self.extent.unwrap_or([[0; 2]; 2]);
        [0, 1].map(|axis| high[axis] - low[axis] + 1)
    }

    /// Side of a column in world units.
    pub fn column_side(&self) -> f64 {
        self.side * f64::from(self.joined).exp2()
    }

    /// How far kept points are apart, about, as seen from above.
    pub fn spacing(&self) -> f64 {
        let left: u64 = self.columns.values().map(|column| column.left).sum();
        self.column_side() * (self.columns.len() as f64 / left.max(1) as f64).sqrt()
    }

    /// The largest deviation of each column; none where there is none.
    pub fn deviations(&self) -> Result<Option<DrawnMap>> {
        self.drawn(&ERRORS, |column| column.deviation)
    }

    /// The records that are left in each column for each unit of its area.
    pub fn densities(&self) -> Result<Option<DrawnMap>> {
        let area = self.column_side() * self.column_side();
        self.drawn(&DENSITIES, |column| Some(column.left as f64 / area))
    }

    fn drawn(
        &self,
        colors: &[[u8; 3]],
        of: impl Fn(&TileColumn) -> Option<f64>,
    ) -> Result<Option<DrawnMap>> {
        let mut figures: Vec<f64> = self.columns.values().filter_map(&of).collect();
        figures.sort_unstable_by(f64::total_cmp);
        // A few columns far beyond all others do not take all colours.
        let most = figures.get((figures.len().saturating_sub(1)) * 98 / 100).copied();
        let (Some(most), Some([low, _])) = (most, self.extent) else { return Ok(None) };
        let size = self.size().map(|side| side as u32);
        let mut pixels = PAPER.repeat(size[0] as usize * size[1] as usize);
        for (place, column) in &self.columns {
            let Some(figure) = of(column) else { continue };
            let share = if most > 0.0 { (figure / most).clamp(0.0, 1.0) } else { 0.0 };
            let x = (place[0] - low[0]) as usize;
            let y = size[1] as usize - 1 - (place[1] - low[1]) as usize;
            let at = 3 * (y * size[0] as usize + x);
            pixels[at..at + 3].copy_from_slice(&mixed(colors, share));
        }
        Ok(Some(DrawnMap { image: Image::of(size, &pixels)?, most }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{DeviationFigures, Pair};

    fn tile(x: f64, y: f64, z: f64, max: Option<f64>) -> TileFigures {
        let figures = |max| DeviationFigures { points: 9, rms: 0.0, max, at: [0.0; 3] };
        TileFigures {
            corner: [x, y, z],
            points: Pair { before: 10, after: 2 },
            plane: Pair { before: None, after: None },
            deviation: max.map(figures),
        }
    }

    #[test]
    fn tiles_above_each_other_are_one_column() {
        let mut map = TileMap::new(0.5, [0.25, 0.0]);
        map.add(&tile(0.25, 0.0, 0.0, Some(1.0)));
        map.add(&tile(0.25, 0.0, 0.5, Some(3.0)));
        map.add(&tile(-0.25, 0.5, 0.0, None));
        let two = TileColumn { left: 4, deviation: Some(3.0) };
        assert_eq!(map.columns.get(&[0, 0]), Some(&two));
        assert_eq!(map.columns.get(&[-1, 1]), Some(&TileColumn { left: 2, deviation: None }));
        let drawn = map.deviations().unwrap().unwrap();
        assert_eq!((drawn.image.width, drawn.image.height, drawn.most), (2, 2, 3.0));
        assert_eq!(map.densities().unwrap().unwrap().most, 8.0);
        assert_eq!(map.spacing(), 0.5 * (2.0f64 / 6.0).sqrt());
    }

    #[test]
    fn many_columns_are_joined_and_none_is_lost() {
        let mut map = TileMap::new(1.0, [0.0; 2]);
        for n in 0..1_000 {
            map.add(&tile(f64::from(n) - 500.0, f64::from(n % 7), 0.0, Some(f64::from(n))));
        }
        assert_eq!((map.joined, map.column_side()), (3, 8.0));
        assert!(map.size()[0] <= SIDE && map.columns.len() > 100);
        assert_eq!(map.columns.values().map(|column| column.left).sum::<u64>(), 2_000);
        let worst = map.columns.values().filter_map(|column| column.deviation).fold(0.0, f64::max);
        assert_eq!(worst, 999.0);
    }

    #[test]
    fn without_tiles_there_is_no_map() {
        assert_eq!(TileMap::new(1.0, [0.0; 2]).deviations().unwrap(), None);
    }
}
