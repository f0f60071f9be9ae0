//! Leases, who holds them, and what a refusal says.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};

use proptest::prelude::*;

use super::*;
use crate::ErrorKind;

const MIB: u64 = 1 << 20;

#[test]
fn a_lease_is_returned_on_drop() {
    let budget = Budget::new(100);
    let a = budget.lease(60, "tile").unwrap();
    let b = budget.clone().lease(40, "index").unwrap();
    assert_eq!((budget.used(), budget.free(), budget.limit()), (100, 0, 100));
    drop(a);
    assert_eq!((budget.used(), b.bytes()), (40, 40));
    drop(b);
    assert_eq!((budget.used(), budget.peak()), (0, 100));
}

#[test]
fn a_refusal_names_what_was_asked_what_is_free_and_what_would_do() {
    let budget = Budget::new(128 * MIB);
    let _held = budget.lease(100 * MIB, "index").unwrap();
    let error = budget.lease(40 * MIB + 1, "tile").unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Memory);
    assert_eq!(
        error.to_string(),
        "the tile needs 41 MiB of memory, but 28 MiB of the budget of 128 MiB is free: \
         100 MiB for the index are taken"
    );
    assert_eq!(error.remedy(), Some("give at least `run.memory = \"141MiB\"`"));
    assert_eq!(budget.used(), 100 * MIB);
}

#[test]
fn the_budget_that_a_refusal_names_would_do() {
    let budget = Budget::new(10);
    let error = budget.lease(3 * MIB, "tile").unwrap_err();
    assert_eq!(error.remedy(), Some("give at least `run.memory = \"3MiB\"`"));
    assert!(Budget::new(3 * MIB).lease(3 * MIB, "tile").is_ok());
}

#[test]
fn sums_beyond_u64_are_refused_and_do_not_wrap() {
    let budget = Budget::new(u64::MAX);
    let mut lease = budget.lease(u64::MAX - 1, "tile").unwrap();
    assert!(budget.try_lease(2, "tile").is_none());
    assert!(lease.grow(u64::MAX).is_err());
    assert_eq!(lease.bytes(), u64::MAX - 1);
}

#[test]
fn a_lease_grows_and_shrinks_within_the_budget() {
    let budget = Budget::new(100);
    let mut lease = budget.lease(10, "cache").unwrap();
    lease.grow(90).unwrap();
    assert!(lease.grow(1).is_err());
    lease.shrink_to(70);
    assert_eq!((lease.bytes(), budget.used()), (70, 70));
    lease.shrink_to(1000);
    assert_eq!((lease.bytes(), budget.used()), (70, 70));
    lease.shrink_to(0);
    assert_eq!((lease.bytes(), budget.used()), (0, 0));
}

#[test]
fn threads_never_hold_more_than_the_limit() {
    let budget = Budget::new(1000);
    let refused = AtomicU64::new(0);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for i in 0..10_000 {
                    match budget.try_lease(300 + i % 7, "tile") {
                        Some(lease) => drop(lease),
                        None => _ = refused.fetch_add(1, Ordering::Relaxed),
                    }
                    assert!(budget.used() <= 1000);
                }
            });
        }
    });
    assert_eq!(budget.used(), 0);
    assert!((300..=1000).contains(&budget.peak()));
}

#[test]
fn bytes_are_shown_in_the_largest_unit() {
    let text = [0, 1023, 1024, 1536, 200 * MIB + 300_000, 3 << 39].map(|n| Bytes(n).to_string());
    assert_eq!(text, ["0 B", "1023 B", "1 KiB", "1.5 KiB", "200 MiB", "1.5 TiB"]);
}

#[test]
fn what_is_refused_never_reads_like_what_is_needed() {
    for limit in [1, MIB - 1, MIB, 269 * MIB + 999_999, 270 * MIB - 1, u64::MAX - 1] {
        let number = |text: &str| text.split([' ', 'M']).next().unwrap().to_owned();
        let (less, enough) = (at_most_mebibytes(limit), whole_mebibytes(limit + 1));
        assert!(less.ends_with(" B") || number(&less) != number(&enough), "{less} {enough}");
    }
    assert_eq!(at_most_mebibytes(270 * MIB - 1), "269.9 MiB");
    assert_eq!(at_most_mebibytes(256 * MIB), "256 MiB");
}

