//! Hand-made scans for the tests of `cells` and `median`, and both stages written as plainly as can
//! be: recursive, on cloned lists, over the whole scan at once.
#![allow(dead_code, clippy::unwrap_used, reason = "each test uses its part; tests may panic")]

use pointmill::internals::{
    MaxAngle, TileKey, cosine, direction, dominant_axis, is_turned, morton_cmp, outer_sum, sine2,
};
use pointmill::ops::{Cells, Measure, Median, Reference, Side, Split};
use pointmill::point::{Bounds, Dimension, Endian, Layout, NORMAL, Position, Scalar, Schema};
use pointmill::quantity::{Angle, Length, Setting};
use pointmill::report::Tally;
use pointmill::stage::{Lattice, Levels, ScanFacts, TileOp};
use pointmill::tile::{Fate, Tile};
use proptest::prelude::*;

pub const NONE: [f32; 3] = [f32::NAN; 3];
const X: [f64; 3] = [1.0, 0.0, 0.0];

/// A position, its normal and how many records share it.
#[derive(Debug, Clone, Copy)]
pub struct Point {
    pub at: Position,
    pub normal: [f32; 3],
    pub copies: u32,
}

/// Distinct positions in Morton order.
pub fn scan(points: impl IntoIterator<Item = (Position, [f32; 3], u32)>) -> Vec<Point> {
    let mut scan: Vec<Point> =
        points.into_iter().map(|(at, normal, copies)| Point { at, normal, copies }).collect();
    scan.sort_by(|a, b| morton_cmp(&a.at, &b.at));
    scan.dedup_by_key(|p| p.at);
    scan
}

pub fn whole(scan: &[Point]) -> TileKey {
    TileKey::holding(&Bounds::of(scan.iter().map(|p| p.at)))
}

/// The tile of `cube`, its zone grown by `side`, and nothing loaded beyond.
pub fn tile(scan: &[Point], cube: Bounds, side: i64) -> Tile {
    let zone = cube.grown(side);
    let loaded: Vec<Point> = scan.iter().copied().filter(|p| zone.contains(p.at)).collect();
    let start = loaded.iter().take_while(|p| !cube.contains(p.at)).count();
    let count = loaded.iter().filter(|p| cube.contains(p.at)).count();
    let mut tile = Tile::of(loaded.iter().map(|p| p.at).collect());
    (tile.cube, tile.zone, tile.core) = (cube, zone, start..start + count);
    tile.copies = loaded.iter().map(|p| p.copies).collect();
    tile.columns.set(&NORMAL, &loaded.iter().map(|p| p.normal).collect::<Vec<_>>());
    tile
}

/// As the keys of a stage.
pub fn length(steps: f64) -> Length {
    Length::of(steps).unwrap()
}

pub fn radians(angle: f64) -> Option<Setting<Angle>> {
    Some(Angle::radians(angle).unwrap().into())
}

pub fn spacing(length: Length) -> Setting<Length> {
    length.into()
}

pub fn cells(side: f64, max_angle: f64, split: Split) -> Cells {
    let mut stage = Cells::default();
    (stage.side, stage.max_angle, stage.split) =
        (Side::Length(length(side)), radians(max_angle), split);
    stage
}

/// Settles the stage on `scan`, on a lattice of whole numbers.
pub fn settle(mut stage: Cells, scan: &[Point]) -> Cells {
    let axes = ["X", "Y", "Z"].iter().zip([0, 8, 16]);
    let schema = Schema {
        layout: Layout::plain("PLY"),
        endian: Endian::Little,
        stride: 24,
        dimensions: axes.map(|(name, at)| Dimension::new(*name, Scalar::F64, at)).collect(),
    };
    let lattice = Lattice::of(&schema, Some(1.0)).unwrap();
    let mut levels = Levels::default();
    for (i, p) in scan.iter().enumerate() {
        levels.add(i.checked_sub(1).map(|before| scan[before].at), p.at);
    }
    let points = scan.iter().map(|p| u64::from(p.copies)).sum();
    let bounds = Bounds::of(scan.iter().map(|p| p.at));
    stage.settle(&ScanFacts::new(points, bounds, &lattice, &levels)).unwrap();
    stage
}

