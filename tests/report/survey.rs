//! The survey: planes and deviations of tiles and scan, against geometry and in any order of
//! merging.

use pointmill::internals::{
    Lot, Moments, Plane, ScanSurvey, TileKey, morton_cmp, report_tile_level,
};
use pointmill::point::{Bounds, Dimension, Endian, Layout, Position, Scalar, Schema};
use pointmill::report::{Pair, TileFigures, Totals};
use pointmill::stage::{Lattice, Levels};
use pointmill::tile::Fate;
use pointmill::{ErrorKind, Result};
use proptest::prelude::*;

use crate::support::random::Random;

/// A position, its copies and what becomes of them.
type Record = (Position, u32, Fate);

fn lattice(step: f64) -> Lattice {
    let axis = |i: usize| Dimension::new(["X", "Y", "Z"][i], Scalar::F64, 8 * i);
    let dimensions = (0..3).map(axis).collect();
    let schema =
        Schema { layout: Layout::plain("PLY"), endian: Endian::Little, stride: 24, dimensions };
    Lattice::of(&schema, Some(step)).unwrap()
}

fn represented(deviation: f32) -> Fate {
    Fate::Represented { deviation }
}

fn sorted(mut records: Vec<Record>) -> Vec<Record> {
    records.sort_by(|a, b| morton_cmp(&a.0, &b.0));
    records.dedup_by(|a, b| a.0 == b.0);
    records
}

/// Surveys sorted records in tiles of side 2^`level`; tiles are dealt to `threads` surveys, which
/// are merged last first, and the second walk is cut elsewhere.
fn survey(records: &[Record], level: u32, threads: usize) -> Result<(Vec<TileFigures>, Totals)> {
    let lattice = lattice(0.5);
    let bounds = Bounds::of(records.iter().map(|r| r.0));
    let mut parts = vec![ScanSurvey::new(&bounds); threads];
    let mut tiles = Vec::new();
    let same = |a: &Record, b: &Record| TileKey::around(a.0, level) == TileKey::around(b.0, level);
    for (i, tile) in records.chunk_by(same).enumerate() {
        let part = &mut parts[i % threads];
        let mut survey = part.tile(TileKey::around(tile[0].0, level), false);
        tile.iter().for_each(|&(p, n, fate)| survey.add(p, Lot::of(n, fate)));
        tile.iter().for_each(|&(p, n, fate)| part.add(p, Lot::of(n, fate)));
        let mut fitted = survey.fit();
        tile.iter().for_each(|&(p, n, fate)| fitted.measure(p, Lot::of(n, fate)));
        tiles.push(fitted.finish(&lattice, part)?);
    }
    let mut scan = parts.pop().unwrap();
    parts.iter().rev().for_each(|part| scan.merge(part));
    let mut scan = scan.fit();
    for stretch in records.chunks(records.len().div_ceil(threads)).rev() {
        let mut part = scan.part();
        stretch.iter().rev().for_each(|&(p, n, fate)| part.measure(p, Lot::of(n, fate)));
        scan.merge(part.sums());
    }
    Ok((tiles, scan.finish(&lattice)?))
}

fn json(survey: &(Vec<TileFigures>, Totals)) -> String {
    serde_json::to_string(survey).unwrap()
}

fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance
}

/// Uniform in −1..1 and the same on every machine.
fn noise(seed: u64) -> f64 {
    Random(seed).signed(1.0)
}

#[test]
fn a_tilted_plane_has_no_error_and_its_own_normal() {
    // z = 2x − y + 7 in whole steps, far from world 0.
    let far = 1 << 40;
    let positions = (-50..50).flat_map(|x| (-50..50).map(move |y| (x, y)));
    let positions: Vec<Position> =
        positions.map(|(x, y)| [far + x, y - far, 2 * x - y + 7]).collect();
    let mut moments = Moments::for_bounds(&Bounds::of(positions.iter().copied()));
    positions.iter().for_each(|&p| moments.add(p, 1));
    let plane = Plane::fit(&moments).unwrap();
    let expected = [2.0, -1.0, -1.0].map(|v: f64| v / 6f64.sqrt());
    let cosine: f64 = plane.normal().iter().zip(expected).map(|(a, b)| a * b).sum();
    assert!(close(cosine.abs(), 1.0, 1e-14), "{:?}", plane.normal());
    for &p in &positions {
        assert!(plane.distance(p).abs() < 1e-12);
    }
    let above = [far, -far, 7 + 6];
    assert!(close(plane.distance(above).abs(), 6f64.sqrt(), 1e-12));
}

