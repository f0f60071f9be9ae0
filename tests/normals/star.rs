//! The star of a point and the fit over it, against a library triangulation of the same
//! neighbourhood and a least-squares fit in its rotated frame.

use super::solvers::{
    Vec3, angle, around, covariance, cross, dot, frame, jacobi, normalised, rotated_fit,
};
use crate::support::random::Random;
use pointmill::internals::plane::{self, Covariance};
use pointmill::internals::{Estimate, Estimator, Star};
use pointmill::ops::normals::Method;
use spade::{DelaunayTriangulation, Point2, Triangulation};

/// In-circle and orientation values (of vectors of length about 1) nearer to 0 than this are not
/// compared: there, rounding may decide.
const NEAR_ZERO: f64 = 1e-9;

/// The triangles of the library's triangulation that touch 0, as indices of `flat`, and whether 0
/// is on the border. None where a decision about them is too close.
fn triangles(flat: &[[f64; 2]]) -> Option<(Vec<[usize; 2]>, bool)> {
    let largest = flat.iter().flatten().fold(0.0f64, |m, c| m.max(c.abs()));
    let flat: Vec<[f64; 2]> = flat.iter().map(|q| q.map(|c| c / largest)).collect();
    let mut delaunay = DelaunayTriangulation::<Point2<f64>>::new();
    let center = delaunay.insert(Point2::new(0.0, 0.0)).unwrap();
    let handles: Vec<_> =
        flat.iter().map(|q| delaunay.insert(Point2::new(q[0], q[1])).unwrap()).collect();
    if delaunay.num_vertices() != flat.len() + 1 {
        return None;
    }
    let mut found = Vec::new();
    let mut border = false;
    for edge in delaunay.vertex(center).out_edges() {
        let Some(face) = edge.face().as_inner() else {
            border = true;
            continue;
        };
        let rank = |v| handles.iter().position(|h| *h == v);
        let corners: Vec<usize> = face.vertices().iter().filter_map(|v| rank(v.fix())).collect();
        found.push([corners[0], corners[1]]);
    }
    let area = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    let square = |q: [f64; 2]| q[0] * q[0] + q[1] * q[1];
    for i in 0..flat.len() {
        for j in 0..i {
            let (a, b) = (flat[i], flat[j]);
            if area(a, b).abs() < NEAR_ZERO * (square(a) * square(b)).sqrt() {
                return None;
            }
            for c in flat[..j].iter().copied() {
                let terms =
                    [area(a, b) * square(c), area(b, c) * square(a), area(c, a) * square(b)];
                let size: f64 = terms.iter().map(|t| t.abs()).sum();
                if terms.iter().sum::<f64>().abs() < NEAR_ZERO * size {
                    return None;
                }
            }
        }
    }
    Some((found, border))
}

/// The mean unit normal of the library's triangles, at length 1, and whether 0 is on the border;
/// None where it cannot be compared.
fn oracle(offsets: &[[i64; 3]]) -> Option<(Vec3, bool)> {
    let [least, middle, _] = jacobi(covariance(offsets));
    if middle.0 < 1.001 * least.0 {
        return None; // the plane itself is undecided
    }
    let [u, v, normal] = frame(least.1);
    let points: Vec<Vec3> = offsets.iter().map(|o| o.map(|c| c as f64)).collect();
    let flat: Vec<[f64; 2]> = points.iter().map(|p| [dot(*p, u), dot(*p, v)]).collect();
    let (found, border) = triangles(&flat)?;
    let mut sum = [0.0; 3];
    for [a, b] in found {
        let n = normalised(cross(points[a], points[b]));
        let side = dot(n, normal).signum();
        sum = std::array::from_fn(|i| sum[i] + side * n[i]);
    }
    Some((normalised(sum), border))
}

