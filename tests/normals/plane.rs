//! Moments and eigenvectors against solvers written another way.

use super::solvers::{angle, covariance, dot, frame, jacobi};
use crate::support::random::Random;
use pointmill::internals::plane::{self, Covariance, Symmetric};

fn full(m: Symmetric) -> [[f64; 3]; 3] {
    let [xx, xy, xz, yy, yz, zz] = m;
    [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
}

fn with_eigenvalues(values: [f64; 3], axes: [[f64; 3]; 3]) -> Symmetric {
    let entry = |i: usize, j: usize| (0..3).map(|e| values[e] * axes[e][i] * axes[e][j]).sum();
    [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)]
}

/// The eigenvector of the largest eigenvalue.
fn largest_vector(matrix: Symmetric) -> [f64; 3] {
    plane::smallest(matrix.map(|v| -v)).1
}

#[test]
fn eigenvectors_agree_with_jacobi_rotations() {
    let mut random = Random(1);
    for round in 0..20_000 {
        let mut values: [f64; 3] = std::array::from_fn(|_| random.signed(1.0));
        if round % 2 == 0 {
            values = values.map(|v| 10f64.powf(6.0 * v));
        }
        let size = 10f64.powf(random.signed(100.0));
        let matrix = with_eigenvalues(values.map(|v| v * size), frame(random.direction()));
        let [least, middle, most] = jacobi(full(matrix));
        let norm = least.0.abs().max(most.0.abs());
        let (value, vector) = plane::smallest(matrix);
        assert!((value - least.0).abs() <= 1e-14 * norm, "{value} {least:?} {matrix:?}");
        let bound = |gap: f64| 1e-14 * norm / gap;
        assert!(angle(vector, least.1) <= bound(middle.0 - least.0), "{matrix:?}");
        let vector = largest_vector(matrix);
        assert!(angle(vector, most.1) <= bound(most.0 - middle.0), "{matrix:?}");
        assert!((dot(vector, vector) - 1.0).abs() < 1e-15);
    }
}

#[test]
fn near_double_roots_keep_their_vectors() {
    let mut random = Random(2);
    for gap in [1e-3, 1e-6, 1e-9, 1e-12] {
        for _ in 0..1000 {
            let axes = frame(random.direction());
            let (_, low) = plane::smallest(with_eigenvalues([1.0, 1.0 + gap, 3.0], axes));
            assert!(angle(low, axes[0]) < 1e-14 / gap, "smallest pair {gap}");
            let (_, low) = plane::smallest(with_eigenvalues([1.0, 3.0 + gap, 3.0], axes));
            assert!(angle(low, axes[0]) < 1e-14, "largest pair {gap}");
            let high = largest_vector(with_eigenvalues([3.0, 3.0 + gap, 1.0], axes));
            assert!(angle(high, axes[1]) < 1e-14 / gap, "largest of a pair {gap}");
        }
    }
}

