//! Estimated normals against surfaces whose normals are known, and at the ends of what can come in.

use super::solvers::{Vec3, angle, around, covariance, cross, dot, frame, jacobi, normalised};
use crate::support::random::Random;
use pointmill::internals::{Estimate, Estimator, Fallback};
use pointmill::ops::normals::Method;

const METHODS: [Method; 2] = [Method::Varady, Method::Pca];
/// What rounding to f32 may turn a normal by.
const SINGLE: f64 = 1e-7;

fn normal(method: Method, offsets: &[[i64; 3]]) -> Vec3 {
    match Estimator::new(method).estimate(offsets) {
        (Estimate::Normal(n), None) => n.map(f64::from),
        other => panic!("{method:?}: {other:?} for {offsets:?}"),
    }
}

/// FNV-1a of the seeded normals by `METHODS`; they change only with the algorithm.
const BITS: [u64; 2] = [0xc7c70a0af217f0b0, 0x2bc42aecf16fddfa];

/// Places in a disc of radius 1.
fn disc(random: &mut Random) -> (f64, f64) {
    let (radius, angle) = (random.unit().sqrt(), std::f64::consts::TAU * random.unit());
    (radius * angle.cos(), radius * angle.sin())
}

/// Ten places all around, each in its tenth of a turn, at radius 0.3 to 1.
fn ring(random: &mut Random) -> impl FnMut() -> (f64, f64) + '_ {
    let start = random.unit();
    let mut place = 0.0;
    move || {
        place += 1.0;
        let angle = std::f64::consts::TAU * (start + (place + 0.8 * random.unit()) / 10.0);
        let radius = 0.3 + 0.7 * random.unit();
        (radius * angle.cos(), radius * angle.sin())
    }
}

#[test]
fn normals_of_a_plane_are_exact() {
    let mut random = Random(1);
    for round in 0..4000 {
        let size = if round % 2 == 0 { 30.0 } else { 3e6 };
        let [a, b]: [[i64; 3]; 2] =
            std::array::from_fn(|_| std::array::from_fn(|_| random.signed(size).round() as i64));
        let truth = cross(a.map(|c| c as f64), b.map(|c| c as f64));
        if dot(truth, truth) < 1.0 {
            continue;
        }
        let mut offsets: Vec<[i64; 3]> = Vec::new();
        while offsets.len() < 3 + round % 20 {
            let (x, y) = (random.signed(9.0) as i64, random.signed(9.0) as i64);
            let offset = std::array::from_fn(|i| x * a[i] + y * b[i]);
            if offset != [0; 3] && !offsets.contains(&offset) {
                offsets.push(offset);
            }
        }
        let line = |o: &[i64; 3]| cross(o.map(|c| c as f64), offsets[0].map(|c| c as f64));
        if offsets.iter().all(|o| line(o) == [0.0; 3]) {
            continue;
        }
        for method in METHODS {
            // A sliver of a neighbourhood leaves its own plane less well told to `pca`.
            let [_, middle, most] = jacobi(covariance(&offsets));
            let bound = if method == Method::Pca { 1e-15 * most.0 / middle.0 } else { 0.0 };
            let error = angle(normal(method, &offsets), normalised(truth));
            assert!(error < SINGLE + bound, "{method:?} {error}: {offsets:?}");
        }
    }
}

#[test]
fn normals_of_a_sphere_err_by_less_than_the_neighbourhood_turns() {
    const RADIUS: f64 = 1e6;
    let mut random = Random(2);
    for size in [1e3, 1e4, 1e5] {
        for method in METHODS {
            let (mut worst, mut sum) = (0.0f64, 0.0);
            for _ in 0..1000 {
                let axes = frame(random.direction());
                let cap = |x: f64, y: f64| (RADIUS * RADIUS - x * x - y * y).sqrt();
                let offsets = around(10, size, axes, ring(&mut random), cap);
                let error = angle(normal(method, &offsets), axes[2]);
                worst = worst.max(error);
                sum += error;
            }
            let turn = size / RADIUS;
            assert!(worst < turn, "{method:?} {size}: {worst}");
            assert!(sum / 1000.0 < 0.3 * turn, "{method:?} {size}: mean {}", sum / 1000.0);
        }
    }
}

#[test]
fn normals_beside_a_ridge_are_those_of_their_face_and_on_it_lie_between() {
    const SIZE: f64 = 1e5;
    let mut random = Random(3);
    for method in METHODS {
        for slope in [0.1f64, 0.25, 0.5] {
            let half = slope.atan();
            let mut worst = 0.0f64;
            for _ in 0..500 {
                let axes = frame(random.direction());
                let [u, _, up] = axes;
                // The ridge runs along the second axis, at x = 0; p is on the face x < 0.
                let roof = |from: f64| move |x: f64, _: f64| -slope * (x + from).abs();
                let face = normalised(std::array::from_fn(|i| up[i] - slope * u[i]));
                let beside = around(10, SIZE, axes, ring(&mut random), roof(-1.01 * SIZE));
                assert!(angle(normal(method, &beside), face) < 3e-5);
                let on = around(10, SIZE, axes, ring(&mut random), roof(0.0));
                worst = worst.max(angle(normal(method, &on), up));
            }
            assert!(worst < 0.7 * half, "{method:?} {slope}: {worst}");
        }
    }
}

#[test]
fn a_symmetric_ridge_has_the_bisector() {
    let offsets = [
        [-10, -10, -5],
        [10, -10, -5],
        [0, -9, 0],
        [-10, 0, -5],
        [10, 0, -5],
        [-10, 10, -5],
        [10, 10, -5],
        [0, 9, 0],
    ];
    for method in METHODS {
        assert_eq!(normal(method, &offsets), [0.0, 0.0, 1.0]);
    }
}