/// Compares one neighbourhood; what was compared: None, or whether p is on the border.
fn compare(star: &mut Star, offsets: &[[i64; 3]]) -> Option<bool> {
    let (expected, border) = oracle(offsets)?;
    let covariance = Covariance::of(offsets);
    let (_, flat) = plane::smallest(covariance.matrix());
    let first = star.normal(offsets, flat).unwrap();
    assert!(angle(first, expected) < 1e-9, "{first:?}, not {expected:?}: {offsets:?}");

    let fitted = plane::unit(plane::product(&covariance.adjugate(), first)).unwrap();
    let expected = rotated_fit(offsets, expected);
    assert!(angle(fitted, expected) < 1e-8, "{fitted:?}, not {expected:?}: {offsets:?}");

    let (estimate, fallback) = Estimator::new(Method::Varady).estimate(offsets);
    let Estimate::Normal(normal) = estimate else { panic!("no normal for {offsets:?}") };
    assert_eq!(fallback, None);
    assert!(angle(normal.map(f64::from), expected) < 2e-7);
    assert_eq!(normal, plane::canonical(normal));
    Some(border)
}

#[test]
fn random_neighbourhoods_agree_with_a_library_triangulation() {
    let mut star = Star::default();
    let (mut inside, mut border) = (0, 0);
    for seed in 0..20_000 {
        let mut random = Random(seed);
        let axes = frame(random.direction());
        let size = 10f64.powf(2.0 + 7.0 * random.unit());
        let rough = random.unit() * random.unit() * size;
        // A disc, or a half or a quarter of it as at the border of a scan.
        let (turn, part) = (random.unit(), [1.0, 1.0, 0.5, 0.25][seed as usize % 4]);
        let k = 3 + (seed as usize * 7) % 30;
        let mut noise = Random(seed + 1_000_000);
        let offsets = around(
            k,
            size,
            axes,
            || {
                let angle = std::f64::consts::TAU * (turn + part * random.unit());
                let radius = random.unit().sqrt() + 0.01;
                (radius * angle.cos(), radius * angle.sin())
            },
            |_, _| 0.0,
        );
        let offsets: Vec<[i64; 3]> =
            offsets.iter().map(|o| o.map(|c| c + noise.signed(rough).round() as i64)).collect();
        match compare(&mut star, &offsets) {
            Some(true) => border += 1,
            Some(false) => inside += 1,
            None => {}
        }
    }
    assert!(inside > 5000 && border > 5000, "{inside} inside, {border} on the border");
}

#[test]
fn neighbourhoods_of_unlike_distances_agree_with_a_library_triangulation() {
    let mut star = Star::default();
    let mut compared = 0;
    for seed in 0..5000 {
        let mut random = Random(seed);
        let axes = frame(random.direction());
        let mut noise = Random(seed + 7);
        let offsets = around(
            10,
            1e9,
            axes,
            || {
                let angle = std::f64::consts::TAU * random.unit();
                let radius = 10f64.powf(-5.0 * random.unit());
                (radius * angle.cos(), radius * angle.sin())
            },
            |x, y| 0.1 * (x + y),
        );
        let offsets: Vec<[i64; 3]> =
            offsets.iter().map(|o| o.map(|c| c + noise.signed(100.0).round() as i64)).collect();
        compared += usize::from(compare(&mut star, &offsets).is_some());
    }
    assert!(compared > 4000, "{compared}");
}

#[test]
fn a_square_grid_has_four_triangles() {
    // Heights on a grid: the diagonal neighbours are cocircular with p and its nearest four, and so
    // left out.
    let mut offsets = Vec::new();
    for x in -1..=1i64 {
        for y in -1..=1i64 {
            if (x, y) != (0, 0) {
                offsets.push([10 * x, 10 * y, if x * y == 0 { 0 } else { 9 }]);
            }
        }
    }
    offsets.push([20, 0, 5]);
    offsets.push([0, 20, -5]);
    let first = Star::default().normal(&offsets, [0.0, 0.0, 1.0]).unwrap();
    assert_eq!(first, [0.0, 0.0, 1.0]);
}

