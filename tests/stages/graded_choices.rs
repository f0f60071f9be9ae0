//! What else `graded` is asked: which points count more, that borders stay, and how many points the
//! shape of a scan asks for.

use std::collections::BTreeSet;

use super::graded::{At, graded};
use crate::support::random::Random;
use serde_json::{Value, json};

/// The positions in steps that a run keeps.
fn kept(scan: &[At], keys: Value, tile_points: Option<usize>) -> BTreeSet<At> {
    graded(scan, keys, tile_points).kept.into_keys().collect()
}

/// A surface over a square of `side` points, as high as `height` says.
fn surface(side: i64, mut height: impl FnMut(i64, i64) -> i64) -> Vec<At> {
    let mut points = Vec::new();
    for x in 0..side {
        points.extend((0..side).map(|y| [16 * x, 16 * y, height(x, y)]));
    }
    points
}

#[test]
fn points_that_weigh_more_draw_more_points() {
    // The same waves in both halves, which are parted at x = 1 in world units.
    let wave = |x: i64, y: i64| ((x as f64 / 3.0).sin() * (y as f64 / 4.0).cos() * 60.0) as i64;
    let scan = surface(128, |x, y| wave(x % 64, y));
    let left = |kept: &BTreeSet<At>| kept.iter().filter(|p| p[0] < 1024).count();
    let even = kept(&scan, json!({ "keep": 1000 }), None);
    let half = left(&even);
    assert!(even.len() == 1000 && (400..600).contains(&half), "{half}");
    let weighs = json!({ "keep": 1000, "weight": "X < 1 ? 400 : Y > 100 ? 7 : 1" });
    let uneven = kept(&scan, weighs.clone(), None);
    assert!(uneven.len() == 1000 && left(&uneven) > half + 100, "{}", left(&uneven));
    assert!(kept(&scan, weighs, Some(900)) == uneven, "tiles change nothing");
    // What weighs alike is as if nothing weighed.
    assert!(kept(&scan, json!({ "keep": 1000, "weight": "X < 9 ? 1 : 2" }), None) == even);
}

/// The area of the convex hull of what is seen from above.
fn hull_area(points: &BTreeSet<At>) -> i64 {
    let turn = |a: At, b: At, c: At| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let chain = |points: &mut dyn Iterator<Item = &At>| {
        let mut hull: Vec<At> = Vec::new();
        for p in points {
            while hull.len() > 1 && turn(hull[hull.len() - 2], hull[hull.len() - 1], *p) <= 0 {
                hull.pop();
            }
            hull.push(*p);
        }
        hull.pop();
        hull
    };
    let lower = chain(&mut points.iter());
    let hull = [lower, chain(&mut points.iter().rev())].concat();
    let pairs = hull.iter().zip(hull.iter().cycle().skip(1));
    pairs.map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<i64>() / 2
}

#[test]
fn borders_of_a_scan_stay_where_that_is_asked_for() {
    let scan = surface(100, |x, y| (x * 7 + y * 3) % 5);
    let all = hull_area(&scan.iter().copied().collect()) as f64;
    let share = |keys: Value| hull_area(&kept(&scan, keys, None)) as f64 / all;
    let (without, with) =
        (share(json!({ "keep": "2%" })), share(json!({ "keep": "2%", "borders": true })));
    assert!(without < 0.995 && with > 0.999, "{without} {with}");
}

#[test]
fn as_many_points_stay_as_the_shape_asks_for() {
    let auto = || json!({ "keep": "auto" });
    // Noise alone: no number of points lowers the error, and the least of all does.
    let mut random = Random(5);
    let noisy = surface(150, |_, _| random.below(40) as i64);
    let least = kept(&noisy, auto(), None);
    assert_eq!(least.len(), 150 * 150 / 128);
    // Waves of no noise: twice as many halve it, as long as there are any.
    let smooth =
        surface(150, |x, y| ((x as f64 / 5.0).sin() * (y as f64 / 5.0).sin() * 4e3) as i64);
    let most = kept(&smooth, auto(), None);
    assert_eq!(most.len(), 150 * 150 / 8);
    assert!(kept(&smooth, auto(), Some(1500)) == most, "tiles change nothing");
    // It is the reduction to that number.
    assert!(kept(&smooth, json!({ "keep": 150 * 150 / 8 }), None) == most);
    // Few points and copies of one.
    assert_eq!(kept(&noisy[..40], auto(), None).len(), 40);
    assert_eq!(kept(&[[1, 2, 3]; 500], auto(), None).len(), 1);
}
