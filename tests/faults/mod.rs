//! A machine that fails: calls that fail or fall short, a disk that fills, kills, and scratch data
//! that comes back changed. Each test tries a few places of many; `POINTMILL_FAULTS=all` tries all.
//!
//! Whatever fails, outputs are old or complete, nothing is left behind that is not named, and the
//! same run gives the right bytes once the machine is sound (`machine.rs` looks after each
//! fault).

mod machine;

use machine::{Bench, Does, EACCES, EINTR, EIO, EMFILE, ENOLCK, ENOSPC, Fault, When, spread};

/// Every n-th call of a kind fails once, each in a run of its own.
fn each_fails(bench: &mut Bench, call: &'static str, error: u32, most: u64) {
    for n in spread(bench.count(call, None).calls, most) {
        bench.fails(&Fault { call, path: None, does: Does::Error(error), when: When::Nth(n) });
    }
}

#[test]
fn a_read_that_fails_fails_the_run_and_spares_what_is_there() {
    let mut bench = Bench::new();
    each_fails(&mut bench, "read", EIO, 5);
    each_fails(&mut bench, "pread", EIO, 7);
    bench.hold(8);
}

#[test]
fn what_cannot_be_read_of_a_header_or_a_table_is_not_taken_for_missing() {
    let mut bench = Bench::new();
    // The header, the records behind it, the chunk table and its place: before any point.
    for n in 1..=12 {
        let does = Does::Error(EIO);
        bench.fails(&Fault { call: "pread", path: None, does, when: When::Nth(n) });
    }
    bench.hold(12);
}

#[test]
fn a_write_that_fails_fails_the_run_and_spares_what_is_there() {
    let mut bench = Bench::new();
    each_fails(&mut bench, "write", EIO, 5);
    each_fails(&mut bench, "write", ENOSPC, 3);
    each_fails(&mut bench, "pwrite", EIO, 5);
    each_fails(&mut bench, "pwrite", ENOSPC, 3);
    bench.hold(12);
}

#[test]
fn a_name_or_a_sync_that_fails_fails_the_run_and_what_was_replaced_is_told() {
    let mut bench = Bench::new();
    each_fails(&mut bench, "sync", EIO, 8);
    each_fails(&mut bench, "rename", EACCES, 4);
    each_fails(&mut bench, "mkdir", EACCES, 3);
    bench.hold(9);
}

#[test]
fn what_cannot_be_opened_removed_or_locked_never_gives_another_output() {
    let mut bench = Bench::new();
    for (call, error, most) in
        [("open", EACCES, 7), ("open", EMFILE, 4), ("unlink", EIO, 4), ("lock", ENOLCK, 2)]
    {
        for n in spread(bench.count(call, None).calls, most) {
            let does = Does::Error(error);
            bench.never_lies(&Fault { call, path: None, does, when: When::Nth(n) });
        }
    }
    bench.hold(13);
}

#[test]
fn calls_that_do_half_or_are_interrupted_change_nothing() {
    let mut bench = Bench::new();
    for call in ["read", "pread", "write", "pwrite"] {
        for (does, every) in [(Does::Short, 1), (Does::Short, 2), (Does::Error(EINTR), 2)] {
            bench.endures(&Fault { call, path: None, does, when: When::Every(every) });
        }
    }
    bench.hold(12);
}

#[test]
fn a_disk_that_fills_fails_the_run_and_spares_what_is_there() {
    let mut bench = Bench::new();
    let bytes = bench.count("output", None).written;
    assert!(bytes > 100_000, "{bytes} bytes are written");
    for n in spread(16, 6) {
        let when = When::Nth(bytes / 17 * n);
        bench.fails(&Fault { call: "output", path: None, does: Does::Full, when });
    }
    bench.hold(6);
}

#[test]
fn a_kill_at_any_call_leaves_outputs_old_or_complete() {
    let mut bench = Bench::new();
    for call in ["open", "mkdir", "lock", "write", "pwrite", "sync", "rename", "unlink"] {
        for n in spread(bench.count(call, None).calls, 4) {
            let fault = Fault { call, path: None, does: Does::Kill, when: When::Nth(n) };
            let (ran, _) = bench.suffer(&fault);
            if ran.code.is_some() {
                bench.note(&fault, &ran, "it was not killed");
            }
        }
    }
    bench.hold(20);
}

#[test]
fn scratch_data_that_comes_back_changed_is_noticed() {
    let mut bench = Bench::new();
    for path in [
        "-found-",
        "-records-",
        "-positions-",
        "-order-",
        "-runs-",
        "-states-",
        "-fates-",
        "-normals-",
        "-figures-",
        "-report-",
    ] {
        let path = Some(path);
        for n in spread(bench.count("pread", path).calls, 3) {
            let when = When::Nth(n);
            bench.never_lies(&Fault { call: "pread", path, does: Does::Flip, when });
        }
    }
    bench.hold(16);
}