#[test]
fn with_circles_a_square_grid_has_eight_triangles() {
    // A gable over a grid whose diagonal corners are lifted by different amounts: with them as
    // corners eight triangles, each by hand, tell the mean.
    let mut random = Random(9);
    for _ in 0..200 {
        let ring = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];
        let at: Vec<[i64; 3]> =
            ring.iter().map(|&(x, y)| [10 * x, 10 * y, random.coordinate(9) - 4]).collect();
        let mean = |corners: &[[i64; 3]]| {
            let mut sum = [0.0; 3];
            for (n, a) in corners.iter().enumerate() {
                let b = corners[(n + 1) % corners.len()];
                let cross = [
                    a[1] * b[2] - a[2] * b[1],
                    a[2] * b[0] - a[0] * b[2],
                    a[0] * b[1] - a[1] * b[0],
                ];
                let unit = normalised(cross.map(|v| v as f64));
                (0..3).for_each(|axis| sum[axis] += unit[axis]);
            }
            normalised(sum)
        };
        let nearest: Vec<[i64; 3]> = at.iter().copied().step_by(2).collect();
        let mut offsets = at.clone();
        offsets.sort_unstable();
        let up = [0.0, 0.0, 1.0];
        let out = Star::default().normal(&offsets, up).unwrap();
        let taken = Star::with_circles().normal(&offsets, up).unwrap();
        assert!(angle(out, mean(&nearest)) < 1e-14);
        assert!(angle(taken, mean(&at)) < 1e-14);
    }
    // Where no four are on a circle both are one.
    let mut compared = 0;
    for _ in 0..500 {
        let offsets: Vec<[i64; 3]> = (0..10)
            .map(|_| [0; 3].map(|_: i32| random.coordinate(2_000_000) - 1_000_000))
            .collect();
        let up = [0.0, 0.0, 1.0];
        let [out, taken] =
            [Star::default(), Star::with_circles()].map(|mut star| star.normal(&offsets, up));
        assert_eq!(out, taken);
        compared += usize::from(out.is_some());
    }
    assert!(compared > 400, "{compared}");
}

#[test]
fn cocircular_points_are_left_out_however_the_plane_lies() {
    // Eight points of a square grid, the diagonal ones lifted: with strict turns only the four
    // nearest count, whose triangles are flat.
    let mut random = Random(6);
    let mut tilted = 0;
    for _ in 0..2000 {
        // A rotation by an integer quaternion, times its squared length: integer coordinates.
        let [w, x, y, z]: [i64; 4] = std::array::from_fn(|_| random.signed(12.0).round() as i64);
        let axes = [
            [w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y)],
            [2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x)],
            [2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z],
        ];
        if axes[0] == [0; 3] {
            continue;
        }
        tilted += 1;
        let offsets: Vec<[i64; 3]> = (-1..=1)
            .flat_map(|a: i64| (-1..=1).map(move |b: i64| (a, b)))
            .filter(|&grid| grid != (0, 0))
            .map(|(a, b)| {
                let up = i64::from(a * b != 0) * (a + 2);
                std::array::from_fn(|i| 10 * (a * axes[0][i] + b * axes[1][i]) + up * axes[2][i])
            })
            .collect();
        let normal = normalised(axes[2].map(|c| c as f64));
        let first = Star::default().normal(&offsets, normal).unwrap();
        assert!(angle(first, normal) < 1e-14, "{axes:?}");
    }
    assert!(tilted > 1000);
}

#[test]
fn a_straight_scan_edge_makes_no_triangle_with_both_neighbours_on_it() {
    // p on the border of a flat grid, the edge neighbours above and below the plane by turns.
    let offsets = [[-10, 0, 3], [10, 0, -3], [-10, 10, 0], [0, 10, 0], [10, 10, 0]];
    let first = Star::default().normal(&offsets, [0.0, 0.0, 1.0]).unwrap();
    // The triangles p(10,0)(0,10) and p(0,10)(-10,0) lie in one plane.
    assert!(angle(first, normalised([0.3, 0.0, 1.0])) < 1e-15);
}

#[test]
fn of_neighbours_above_each_other_the_morton_first_counts() {
    let base = [[10, 0, 0], [0, 10, 0], [-10, 0, 0]];
    let with = |z: [i64; 2]| [base[0], base[1], base[2], [0, -10, z[0]], [0, -10, z[1]]];
    let up = [0.0, 0.0, 1.0];
    let mut star = Star::default();
    let alone = star.normal(&with([7, 7])[..4], up).unwrap();
    assert_eq!(star.normal(&with([7, 2]), up).unwrap(), alone);
    assert_ne!(star.normal(&with([2, 7]), up).unwrap(), alone);
}