#[test]
fn the_rms_of_noise_about_a_plane_is_that_of_the_noise() {
    let mut records = Vec::new();
    let mut squares = 0.0;
    for i in 0..20_000i64 {
        let height = (noise(i as u64) * 1000.0).round();
        squares += height * height;
        records.push(([i % 200 * 500, i / 200 * 500, 2000 + height as i64], 1, Fate::Kept));
    }
    let (tiles, totals) = survey(&sorted(records), 20, 1).unwrap();
    let rms = (squares / 20_000.0).sqrt() * 0.5;
    assert_eq!(tiles.len(), 1);
    let figures = totals.scan_plane.before.unwrap();
    assert!(close(figures.rms, rms, rms * 1e-3), "{} {rms}", figures.rms);
    // Uniform noise: mean |d| is half the amplitude, RMS is amplitude / √3.
    assert!(close(figures.mean / figures.rms, 3f64.sqrt() / 2.0, 0.01));
    assert_eq!(totals.scan_plane.before, totals.scan_plane.after);
    assert_eq!(totals.scan_plane, totals.tile_plane);
    assert_eq!(totals.deviation, None);
}

#[test]
fn few_equal_and_collinear_positions_lie_on_their_plane() {
    let far = 1i64 << 61;
    let cases: [&[Record]; 6] = [
        &[([5, 6, 7], 1, Fate::Kept)],
        &[([5, 6, 7], 1000, Fate::KeptOnce)],
        &[([0, 0, 0], 1, Fate::Kept), ([3, 4, 5], 7, Fate::Kept)],
        &[([0; 3], 1, Fate::Kept), ([1, 2, 3], 1, Fate::Kept), ([2, 4, 6], 1, Fate::Kept)],
        &[([-far; 3], 1, Fate::Kept), ([far; 3], 1, Fate::Kept)],
        &[
            ([-far; 3], 1, represented(0.0)),
            ([far, 0, 0], 2, Fate::KeptOnce),
            ([far; 3], 1, Fate::Kept),
        ],
    ];
    for records in cases {
        let (_, totals) = survey(&sorted(records.to_vec()), 62, 1).unwrap();
        let extent = Bounds::of(records.iter().map(|r| r.0)).extent();
        let extent = *extent.iter().max().unwrap() as f64;
        for figures in [totals.tile_plane.before, totals.scan_plane.before, totals.scan_plane.after]
        {
            let figures = figures.unwrap();
            // Where coordinates are rounded to fit, the plane is off by 2^-43 of the extent.
            assert!(figures.rms <= 1e-12 * extent, "{records:?}: {figures:?}");
            assert!(figures.mean <= figures.rms * (1.0 + 1e-12));
        }
    }
}

#[test]
fn figures_match_a_scan_worked_out_by_hand() {
    // Two tiles of side 4, step 0.5. First: z = 0 and 2 in turn on a square; second: one point.
    let records = sorted(vec![
        ([0, 0, 0], 1, Fate::Kept),
        ([1, 1, 0], 2, Fate::KeptOnce),
        ([0, 1, 1], 3, represented(1.0)),
        ([1, 0, 1], 3, represented(-1.0)),
        ([4, 0, 0], 1, represented(2.0)),
    ]);
    let (tiles, totals) = survey(&records, 2, 1).unwrap();
    assert_eq!(tiles.len(), 2);
    assert_eq!((tiles[0].corner, tiles[1].corner), ([0.0; 3], [2.0, 0.0, 0.0]));
    assert_eq!(tiles[0].points, Pair { before: 9, after: 2 });
    assert_eq!(tiles[1].points, Pair { before: 1, after: 0 });
    assert_eq!(tiles[1].plane.after, None);
    let first = tiles[0].deviation.unwrap();
    // Removed: one copy at 0, six at 1 step; ties name the first in Morton order.
    assert_eq!((first.points, first.rms, first.max), (7, (6f64 / 7.0).sqrt() * 0.5, 0.5));
    assert_eq!(first.at, [0.5, 0.0, 0.5]);
    let all = totals.deviation.unwrap();
    assert_eq!((all.points, all.rms), (8, (10f64 / 8.0).sqrt() * 0.5));
    assert_eq!((all.p50, all.p95, all.p99, all.max), (0.5, 1.0, 1.0, 1.0));
    assert_eq!(all.at, [2.0, 0.0, 0.0]);
    assert_eq!((totals.tiles, totals.points), (2, Pair { before: 10, after: 2 }));
    // ΣΣd²/Σn: the second tile's only point is on its plane.
    let (rms, total) = (tiles[0].plane.before.unwrap().rms, totals.tile_plane.before.unwrap().rms);
    assert!(rms > 0.0 && close(total, rms * (0.9f64).sqrt(), 1e-15));
    assert!(totals.scan_plane.before.unwrap().rms > 0.0);
}

