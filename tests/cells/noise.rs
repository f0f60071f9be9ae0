//! What `cells` says before a run: how far normals scatter on planes, and how much will stay.

use super::scene::*;
use crate::support::random::Random;
use pointmill::ops::{Cells, Keep, Side, Split};
use pointmill::point::Position;
use pointmill::quantity::{Angle, Setting};
use pointmill::stage::TileOp;

/// A number in [−1, 1) that looks random.
fn noise(seed: u64) -> f64 {
    Random(seed).signed(1.0)
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
    let [scatter, kept, of, decided, seen] = stage.sample(&mut tile).unwrap()[..] else { panic!() };
    assert_eq!(decided, seen, "all are decided about");
    [scatter, kept, of]
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
        .map(|(scatter, kept)| vec![scatter, kept, 100.0, 1.0, 1.0])
        .into();
    let forecast = stage.forecast(&samples);
    assert_eq!(forecast.decisions, [("normal_scatter".to_owned(), 0.1412.into())]);
    assert_eq!(
        forecast.warning.as_deref(),
        Some(
            "normals scatter 0.14 rad, more than the largest angle of a cell, 0.1 rad: expect about 52 % of the points \
             to stay; raise `normals.neighbors` or `cells.max_angle`, or give `cells.keep`"
        )
    );
    stage.max_angle = radians(0.15);
    assert_eq!(stage.forecast(&samples).warning, None);
    stage.max_angle = Some(Angle::degrees(6.0).unwrap().into());
    let told = stage.forecast(&samples).warning.unwrap();
    assert!(told.contains("8.1deg, ") && told.contains("6deg"), "{told}");
    stage.max_angle = radians(0.1);
    assert_eq!(stage.forecast(&samples[..1]).warning, None);
    assert!(stage.forecast(&samples[1..2]).decisions.is_empty(), "nothing is planar");
    assert_eq!(stage.forecast(&[]), Default::default());
    (stage.max_angle, stage.keep) = (None, Some(Keep::Records(500)));
    let forecast = stage.forecast(&samples);
    assert_eq!((forecast.decisions.len(), forecast.warning), (1, None));
}

#[test]
fn so_few_points_that_a_percent_sign_may_be_missing_are_warned_of() {
    let plane = surface(|_, _| 0, |_, _| [0.0; 2], 0.0);
    let warning = |keep: Keep| {
        let mut stage = Cells::default();
        stage.keep = Some(keep);
        settle(stage, &plane).forecast(&[]).warning
    };
    let told = warning(Keep::Records(10)).unwrap();
    assert!(told.contains("leaves 10 of 1,024 points") && told.contains("\"10%\""), "{told}");
    assert_eq!(warning(Keep::Records(11)), None, "more than a hundredth");
    assert_eq!(warning(Keep::Share(10_000_000)), None);
}

#[test]
fn what_is_auto_follows_from_the_scatter_and_the_number_to_keep() {
    let plane = surface(|_, _| 0, |_, _| [0.0; 2], 0.0);
    let chosen = |keep: Option<Keep>, scatter: f64, decided: f64| {
        let mut stage = Cells::default();
        (stage.side, stage.keep, stage.min_spacing) = (Side::Spread, keep, Some(Setting::Auto));
        if keep.is_none() {
            stage.max_angle = Some(Setting::Auto);
        }
        let mut stage = settle(stage, &plane);
        let forecast = stage.forecast(&[vec![scatter, 0.0, 0.0, decided, 1.0]]);
        let value = |key: &str| {
            let found = forecast.chosen.iter().find(|(name, _)| name == key);
            found.map(|(_, value)| value.clone())
        };
        (value("max_angle"), value("side"), value("min_spacing"), stage.needs().cell_side)
    };
    // A square of 32 × 32 positions, 4 steps apart: 8 × 8 cubes of side 16 are 64, and those of 1.25
    // sides are as wide as 20 steps.
    let (angle, side, spacing, cell) = chosen(Some(Keep::Records(64)), 0.1, 1.0);
    assert_eq!((angle, side, spacing, cell), (None, Some(20.0.into()), Some(12.0.into()), 20));
    // Between two levels by powers: 128 cubes of 16 / √2.
    let (_, side, spacing, _) = chosen(Some(Keep::Records(128)), 0.1, 1.0);
    assert_eq!((side, spacing), (Some(14.0.into()), Some(8.0.into())));
    // More than a third of 1,024 positions: cells as small as that may be more than are to stay.
    let (_, side, spacing, cell) = chosen(Some(Keep::Records(400)), 0.1, 1.0);
    assert_eq!((side, spacing, cell), (None, Some("none".into()), 32));
    // Half of the positions are decided about: an eighth of those is 64, and nothing is known of
    // their spacing.
    let (_, side, spacing, _) = chosen(Some(Keep::Share(12_500_000)), 0.1, 0.5);
    assert_eq!((side, spacing), (Some(20.0.into()), Some("none".into())));
    let (angle, side, spacing, cell) = chosen(None, 0.1, 1.0);
    assert_eq!(
        (angle, side, spacing),
        (Some(0.4.into()), None, Some(f64::from(cell as u32 / 4).into()))
    );
    assert_eq!(chosen(None, 0.01, 1.0).0, Some(0.1.into()), "the paper's angle at least");
    assert_eq!(chosen(None, 0.9, 1.0).0, Some(1.0.into()), "noise is no reason to lose edges");
    assert_eq!(chosen(None, f64::NAN, 1.0).0, Some(0.1.into()), "nothing is planar");
}