#[test]
fn of_neighbours_in_one_direction_the_nearest_counts() {
    let mut star = Star::default();
    let up = [0.0, 0.0, 1.0];
    // All directions, so that one is where counting directions begins; p inside or on the border.
    for turn in 0..8 {
        let turned = |x: i64, y: i64, z: i64| -> [i64; 3] {
            let (mut x, mut y) = (x, y);
            for _ in 0..turn % 4 {
                (x, y) = (-y, x);
            }
            if turn >= 4 { [x - y, x + y, z] } else { [x, y, z] }
        };
        let rest = [turned(7, 5, 1), turned(-6, 7, 0), turned(-5, -8, 2)];
        for rest in [&rest[..], &rest[..2]] {
            let with = |more: &[[i64; 3]]| [more, rest].concat();
            let (near, far) = (turned(0, -3, 1), turned(0, -30, -4));
            let expected = star.normal(&with(&[near]), up);
            assert!(expected.is_some() && expected != star.normal(&with(&[far]), up));
            assert_eq!(star.normal(&with(&[near, far]), up), expected);
            assert_eq!(star.normal(&with(&[far, near]), up), expected);
        }
    }
}

#[test]
fn neighbours_in_the_direction_where_counting_begins_are_one_direction() {
    // A tilted plane and neighbours far above it: rounding puts some of one direction at the
    // beginning and some at the end.
    let up = normalised([2.0, 1.0, 2.0]);
    let at = |x: i64, y: i64, z: i64| -> [i64; 3] {
        let axes = [[11, -2, -10], [-2, 14, -5], [2, 1, 2]];
        std::array::from_fn(|i| x * axes[0][i] + y * axes[1][i] + z * axes[2][i])
    };
    let mut star = Star::default();
    let rest = [at(7, 5, 1), at(-6, 7, 0), at(-5, -8, 2)];
    for near in 1..30 {
        for far in near + 1..31 {
            let (near, far) = (at(0, -near, 301 * far), at(0, -far, 103 * near));
            let expected = star.normal(&[&[near], &rest[..]].concat(), up).unwrap();
            let both = [[near, far], [far, near]]
                .map(|two| star.normal(&[&two, &rest[..]].concat(), up).unwrap());
            assert!(both.iter().all(|n| angle(*n, expected) < 1e-15), "{near:?} {far:?}");
        }
    }
}

#[test]
fn neighbours_straight_above_and_lines_make_no_triangle() {
    let up = [0.0, 0.0, 1.0];
    let mut star = Star::default();
    assert_eq!(star.normal(&[], up), None);
    assert_eq!(star.normal(&[[0, 0, 5], [0, 0, -5]], up), None);
    assert_eq!(star.normal(&[[1, 0, 5], [0, 0, -5]], up), None);
    assert_eq!(star.normal(&[[1, 0, 5], [-1, 0, 5], [2, 0, 0], [-7, 0, 1]], up), None);
    assert_eq!(star.normal(&[[1, 0, 0], [0, 1, 0], [0, 0, 9]], up), Some(up));
}

#[test]
fn a_pipeline_says_what_is_on_a_circle() {
    // Nine points whose plane of regression is level; the middle of the far row of heights turns
    // the normal of the point in the middle, its nearest four by more than all eight.
    let heights = [[1, 0, -1], [-2, 0, 2], [1, 0, -1]];
    let points: Vec<([f64; 3], u32)> = (0..9u32)
        .map(|n| {
            let (x, y) = ((n % 3) as usize, (n / 3) as usize);
            ([10.0 * x as f64, 10.0 * y as f64, f64::from(heights[y][x])], n)
        })
        .collect();
    let normal = |keys: &str| {
        let case = crate::support::case::Case::new();
        case.ply(&points);
        let keys = format!("[[stage]]\nkind = 'normals'\nneighbors = 8\n{keys}\n");
        let names = "dimensions = ['NormalX', 'NormalY', 'NormalZ']\nencoding = 'ascii'";
        case.run("", &keys, names).unwrap();
        let text = std::fs::read_to_string(case.path("out.ply")).unwrap();
        let line = text.lines().find(|line| line.starts_with("10 10 ")).unwrap().to_owned();
        line.split(' ').skip(4).map(|v| v.parse().unwrap()).collect::<Vec<f64>>()
    };
    for method in ["delaunay", "varady"] {
        let of = |circles: &str| normal(&format!("method = '{method}'\n{circles}"));
        let (default, out, taken) = (of(""), of("cocircular = 'out'"), of("cocircular = 'in'"));
        assert_eq!(default, out);
        assert!(out[0] != taken[0], "{method}: {out:?} {taken:?}");
    }
}
