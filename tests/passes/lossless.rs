//! Nothing lost where stages remove by class, mark, repeat or feed several outputs: every written
//! record is one of the input, but for the one field that a mark writes, and every record is accounted
//! for.

use std::collections::BTreeMap;
use std::path::Path;

use crate::support::random::Random;
use crate::support::runs::{Memory, Ran, Settings, run_with};
use crate::support::scan::Scan;
use pointmill::synth::Scene;

const TILED: Settings = Settings {
    tile_points: Some(100),
    memory: Memory::Least(0),
    threads: 2,
    spill: "always",
    simd: "auto",
};
/// Where a record has its flags and its class (LAS 1.4 R15, table 16), and the bits of flags.
const FLAGS: usize = 15;
const CLASS: usize = 16;
const KEY_POINT: u8 = 2;
const WITHHELD: u8 = 4;

type Counted = BTreeMap<Vec<u8>, u64>;

/// Records in any order, each as `seen`, and how often each is there.
fn counted_as(scan: &Scan, seen: impl Fn(&mut [u8])) -> Counted {
    let mut all = Counted::new();
    for record in scan.records.chunks_exact(scan.schema.stride) {
        let mut record = record.to_vec();
        seen(&mut record);
        *all.entry(record).or_default() += 1;
    }
    all
}

fn counted(scan: &Scan) -> Counted {
    counted_as(scan, |_| {})
}

/// How many of `all` are left beside those of `part`, all of which must be there.
fn beside(all: &Counted, part: &Counted, what: &str) -> u64 {
    for (record, n) in part {
        let of = all.get(record).copied().unwrap_or(0);
        assert!(*n <= of, "{what}: {n} of a record that is there {of} times: {record:?}");
    }
    all.values().sum::<u64>() - part.values().sum::<u64>()
}

/// Stages, each a kind and its keys.
fn stages(each: &[(&str, &str)]) -> String {
    each.iter().map(|(kind, keys)| format!("[[stage]]\nkind = \"{kind}\"\n{keys}\n")).collect()
}

fn landscape() -> Scan {
    let scan = Scan::synthetic(Scene::Als, 8_000, 31).snapped(80);
    scan.with_copies(7).with_classes_and_flags(8)
}

fn reduced(scan: &Scan, folder: &Path, stages: &str, withheld: &str) -> (Ran, Scan) {
    let files = scan.write_split(folder, 3, &mut Random(3));
    let keys = format!("withheld = \"{withheld}\"");
    let ran = run_with(folder, &files, stages, "laz", TILED, &keys)
        .unwrap_or_else(|error| panic!("{stages}: {error:?}"));
    assert!(ran.count("tiles") >= 8 && ran.spilled > 0, "{} tiles", ran.count("tiles"));
    let written = Scan::read(&ran.output, usize::MAX);
    let ledger = &ran.report.result.ledger;
    assert_eq!(ledger.read, scan.points() as u64);
    assert_eq!(ledger.kept, written.points() as u64);
    assert_eq!(ledger.read, ledger.kept + ledger.removed_records());
    (ran, written)
}

fn removed(ran: &Ran, stage: &str) -> u64 {
    let of = ran.report.result.ledger.removed.iter().filter(|r| r.stage == stage);
    of.map(|r| r.records).sum()
}

/// Records by class.
fn classes(scan: &Scan) -> BTreeMap<u8, u64> {
    let mut all = BTreeMap::new();
    let records = scan.records.chunks_exact(scan.schema.stride);
    records.for_each(|record| *all.entry(record[CLASS]).or_default() += 1);
    all
}

/// The report's figures by class are those of the files.
fn assert_classes(ran: &Ran, scan: &Scan, written: &Scan) {
    let (before, after) = (classes(scan), classes(written));
    assert!(before.len() >= 4, "{before:?}");
    let figures = &ran.report.result.classes;
    assert_eq!(figures.len(), before.len(), "{figures:?}");
    for figure in figures {
        let of = |counts: &BTreeMap<u8, u64>| counts.get(&figure.class).copied().unwrap_or(0);
        assert_eq!((figure.before, figure.after), (of(&before), of(&after)), "{figure:?}");
    }
}

