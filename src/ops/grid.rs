//! The stage `grid`: of every cube of one size, one point stays.

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::lengths::{LARGEST_SIDE, rounded};
use super::removal::{RemovalAccount, keep_once, remove, represent};
use crate::geom::angle::is_known;
use crate::geom::lattice::Lattice;
use crate::geom::plane::{Covariance, smallest};
use crate::point::{Bounds, NORMAL, Position, Units, center_distance2, distance2, names};
use crate::quantity::Length;
use crate::report::Tally;
use crate::stage::{Needs, Role, RoleName, ScanFacts, StageKind, StagePlace, TileOp};
use crate::tile::Tile;
use crate::{Error, Result};

/// Bytes a position: its key, its cube and its index, coordinates to take a median of, and an
/// offset. All positions may share one key.
const BYTES: usize =
    size_of::<u64>() + size_of::<CubeMember>() + size_of::<i64>() + size_of::<[i64; 3]>();
/// Positions of a cube from which on their least-squares plane says something of them: three are
/// always on one.
const FEWEST: usize = 4;

/// The uniform grid of Martin et al., with which the paper compares; elsewhere called voxel
/// thinning: of every occupied cube one record stays.
///
/// The cubes are anchored at world 0 and have the side `side`, rounded to whole lattice steps,
/// which the report names; a warning says if that is more than a thousandth off. It looks at
/// nothing but positions, so no stage needs to come before it. Copies weigh as one position and are
/// removed as coincident.
///
/// The report says how far what was removed lies from the plane through the point that stays: after
/// `normals` with the normal of that point; else with that of the least-squares plane of the cube's
/// positions, where there are four or more that are not on one line. What is in other cubes is not
/// measured, and the report counts what is.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Side of the cubes, a length above 0; rounded to whole lattice steps.
    pub side: Length,
    /// Which position of a cube stays; of equally good ones the first in Morton order.
    #[serde(default)]
    pub pick: Pick,
    #[serde(skip)]
    settled: Option<SettledSide>,
}

/// Which position of a cube stays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Pick {
    /// The nearest to the cube's centre.
    #[default]
    Center,
    /// The nearest to the lower medians of the x, of the y and of the z of the cube's positions.
    Median,
    /// The first in canonical order (Morton order). The fastest.
    First,
}

/// The side once the lattice is known.
#[derive(Debug, Clone, Copy)]
struct SettledSide {
    /// Lattice steps.
    steps: i64,
    /// World units.
    length: f64,
}

/// Which cube along each axis, from world 0, and the index of a position in it.
type CubeMember = ([i64; 3], u32);

impl Grid {
    /// A grid of cubes of that side.
    pub fn new(side: Length, pick: Pick) -> Self {
        Grid { side, pick, settled: None }
    }
}

impl StageKind for Grid {
    const KIND: &'static str = "grid";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Keeps one point of every cube of a uniform grid.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::TileOp(Box::new(self)))
    }
}

impl TileOp for Grid {
    fn needs(&self) -> Needs {
        let side = self.settled.map_or(0, |settled| settled.steps);
        let looks = Needs::none().looks_at(names::XYZ);
        looks.cells(side, side.count_ones() == 1).bytes_per_point(BYTES).removes(None).measures()
    }

    fn convert(&mut self, units: &Units) -> Result<()> {
        self.side = self.side.in_scan(units, "grid.side")?;
        Ok(())
    }

    fn lengths(&self) -> Vec<(&'static str, Length)> {
        vec![("grid.side", self.side)]
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        let steps = scan.lattice.steps(self.side.value()).min(LARGEST_SIDE);
        self.settled = Some(SettledSide { steps, length: steps as f64 * scan.lattice.step });
        Ok(())
    }

