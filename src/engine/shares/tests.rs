//! The division of memory.

use super::*;

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
        lists: 0,
        mills: true,
        tagged: false,
        ranked: false,
        run_most: None,
        gathers: false,
        has_cells: true,
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
            let kept = shares.kept_in_memory.min(there.points * (30 + KEPT_BYTES));
            there.tile_positions(1, limit - shares.base - shares.index - kept) as u64
        };
        assert!(free(named) >= positions, "{positions}: {named}");
        assert!(named < 160 << 20 || free(named - (3 << 20)) < positions, "{positions}");
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
            lists: most as u64,
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
    assert!(shares.work >= 2 * few.merge(100), "{shares:?}");
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
    assert!(error.to_string().ends_with(&format!("need at least {mebibytes} MiB")), "{error}");
}