#[test]
fn double_roots_give_a_vector_of_their_eigenspace() {
    let mut random = Random(3);
    for _ in 0..1000 {
        let axes = frame(random.direction());
        let (value, low) = plane::smallest(with_eigenvalues([1.0, 1.0, 5.0], axes));
        assert!(dot(low, axes[2]).abs() < 1e-14 && (value - 1.0).abs() < 1e-14);
    }
    let (value, low) = plane::smallest([2.0, 0.0, 0.0, 2.0, 0.0, 2.0]);
    assert_eq!((value, low), (2.0, [0.0, 0.0, 1.0]));
    assert_eq!(plane::smallest([0.0; 6]), (0.0, [0.0, 0.0, 1.0]));
    let (value, low) = plane::smallest([1.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    assert!(value.abs() < 1e-15 && low == [0.0, 0.0, 1.0]);
    assert_eq!(largest_vector([0.0, 0.0, 0.0, 4.0, 0.0, 0.0]), [0.0, 1.0, 0.0]);
}

#[test]
fn matrices_that_are_no_numbers_give_an_axis() {
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for place in 0..6 {
            let mut matrix = [1.0, 0.0, 0.0, 2.0, 0.0, 3.0];
            matrix[place] = wrong;
            let (value, vector) = plane::smallest(matrix);
            assert!(value.is_nan() && vector == [0.0, 0.0, 1.0]);
        }
    }
    for tiny in [f64::MIN_POSITIVE, 1e-320, 1e-160, 1e300, f64::MAX] {
        let (_, vector) = plane::smallest([tiny, 0.0, 0.0, tiny / 4.0, 0.0, tiny / 2.0]);
        assert!((dot(vector, vector) - 1.0).abs() < 1e-15, "{tiny}");
    }
}

#[test]
fn covariance_is_that_of_the_neighbours_and_the_point() {
    let mut random = Random(4);
    for round in 0..5000 {
        let size = 2f64.powf(1.0 + 40.0 * random.unit());
        let offsets: Vec<[i64; 3]> = (0..2 + round % 63)
            .map(|_| std::array::from_fn(|_| random.signed(size).round() as i64))
            .collect();
        let [ours, theirs] = [full(Covariance::of(&offsets).matrix()), covariance(&offsets)];
        let norm = theirs[0][0] + theirs[1][1] + theirs[2][2];
        for i in 0..3 {
            for j in 0..3 {
                assert!((ours[i][j] - theirs[i][j]).abs() <= 1e-14 * norm, "{offsets:?}");
            }
        }
    }
}

#[test]
fn covariance_of_offsets_at_the_end_of_the_range_is_finite_and_right() {
    for exponent in [55, 58, 60, 61, 62] {
        let d = 1i64 << exponent;
        let offsets = [[d, 0, 0], [-d, 0, 0], [0, d, 0], [0, -d, 0], [0, 0, d - 1]];
        let matrix = full(Covariance::of(&offsets).matrix());
        let expected = covariance(&offsets);
        for i in 0..3 {
            for j in 0..3 {
                let error = (matrix[i][j] - expected[i][j]).abs();
                assert!(error <= 1e-15 * expected[0][0], "2^{exponent}");
            }
        }
    }
    let far = [[i64::MAX; 3], [i64::MIN + 1; 3], [i64::MAX, 0, 0]];
    assert!(Covariance::of(&far).matrix().iter().all(|v| v.is_finite()));
    assert!(Covariance::of(&[[i64::MIN; 3]; 64]).matrix().iter().all(|v| v.is_finite()));
}

#[test]
fn a_line_is_told_exactly() {
    assert!(plane::collinear(&[]));
    assert!(plane::collinear(&[[3, -1, 2]]));
    assert!(plane::collinear(&[[0, 0, 0], [3, -1, 2], [-6, 2, -4]]));
    assert!(!plane::collinear(&[[3, -1, 2], [-6, 2, -5]]));
    let far = (1 << 62) - 1;
    assert!(plane::collinear(&[[far, 0, far], [-far, 0, -far], [1, 0, 1]]));
    assert!(!plane::collinear(&[[far, 0, far], [-far, 0, -far], [1, 0, 2]]));
    assert!(!plane::collinear(&[[far, far, far - 1], [far - 1, far - 1, far - 2]]));
    assert!(plane::collinear(&[[i64::MIN; 3], [i64::MAX; 3]]));
}

#[test]
fn the_adjugate_of_a_perfect_plane_is_exact() {
    // x + 2y + 3z = 0
    let offsets = [[2, -1, 0], [3, 0, -1], [1, 1, -1], [-5, 1, 1], [-7, 2, 1]];
    let [xx, xy, xz, yy, yz, zz] = Covariance::of(&offsets).adjugate();
    assert!(xx > 0.0);
    assert_eq!([xx, xy, xz, yy, yz, zz], [1.0, 2.0, 3.0, 4.0, 6.0, 9.0].map(|v| v * xx));
    assert_eq!(Covariance::of(&[[1, 2, 3], [2, 4, 6], [-3, -6, -9]]).adjugate(), [0.0; 6]);
}

#[test]
fn the_canonical_sign_makes_the_largest_component_positive() {
    assert_eq!(plane::canonical([-0.6, 0.0, 0.8]), [-0.6, 0.0, 0.8]);
    assert_eq!(plane::canonical([0.6, -0.0, -0.8]), [-0.6, 0.0, 0.8]);
    assert_eq!(plane::canonical([-0.5f32, 0.5, 0.0]), [0.5, -0.5, 0.0]);
    assert_eq!(plane::canonical([0.0f32, -0.5, 0.5]), [0.0, 0.5, -0.5]);
    assert!(plane::canonical([0.0, -1.0, 0.0]).iter().all(|c: &f64| c.is_sign_positive()));
}