#[test]
fn what_is_written_and_what_is_removed_are_the_input() {
    let scan = landscape();
    let all = counted(&scan);
    let cases = [
        stages(&[("outliers", "multiplier = 0.8")]),
        stages(&[("outliers", "method = \"radius\"\nradius = 0.9\nmin_neighbors = 5")]),
        stages(&[("grid", "side = 1.3")]),
        stages(&[("normals", ""), ("cells", "keep = \"10%\""), ("median", "")]),
        stages(&[("normals", ""), ("cells", "side = 2.1"), ("median", "passes = 3")]),
        stages(&[
            ("outliers", ""),
            ("normals", "classes = [2, 6]"),
            ("cells", "classes = [2, 6]\nkeep = \"20%\"\nside = 3.3"),
            ("median", "classes = [2, 6]"),
            ("grid", "side = 0.9\nclasses = [5]\nwith = [\"overlap\"]"),
        ]),
    ];
    for stages in &cases {
        for withheld in ["drop", "keep"] {
            let folder = tempfile::tempdir().unwrap();
            let (ran, written) = reduced(&scan, folder.path(), stages, withheld);
            let gone = beside(&all, &counted(&written), stages);
            assert_eq!(gone, ran.report.result.ledger.removed_records(), "{stages}");
            assert!(gone > 20 && written.points() > 100, "{stages}");
            assert_classes(&ran, &scan, &written);
            let is_withheld = |r: &&[u8]| r[FLAGS] & WITHHELD != 0;
            let of = scan.records.chunks_exact(scan.schema.stride).filter(is_withheld).count();
            let dropped = if withheld == "drop" { of as u64 } else { 0 };
            assert!(of > 100);
            assert_eq!(removed(&ran, "read"), dropped, "{:?}", ran.report.result.ledger);
        }
    }
}

/// The records that `of` holds.
fn part(scan: &Scan, of: impl Fn(&[u8]) -> bool) -> Scan {
    let which: Vec<usize> = (0..scan.points()).filter(|&i| of(scan.record(i))).collect();
    scan.pick(&which)
}

#[test]
fn what_is_not_selected_passes_through_untouched() {
    let scan = landscape();
    let is_selected = |r: &[u8]| matches!(r[CLASS], 2 | 5) && r[FLAGS] & KEY_POINT == 0;
    for sees in ["selected", "all"] {
        let keys = |more: &str| {
            format!("{more}\nclasses = [5, 2]\nwithout = [\"key-point\"]\nsees = {sees:?}")
        };
        for stages in [
            stages(&[("outliers", &keys("multiplier = 0.8"))]),
            stages(&[("grid", &keys("side = 1.7\npick = \"first\""))]),
            stages(&[
                ("normals", &keys("")),
                ("cells", &keys("keep = \"5%\"")),
                ("median", &keys("")),
            ]),
            stages(&[
                ("normals", &keys("")),
                ("cells", &keys("")),
                ("median", &keys("passes = 2")),
            ]),
        ] {
            for withheld in ["keep", "ignore"] {
                let folder = tempfile::tempdir().unwrap();
                let (ran, written) = reduced(&scan, folder.path(), &stages, withheld);
                let aside = |r: &[u8]| withheld == "ignore" && r[FLAGS] & WITHHELD != 0;
                let passes = |r: &[u8]| !is_selected(r) || aside(r);
                let (through, back) = (part(&scan, passes), part(&written, passes));
                assert!(through.points() > 1000);
                assert!(counted(&through) == counted(&back), "{withheld}\n{stages}");
                let gone = beside(&counted(&scan), &counted(&written), &stages);
                assert_eq!(gone, ran.report.result.ledger.removed_records());
                assert!(gone > 20, "{stages}");
            }
        }
    }
}

#[test]
fn a_target_of_a_share_is_one_of_the_records_decided_about() {
    let scan = landscape();
    let is_ground = |r: &[u8]| r[CLASS] == 2 && r[FLAGS] & WITHHELD == 0;
    let ground = part(&scan, is_ground).points() as u64;
    let limited = |keys: &str| format!("{keys}\nclasses = [2]");
    let stages =
        stages(&[("normals", ""), ("cells", &limited("keep = \"20%\"")), ("median", &limited(""))]);
    let folder = tempfile::tempdir().unwrap();
    let (_, written) = reduced(&scan, folder.path(), &stages, "drop");
    let kept = part(&written, is_ground).points() as u64;
    assert_eq!(kept, (ground * 2 + 5) / 10, "of {ground}");
}

