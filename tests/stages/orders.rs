//! The order of an output's records: that of the inputs where it is asked for, whatever the tiles, and
//! in the chunks of LAZ that of time.

use std::path::Path;

use crate::support::assert_same;
use crate::support::case_file;
use crate::support::random::Random;
use crate::support::runs::{Memory, Settings, run};
use crate::support::scan::Scan;
use pointmill::point::names;
use pointmill::synth::Scene;

const REDUCTION: &str = "[[stage]]\nkind = \"normals\"\n[[stage]]\nkind = \"cells\"\n\
                         [[stage]]\nkind = \"median\"\n";
const NORMALS: &str = "dimensions = [\"NormalX\", \"NormalY\", \"NormalZ\"]";

/// Runs that must not differ.
const CONFIGURATIONS: [(Settings, usize); 3] = [
    (Settings::PLAIN, 1),
    (
        Settings {
            tile_points: Some(400),
            memory: Memory::Least(0),
            threads: 3,
            spill: "always",
            ..Settings::PLAIN
        },
        1,
    ),
    (
        Settings {
            tile_points: Some(700),
            memory: Memory::Least(8),
            threads: 2,
            spill: "always",
            ..Settings::PLAIN
        },
        3,
    ),
];

/// 40,000 points in an order of their own, with copies, on a grid of 5 cm.
fn landscape() -> Scan {
    let scan = Scan::synthetic(Scene::Als, 40_000, 7).snapped(50).with_copies_and_an_outlier(1);
    let mut order: Vec<usize> = (0..scan.points()).collect();
    Random(3).shuffle(&mut order);
    scan.pick(&order)
}

/// The outputs of the same pipeline in all configurations, which are the same bytes.
fn same(scan: &Scan, stages: &str, write: &str) -> Scan {
    let mut first: Option<Vec<u8>> = None;
    let mut written = None;
    for (settings, files) in CONFIGURATIONS {
        let folder = tempfile::tempdir().unwrap();
        let inputs = scan.write_split(folder.path(), files, &mut Random(8));
        let ran = run(folder.path(), &inputs, stages, write, settings).unwrap();
        if settings.tile_points.is_some() {
            assert!(ran.count("tiles") >= 30 && ran.spilled > 0 && ran.count("runs") > 4);
        }
        let bytes = ran.bytes();
        assert_same(first.get_or_insert(bytes.clone()), &bytes, &format!("{settings:?} {write}"));
        written = Some(Scan::read(&ran.output, usize::MAX));
    }
    written.unwrap()
}

fn sorted(scan: &Scan) -> Vec<&[u8]> {
    let mut records: Vec<&[u8]> = scan.records.chunks_exact(scan.schema.stride).collect();
    records.sort_unstable();
    records
}

#[test]
fn a_reduced_output_in_the_order_of_the_inputs_is_what_they_have_without_the_rest() {
    let scan = landscape();
    for write in ["las", "laz"] {
        let canonical = same(&scan, REDUCTION, &format!("{write}\norder = \"canonical\""));
        let written = same(&scan, REDUCTION, &format!("{write}\norder = \"input\""));
        assert!(sorted(&written) == sorted(&canonical), "the same records");
        assert!(written.records != canonical.records && written.points() > 1000);
        let mut rest = 0..scan.points();
        for i in 0..written.points() {
            assert!(
                rest.any(|j| scan.record(j) == written.record(i)),
                "record {i} is out of order"
            );
        }
    }
}

#[test]
fn a_marked_scan_in_the_order_of_the_inputs_is_the_input_but_for_the_mark() {
    let scan = landscape();
    let stages = format!("{REDUCTION}mark = \"key-point\"\n");
    let written = same(&scan, &stages, "laz\norder = \"input\"");
    assert_eq!(written.points(), scan.points());
    let key_point = scan.schema.find(names::KEY_POINT).unwrap();
    let mut marked = 0;
    for i in 0..scan.points() {
        let value = key_point.get(written.record(i), scan.schema.endian).as_f64();
        marked += value as usize;
        let mut record = scan.record(i).to_vec();
        let value = key_point.get(written.record(i), scan.schema.endian);
        assert!(key_point.put(&mut record, scan.schema.endian, value));
        assert!(record == written.record(i), "record {i}");
    }
    assert!(marked > 1000 && marked < scan.points() - 1000, "{marked} marked");
}

