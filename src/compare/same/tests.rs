//! The comparison of records beside a count of all of them, spilled and on several threads.

use std::collections::HashMap;
use std::num::NonZeroUsize;
use std::path::Path;

use super::told::PLACES;
use super::*;
use crate::engine::Quiet;
use crate::geom::hash::of_position;

/// A scan of texts: so many records, of which those numbers that `other` tells are changed so.
fn scan(at: &Path, name: &str, numbers: &[(i64, i64)]) -> (String, Vec<[i64; 4]>) {
    let record = |&(n, more): &(i64, i64)| {
        let value = |axis: i64, below: u64| (of_position(5, [n, axis, 0]) % below) as i64;
        [value(0, 90), value(1, 90), value(2, 12), more]
    };
    let all: Vec<[i64; 4]> = numbers.iter().map(record).collect();
    let lines = all.iter().map(|[x, y, z, i]| format!("{x},{y},{z},{i}\n"));
    let path = at.join(name);
    std::fs::write(&path, format!("x,y,z,intensity\n{}", lines.collect::<String>())).unwrap();
    (path.to_str().unwrap().to_owned(), all)
}

fn compared(first: &str, second: &str, threads: usize, spill: SpillSetting) -> RecordsComparison {
    let run = RunSettings {
        threads: NonZeroUsize::new(threads),
        memory: Some(96 << 20),
        spill,
        ..RunSettings::default()
    };
    let paths = [first.to_owned(), second.to_owned()];
    let [first, second] = [&paths[..1], &paths[1..]];
    let registry = Registry::builtin();
    compare_records([first, second], &Selection::default(), &run, &registry, &Quiet).unwrap()
}

#[test]
fn many_bins_on_disk_say_what_counting_says_on_any_number_of_threads() {
    let at = tempfile::tempdir().unwrap();
    let numbers: Vec<(i64, i64)> = (0..70_000).map(|n| (n, n % 5)).collect();
    let (first, of_first) = scan(at.path(), "first.csv", &numbers);
    // A third is left out, of the others every second one is changed, and some come twice.
    let kept = numbers.iter().filter(|(n, _)| n % 3 > 0);
    let changed = kept.map(|&(n, more)| (n, if n % 2 == 0 { more + 5 } else { more }));
    let twice = numbers[..2000].iter().copied();
    let others: Vec<(i64, i64)> = changed.chain(twice).collect();
    let (second, of_second) = scan(at.path(), "second.csv", &others);
    let mut counts = HashMap::<[i64; 4], [u64; 2]>::new();
    of_first.iter().for_each(|record| counts.entry(*record).or_default()[0] += 1);
    of_second.iter().for_each(|record| counts.entry(*record).or_default()[1] += 1);
    let more = |side: usize| {
        let more = counts.values().map(|count| count[side].saturating_sub(count[1 - side]));
        more.sum::<u64>()
    };
    let told = compared(&first, &second, 2, SpillSetting::Always);
    assert_eq!((told.only_first.count, told.only_second.count), (more(0), more(1)));
    assert!(told.changed.pairs > 10_000, "{told:?}");
    assert_eq!(told.changed.dimensions.len(), 1);
    assert_eq!(told.changed.dimensions[0].name, "Intensity");
    assert_eq!(told.changed.dimensions[0].pairs, told.changed.pairs);
    assert_eq!(told.changed.places.len(), PLACES);
    for (threads, spill) in [(1, SpillSetting::Always), (3, SpillSetting::Auto)] {
        assert_eq!(compared(&first, &second, threads, spill), told);
    }
    // The other way around.
    let back = compared(&second, &first, 2, SpillSetting::Auto);
    assert_eq!((&back.only_first, &back.only_second), (&told.only_second, &told.only_first));
    assert_eq!(back.changed.pairs, told.changed.pairs);
    let same = compared(&first, &first, 2, SpillSetting::Always);
    assert!(same.same && same.same_order);
}