    fn warnings(&self, lattice: &Lattice) -> Vec<String> {
        rounded(lattice, "grid.side", self.side.value()).into_iter().collect()
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let side = self
            .settled
            .ok_or_else(|| Error::internal("the stage grid ran before its side was settled"))?
            .steps;
        if u32::try_from(tile.positions.len()).is_err() {
            return Err(Error::internal("a tile has more than 2^32 positions"));
        }
        let mut counts = CubeCounts::default();
        let (mut entries, mut axis) = (Vec::new(), Vec::new());
        for bucket in keyed(tile, side).chunk_by(|a, b| a >> u32::BITS == b >> u32::BITS) {
            entries.clear();
            entries.reserve_exact(bucket.len());
            entries.extend(bucket.iter().map(|&key| {
                let i = key as u32;
                (cube(tile.positions[i as usize], side), i)
            }));
            if entries.iter().any(|entry| entry.0 != entries[0].0) {
                entries.sort_unstable();
            }
            for group in entries.chunk_by(|a, b| a.0 == b.0) {
                if let Some(kept) = self.pick.of(tile, group, side, &mut axis) {
                    counts.decide(tile, group, kept);
                }
            }
        }
        let account = RemovalAccount { stage: "grid", marked: "grid_marked", mark: None };
        account.enter(tally, "coincident", counts.coincident);
        account.enter(tally, "represented", counts.represented);
        tally.count("grid_cubes", counts.cubes);
        Ok(())
    }

    fn decisions(&self) -> Vec<(String, Value)> {
        self.settled.map_or(Vec::new(), |settled| {
            vec![
                ("side".into(), settled.length.into()),
                ("side_steps".into(), settled.steps.into()),
            ]
        })
    }
}

/// What became of the positions of a tile's core.
#[derive(Default)]
struct CubeCounts {
    /// Cubes whose first position is in the core.
    cubes: u64,
    coincident: u64,
    represented: u64,
    /// Memory to work in.
    offsets: Vec<[i64; 3]>,
}

impl CubeCounts {
    /// Removes all positions of a cube but the one that is `kept`.
    fn decide(&mut self, tile: &mut Tile, group: &[CubeMember], kept: usize) {
        let core = tile.core.clone();
        let members = || group.iter().map(|(_, i)| *i as usize);
        self.cubes += u64::from(members().next().is_some_and(|first| core.contains(&first)));
        let normal = tile.columns.find(&NORMAL).map(|normals| normals[kept]);
        let known = normal.filter(|normal| is_known(*normal)).map(|normal| normal.map(f64::from));
        let normal = known.or_else(|| self.plane(tile, group, kept));
        for i in members().filter(|i| core.contains(i)) {
            if i == kept {
                self.coincident += keep_once(tile, i);
            } else if let Some(normal) = normal {
                self.represented += represent(tile, i, kept, normal);
            } else {
                self.represented += remove(tile, i);
            }
        }
    }

    /// The normal of the least-squares plane of a cube's positions; none where there are too few
    /// for a plane to say anything of them, or all on one line.
    fn plane(&mut self, tile: &Tile, group: &[CubeMember], kept: usize) -> Option<[f64; 3]> {
        if group.len() < FEWEST {
            return None;
        }
        let (at, others) = (tile.positions[kept], group.iter().map(|(_, i)| *i as usize));
        let offset = |i: usize| {
            let p = tile.positions[i];
            std::array::from_fn(|axis| p[axis].saturating_sub(at[axis]))
        };
        self.offsets.clear();
        // No more than is declared, which growing by itself would be.
        self.offsets.reserve_exact(group.len());
        self.offsets.extend(others.filter(|&i| i != kept).map(offset));
        let covariance = Covariance::of(&self.offsets);
        (!covariance.is_of_a_line()).then(|| smallest(covariance.matrix()).1)
    }
}

/// Which cube along each axis, from world 0.
fn cube(p: Position, side: i64) -> [i64; 3] {
    p.map(|v| v.div_euclid(side))
}

/// The positions that the stage decides about, as the lowest bits of their cubes above their
/// indices: those of a cube one after the other, in Morton order, with those of cubes far away
/// whose lowest bits are the same. Cubes that no position of the core is in may be missing.
fn keyed(tile: &Tile, side: i64) -> Vec<u64> {
    let Range { start, end } = tile.core;
    let core = Bounds::of(tile.positions[start..end].iter().copied());
    if core.is_empty() {
        return Vec::new();
    }
    let reached = Bounds { lo: cube(core.lo, side), hi: cube(core.hi, side) };
    let lowest = |v: i64, bits: u32| v as u64 & ((1 << bits) - 1);
    let mut keys = Vec::with_capacity(tile.positions.len());
    keys.extend(tile.positions.iter().enumerate().filter_map(|(i, &p)| {
        let cube @ [x, y, z] = cube(p, side);
        let cube_bits = lowest(z, 10) << 22 | lowest(y, 11) << 11 | lowest(x, 11);
        let is_in = reached.contains(cube) && tile.is_chosen(i);
        is_in.then_some(cube_bits << u32::BITS | i as u64)
    }));
    // Octree nodes follow one another in Morton order.
    if side.count_ones() > 1 {
        keys.sort_unstable();
    }
    keys
}