#[test]
fn nothing_surveyed_is_nothing_reported() {
    let scan = ScanSurvey::new(&Bounds::EMPTY).fit();
    let totals = scan.finish(&lattice(1.0)).unwrap();
    assert_eq!((totals.tiles, totals.points), (0, Pair::default()));
    assert_eq!((totals.scan_plane, totals.deviation), (Pair::default(), None));
}

#[test]
fn a_second_walk_that_misses_records_is_told() {
    let mut scan = ScanSurvey::new(&Bounds::of([[1, 2, 3]]));
    let mut tile = scan.tile(TileKey::around([0; 3], 4), false);
    tile.add([1, 2, 3], Lot::of(5, Fate::KeptOnce));
    let error = tile.fit().finish(&lattice(1.0), &mut scan).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Internal);
    assert!(error.to_string().contains("5 records before and 1 after"), "{error}");
}

#[test]
fn a_scan_that_misses_what_its_tiles_saw_is_told() {
    let (p, fate) = ([1, 2, 3], represented(1.0));
    let mut scan = ScanSurvey::new(&Bounds::of([p]));
    let mut tile = scan.tile(TileKey::around(p, 4), false);
    tile.add(p, Lot::of(5, fate));
    let mut tile = tile.fit();
    tile.measure(p, Lot::of(5, fate));
    tile.finish(&lattice(1.0), &mut scan).unwrap();
    let mut scan = scan.fit();
    let mut part = scan.part();
    part.measure(p, Lot::of(5, fate));
    scan.merge(part.sums());
    let error = scan.finish(&lattice(1.0)).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Internal);
    assert!(
        error.to_string().ends_with("5 records before and 0 after the reduction, but 0 removed")
    );
}

#[test]
fn a_deviation_that_is_no_number_is_an_internal_error() {
    let error = survey(&[([0; 3], 3, represented(f32::NAN))], 4, 1).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Internal);
    assert_eq!(error.to_string(), "3 removed records have a deviation that is no number");
}

#[test]
fn report_tiles_hold_4096_positions_on_average() {
    let mut levels = Levels::default();
    let mut before = None;
    let mut grid: Vec<Position> = (0..128 * 128).map(|i| [i % 128, i / 128, 0]).collect();
    grid.sort_by(morton_cmp);
    for p in grid {
        levels.add(before, p);
        before = Some(p);
    }
    assert_eq!(report_tile_level(&levels), 6);
}

#[test]
fn report_tiles_of_a_small_scan_are_no_larger_than_it_needs() {
    let mut levels = Levels::default();
    let mut before = None;
    for p in [[-3, 5, 5], [-2, 5, 5], [100, 5, 5], [120, 5, 5]] {
        levels.add(before, p);
        before = Some(p);
    }
    // One tile on each side of 0; 100 and 120 first share a cube of side 32.
    assert_eq!(report_tile_level(&levels), 5);
    assert_eq!(report_tile_level(&Levels::default()), 0);
}

fn record(reach: i64) -> impl Strategy<Value = Record> {
    let fate = prop_oneof![
        Just(Fate::Kept),
        Just(Fate::KeptOnce),
        (-8i32..20, 0u8..4).prop_map(|(e, m)| represented(f32::from(m) * 2f32.powi(e))),
    ];
    let copies = prop_oneof![4 => 1u32..4, 1 => Just(u32::MAX)];
    (prop::array::uniform3(-reach..=reach), copies, fate)
}

