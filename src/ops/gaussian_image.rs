//! The stage `gaussian-image`: positions whose normals fall into one part of a sphere are a cell.

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::cells::{Grouping, POSITIONS_PER_CUBE};
use super::lengths::{LARGEST_SIDE, rounded};
use crate::geom::lattice::Lattice;
use crate::point::{NORMAL, Units};
use crate::quantity::{Length, Setting, Whole};
use crate::report::Tally;
use crate::stage::{Needs, Role, RoleName, ScanFacts, StageKind, StagePlace, TileOp};
use crate::tile::{Partition, Tile};
use crate::{Error, Result};

/// Most parts along an edge of a face.
const MOST_PARTS: u64 = 64;
const PARTS: Whole<1, MOST_PARTS> = Whole::of(8);
/// Bytes a position: member, turned, end of a group and of an initial one, and what it is sorted
/// by; where positions are sorted by cube 32 more.
const BYTES: usize = 4 + 1 + 4 + 4 + 8;
const SORTING_BYTES: usize = 32;

/// The Gaussian image of Zanaty et al., with which the paper compares: normals are put on the unit
/// sphere, the sphere is divided into parts, and positions whose normals fall into one part are a
/// cell. `median` with `pick = "centroid"` behind it is their method, which represents each cell by
/// its centre of mass; with another `pick` a point of the scan stays.
///
/// Each face of a cube around the sphere is divided into `parts` times `parts` parts, of equal
/// angles along its edges. Unless `normals` turned them to a side (`orient`), a normal and its
/// opposite are the same, so that half of the sphere is used.
///
/// Zanaty et al. divide the normals of a whole object, of which a part may be on several sides of
/// it. Here each cube of side `side`, anchored at world 0, is such an object: what is in one cell
/// is near by, and the method works on scans of any size. Where a cube holds the scan, the method
/// is theirs; it must then be in memory. A position without a normal is in no cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GaussianImage {
    /// Side of the cubes: a length above 0, or `"auto"`: the smallest power of two of lattice steps
    /// for which occupied cubes hold 32 positions on average, over the whole scan.
    pub side: Setting<Length>,
    /// Parts along each edge of a face of the cube around the sphere, 1 to 64.
    pub parts: Whole<1, MOST_PARTS>,
    /// The side in lattice steps and in world units, once the scan is known.
    #[serde(skip)]
    settled: Option<(i64, f64)>,
}

impl Default for GaussianImage {
    fn default() -> Self {
        GaussianImage { side: Setting::Auto, parts: PARTS, settled: None }
    }
}

impl StageKind for GaussianImage {
    const KIND: &'static str = "gaussian-image";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Divides the scan into cells of normals in one part of the sphere.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::TileOp(Box::new(self)))
    }
}

impl TileOp for GaussianImage {
    fn needs(&self) -> Needs {
        let (side, _) = self.settled.unwrap_or_default();
        let aligned = side.count_ones() == 1 || self.side == Setting::Auto;
        let bytes = BYTES + if aligned { 0 } else { SORTING_BYTES };
        Needs::none().reads(&NORMAL).makes_cells().cells(side, aligned).bytes_per_point(bytes)
    }

    fn convert(&mut self, units: &Units) -> Result<()> {
        if let Setting::Given(side) = &mut self.side {
            *side = side.in_scan(units, "gaussian-image.side")?;
        }
        Ok(())
    }

    fn lengths(&self) -> Vec<(&'static str, Length)> {
        self.side.given().map(|side| ("gaussian-image.side", side)).into_iter().collect()
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        let steps = match self.side {
            Setting::Auto => 1 << scan.levels.smallest_side(POSITIONS_PER_CUBE).min(62),
            Setting::Given(side) => scan.lattice.steps(side.value()).min(LARGEST_SIDE),
        };
        self.settled = Some((steps, steps as f64 * scan.lattice.step));
        Ok(())
    }

    fn warnings(&self, lattice: &Lattice) -> Vec<String> {
        let each = self.lengths().into_iter();
        each.filter_map(|(address, length)| rounded(lattice, address, length.value())).collect()
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let (side, _) = self.settled.ok_or_else(|| {
            Error::internal("the stage gaussian-image ran before its side was settled")
        })?;
        if u32::try_from(tile.positions.len()).is_err() {
            return Err(Error::internal("a tile has more than 2^32 positions"));
        }
        let mut cells = std::mem::take(&mut tile.cells);
        cells.clear();
        cells.reference = None;
        let normals = tile.columns.get(&NORMAL)?;
        let crossing = Grouping { tile, normals, side, by_class: false }.run(&mut cells);
        let part = |i: u32| SpherePart::of(normals[i as usize], self.parts.get(), tile.oriented);
        // A cell counts in the tile whose core has its Morton-first position.
        let owned = |cells: &Partition| {
            let first = |group: Range<usize>| cells.members[group.start] as usize;
            cells.groups().filter(|group| tile.core.contains(&first(group.clone()))).count() as u64
        };
        let initial = owned(&cells);
        divide(&mut cells, part);
        let all = owned(&cells);
        tally.work("crossing_cells", crossing);
        tally.count("cells_initial", initial);
        tally.count("cells", all);
        tile.cells = cells;
        Ok(())
    }

    fn decisions(&self) -> Vec<(String, Value)> {
        self.settled.map_or(Vec::new(), |(steps, length)| {
            vec![("side".into(), length.into()), ("side_steps".into(), steps.into())]
        })
    }
}