#[test]
fn too_few_and_collinear_neighbours_have_no_normal() {
    let mut line = vec![];
    for method in METHODS {
        let mut estimator = Estimator::new(method);
        line.clear();
        for i in 1..20 {
            assert_eq!(estimator.estimate(&line), (Estimate::None, None), "{line:?}");
            line.push([7 * i, -3 * i, i << 50]);
        }
        let mut bent = line.clone();
        bent[9][2] += 1 << 50;
        assert!(matches!(estimator.estimate(&bent).0, Estimate::Normal(_)));
    }
}

#[test]
fn two_neighbours_have_the_normal_of_their_triangle() {
    let mut random = Random(4);
    for _ in 0..1000 {
        let offsets: [[i64; 3]; 2] =
            std::array::from_fn(|_| std::array::from_fn(|_| random.signed(1e4).round() as i64));
        let [a, b] = offsets.map(|o| o.map(|c| c as f64));
        let truth = cross(a, b);
        if dot(truth, truth) < 0.01 * dot(a, a) * dot(b, b) {
            continue;
        }
        for method in METHODS {
            assert!(angle(normal(method, &offsets), truth) < SINGLE);
        }
    }
}

#[test]
fn the_size_of_a_step_changes_no_normal() {
    let mut random = Random(5);
    for _ in 0..500 {
        let axes = frame(random.direction());
        let offsets = around(10, 800.0, axes, || disc(&mut random), |x, y| 2e-4 * x * y);
        for method in METHODS {
            let expected = normal(method, &offsets);
            for shift in [10, 20, 30, 40, 50, 52] {
                let coarse: Vec<_> = offsets.iter().map(|o| o.map(|c| c << shift)).collect();
                assert!(angle(normal(method, &coarse), expected) < SINGLE, "{shift}");
            }
        }
    }
}

#[test]
fn the_order_of_neighbours_decides_nothing_but_ties() {
    let mut random = Random(6);
    for _ in 0..500 {
        let axes = frame(random.direction());
        let mut offsets = around(12, 1e5, axes, || disc(&mut random), |x, y| 2e-6 * x * y);
        let expected = METHODS.map(|method| normal(method, &offsets));
        for _ in 0..5 {
            let (i, j) = (random.number() as usize % 12, random.number() as usize % 12);
            offsets.swap(i, j);
            for (method, expected) in METHODS.into_iter().zip(expected) {
                assert!(angle(normal(method, &offsets), expected) < SINGLE);
            }
        }
    }
}

#[test]
fn a_neighbourhood_too_long_and_thin_for_its_plane_falls_back_and_says_so() {
    // Not collinear, but the third position is lost beside the others: any plane along their line.
    let far = 1i64 << 61;
    let mut told = 0;
    for thin in [[0, 1, 0], [0, 0, 1], [0, 1, 1], [0, -1, 1]] {
        let offsets = [[-far, 0, 0], thin, [far, 0, 0]];
        let (estimate, fallback) = Estimator::new(Method::Varady).estimate(&offsets);
        let Estimate::Normal(n) = estimate else { panic!("no normal") };
        assert_eq!(n[0], 0.0);
        told += usize::from(fallback == Some(Fallback::NoTriangle));
        assert_eq!(Estimator::new(Method::Pca).estimate(&offsets).1, None);
    }
    assert!(told > 0);
}

#[test]
fn any_offsets_give_a_canonical_unit_normal_or_none() {
    let mut random = Random(7);
    let mut estimators = METHODS.map(Estimator::new);
    let mut normals = 0;
    for round in 0..20_000 {
        let bits = 1 + random.number() % 63;
        let offsets: Vec<[i64; 3]> = (0..random.number() % 70)
            .map(|_| {
                let fewer = if round % 3 == 0 { random.number() % bits } else { 0 };
                std::array::from_fn(|_| (random.number() as i64 | 1) >> (64 - bits + fewer).min(63))
            })
            .collect();
        for estimator in &mut estimators {
            let (Estimate::Normal(n), _) = estimator.estimate(&offsets) else { continue };
            normals += 1;
            let n64 = n.map(f64::from);
            assert!((dot(n64, n64) - 1.0).abs() < 1e-6, "{n:?}: {offsets:?}");
            let largest = n.iter().fold(0.0f32, |m, c| if c.abs() > m.abs() { *c } else { m });
            assert!(largest > 0.0, "{n:?}");
        }
    }
    assert!(normals > 20_000, "{normals}");
}

#[test]
fn many_neighbours_are_no_limit() {
    let mut random = Random(8);
    let axes = frame(random.direction());
    let offsets = around(500, 1e6, axes, || disc(&mut random), |_, _| 0.0);
    for method in METHODS {
        assert!(angle(normal(method, &offsets), axes[2]) < 1e-6);
    }
}

#[test]
fn bits_are_the_same_on_every_platform_and_build() {
    let mut random = Random(9);
    for (method, expected) in METHODS.into_iter().zip(BITS) {
        let mut estimator = Estimator::new(method);
        let mut hash = 0xcbf2_9ce4_8422_2325u64;
        for _ in 0..5000 {
            let shift = 34 + random.number() % 20;
            let offsets: Vec<[i64; 3]> = (0..4 + random.number() % 12)
                .map(|_| std::array::from_fn(|_| random.number() as i64 >> shift))
                .collect();
            let (estimate, _) = estimator.estimate(&offsets);
            let Estimate::Normal(n) = estimate else { continue };
            assert_eq!(estimate, Estimator::new(method).estimate(&offsets).0, "scratch matters");
            for byte in n.iter().flat_map(|c| c.to_le_bytes()) {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
            }
        }
        assert_eq!(hash, expected, "{method:?}: {hash:#018x}");
    }
}