proptest! {
    #[test]
    fn any_split_and_any_order_give_the_same_bytes(
        (bits, records) in (4u32..62).prop_flat_map(|bits| {
            (Just(bits), prop::collection::vec(record(1i64 << bits), 1..120))
        }),
        depth in 0u32..4, threads in 2usize..7,
    ) {
        let records = sorted(records);
        let level = bits - depth;
        let one = survey(&records, level, 1).unwrap();
        prop_assert_eq!(json(&one), json(&survey(&records, level, threads).unwrap()));
    }

    #[test]
    fn moments_of_parts_in_any_order_are_those_of_the_whole(
        positions in prop::collection::vec((prop::array::uniform3(-(1i64 << 62)..1 << 62), 1u32..), 1..60),
        cut in 0usize..60,
    ) {
        let bounds = Bounds::of(positions.iter().map(|p| p.0));
        let of = |part: &mut dyn Iterator<Item = &(Position, u32)>| {
            let mut moments = Moments::for_bounds(&bounds);
            part.for_each(|&(p, copies)| moments.add(p, copies));
            moments
        };
        let (a, b) = positions.split_at(cut.min(positions.len()));
        let mut merged = of(&mut b.iter().rev());
        merged.merge(&of(&mut a.iter()));
        prop_assert_eq!(merged, of(&mut positions.iter()));
    }

    #[test]
    fn moments_of_tiles_with_their_own_origins_are_those_of_the_whole(
        positions in prop::collection::vec((prop::array::uniform3(0i64..1 << 43), 1u32..), 1..60),
        far in prop::array::uniform3(-(1i64 << 61)..1 << 61), cut in 0usize..60,
    ) {
        let positions: Vec<(Position, u32)> = positions
            .into_iter()
            .map(|(p, copies)| (std::array::from_fn(|a| p[a] + far[a]), copies))
            .collect();
        let of = |part: &[(Position, u32)]| {
            let mut moments = Moments::for_bounds(&Bounds::of(part.iter().map(|p| p.0)));
            part.iter().for_each(|&(p, copies)| moments.add(p, copies));
            moments
        };
        let whole = of(&positions);
        let mut absorbed = Moments::for_bounds(&Bounds::of(positions.iter().map(|p| p.0)));
        let (a, b) = positions.split_at(cut.min(positions.len()));
        absorbed.absorb(&of(b));
        absorbed.absorb(&of(a));
        prop_assert!(whole.is_exact());
        prop_assert_eq!(absorbed, whole);
    }

    #[test]
    fn copies_weigh_as_if_they_were_added_one_by_one(
        positions in prop::collection::vec((prop::array::uniform3(-1000i64..1000), 1u32..5), 1..30),
    ) {
        let bounds = Bounds::of(positions.iter().map(|p| p.0));
        let (mut at_once, mut one_by_one) = (Moments::for_bounds(&bounds), Moments::for_bounds(&bounds));
        for &(p, copies) in &positions {
            at_once.add(p, copies);
            (0..copies).for_each(|_| one_by_one.add(p, 1));
        }
        prop_assert_eq!(at_once, one_by_one);
    }

    #[test]
    fn no_other_plane_through_the_centre_is_nearer(
        positions in prop::collection::vec(prop::array::uniform3(-10_000i64..10_000), 3..40),
        other in prop::array::uniform3(-1f64..1.0),
    ) {
        let bounds = Bounds::of(positions.iter().copied());
        let mut moments = Moments::for_bounds(&bounds);
        positions.iter().for_each(|&p| moments.add(p, 1));
        let plane = Plane::fit(&moments).unwrap();
        let n = positions.len() as f64;
        let mean: [f64; 3] =
            std::array::from_fn(|a| positions.iter().map(|p| p[a] as f64).sum::<f64>() / n);
        let length = other.iter().map(|v| v * v).sum::<f64>().sqrt().max(1e-9);
        let (mut fitted, mut rival) = (0.0, 0.0);
        for p in &positions {
            fitted += plane.distance(*p).powi(2);
            let d: f64 = (0..3).map(|a| (p[a] as f64 - mean[a]) * other[a] / length).sum();
            rival += d * d;
        }
        prop_assert!(fitted <= rival * (1.0 + 1e-9) + 1e-9, "{} {}", fitted, rival);
    }
}