/// Divides each group of `cells` by the part of the sphere that its normals are in.
fn divide(cells: &mut Partition, part: impl Fn(u32) -> SpherePart) {
    let ends = std::mem::take(&mut cells.ends);
    cells.ends.reserve_exact(cells.members.len());
    cells.turned.resize(cells.members.len(), false);
    let (mut start, mut keyed) = (0, Vec::new());
    for end in ends {
        let members = &mut cells.members[start..end as usize];
        keyed.clear();
        keyed.reserve_exact(members.len());
        keyed.extend(members.iter().map(|&i| part(i).before(i)));
        keyed.sort_unstable();
        for (at, key) in keyed.iter().enumerate() {
            (members[at], cells.turned[start + at]) = ((key >> 1) as u32, key & 1 == 1);
            if keyed.get(at + 1).is_none_or(|next| next >> MEMBER_BITS != key >> MEMBER_BITS) {
                cells.ends.push((start + at + 1) as u32);
            }
        }
        start = end as usize;
    }
}

/// A part of the unit sphere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct SpherePart {
    number: u32,
    /// True if the opposite of the normal is in it.
    turned: bool,
}

/// Bits below the number of a part: a member, and whether its normal is turned.
const MEMBER_BITS: u32 = u32::BITS + 1;

impl SpherePart {
    /// What sorts members by their parts, and those of one part in their order.
    fn before(self, member: u32) -> u64 {
        u64::from(self.number) << MEMBER_BITS | u64::from(member) << 1 | u64::from(self.turned)
    }

    /// That of a unit normal; where its sign means nothing, that of the one of the two whose
    /// largest component is positive.
    fn of(normal: [f32; 3], parts: u64, oriented: bool) -> SpherePart {
        let axis =
            (1..3).fold(
                0,
                |best, axis| {
                    if normal[axis].abs() > normal[best].abs() { axis } else { best }
                },
            );
        let is_back = normal[axis] < 0.0;
        let turned = is_back && !oriented;
        let sign = if turned { -1.0 } else { 1.0 };
        let depth = f64::from(normal[axis].abs());
        let along = |other: usize| {
            let slope = sign * f64::from(normal[(axis + other) % 3]) / depth;
            let angle = libm::atan(slope) / std::f64::consts::FRAC_PI_4;
            (((angle + 1.0) / 2.0 * parts as f64) as u64).min(parts - 1)
        };
        let face = (2 * axis + usize::from(is_back && oriented)) as u64;
        SpherePart { number: ((face * parts + along(1)) * parts + along(2)) as u32, turned }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opposite_normals_are_in_one_part_unless_they_are_oriented() {
        for normal in [[0.6, 0.0, 0.8], [-0.6, 0.64, 0.48], [0.0, -1.0, 0.0], [0.577; 3]] {
            let back = normal.map(|v: f32| -v);
            for parts in [1, 2, 8] {
                let (one, two) =
                    (SpherePart::of(normal, parts, false), SpherePart::of(back, parts, false));
                assert_eq!(one.number, two.number, "{normal:?}");
                assert!(one.turned != two.turned);
                let (one, two) =
                    (SpherePart::of(normal, parts, true), SpherePart::of(back, parts, true));
                assert!(one.number != two.number && !one.turned && !two.turned, "{normal:?}");
            }
        }
    }

    #[test]
    fn parts_are_of_equal_angles() {
        // Eight parts along an edge of 90 degrees: each is 11.25 wide.
        let number = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            SpherePart::of([0.0, sin as f32, cos as f32], 8, true).number
        };
        let edges: Vec<u32> =
            (0..8).map(|at| number(-45.0 + 11.25 * f64::from(at) + 0.1)).collect();
        let ends: Vec<u32> =
            (1..=8).map(|at| number(-45.0 + 11.25 * f64::from(at) - 0.1)).collect();
        assert_eq!(edges, ends);
        assert!(edges.windows(2).all(|pair| pair[0] != pair[1]), "{edges:?}");
    }

    #[test]
    fn a_cube_is_divided_by_the_sphere_in_morton_order() {
        let mut tile = Tile::of((0..6).map(|x| [x, 0, 0]).collect());
        let (up, side): ([f32; 3], [f32; 3]) = ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
        let down = [0.0, 0.0, -1.0];
        tile.columns.set(&NORMAL, &[up, side, down, [f32::NAN; 3], up, side]);
        let stage = GaussianImage { settled: Some((8, 8.0)), ..GaussianImage::default() };
        let mut tally = Tally::default();
        stage.run(&mut tile, &mut tally).unwrap();
        assert_eq!(tile.cells.members, [1, 5, 0, 2, 4]);
        assert_eq!(tile.cells.ends, [2, 5]);
        assert_eq!(tile.cells.turned, [false, false, false, true, false]);
        assert_eq!((tally.counts["cells_initial"], tally.counts["cells"]), (1, 2));
    }

    #[test]
    fn keys_out_of_bounds_are_refused() {
        assert_eq!(toml::from_str::<GaussianImage>("").unwrap(), GaussianImage::default());
        assert!(toml::from_str::<GaussianImage>("side = '5cm'\nparts = 64").is_ok());
        for wrong in ["parts = 0", "parts = 65", "side = 0", "side = 'spread'"] {
            assert!(toml::from_str::<GaussianImage>(wrong).is_err(), "{wrong}");
        }
    }
}
