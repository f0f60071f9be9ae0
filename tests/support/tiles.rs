//! Tiles, lattices and tallies for tests that drive stages by hand.

use pointmill::internals::{TileKey, morton_cmp};
use pointmill::point::{Bounds, Dimension, Endian, Layout, Position, Scalar, Schema};
use pointmill::report::Tally;
use pointmill::stage::{Lattice, Levels, ScanFacts, TileOp};
use pointmill::tile::{Fate, Tile};

/// Distinct positions in Morton order.
pub fn sorted(positions: impl IntoIterator<Item = Position>) -> Vec<Position> {
    let mut sorted: Vec<Position> = positions.into_iter().collect();
    sorted.sort_by(morton_cmp);
    sorted.dedup();
    sorted
}

/// The occupied octree nodes of at most `most` positions, the largest such, in Morton order.
pub fn cubes(scan: &[Position], most: usize) -> Vec<Bounds> {
    let mut keys = vec![TileKey::holding(&Bounds::of(scan.iter().copied()))];
    let mut cubes = Vec::new();
    while let Some(key) = keys.pop() {
        let cube = key.cube();
        let count = scan.iter().filter(|p| cube.contains(**p)).count();
        match key.children() {
            Some(halves) if count > most => keys.extend(halves.into_iter().rev()),
            _ if count > 0 => cubes.push(cube),
            _ => {}
        }
    }
    cubes
}

/// The tile of `cube`, grown by `reach`; all of the scan is loaded.
pub fn tile(scan: &[Position], cube: Bounds, reach: i64) -> Tile {
    let mut tile = Tile::of(scan.to_vec());
    let start = scan.iter().take_while(|p| !cube.contains(**p)).count();
    let count = scan.iter().filter(|p| cube.contains(**p)).count();
    (tile.cube, tile.zone, tile.core) = (cube, cube.grown(reach), start..start + count);
    tile
}

/// Settles a stage on `scan`, on a lattice of this step.
pub fn settle(stage: &mut dyn TileOp, scan: &[Position], step: f64) {
    let axes = ["X", "Y", "Z"].iter().zip([0, 8, 16]);
    let schema = Schema {
        layout: Layout::plain("PLY"),
        endian: Endian::Little,
        stride: 24,
        dimensions: axes.map(|(name, at)| Dimension::new(*name, Scalar::F64, at)).collect(),
    };
    let lattice = Lattice::of(&schema, Some(step)).unwrap();
    let mut levels = Levels::default();
    for (i, p) in scan.iter().enumerate() {
        levels.add(i.checked_sub(1).map(|before| scan[before]), *p);
    }
    let bounds = Bounds::of(scan.iter().copied());
    let facts = ScanFacts::new(scan.len() as u64, bounds, &lattice, &levels);
    stage.settle(&facts).unwrap();
}

/// What became of the positions of a tile's core.
pub fn fates(tile: &Tile) -> Vec<(Position, Fate)> {
    tile.core.clone().map(|i| (tile.positions[i], tile.fates[i])).collect()
}

pub fn removed(tally: &Tally, stage: &str, reason: &'static str) -> u64 {
    tally.removed.get(&(stage.to_owned(), reason.into())).copied().unwrap_or(0)
}

/// Exact squared distance of positions that are not far apart.
pub fn far2(a: Position, b: Position) -> i128 {
    (0..3).map(|i| (i128::from(a[i]) - i128::from(b[i])).pow(2)).sum()
}

/// What a pipeline of a made-up scan with this stage is refused for.
pub fn refusal(stage: &str) -> String {
    let text = format!(
        "[[stage]]\nkind = 'synth'\nscene = 'plane'\npoints = 10\n\n[[stage]]\n{stage}\n\n\
         [[stage]]\nkind = 'write'\npath = 'out.las'\n"
    );
    let registry = pointmill::Registry::builtin();
    match pointmill::Graph::parse(&text, "p.toml", &registry) {
        Ok(_) => panic!("not refused: {stage}"),
        Err(error) => format!("{error:?}\n{error}"),
    }
}
