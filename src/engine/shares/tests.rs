//! The division of memory.

use super::*;
use crate::engine::demands::FEWEST;
use crate::engine::pass::ColumnBytes;
use crate::point::NORMAL;
use crate::stage::{ChunkSize, Needs};

fn demands(limit: u64) -> Demands {
    Demands {
        standings: 2,
        filters: false,
        limit,
        resident: 8 << 20,
        threads: 2,
        stride: 30,
        points: 10_000_000,
        part_bytes: 1 << 20,
        chunk: ChunkSize { points: 50_000, bytes: 4_500_000 },
        sinks: 1,
        lists: Bytes(0),
        arranging: Arranging::default(),
        mills: true,
        tagged: false,
        ranked: false,
        connected: Bytes(0),
        run_most: None,
        gathers: false,
        has_cells: true,
        is_plain: false,
        columns: ColumnBytes { tile: 12, stored: 20, row: 12, of_records: false },
        passes: vec![vec![Needs { neighbors: 10, bytes_per_point: 40, ..Needs::default() }]],
    }
}

#[test]
fn what_is_divided_is_no_more_than_the_limit() {
    for mib in [64, 100, 128, 256, 1024, 65_536] {
        let Ok(shares) = demands(mib << 20).divide() else {
            assert!(mib < 128, "{mib} MiB do for two threads");
            continue;
        };
        let sum = shares.base + shares.work + shares.index + shares.kept_in_memory;
        assert!(sum <= mib << 20, "{mib} MiB: {shares:?}");
        assert!(shares.run_records >= FEWEST && shares.tile_positions >= FEWEST, "{shares:?}");
    }
}

#[test]
fn the_limit_for_a_heavy_tile_leaves_that_tile_its_memory() {
    for positions in [20_000, 1_000_000, 30_000_000] {
        let named = demands(0).limit_for_tile(1, positions);
        let free = |limit: u64| {
            let there = demands(limit);
            let shares = there.divide().unwrap();
            // What is kept in memory is no more than the scan.
            let kept = shares.kept_in_memory.min(there.points * (30 + KEPT_BYTES as u64));
            there.tile_positions(1, limit - shares.base - shares.index - kept) as u64
        };
        assert!(free(named) >= positions, "{positions}: {named}");
        assert!(named < 160 << 20 || free(named - (4 << 20)) < positions, "{positions}");
        assert!(demands(0).limit_for_tile(2, positions) >= named);
    }
}

#[test]
fn numbers_at_their_extremes_are_refused_and_never_wrap() {
    for most in [usize::MAX, usize::MAX / 2, 1 << 40, 1 << 32] {
        let worst = Demands {
            resident: most as u64,
            threads: most,
            stride: most,
            points: most as u64,
            part_bytes: most as u64,
            chunk: ChunkSize { points: most, bytes: most as u64 },
            sinks: most,
            lists: Bytes::from(most),
            run_most: Some(0),
            passes: vec![vec![Needs { bytes_per_point: most, ..Needs::default() }; 3]],
            ..demands(most as u64)
        };
        for mills in [true, false] {
            let worst = Demands { mills, ..worst.clone() };
            assert_eq!(worst.divide().unwrap_err().kind(), crate::ErrorKind::Memory);
            let most = (most as u64).min(1 << 40);
            // One of them alone, whatever the others.
            let one = Demands { limit: u64::MAX, points: most, mills, ..demands(0) };
            assert!(one.divide().is_ok_and(|shares| !mills || shares.run_records > 0));
            let one = Demands { threads: most as usize, mills, ..demands(1 << 30) };
            assert!(one.divide().is_err());
        }
        assert!(worst.limit_for_tile(usize::MAX, u64::MAX) > 1 << 62);
    }
}

#[test]
fn runs_of_a_few_records_are_planned_with_the_memory_to_merge_them() {
    let few = Demands { run_most: Some(100), points: 1_000_000, ..demands(1 << 30) };
    let shares = few.divide().unwrap();
    assert_eq!(shares.run_records, 100);
    assert!(few.merge(100).sum().fit(shares.work), "{shares:?}");
}