/// What a run over all tiles says: the fate of every position, and the tally.
#[derive(Debug)]
pub struct Outcome {
    pub fates: Vec<(Position, Fate)>,
    pub groups: Vec<Vec<Position>>,
    pub tally: Tally,
}

impl Outcome {
    pub fn kept(&self) -> Vec<Position> {
        let kept = self.fates.iter().filter(|f| !matches!(f.1, Fate::Represented { .. }));
        kept.map(|f| f.0).collect()
    }

    pub fn count(&self, name: &str) -> u64 {
        self.tally.counts.get(name).copied().unwrap_or(0)
    }
}

/// Runs both stages over the tiles of `cubes`.
pub fn run(stage: &Cells, scan: &[Point], cubes: &[Bounds]) -> Outcome {
    let side = stage.needs().cell_side;
    let mut outcome = Outcome { fates: Vec::new(), groups: Vec::new(), tally: Tally::default() };
    for cube in cubes {
        let mut tile = tile(scan, *cube, side);
        let mut tally = Tally::default();
        stage.run(&mut tile, &mut tally).unwrap();
        Median::default().run(&mut tile, &mut tally).unwrap();
        outcome.tally.merge(&tally);
        outcome.fates.extend(tile.core.clone().map(|i| (tile.positions[i], tile.fates[i])));
        outcome.groups.extend(groups(&tile));
    }
    outcome
}

/// Runs both stages with the whole scan in one tile.
pub fn run_whole(stage: Cells, scan: &[Point]) -> Outcome {
    run(&settle(stage, scan), scan, &[whole(scan).cube()])
}

/// The positions of every group.
pub fn groups(tile: &Tile) -> Vec<Vec<Position>> {
    let positions = |group: std::ops::Range<usize>| {
        tile.cells.members[group].iter().map(|&i| tile.positions[i as usize]).collect()
    };
    tile.cells.groups().map(positions).collect()
}

/// The partition of `scan`, written plainly: groups in no particular order.
pub fn plain_groups(scan: &[Point], stage: &Cells, side: i64) -> Vec<Vec<Point>> {
    let corner = |p: &Point| p.at.map(|v| v.div_euclid(side) * side);
    let mut corners: Vec<Position> = scan.iter().map(corner).collect();
    corners.sort_unstable();
    corners.dedup();
    let mut groups = Vec::new();
    for c in corners {
        let has_normal = |p: &&Point| corner(p) == c && !p.normal[0].is_nan();
        let cell: Vec<Point> = scan.iter().filter(has_normal).copied().collect();
        if !cell.is_empty() {
            plain_divide(cell, (c, [side; 3]), stage, &mut groups);
        }
    }
    groups
}

/// Of each member a number that falls as its angle grows, and whether its normal is turned.
fn plain_angles(cell: &[Point], stage: &Cells) -> Vec<(f64, bool)> {
    let axis = dominant_axis(outer_sum(cell.iter().map(|p| p.normal)));
    let n = match stage.reference.unwrap_or(Reference::X) {
        Reference::X => X,
        Reference::Y => [0.0, 1.0, 0.0],
        Reference::Z => [0.0, 0.0, 1.0],
        Reference::Vector(v) => {
            let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
            v.map(|c| c / length)
        }
    };
    let of = |p: &Point| {
        let turned = is_turned(axis, p.normal);
        match stage.measure {
            Measure::Axis => (cosine(n, p.normal, turned), turned),
            Measure::Cone => (-sine2(axis, p.normal), turned),
        }
    };
    cell.iter().map(of).collect()
}