/// A mark, the byte that it writes and the bits of it.
const MARKS: [(&str, usize, u8); 4] = [
    ("\"key-point\"", FLAGS, KEY_POINT),
    ("\"withheld\"", FLAGS, WITHHELD),
    ("7", CLASS, 0xff),
    ("18", CLASS, 0xff),
];

#[test]
fn a_mark_changes_one_field_and_says_what_a_removal_would_have_removed() {
    let scan = landscape();
    for (mark, byte, bits) in MARKS {
        let marked = |mark: &str| {
            let cells = ("cells", "side = 2.3");
            let median = stages(&[("normals", ""), cells, ("median", mark)]);
            let both = format!("multiplier = 0.7\n{mark}");
            [median, stages(&[("outliers", &both)])]
        };
        for (marks, removes) in marked(&format!("mark = {mark}")).iter().zip(marked("")) {
            let folder = tempfile::tempdir().unwrap();
            let (plain, kept) = reduced(&scan, folder.path(), &removes, "drop");
            let (ran, written) = reduced(&scan, folder.path(), marks, "drop");
            // Every record is there but for the field.
            let but = |record: &mut [u8]| record[byte] &= !bits;
            let present = part(&scan, |r| r[FLAGS] & WITHHELD == 0);
            assert!(counted_as(&written, but) == counted_as(&present, but), "{marks}");
            // Those that a removal keeps are marked as such.
            let is_kept = |r: &[u8]| match mark {
                "\"key-point\"" => r[FLAGS] & KEY_POINT != 0,
                "\"withheld\"" => r[FLAGS] & WITHHELD == 0,
                _ => r[CLASS] != mark.parse::<u8>().unwrap(),
            };
            let left = part(&written, is_kept);
            assert!(counted_as(&left, but) == counted_as(&kept, but), "{marks}");
            if mark != "\"key-point\"" {
                assert!(left.records == kept.records, "what stays is not touched: {marks}");
            }
            // And the same records are counted as marked as were as removed.
            let counts: u64 = ran
                .report
                .result
                .counts
                .iter()
                .filter(|(name, _)| name.ends_with("_marked"))
                .map(|(_, n)| n)
                .sum();
            let gone = plain.report.result.ledger.removed_records() - removed(&plain, "read");
            assert_eq!(counts, gone, "{marks}");
            assert_eq!(ran.report.result.ledger.removed_records(), removed(&plain, "read"));
            assert_eq!((written.points() - left.points()) as u64, gone, "{marks}");
        }
    }
}

#[test]
fn every_output_has_what_its_stage_left() {
    let scan = landscape();
    let write = |name: &str, from: &str| {
        format!("[[stage]]\nkind = \"write\"\npath = \"{{folder}}/{name}.laz\"\n{from}\n")
    };
    let text = [
        write("read", "order = \"canonical\""),
        stages(&[("outliers", "multiplier = 0.8\nname = \"clean\"")]),
        stages(&[("normals", "")]),
        write("normals", ""),
        stages(&[("cells", "side = 2.3"), ("median", "name = \"reduced\"")]),
        stages(&[("grid", "side = 1.9\nclasses = [2]")]),
        write("clean", "from = \"clean\""),
        write("reduced", "from = \"reduced\""),
    ]
    .concat();
    let folder = tempfile::tempdir().unwrap();
    let (ran, last) = reduced(&scan, folder.path(), &text, "drop");
    let of = |name: &str| Scan::read(&folder.path().join(format!("{name}.laz")), usize::MAX);
    let [read, normals, clean, reduced] = ["read", "normals", "clean", "reduced"].map(of);
    let present = part(&scan, |r| r[FLAGS] & WITHHELD == 0);
    assert!(counted(&read) == counted(&present));
    assert!(normals.records == clean.records);
    for (more, less, stage) in
        [(&read, &clean, "outliers"), (&clean, &reduced, "median"), (&reduced, &last, "grid")]
    {
        let gone = beside(&counted(more), &counted(less), stage);
        assert_eq!(gone, removed(&ran, stage));
        assert!(gone > 20, "{stage}");
    }
    assert_classes(&ran, &scan, &last);
}