impl Pick {
    /// The position of a cube that stays. `axis` is memory to work in.
    fn of(
        self,
        tile: &Tile,
        group: &[CubeMember],
        side: i64,
        axis: &mut Vec<i64>,
    ) -> Option<usize> {
        let at = |entry: &CubeMember| tile.positions[entry.1 as usize];
        let (cube, first) = group.first()?;
        let nearest = |distance2: &dyn Fn(Position) -> u128| {
            let nearest = group.iter().min_by_key(|entry| (distance2(at(entry)), entry.1));
            nearest.map(|entry| entry.1 as usize)
        };
        match self {
            Pick::First => Some(*first as usize),
            Pick::Center => nearest(&|p| center_distance2(p, cube.map(|v| v * side), side)),
            Pick::Median => {
                let mut median = [0; 3];
                for (i, median) in median.iter_mut().enumerate() {
                    axis.clear();
                    axis.reserve_exact(group.len());
                    axis.extend(group.iter().map(|entry| at(entry)[i]));
                    let middle = (axis.len() - 1) / 2;
                    *median = *axis.select_nth_unstable(middle).1;
                }
                nearest(&|p| distance2(p, median))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_side_must_be_given_and_above_0() {
        let grid: Grid = toml::from_str("side = 2").unwrap();
        assert_eq!((grid.side.value(), grid.pick), (2.0, Pick::Center));
        let grid: Grid = toml::from_str("side = 0.5\npick = 'median'").unwrap();
        assert_eq!((grid.side.value(), grid.pick), (0.5, Pick::Median));
        for wrong in ["", "side = 0", "side = -1", "side = nan", "side = inf", "side = 'auto'"] {
            assert!(toml::from_str::<Grid>(wrong).is_err(), "{wrong}");
        }
        let told = toml::from_str::<Grid>("side = 0.0").unwrap_err().to_string();
        assert!(told.contains("a length above 0"), "{told}");
        assert!(toml::from_str::<Grid>("side = 1\npick = 'last'").is_err());
    }

    #[test]
    fn cubes_of_which_the_lowest_bits_are_the_same_are_apart() {
        use crate::tile::Fate;

        let far = 3 << 11;
        for pick in [Pick::Center, Pick::Median, Pick::First] {
            let mut tile =
                Tile::of(vec![[0, 0, 0], [1, 0, 0], [far, 0, 0], [far + 1, 0, 0], [0, far, 0]]);
            let settled = Some(SettledSide { steps: 3, length: 3.0 });
            let keys = keyed(&tile, 3);
            assert!(keys.iter().all(|key| key >> 32 == keys[0] >> 32), "{keys:x?}");
            let mut tally = Tally::default();
            Grid { settled, ..Grid::new(Length::of(3.0).unwrap(), pick) }
                .run(&mut tile, &mut tally)
                .unwrap();
            let kept: Vec<bool> = tile.fates.iter().map(|fate| *fate == Fate::Kept).collect();
            let first = pick != Pick::Center;
            assert_eq!(kept, [first, !first, first, !first, true], "{pick:?}");
        }
    }

    #[test]
    fn cubes_at_the_end_of_the_lattice_do_not_overflow() {
        let far = (1 << 62) - 1;
        for side in [1, 3, far, LARGEST_SIDE] {
            for pick in [Pick::Center, Pick::Median, Pick::First] {
                let mut tile = Tile::of(vec![[-far; 3], [far; 3]]);
                let length = 1.0;
                let grid = Grid {
                    settled: Some(SettledSide { steps: side, length }),
                    ..Grid::new(Length::of(1.0).unwrap(), pick)
                };
                grid.run(&mut tile, &mut Tally::default()).unwrap();
                assert!(tile.fates.iter().all(|fate| *fate == crate::tile::Fate::Kept));
            }
        }
    }
}
