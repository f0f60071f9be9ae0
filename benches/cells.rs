//! How long `cells` and `median` take for a point, on a rough plane of a million positions in cells
//! of about 33: `cargo bench --bench cells`.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a bench is no part of the program")]

use std::time::Instant;

use pointmill::internals::{TileKey, morton_cmp};
use pointmill::ops::{Cells, Median, Side, Split};
use pointmill::point::{Bounds, Dimension, Endian, Layout, NORMAL, Position, Scalar, Schema};
use pointmill::quantity::Length;
use pointmill::report::Tally;
use pointmill::stage::{Lattice, Levels, ScanFacts, TileOp};
use pointmill::tile::{Fate, Tile};

/// Positions a side of the plane.
const SIDE: i64 = 1000;
/// Steps between them.
const SPACING: i64 = 11;

/// A number in [−1, 1) that looks random.
fn noise(seed: u64) -> f64 {
    let mut v = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    v = (v ^ (v >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    v = (v ^ (v >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((v ^ (v >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// A plane whose normals are off by up to `roughness`, its estimated signs at random.
fn plane(roughness: f64) -> Tile {
    let mut positions: Vec<Position> = (0..SIDE * SIDE)
        .map(|i| {
            let jitter = |salt: u64| (noise(i as u64 * 3 + salt) * 5.0) as i64;
            [i % SIDE * SPACING + jitter(0), i / SIDE * SPACING + jitter(1), jitter(2)]
        })
        .collect();
    positions.sort_unstable_by(morton_cmp);
    positions.dedup();
    let normals: Vec<[f32; 3]> = (0..positions.len() as u64)
        .map(|i| {
            let (x, y) =
                (roughness * noise(i * 3 + (1 << 40)), roughness * noise(i * 3 + (2 << 40)));
            let length = (x * x + y * y + 1.0).sqrt() * noise(i).signum();
            [x / length, y / length, 1.0 / length].map(|v| v as f32)
        })
        .collect();
    let cube = TileKey::holding(&Bounds::of(positions.iter().copied())).cube();
    let mut tile = Tile::of(positions);
    (tile.cube, tile.zone) = (cube, cube);
    tile.columns.set(&NORMAL, &normals);
    tile
}

fn settled(side: i64, split: Split, tile: &Tile) -> Cells {
    let mut stage = Cells::default();
    (stage.side, stage.split) = (Side::Length(Length::of(side as f64).unwrap()), split);
    let axes = ["X", "Y", "Z"].iter().zip([0, 8, 16]);
    let schema = Schema {
        layout: Layout::plain("PLY"),
        endian: Endian::Little,
        stride: 24,
        dimensions: axes.map(|(name, at)| Dimension::new(*name, Scalar::F64, at)).collect(),
    };
    let (lattice, levels) = (Lattice::of(&schema, Some(1.0)).unwrap(), Levels::default());
    let mut facts = ScanFacts::new(tile.positions.len() as u64, tile.cube, &lattice, &levels);
    facts.positions = facts.points;
    stage.settle(&facts).unwrap();
    stage
}

fn main() {
    println!("{:28} {:>10} {:>10} {:>9} {:>9}", "scene", "cells", "groups", "ns/point", "median");
    for (name, roughness) in [("smooth", 0.01), ("noisy", 0.2), ("rough", 3.0)] {
        let mut tile = plane(roughness);
        for (how, side, split) in [
            ("aligned", 64, Split::Voronoi),
            ("unaligned", 63, Split::Voronoi),
            ("octant", 64, Split::Octant),
            ("large", 4096, Split::Voronoi),
        ] {
            let stage = settled(side, split, &tile);
            let mut best = [f64::INFINITY; 2];
            let mut tally = Tally::default();
            for _ in 0..7 {
                tally = Tally::default();
                tile.fates.fill(Fate::Kept);
                let start = Instant::now();
                stage.run(&mut tile, &mut tally).unwrap();
                let between = Instant::now();
                Median::default().run(&mut tile, &mut tally).unwrap();
                let points = tile.positions.len() as f64;
                best[0] = best[0].min((between - start).as_secs_f64() * 1e9 / points);
                best[1] = best[1].min(between.elapsed().as_secs_f64() * 1e9 / points);
            }
            println!(
                "{:28} {:>10} {:>10} {:>9.0} {:>9.0}",
                format!("{name}, {how}"),
                tally.counts["cells_initial"],
                tally.counts["cells"],
                best[0],
                best[1]
            );
        }
    }
}
