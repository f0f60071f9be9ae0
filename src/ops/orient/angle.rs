//! Normals look to where the scan angle says: left or right of the way of flight, and up.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};

use super::sign::{TIME, turn};
use crate::geom::plane::dot;
use crate::point::{Column, NORMAL, Position, names};
use crate::report::Tally;
use crate::stage::{Gathered, Needs, ScanOp, TileOp};
use crate::tile::Tile;
use crate::{Error, Result};

const ANGLE: Column<f64> = Column::new(names::SCAN_ANGLE, &[]);
const SOURCE: Column<f64> = Column::new(names::POINT_SOURCE_ID, &[]);
/// Parts of a second that times are rounded to.
const PARTS: f64 = 1e4;

/// `orient` by scan angles.
#[derive(Debug, Default)]
pub(super) struct AngleOrientation {
    /// For each source what is to the right of its way, of length 1; none where it has no way.
    rights: Option<BTreeMap<u16, Option<[f64; 2]>>>,
}

/// Sums over the positions of a source.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FlightSums {
    source: u64,
    count: u64,
    /// Of time, of its square, of x, of y, and of time by x and by y.
    sums: [i128; 6],
}

impl FlightSums {
    fn of(source: u16) -> Self {
        FlightSums { source: source.into(), count: 0, sums: [0; 6] }
    }

    fn add(&mut self, time: f64, [x, y, _]: Position) {
        let [t, x, y] = [(time * PARTS).round() as i64, x, y].map(i128::from);
        self.count += 1;
        for (sum, term) in self.sums.iter_mut().zip([t, t * t, x, y, t * x, t * y]) {
            *sum = sum.wrapping_add(term);
        }
    }

    fn merge(&mut self, other: &FlightSums) {
        self.count += other.count;
        for (sum, term) in self.sums.iter_mut().zip(other.sums) {
            *sum = sum.wrapping_add(term);
        }
    }

    /// What is to the right of the way by least squares.
    fn right(&self) -> Option<[f64; 2]> {
        let n = self.count as f64;
        let [t, tt, x, y, tx, ty] = self.sums.map(|sum| sum as f64 / n);
        let spread = tt - t * t;
        let (vx, vy) = ((tx - t * x) / spread, (ty - t * y) / spread);
        let speed = (vx * vx + vy * vy).sqrt();
        (speed.is_finite() && speed > 0.0).then(|| [vy / speed, -vx / speed])
    }
}

impl TileOp for AngleOrientation {
    fn needs(&self) -> Needs {
        let needs = Needs::none().looks_at(names::XYZ).reads(&NORMAL).reads(&ANGLE);
        needs.reads(&SOURCE).writes(&NORMAL)
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let unfound = || Error::internal("the stage orient ran before ways were known");
        let rights = self.rights.as_ref().ok_or_else(unfound)?;
        let (angles, sources) = (tile.columns.take(&ANGLE)?, tile.columns.take(&SOURCE)?);
        turn(tile, tally, |_, i, normal| {
            let [right_x, right_y] = rights.get(&(sources[i] as u16)).copied().flatten()?;
            // LAS 1.4 R15, 2.6: negative to the left of the way of flight, 0 below the sensor.
            let angle = Some(angles[i].to_radians()).filter(|angle| angle.is_finite())?;
            let (sin, cos) = (libm::sin(angle), libm::cos(angle));
            let sight = [-right_x * sin, -right_y * sin, cos];
            Some(dot(normal.map(f64::from), sight) < 0.0)
        })?;
        tile.columns.put(angles);
        tile.columns.put(sources);
        Ok(())
    }
}

impl ScanOp for AngleOrientation {
    type Summary = Vec<FlightSums>;

    fn gather_needs(&self) -> Needs {
        let needs = Needs::none().looks_at(names::XYZ).reads(&TIME).reads(&SOURCE);
        // What the second phase reads is there from the first on.
        needs.reads(&NORMAL).bytes_per_point(2 * size_of::<FlightSums>() / MANY)
    }

    fn gather(&self, tile: &mut Tile, _: &mut Tally) -> Result<Vec<FlightSums>> {
        let (times, sources) = (tile.columns.get(&TIME)?, tile.columns.get(&SOURCE)?);
        let mut sums = BTreeMap::new();
        for i in tile.core.clone().filter(|&i| tile.is_chosen(i)) {
            let source = sources[i] as u16;
            let sum = sums.entry(source).or_insert_with(|| FlightSums::of(source));
            if times[i].is_finite() {
                sum.add(times[i], tile.positions[i]);
            }
        }
        Ok(sums.into_values().collect())
    }

    fn conclude(&mut self, gathered: &dyn Gathered<Vec<FlightSums>>) -> Result<Option<String>> {
        let mut all = BTreeMap::new();
        gathered.each(&mut |tile| {
            for sums in tile {
                let source = sums.source as u16;
                all.entry(source).or_insert_with(|| FlightSums::of(source)).merge(&sums);
            }
            Ok(())
        })?;
        let rights: BTreeMap<u16, Option<[f64; 2]>> =
            all.into_iter().map(|(source, sums)| (source, sums.right())).collect();
        let lost = rights.values().filter(|right| right.is_none()).count();
        self.rights = Some(rights);
        Ok((lost > 0).then(|| {
            format!(
                "`orient` finds no way of flight of {lost} values of PointSourceId: their normals \
                 stay as they are"
            )
        }))
    }
}

/// Positions that share a source, at least: of fewer the sums are bounded by what a call may hold.
const MANY: usize = 16;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_right_of_a_way_is_found_far_from_the_origin() {
        for ([vx, vy], right) in
            [([30.0, 0.0], [0.0, -1.0]), ([0.0, 50.0], [1.0, 0.0]), ([-3.0, -4.0], [-0.8, 0.6])]
        {
            let mut sums = FlightSums::of(1);
            for n in 0..2000 {
                // Points lie across the way, as a mirror throws them there.
                let (t, across) = (f64::from(n) * 0.01, f64::from(n * 37 % 201 - 100) * 1000.0);
                let along = [350_000_000.0 + vx * t * 1000.0, 5_600_000_000.0 + vy * t * 1000.0];
                let x = along[0] + across * right[0];
                let y = along[1] + across * right[1];
                sums.add(300_000_000.0 + t, [x as i64, y as i64, 0]);
            }
            let found = sums.right().unwrap();
            let off = (found[0] - right[0]).abs() + (found[1] - right[1]).abs();
            assert!(off < 0.05, "{found:?}, not {right:?}");
        }
        assert_eq!(FlightSums::of(1).right(), None);
    }
}