/// The first of the largest values.
fn first_largest(values: &[f64]) -> usize {
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    values.iter().position(|&v| v == most).unwrap()
}

fn plain_sites(cell: &[Point], angles: &[(f64, bool)], stage: &Cells) -> (Point, Point) {
    let falling: Vec<f64> = angles.iter().map(|a| a.0).collect();
    let far = first_largest(&falling.iter().map(|v| -v).collect::<Vec<_>>());
    let near = match stage.measure {
        Measure::Axis => first_largest(&falling),
        Measure::Cone => {
            let unit = |i: usize| {
                let n = direction(cell[i].normal.map(f64::from)).unwrap();
                if angles[i].1 { n.map(|v| -v) } else { n }
            };
            let chord2 = |i| (0..3).map(|a| (unit(i)[a] - unit(far)[a]).powi(2)).sum::<f64>();
            first_largest(&(0..cell.len()).map(chord2).collect::<Vec<_>>())
        }
    };
    (cell[near], cell[far])
}

fn plain_divide(
    cell: Vec<Point>,
    cube: (Position, [i64; 3]),
    stage: &Cells,
    groups: &mut Vec<Vec<Point>>,
) {
    let angles = plain_angles(&cell, stage);
    let most = angles.iter().map(|a| a.0).fold(f64::NEG_INFINITY, f64::max);
    let least = angles.iter().map(|a| a.0).fold(f64::INFINITY, f64::min);
    let max_angle =
        MaxAngle::new(stage.max_angle.and_then(Setting::given).map_or(0.1, Angle::in_radians));
    let is_wide = match stage.measure {
        Measure::Axis => max_angle.is_exceeded(most, least),
        Measure::Cone => max_angle.is_exceeded_by(1.0 + 2.0 * least),
    };
    let tight = Bounds::of(cell.iter().map(|p| p.at));
    let length = tight.extent().into_iter().max().unwrap() as f64;
    let is_long = stage.max_side.is_some_and(|side| length > side.value());
    let is_short =
        stage.min_spacing.and_then(Setting::given).is_some_and(|least| length <= least.value());
    if !is_long && (cell.len() <= stage.min_points.get() || !is_wide || is_short) {
        groups.push(cell);
        return;
    }
    let is_one_angle = angles.iter().all(|a| a.0 == angles[0].0);
    let split = match stage.split {
        _ if is_long => Split::Octant,
        Split::Dirichlet if is_one_angle => Split::Voronoi,
        split => split,
    };
    match split {
        Split::Voronoi => {
            let (a, b) = plain_sites(&cell, &angles, stage);
            let far = |p: &Point, q: &Point| -> i128 {
                (0..3).map(|i| (i128::from(p.at[i]) - i128::from(q.at[i])).pow(2)).sum()
            };
            let (near, rest) = cell.into_iter().partition(|p| far(p, &a) <= far(p, &b));
            plain_divide(near, cube, stage, groups);
            plain_divide(rest, cube, stage, groups);
        }
        Split::Dirichlet => {
            // By angle, of equal ones in Morton order, which is that of the cell.
            let mut sorted: Vec<usize> = (0..cell.len()).collect();
            sorted.sort_by(|&a, &b| angles[b].0.total_cmp(&angles[a].0));
            let count = stage.seeds.unwrap_or(4).min(cell.len());
            let mut sites: Vec<usize> = Vec::new();
            for n in 0..count {
                let quantile = sorted[n * (cell.len() - 1) / (count - 1).max(1)];
                let is_first = |i: &&usize| angles[**i].0 == angles[quantile].0;
                let first = *sorted.iter().find(is_first).unwrap();
                if !sites.contains(&first) {
                    sites.push(first);
                }
            }
            let nearest = |p: &Point| {
                let far = |site: &usize| -> i128 {
                    let q = cell[*site].at;
                    (0..3).map(|i| (i128::from(p.at[i]) - i128::from(q[i])).pow(2)).sum()
                };
                let least = sites.iter().map(far).min().unwrap();
                sites.iter().position(|site| far(site) == least).unwrap()
            };
            for site in 0..sites.len() {
                let part: Vec<Point> =
                    cell.iter().filter(|p| nearest(p) == site).copied().collect();
                plain_divide(part, cube, stage, groups);
            }
        }
        Split::Octant => {
            let (corner, sides) = cube;
            for octant in 0..8 {
                let upper: [bool; 3] = std::array::from_fn(|axis| octant >> axis & 1 == 1);
                let lower = sides.map(|s| (s + 1) / 2);
                let start =
                    std::array::from_fn(|i| corner[i] + if upper[i] { lower[i] } else { 0 });
                let span =
                    std::array::from_fn(|i| if upper[i] { sides[i] - lower[i] } else { lower[i] });
                let inside =
                    |p: &&Point| (0..3).all(|i| (start[i]..start[i] + span[i]).contains(&p.at[i]));
                let part: Vec<Point> = cell.iter().filter(inside).copied().collect();
                if !part.is_empty() {
                    plain_divide(part, (start, span), stage, groups);
                }
            }
        }
    }
}

