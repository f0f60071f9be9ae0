//! Meshes that are thinned.

use super::*;
use crate::geom::hash::of_position;
use crate::geom::morton::morton_cmp;

/// Positions of a surface over 0 to 10,000, in Morton order.
fn surface(count: u64, depth: impl Fn(f64, f64) -> f64) -> Vec<Position> {
    let at = |seed: u64, n: u64| (of_position(seed, [n as i64, 0, 0]) % 10_000) as i64;
    let mut all: Vec<Position> = (0..count)
        .map(|n| {
            let (x, y) = (at(1, n), at(2, n));
            [x, y, depth(x as f64, y as f64) as i64]
        })
        .collect();
    all.sort_by(morton_cmp);
    all.dedup();
    all
}

fn thinned(positions: &[Position], most: u64) -> (ThinnedMesh, Vec<f32>) {
    let lo = [0, 1, 2].map(|axis| positions.iter().map(|p| p[axis]).min().unwrap());
    let mut mesh = ThinnedMesh::of(positions, lo, 2, || Ok(())).unwrap();
    mesh.thin(most, || Ok(())).unwrap();
    let distances = mesh.distances(positions);
    (mesh, distances)
}

#[test]
fn so_many_corners_are_left_and_the_rest_is_near_the_mesh() {
    let positions = surface(3000, |x, y| 0.2 * x + 0.1 * y);
    let (mesh, distances) = thinned(&positions, 300);
    assert_eq!(mesh.corners(), 300);
    assert_eq!(distances.iter().filter(|d| d.is_nan()).count(), 300);
    let largest = distances.iter().copied().fold(0.0, f32::max);
    assert!(largest <= 2.0, "a plane stays one but for rounding: {largest}");
    // Flat parts thin out evenly: each quarter keeps its share.
    let kept = positions.iter().zip(&distances).filter(|(_, d)| d.is_nan());
    let left = kept.filter(|(p, _)| p[0] < 5000 && p[1] < 5000).count();
    assert!((50..100).contains(&left), "{left} of 300 are in a quarter");
}

#[test]
fn more_corners_stay_where_a_surface_bends() {
    let ridge = |x: f64, _: f64| 3.0 * (x - 5000.0).abs();
    let positions = surface(4000, ridge);
    let (_, distances) = thinned(&positions, 400);
    let kept: Vec<&Position> =
        positions.iter().zip(&distances).filter(|(_, d)| d.is_nan()).map(|(p, _)| p).collect();
    let near = |p: &Position| (p[0] - 5000).abs() < 400;
    let share = kept.iter().filter(|p| near(p)).count() as f64 / kept.len() as f64;
    assert!(share > 0.2, "{share} of the kept points lie along the ridge, of all 0.08");
}

#[test]
fn what_waits_is_every_triangle_of_the_mesh_at_any_time() {
    // A border of hundreds of corners on lines, around which a few are left.
    let mut positions = surface(900, |x, y| (x * y) / 9000.0);
    positions.extend((0..400).flat_map(|n| [[25 * n, 0, 3], [0, 25 * n, 9], [25 * n, 9999, 0]]));
    positions.sort_by(morton_cmp);
    positions.dedup();
    let lo = [0, 0, 0];
    for most in [1900, 1500, 1250] {
        let mut mesh = ThinnedMesh::of(&positions, lo, 2, || Ok(())).unwrap();
        mesh.thin(most, || Ok(())).unwrap();
        let waiting: std::collections::BTreeSet<[u32; 3]> =
            mesh.waiting.iter().map(|Reverse((_, positions))| *positions).collect();
        for face in mesh.mesh.inner_faces() {
            let Reverse((_, positions)) =
                mesh.waiting(face.vertices().map(|corner| *corner.data()));
            let border = face.vertices().iter().all(is_on_border);
            assert!(border || waiting.contains(&positions), "{positions:?} of {most}");
        }
    }
}

#[test]
fn positions_of_one_place_have_one_corner_and_lines_none_that_can_go() {
    let (mesh, distances) = thinned(&[[0, 0, 0], [0, 0, 7], [9, 0, 0], [0, 9, 0]], 1);
    assert_eq!(mesh.corners(), 3, "the border stays");
    assert!(distances[1] == 7.0 && distances.iter().filter(|d| d.is_nan()).count() == 3);
    let line: Vec<Position> = (0..10).map(|x| [x, 0, 0]).collect();
    assert_eq!(thinned(&line, 3).0.corners(), 10);
    assert_eq!(thinned(&[[4, 4, 4]], 1).0.corners(), 1);
}