#[test]
fn normals_go_with_their_records_into_the_order_of_the_inputs() {
    let scan = landscape();
    let canonical = same(&scan, REDUCTION, &format!("las\norder = \"canonical\"\n{NORMALS}"));
    let written = same(&scan, REDUCTION, &format!("las\norder = \"input\"\n{NORMALS}"));
    assert!(sorted(&written) == sorted(&canonical), "the same records with the same normals");
    assert!(written.records != canonical.records);
}

#[test]
fn an_output_in_the_order_of_the_inputs_stands_beside_others() {
    let scan = landscape();
    let folder = tempfile::tempdir().unwrap();
    let inputs = scan.write_split(folder.path(), 2, &mut Random(8));
    let stages = format!(
        "[[stage]]\nkind = \"write\"\npath = \"{{folder}}/all.las\"\norder = \"input\"\n{REDUCTION}\
         [[stage]]\nkind = \"write\"\npath = \"{{folder}}/input.laz\"\norder = \"input\"\n"
    );
    let settings = CONFIGURATIONS[1].0;
    let ran = run(folder.path(), &inputs, &stages, "las", settings).unwrap();
    let read = |name: &str| Scan::read(&folder.path().join(name), usize::MAX);
    assert_same(&scan.records, &read("all.las").records, "all that is read");
    let (ordered, canonical) = (read("input.laz"), Scan::read(Path::new(&ran.output), usize::MAX));
    assert!(sorted(&ordered) == sorted(&canonical) && ordered.records != canonical.records);
}

#[test]
fn chunks_of_laz_hold_what_their_rank_says_in_order_of_time() {
    const CHUNK: usize = 50_000;
    let scan = Scan::synthetic(Scene::Als, 130_000, 9);
    let mut order: Vec<usize> = (0..scan.points()).collect();
    Random(3).shuffle(&mut order);
    let scan = scan.pick(&order);
    let find = |name: &str| scan.schema.find(name).unwrap().clone();
    let (time, number) = (find(names::GPS_TIME), find(names::RETURN_NUMBER));
    let key = |scan: &Scan, i: usize| {
        let get =
            |d: &pointmill::point::Dimension| d.get(scan.record(i), scan.schema.endian).as_f64();
        (get(&time), get(&number))
    };
    // Nothing is removed but copies.
    let stages = "[[stage]]\nkind = \"grid\"\nside = 0.000001\n";
    let folder = tempfile::tempdir().unwrap();
    let inputs = scan.write_split(folder.path(), 2, &mut Random(8));
    let read = |write: &str| {
        let ran = run(folder.path(), &inputs, stages, write, Settings::PLAIN).unwrap();
        Scan::read(&ran.output, usize::MAX)
    };
    let canonical = read("laz\norder = \"canonical\"");
    let (las, laz) = (read("las"), read("laz"));
    assert_same(&canonical.records, &las.records, "what is not compressed stays canonical");
    assert!(canonical.points() > 2 * CHUNK, "{} points", canonical.points());
    let mut moved = 0;
    for begin in (0..laz.points()).step_by(CHUNK) {
        let these: Vec<usize> = (begin..laz.points().min(begin + CHUNK)).collect();
        let (a, b) = (laz.pick(&these), canonical.pick(&these));
        assert!(sorted(&a) == sorted(&b), "a chunk has the records of its ranks");
        assert!((1..a.points()).all(|i| key(&a, i - 1) <= key(&a, i)), "by time, then return");
        moved += usize::from(a.records != b.records);
    }
    assert!(moved >= 2, "{moved} chunks were in another order before");
}

#[test]
fn where_no_point_goes_the_order_of_the_inputs_is_kept_as_it_is() {
    let case = case_file("181-order.las");
    let scan = Scan::read(&case, usize::MAX);
    let folder = tempfile::tempdir().unwrap();
    let stages = "[[stage]]\nkind = \"outliers\"\nneighbors = 3\nmultiplier = 1e9\n";
    let read = |write: &str| {
        let ran = run(folder.path(), std::slice::from_ref(&case), stages, write, Settings::PLAIN);
        Scan::read(&ran.unwrap().output, usize::MAX)
    };
    let written = read("las\norder = \"input\"");
    assert_same(&scan.records, &written.records, "the records in their order");
    assert!(read("las").records != scan.records, "in canonical order they are elsewhere");
}