#[test]
fn a_stream_needs_no_index() {
    let shares = Demands { mills: false, ..demands(64 << 20) }.divide().unwrap();
    assert_eq!((shares.index, shares.kept_in_memory), (0, 0));
    assert!(shares.base + shares.work <= 64 << 20);
}

#[test]
fn a_refusal_names_a_limit_that_does() {
    let error = demands(32 << 20).divide().unwrap_err();
    let help = error.remedy().unwrap().to_owned();
    let mebibytes: u64 = help
        .split_once("`run.memory = \"")
        .unwrap()
        .1
        .split_once("MiB")
        .unwrap()
        .0
        .parse()
        .unwrap();
    assert!(demands(mebibytes << 20).divide().is_ok(), "{help}");
    assert!(demands((mebibytes - 3) << 20).divide().is_err(), "{help}");
    let told = format!("need at least {mebibytes} MiB (");
    assert!(error.to_string().contains(&told), "{error}");
}

/// Demands that differ in all that the division depends on.
fn different() -> Vec<Demands> {
    let needs =
        |neighbors, bytes_per_point| Needs { neighbors, bytes_per_point, ..Needs::default() };
    let deciding = Needs { removes: true, ..needs(0, 17).reads(&NORMAL) };
    let passes = vec![vec![deciding], vec![needs(30, 80), needs(0, 16)]];
    vec![
        demands(128 << 20),
        demands(1 << 30),
        demands(40 << 30),
        Demands { mills: false, ..demands(64 << 20) },
        Demands { mills: false, sinks: 3, threads: 8, stride: 67, ..demands(1 << 30) },
        Demands { tagged: true, sinks: 2, has_cells: false, ..demands(300 << 20) },
        Demands { ranked: true, lists: Bytes(9 << 20), threads: 5, ..demands(600 << 20) },
        Demands { gathers: true, tagged: true, ranked: true, ..demands(512 << 20) },
        Demands { points: 7_000_000_000, threads: 64, ..demands(40 << 30) },
        Demands { run_most: Some(4000), points: 400_000, ..demands(200 << 20) },
        Demands { passes, ..demands(1 << 28) },
        Demands { chunk: ChunkSize { points: 7, bytes: 90 }, threads: 1, ..demands(64 << 20) },
        Demands { points: 0, passes: vec![vec![]], ..demands(77 << 20) },
    ]
}

/// Base, work, index, kept in memory, records of a run and positions of a tile; then the limit for
/// a tile of three million positions, what the mill holds for one of 70,000, and the positions of
/// each of two tiles in 500 MiB.
type Divided = ([u64; 6], [u64; 3]);

#[rustfmt::skip]
const DIVIDED: [Divided; 13] = [
    ([20971520, 87968780, 9629232, 15648196, 524288, 116266], [1802502144, 49773712, 1044604]),
    ([20971520, 402653184, 9629232, 640487888, 524288, 785807], [1802502144, 49773712, 1044604]),
    ([20971520, 402653184, 9629232, 42516419024, 524288, 785807], [1802502144, 49773712, 1044604]),
    ([20971520, 30571712, 0, 0, 0, 0], [763363328, 49773712, 1044604]),
    ([39845888, 227561344, 0, 0, 0, 0], [920649728, 188157264, 750171]),
    ([20971520, 224180844, 9629232, 59791204, 524288, 354824], [1895825408, 54673712, 921064]),
    ([39845888, 466715308, 9746448, 112837956, 524288, 256458], [1318060032, 104239280, 737422]),
    ([20971520, 392434852, 9746448, 113718092, 524288, 545761], [2684354560, 56353712, 746146]),
    ([216006656, 12884901888, 6740234600, 23108529816, 2819920, 785807], [11078205440, 1082808784, 0]),
    ([20971520, 151524764, 385392, 36833524, 4000, 251491], [804257792, 49773712, 1044604]),
    ([20971520, 189631908, 9629232, 48202796, 524288, 241630], [2061500416, 56974992, 762901]),
    ([17825792, 31294480, 9629232, 8359360, 390890, 129921], [1766850560, 17213002, 1113882]),
    ([20971520, 54599344, 0, 5169488, 333821, 60442], [586153984, 45643712, 1394784]),
];

