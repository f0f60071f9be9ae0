//! To which side normals point: up, towards a viewpoint, and on the borders of both.

use crate::support::tiles::*;
use pointmill::ops::normals::{Normals, Orient};
use pointmill::point::{NORMAL, Position};
use pointmill::report::Tally;
use pointmill::stage::TileOp;
use pointmill::tile::Tile;

const STEP: f64 = 0.5;

fn up() -> Normals {
    let mut stage = Normals::default();
    stage.orient = Orient::Up;
    stage
}

fn towards(viewpoint: [f64; 3]) -> Normals {
    let mut stage = Normals::default();
    (stage.orient, stage.viewpoint) = (Orient::Viewpoint, Some(viewpoint));
    stage
}

fn run(mut stage: Normals, scan: &[Position]) -> Tile {
    settle(&mut stage, scan, STEP);
    let mut tile = Tile::of(scan.to_vec());
    tile.columns.add(&stage.needs().writes, scan.len());
    stage.run(&mut tile, &mut Tally::default()).unwrap();
    tile
}

/// A sphere of radius 1,000 steps around `center`.
fn sphere(center: Position) -> Vec<Position> {
    let points = (0..2000).map(|i| {
        let z = 1.0 - (2 * i + 1) as f64 / 2000.0;
        let (around, across) = (f64::from(i) * 2.399_963, (1.0 - z * z).sqrt());
        let unit = [across * around.cos(), across * around.sin(), z];
        std::array::from_fn(|axis| center[axis] + (unit[axis] * 1000.0).round() as i64)
    });
    sorted(points)
}

fn normals(tile: &Tile) -> &[[f32; 3]] {
    tile.columns.get(&NORMAL).unwrap()
}

/// `a` and `b` agree but for signs; returns how many signs differ.
fn turned(a: &Tile, b: &Tile) -> usize {
    let opposite = |n: [f32; 3]| n.map(|c| -c);
    let pairs = normals(a).iter().zip(normals(b));
    assert!(pairs.clone().all(|(a, b)| a == b || opposite(*a) == *b));
    pairs.filter(|(a, b)| a != b).count()
}

#[test]
fn an_orientation_changes_signs_alone_and_says_so() {
    let scan = sphere([0; 3]);
    let none = run(Normals::default(), &scan);
    assert!(!none.oriented);
    for stage in [up(), towards([0.0; 3]), towards([1e6, -3.0, 0.25])] {
        let tile = run(stage, &scan);
        assert!(tile.oriented);
        let turned = turned(&none, &tile);
        assert!(turned > 300 && turned < 1900, "{turned}");
        let minus_zero = |n: &[f32; 3]| n.iter().any(|c| c.to_bits() == 1 << 31);
        assert!(!normals(&tile).iter().any(minus_zero));
    }
}

#[test]
fn up_is_a_positive_z() {
    let tile = run(up(), &sphere([1 << 40, -(1 << 41), 77]));
    assert!(normals(&tile).iter().all(|n| n[2] > 0.0 || n[2] == 0.0 && n[1] >= 0.0));
}

#[test]
fn on_walls_up_is_a_positive_y_and_then_x() {
    let wall = |at: fn(i64, i64) -> Position| {
        let scan = sorted((0..400).map(|i| at(i % 20 * 7, i / 20 * 5 + i % 3)));
        let tile = run(up(), &scan);
        assert!(normals(&tile).iter().all(|n| *n == normals(&tile)[0]), "it is flat");
        normals(&tile)[0]
    };
    let [x, y, z] = wall(|t, u| [t, t, u]);
    assert!(z == 0.0 && y > 0.7 && x < -0.7, "its largest component alone would make x positive");
    assert_eq!(wall(|t, u| [t, 3, u]), [0.0, 1.0, 0.0]);
    assert_eq!(wall(|t, u| [3, t, u]), [1.0, 0.0, 0.0]);
    assert_eq!(wall(|t, u| [t, u, 3]), [0.0, 0.0, 1.0]);
}

#[test]
fn a_viewpoint_sees_the_side_of_every_surface_that_faces_it() {
    for center in [[0; 3], [1_000_000, -2_000_000, 3_000], [(1 << 61) + 3, -(1 << 60), 5]] {
        let scan = sphere(center);
        let outwards = |tile: &Tile, i: usize| {
            let p = tile.positions[i];
            let n = normals(tile)[i];
            (0..3).map(|a| (p[a] - center[a]) as f64 * f64::from(n[a])).sum::<f64>() > 0.0
        };
        let world = center.map(|v| v as f64 * STEP);
        let tile = run(towards(world), &scan);
        assert!((0..scan.len()).all(|i| !outwards(&tile, i)), "from within, {center:?}");
        let above = [world[0], world[1], world[2] + 1e6 * STEP];
        let tile = run(towards(above), &scan);
        for (i, p) in scan.iter().enumerate() {
            let height = p[2] - center[2];
            if height.abs() > 100 {
                assert_eq!(outwards(&tile, i), height > 0, "{center:?}");
            }
        }
    }
}

#[test]
fn a_viewpoint_in_the_plane_leaves_the_sign_as_it_is() {
    let scan = sorted((0..400).map(|i| [i % 20 * 7, i / 20 * 5 + i % 3, 4]));
    for (height, z) in [(2.0, 1.0), (2.25, 1.0), (1.75, -1.0), (1e300, 1.0), (-1e300, -1.0)] {
        let tile = run(towards([1e3, 17.0, height]), &scan);
        assert!(normals(&tile).iter().all(|n| *n == [0.0, 0.0, z]), "{height}");
    }
}

#[test]
fn a_viewpoint_and_its_orient_need_each_other() {
    let told = refusal("kind = 'normals'\norient = 'viewpoint'");
    assert!(told.contains("p.toml:8") && told.contains("needs a `normals.viewpoint`"), "{told}");
    let told = refusal("kind = 'normals'\norient = 'up'\nviewpoint = [1, 2, 3]");
    assert!(told.contains("p.toml:9") && told.contains("does nothing without"), "{told}");
    let told = refusal("kind = 'normals'\norient = 'viewpoint'\nviewpoint = [1, 2, nan]");
    assert!(told.contains("finite"), "{told}");
    refusal("kind = 'normals'\norient = 'viewpoint'\nviewpoint = [1, 2]");
    refusal("kind = 'normals'\norient = 'viewpoint'\nviewpoint = [1, 2, 3, 4]");
    refusal("kind = 'median'\npasses = 17");
}
