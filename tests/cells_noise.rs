//! What `cells` says before a run: how far normals scatter on planes, and how much will stay.

mod cells_scene;

use cells_scene::*;
use pointmill::ops::{Cells, Keep, Split};
use pointmill::point::Position;
use pointmill::stage::TileOp;

/// A number in [−1, 1) that looks random.
fn noise(seed: u64) -> f64 {
    let mut v = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    v = (v ^ (v >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    v = (v ^ (v >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((v ^ (v >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// The normal (x, y, z) at length 1, its sign at random.
fn normal([x, y, z]: [f64; 3], seed: u64) -> [f32; 3] {
    let length = (x * x + y * y + z * z).sqrt() * noise(seed ^ 77).signum();
    [x, y, z].map(|v| (v / length) as f32)
}

/// Positions of a square of 32 × 32, 4 steps apart, with normals that are off by `roughness` at most.
fn surface(
    at: impl Fn(i64, i64) -> i64,
    slope: impl Fn(i64, i64) -> [f64; 2],
    roughness: f64,
) -> Vec<Point> {
    scan((0..32 * 32i64).map(|i| {
        let (x, y) = (i % 32 * 4, i / 32 * 4);
        let [a, b] = slope(x, y);
        let off = |salt: u64| roughness * noise(i as u64 * 2 + (salt << 40));
        ([x, y, at(x, y)], normal([a + off(1), b + off(2), 1.0], i as u64), 1)
    }))
}

/// What the stage says of the scan as one sample.
fn sample(stage: &Cells, scan: &[Point]) -> [f64; 3] {
    let mut tile = tile(scan, whole(scan).cube(), 0);
    stage.sample(&mut tile).unwrap().try_into().unwrap()
}

fn stage(scan: &[Point], side: f64) -> Cells {
    settle(cells(side, 0.1, Split::Voronoi), scan)
}

fn scatter(scan: &[Point]) -> f64 {
    sample(&stage(scan, 32.0), scan)[0]
}

#[test]
fn the_scatter_of_a_rough_plane_is_that_of_its_normals() {
    for roughness in [0.01, 0.1, 0.3] {
        // Tilts of uniform noise: two components of variance r²/3.
        let expected = roughness * (2.0f64 / 3.0).sqrt();
        for slope in [0.0, 0.5] {
            let plane = surface(|x, _| (slope * x as f64) as i64, |_, _| [-slope, 0.0], roughness);
            let found = scatter(&plane);
            assert!((found / expected - 1.0).abs() < 0.25, "{roughness}, {slope}: {found}");
        }
    }
}

#[test]
fn curvature_is_no_scatter() {
    let radius = 300.0f64;
    let height = |x: i64, y: i64| {
        let (x, y) = (x as f64 - 62.0, y as f64 - 62.0);
        (radius * radius - x * x - y * y).sqrt()
    };
    let sphere = scan((0..32 * 32i64).map(|i| {
        let (x, y) = (i % 32 * 4, i / 32 * 4);
        let n = [x as f64 - 62.0, y as f64 - 62.0, height(x, y)];
        ([x, y, height(x, y) as i64], normal(n, i as u64), 1)
    }));
    // Across the cap normals differ by 0.55 rad.
    assert!(scatter(&sphere) < 0.01, "{}", scatter(&sphere));
}

#[test]
fn edges_and_leaves_are_not_planar() {
    let ridge =
        surface(|x, _| (x - 64).abs() / 2, |x, _| [if x < 64 { 0.5 } else { -0.5 }, 0.0], 0.0);
    assert!(scatter(&ridge).is_nan());
    let leaves = scan((0..1000u64).map(|i| {
        let at: Position = [0, 1, 2].map(|axis| (64.0 * noise(i * 3 + axis)) as i64);
        (at, normal([3, 4, 5].map(|salt| noise(i * 9 + salt + (1 << 50))), i), 1)
    }));
    assert!(scatter(&leaves).is_nan());
    let line = scan((0..100).map(|i| ([i, i, i / 50], [0.0, 0.0, 1.0], 1)));
    assert!(scatter(&line).is_nan());
    let few = scan((0..9).map(|i| ([i % 3, i / 3, 0], [0.0, 0.0, 1.0], 1)));
    assert!(scatter(&few).is_nan());
}

#[test]
fn a_sample_is_divided_as_the_stage_divides() {
    let rough = surface(|_, _| 0, |_, _| [0.0; 2], 0.2);
    let outcome = run_whole(cells(32.0, 0.1, Split::Voronoi), &rough);
    let [_, kept, of] = sample(&stage(&rough, 32.0), &rough);
    assert_eq!((kept, of), (outcome.kept().len() as f64, rough.len() as f64));
    // Cells that are no octree nodes: whole ones only, 3 × 3 in a cube of 128.
    let [_, kept, of] = sample(&stage(&rough, 40.0), &rough);
    assert!(of == 900.0 && kept < of && kept > of / 3.0, "{kept} of {of}");
    // A cell larger than the sample.
    let [_, kept, of] = sample(&stage(&rough, 1000.0), &rough);
    assert!(of == rough.len() as f64 && kept < of && kept > of / 3.0, "{kept} of {of}");
    let mut keep = cells(32.0, 0.1, Split::Voronoi);
    (keep.max_angle, keep.keep) = (None, Some(Keep::Records(100)));
    assert_eq!(sample(&settle(keep, &rough), &rough)[1..], [0.0, 0.0]);
}

#[test]
fn a_forecast_warns_where_scatter_exceeds_the_angle() {
    let plane = surface(|_, _| 0, |_, _| [0.0; 2], 0.0);
    let mut stage = stage(&plane, 32.0);
    let samples: Vec<Vec<f64>> = [(0.08, 10.0), (f64::NAN, 90.0), (0.141_234, 40.0), (0.3, 68.0)]
        .map(|(scatter, kept)| vec![scatter, kept, 100.0])
        .into();
    let forecast = stage.forecast(&samples);
    assert_eq!(forecast.decisions, [("normal_scatter".to_owned(), 0.1412.into())]);
    assert_eq!(
        forecast.warning.as_deref(),
        Some(
            "normals scatter 0.14 rad, above max_angle 0.1: expect about 52 % of the points to \
             stay; raise neighbors or max_angle, or use --keep"
        )
    );
    stage.max_angle = Some(0.15);
    assert_eq!(stage.forecast(&samples).warning, None);
    stage.max_angle = Some(0.1);
    assert_eq!(stage.forecast(&samples[..1]).warning, None);
    assert!(stage.forecast(&samples[1..2]).decisions.is_empty(), "nothing is planar");
    assert_eq!(stage.forecast(&[]), Default::default());
    (stage.max_angle, stage.keep) = (None, Some(Keep::Records(9)));
    let forecast = stage.forecast(&samples);
    assert_eq!((forecast.decisions.len(), forecast.warning), (1, None));
}