#[test]
fn equal_demands_are_divided_as_ever() {
    // Shares decide how much is spilled and how fast a run is; who changes a formula means to.
    for (there, (shares, others)) in different().iter().zip(DIVIDED) {
        let divided = there.divide().unwrap();
        let Shares { base, work, index, kept_in_memory, run_records, tile_positions } = divided;
        let sizes = [base, work, index, kept_in_memory];
        let all = sizes.into_iter().chain([run_records as u64, tile_positions as u64]);
        assert_eq!(all.collect::<Vec<_>>(), shares, "{there:?}");
        let limit = there.limit_for_tile(1, 3_000_000);
        let positions = there.tile_positions(2, 500 << 20) as u64;
        assert_eq!([limit, there.mill(1, 70_000).sum().0, positions], others, "{there:?}");
    }
}

#[test]
fn every_phase_of_a_run_fits_what_is_planned_for_it() {
    let mut tried = 0;
    for there in different() {
        let shares = there.divide().unwrap();
        let index = there.index().sum();
        assert_eq!((there.base().sum(), index), (Bytes(shares.base), Bytes(shares.index)));
        let phases = match there.mills {
            true => vec![
                there.decode(shares.run_records as u64),
                there.merge(shares.run_records as u64),
                there.mill(there.threads, shares.tile_positions as u64),
            ],
            false => vec![there.stream()],
        };
        for phase in phases {
            assert!(phase.sum().fit(shares.work), "{phase:?} in {shares:?}");
            assert!(phase.sum() > Bytes(0));
            tried += 1;
        }
        let all = shares.base + shares.index + shares.work + shares.kept_in_memory;
        assert!(all <= there.limit);
        let fixed = there.limit - all;
        assert!(!there.mills || fixed == 0, "{fixed} bytes of {shares:?} are for nothing");
    }
    assert!(tried > 30);
}

#[test]
fn a_refusal_lists_the_parts_of_what_it_names_largest_first() {
    for there in different() {
        let error = Demands { limit: 1 << 20, ..there.clone() }.divide().unwrap_err().to_string();
        let (told, parts) = error.strip_suffix(')').and_then(|told| told.split_once(" (")).unwrap();
        let words = told.strip_suffix(" MiB").and_then(|told| told.rsplit(' ').next());
        let whole: f64 = words.unwrap().parse().unwrap();
        let size = |part: &str| {
            let (size, unit) = part.split_once(" for the ").unwrap().0.split_once(' ').unwrap();
            let units = [("GiB", 1024.0), ("MiB", 1.0), ("KiB", 1.0 / 1024.0)];
            size.parse::<f64>().unwrap() * units.iter().find(|(name, _)| *name == unit).unwrap().1
        };
        let sizes: Vec<f64> = parts.split(", ").map(size).collect();
        let named = sizes.len() - usize::from(parts.ends_with(" for the rest"));
        assert!((2..=5).contains(&named), "{error}");
        assert!(sizes[..named].is_sorted_by(|a, b| a >= b), "{error}");
        // What is shown is rounded, the whole upwards to a mebibyte.
        let sum: f64 = sizes.iter().sum();
        assert!((whole - 1.3..whole + 0.3).contains(&sum) || whole > 100.0, "{error}");
        assert!((0.98..1.02).contains(&(sum / whole)) || whole < 100.0, "{error}");
        for name in ["program", "overhead of threads"] {
            assert!(parts.contains(&format!("for the {name}")) || sizes.len() > 5, "{error}");
        }
    }
}