#[test]
fn a_sum_beyond_all_numbers_stays_there_and_fits_nowhere() {
    let beyond = Bytes(u64::MAX - 1) + Bytes(1);
    assert_eq!(beyond, Bytes::BEYOND);
    let times = [0, 1, 3].map(|times| beyond * times);
    for made in times.into_iter().chain([beyond + Bytes(1), Bytes(1 << 40) * (1 << 24)]) {
        assert_eq!(made, Bytes::BEYOND);
        assert!(!made.fit(u64::MAX));
    }
    assert_eq!([Bytes(3), Bytes(4)].into_iter().sum::<Bytes>(), Bytes(7));
    assert!(Bytes::of(6, 7).fit(42) && !Bytes::of(6, 7).fit(41));
    let parts = Holders::of([("a", Bytes(1)), ("b", Bytes(u64::MAX - 1))]);
    assert!(Budget::new(u64::MAX).lease_all(&parts, "whole").is_err());
}

#[test]
fn parts_are_leased_together_or_not_at_all() {
    let budget = Budget::new(10 * MIB);
    let parts = Holders::of([("tile", Bytes(6 * MIB)), ("queue", Bytes(2 * MIB))]);
    let held = budget.lease_all(&parts, "mill").unwrap();
    assert_eq!((budget.used(), budget.at_peak()), (8 * MIB, parts.clone()));
    let error = budget.lease_all(&parts, "mill").unwrap_err();
    assert_eq!(
        error.to_string(),
        "the mill needs 8 MiB of memory, but 2 MiB of the budget of 10 MiB is free: \
         6 MiB for the tile, 2 MiB for the queue are taken"
    );
    assert_eq!(error.remedy(), Some("give at least `run.memory = \"16MiB\"`"));
    assert_eq!(budget.used(), 8 * MIB);
    drop(held);
    assert_eq!((budget.used(), budget.at_peak()), (0, parts));
}

#[test]
fn a_sentence_names_five_holders_and_adds_up_the_others() {
    let names = ["a", "b", "c", "d", "e", "f", "g", "none"];
    let bytes = [10, 70, 30, 30, 50, 20, 60, 0].map(Bytes);
    let holders = Holders::of(names.into_iter().zip(bytes));
    assert_eq!(
        holders.to_string(),
        "70 B for the b, 60 B for the g, 50 B for the e, 30 B for the c, 30 B for the d, \
         30 B for the rest"
    );
    let largest: Vec<_> = holders.largest(2).iter().map(|holder| holder.name).collect();
    assert_eq!(largest, ["b", "g"]);
    assert_eq!((holders.largest(100).len(), holders.sum()), (7, Bytes(270)));
}

proptest! {
    /// Leases of a few names come, grow, shrink and go: an independent table says who holds what.
    #[test]
    fn what_names_hold_is_what_is_used_and_never_beyond_the_limit(
        limit in 0..2000u64,
        steps in prop::collection::vec((0..5usize, 0..3usize, 0..700u64), 1..80),
    ) {
        const NAMES: [&str; 3] = ["tile", "index", "queue"];
        let budget = Budget::new(limit);
        let mut leases = Vec::<(usize, Lease)>::new();
        let (mut held, mut peak, mut at_peak) = ([0; 3], 0, [0; 3]);
        for (what, name, bytes) in steps {
            let fits = held.iter().sum::<u64>() + bytes <= limit;
            match what {
                0 | 1 => {
                    let lease = budget.lease(bytes, NAMES[name]);
                    prop_assert_eq!(lease.is_ok(), fits);
                    leases.extend(lease.ok().map(|lease| (name, lease)));
                    held[name] += if fits { bytes } else { 0 };
                }
                2 => if let Some((name, lease)) = leases.last_mut() {
                    prop_assert_eq!(lease.grow(bytes).is_ok(), fits);
                    held[*name] += if fits { bytes } else { 0 };
                },
                3 => if let Some((name, lease)) = leases.first_mut() {
                    held[*name] -= lease.bytes() - lease.bytes().min(bytes);
                    lease.shrink_to(bytes);
                },
                _ => if !leases.is_empty() {
                    let (name, lease) = leases.swap_remove(bytes as usize % leases.len());
                    held[name] -= lease.bytes();
                },
            }
            let used = held.iter().sum::<u64>();
            if used > peak {
                (peak, at_peak) = (used, held);
            }
            prop_assert!(used <= limit);
            prop_assert_eq!((budget.used(), budget.free()), (used, limit - used));
            let leased = leases.iter().map(|(_, lease)| lease.bytes()).sum::<u64>();
            prop_assert_eq!((budget.peak(), leased), (peak, used));
            let largest = budget.at_peak().largest(3);
            let told: BTreeMap<_, _> =
                largest.iter().map(|holder| (holder.name, holder.bytes.0)).collect();
            let known = NAMES.into_iter().zip(at_peak).filter(|(_, bytes)| *bytes > 0);
            prop_assert_eq!(told, known.collect::<BTreeMap<_, _>>());
        }
        drop(leases);
        prop_assert_eq!(budget.used(), 0);
    }
}
