//! Triangles are those of the whole scan: none is missing, none is there twice, and no seam shows.

use std::collections::BTreeMap;

use super::file::{MeshRead, read_ply};
use super::oracle;
use crate::support::case::{Case, execute};
use crate::support::random::Random;
use pointmill::{Overrides, Quiet};

/// Points of one kind of surface, whole numbers each.
fn scene(kind: usize, points: usize, random: &mut Random) -> Vec<[i64; 3]> {
    let mut at = |most: u64| random.coordinate(most);
    (0..points as i64)
        .map(|n| match kind {
            // Scattered, some above each other.
            0 => [at(600), at(600), at(40)],
            // A grid, all of whose squares have four corners on a circle, with holes.
            1 => [7 * (n % 40), 7 * (n / 40), at(3)],
            // Scan lines, much denser along than across.
            2 => [at(1200), 30 * at(20), at(9)],
            // Clusters far from each other, on both sides of 0.
            3 => {
                let cluster = at(5);
                let corner = [[0, 0], [-900, 5], [900, 900], [-450, -800], [30, 870]];
                let [x, y] = corner[cluster as usize];
                [x + at(60), y + at(60), at(500) - 250]
            }
            // A wall: few places, many heights.
            4 => [at(300), at(3), at(4000)],
            // A line.
            _ => [n, 2 * n, at(5)],
        })
        .filter(|p| kind != 1 || (p[0] * 31 + p[1] * 17) % 9 != 0)
        .collect()
}

fn mesh(points: &[[i64; 3]], run: &str, keys: &str) -> MeshRead {
    let case = Case::new();
    let tagged: Vec<([f64; 3], u32)> =
        points.iter().zip(0..).map(|(p, tag)| (p.map(|v| v as f64), tag)).collect();
    case.ply(&tagged);
    let text = format!(
        "[run]\nlattice = 1.0\n{run}\n[[stage]]\nkind = 'read'\npath = '{}'\n[[stage]]\nkind = \
         'mesh'\npath = '{}'\n{keys}\n",
        case.path("in.ply").display(),
        case.path("out.ply").display()
    );
    execute(&text, &Overrides::default(), &Quiet).unwrap_or_else(|e| panic!("{e}: {text}"));
    read_ply(&case.path("out.ply"))
}

/// Holds a mesh against what it is to be; how many triangles it has.
fn check(points: &[[i64; 3]], most: Option<i64>, axis: usize, run: &str) -> usize {
    let radius = most.map_or(String::new(), |most| format!("max_radius = {most}"));
    let keys = format!("axis = '{}'\n{radius}", ["x", "y", "z"][axis]);
    let found = mesh(points, run, &keys);
    let turned = |p: [i64; 3]| [p[(axis + 1) % 3], p[(axis + 2) % 3], p[axis]];
    let written: Vec<[i64; 3]> =
        found.vertices.iter().map(|p| turned(p.map(|v| v as i64))).collect();
    let mut all: Vec<[i64; 3]> = points.iter().map(|p| turned(*p)).collect();
    let mut sorted = written.clone();
    all.sort_unstable();
    sorted.sort_unstable();
    assert_eq!(all, sorted, "all points are written");
    let expected = oracle::triangles(&written, most);
    let what = format!("{} points, radius {most:?}, axis {axis}, {run}", points.len());
    assert_eq!(found.faces.len(), expected.len(), "{what}");
    // Copies of a corner share its place, and any of them is it.
    let place = |n: usize| written[n];
    for (found, expected) in found.faces.iter().zip(&expected) {
        assert_eq!(found.map(place), expected.map(place), "{what}");
    }
    expected.len()
}

#[test]
fn the_triangles_are_those_of_the_whole_scan_wherever_it_is_cut() {
    let mut random = Random(16);
    let mut triangles = 0;
    for kind in 0..6 {
        for most in [None, Some(4), Some(11), Some(60)] {
            let points = scene(kind, 700, &mut random);
            for run in ["", "tile_points = 40\nthreads = 2", "tile_points = 1\nspill = 'always'"] {
                triangles += check(&points, most, 2, run);
            }
        }
    }
    assert!(triangles > 20_000, "{triangles}");
}

#[test]
fn any_axis_can_be_the_one_across() {
    let mut random = Random(3);
    for axis in 0..3 {
        for kind in [0, 3] {
            let points = scene(kind, 400, &mut random);
            assert!(check(&points, Some(50), axis, "tile_points = 30") > 100);
        }
    }
}

#[test]
fn a_mesh_is_a_surface_without_a_seam() {
    let mut random = Random(8);
    let points: Vec<[i64; 3]> = (0..3000)
        .map(|_| {
            let mut at = || random.coordinate(4000);
            let (x, y) = (at(), at());
            [x, y, (x * y) % 97]
        })
        .collect();
    let found = mesh(&points, "tile_points = 64", "max_radius = 200");
    // Every edge has one triangle on each side, but those at the border, which have one.
    let mut sides: BTreeMap<[usize; 2], usize> = BTreeMap::new();
    for [a, b, c] in &found.faces {
        for edge in [[*a, *b], [*b, *c], [*c, *a]] {
            assert_eq!(sides.insert(edge, 1), None, "an edge has two triangles on one side");
        }
    }
    let border = sides.keys().filter(|[a, b]| !sides.contains_key(&[*b, *a])).count();
    assert!(border < 400, "{border} edges are on a border");
    // Euler: vertices - edges + triangles is 1 for a disc.
    let mut corners: Vec<usize> = found.faces.iter().flatten().copied().collect();
    corners.sort_unstable();
    corners.dedup();
    let edges = (sides.len() + border) / 2;
    assert_eq!(corners.len() + found.faces.len(), edges + 1);
}

#[test]
fn few_points_and_none_are_a_mesh() {
    for points in [vec![], vec![[5, 5, 5]], vec![[0, 0, 0], [9, 9, 9]], vec![[4, 4, 1], [4, 4, 9]]]
    {
        assert_eq!(check(&points, None, 2, ""), 0);
        assert_eq!(check(&points, Some(3), 2, ""), 0);
    }
    assert_eq!(check(&[[0, 0, 0], [3, 0, 7], [0, 4, 9], [0, 0, 1]], Some(3), 2, ""), 1);
    // The first of one place by Morton order, also below 0.
    assert_eq!(check(&[[-3, 0, 0], [3, 0, 7], [0, -4, 9], [-3, 0, -6]], None, 2, ""), 1);
}