/// The position that stays of a group, written plainly. Coordinates below 2^40 only.
pub fn plain_median(group: &[Point], stage: &Cells) -> Position {
    let cosines: Vec<f64> = plain_angles(group, stage).iter().map(|a| a.0).collect();
    let mut sorted = cosines.clone();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let median = sorted[(group.len() - 1) / 2];
    let sum: [i128; 3] = std::array::from_fn(|i| group.iter().map(|p| i128::from(p.at[i])).sum());
    let offset2 = |p: &Point| -> i128 {
        (0..3).map(|i| (group.len() as i128 * i128::from(p.at[i]) - sum[i]).pow(2)).sum()
    };
    let alike = group.iter().zip(&cosines).filter(|(_, c)| **c == median);
    alike.min_by_key(|(p, _)| offset2(p)).unwrap().0.at
}

/// Normals of a few exact directions (so that angles tie) and their opposites, of any direction,
/// and none.
pub fn any_normal() -> impl Strategy<Value = [f32; 3]> {
    let few = prop::sample::select(vec![
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
        [0.6, 0.0, 0.8],
        [-0.6, 0.0, 0.8],
        [0.6, 0.0, -0.8],
        [1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.08, 0.0, 0.996_795],
    ]);
    let any = prop::array::uniform3(-1.0f64..1.0).prop_map(|v| {
        let length = v.iter().map(|c| c * c).sum::<f64>().sqrt().max(1e-9);
        v.map(|c| (c / length) as f32)
    });
    prop_oneof![6 => few, 3 => any, 1 => Just(NONE)]
}

/// Scans of up to `most` positions in a box of `width` around `center`, dense enough to tie.
pub fn any_scan(center: i64, width: i64, most: usize) -> impl Strategy<Value = Vec<Point>> {
    let at = prop::array::uniform3(center - width / 2..center + width / 2);
    prop::collection::vec((at, any_normal(), 1u32..4), most / 2..most).prop_map(scan)
}

/// Octree nodes below `key`, cut where they hold more than `most` positions.
fn cut(scan: &[Point], key: TileKey, most: usize, tiles: &mut Vec<Bounds>) {
    let count = scan.iter().filter(|p| key.cube().contains(p.at)).count();
    match key.children() {
        Some(children) if count > most => {
            children.into_iter().for_each(|child| cut(scan, child, most, tiles));
        }
        _ if count > 0 => tiles.push(key.cube()),
        _ => {}
    }
}

/// A cut of the scan into tiles of at most `most` positions.
pub fn tiles(scan: &[Point], most: usize) -> Vec<Bounds> {
    let mut tiles = Vec::new();
    cut(scan, whole(scan), most, &mut tiles);
    tiles
}
