//! Which points take part, by class and flags: the stage `filter`, noise that is left out, cells
//! that mix no classes, and what is said of all this.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Mutex;

use crate::support::assert_same;
use crate::support::case_file;
use crate::support::random::Random;
use crate::support::runs::{Memory, Ran, Settings, run_with};
use crate::support::scan::Scan;
use pointmill::report::Report;
use pointmill::synth::Scene;
use pointmill::{Graph, Overrides, Registry, Watch};

const TILED: Settings = Settings {
    tile_points: Some(100),
    memory: Memory::Least(0),
    threads: 2,
    spill: "always",
    simd: "auto",
};
const REDUCE: &str = "[[stage]]\nkind = 'normals'\n[[stage]]\nkind = 'cells'\n\
                      [[stage]]\nkind = 'median'\n";
/// Where a record has its flags and its class (LAS 1.4 R15, table 16), and the bit of the overlap
/// flag.
const FLAGS: usize = 15;
const CLASS: usize = 16;
const OVERLAP: u8 = 8;

/// A landscape of classes 1, 2, 5, 6, one point in thirteen noise; flags at random.
fn landscape() -> Scan {
    let mut scan = Scan::synthetic(Scene::Als, 8_000, 31).snapped(80).with_copies(7);
    scan = scan.with_classes_and_flags(8);
    let stride = scan.schema.stride;
    for (i, record) in scan.records.chunks_exact_mut(stride).enumerate().step_by(13) {
        record[CLASS] = if i % 2 == 0 { 7 } else { 18 };
    }
    scan
}

fn of(scan: &Scan, keep: impl Fn(&[u8]) -> bool) -> Scan {
    let kept: Vec<usize> = (0..scan.points()).filter(|&i| keep(scan.record(i))).collect();
    assert!(!kept.is_empty() && kept.len() < scan.points());
    scan.pick(&kept)
}

fn ran(scan: &Scan, stages: &str, keys: &str) -> (Ran, Scan) {
    let folder = tempfile::tempdir().unwrap();
    let files = scan.write_split(folder.path(), 3, &mut Random(3));
    let ran = run_with(folder.path(), &files, stages, "laz", TILED, keys)
        .unwrap_or_else(|error| panic!("{stages}: {error:?}"));
    let written = Scan::read(&ran.output, usize::MAX);
    (ran, written)
}

fn classes(scan: &Scan) -> BTreeMap<u8, u64> {
    let mut all = BTreeMap::new();
    (0..scan.points()).for_each(|i| *all.entry(scan.record(i)[CLASS]).or_default() += 1);
    all
}

fn removed(ran: &Ran, stage: &str, reason: &str) -> u64 {
    let all = &ran.report.result.ledger.removed;
    all.iter().filter(|r| r.stage == stage && r.reason == reason).map(|r| r.records).sum()
}

#[test]
fn a_filter_before_a_reduction_is_as_if_the_rest_were_never_there() {
    let scan = landscape();
    let is_kept = |r: &[u8]| [2, 6].contains(&r[CLASS]) && r[FLAGS] & OVERLAP == 0;
    let part = of(&scan, is_kept);
    let filter = "[[stage]]\nkind = 'filter'\nkeep_classes = [6, 2]\ndrop_flags = ['overlap']\n";
    let (filtered, written) = ran(&scan, &format!("{filter}{REDUCE}"), "");
    let (_, expected) = ran(&part, REDUCE, "");
    assert_same(&written.records, &expected.records, "filtered and cut before");
    assert!(written.points() < part.points() && filtered.count("tiles") >= 8);
    let dropped = (scan.points() - part.points()) as u64;
    assert_eq!(removed(&filtered, "filter", "removed"), dropped);
}

#[test]
fn a_filter_streams_in_the_order_of_the_input() {
    let scan = landscape();
    let filter = "[[stage]]\nkind = 'filter'\ndrop_classes = [7, 18]\nkeep_flags = ['overlap']\n";
    let (streamed, written) = ran(&scan, filter, "");
    let part = of(&scan, |r| ![7, 18].contains(&r[CLASS]) && r[FLAGS] & OVERLAP != 0);
    assert_same(&written.records, &part.records, "streamed and picked");
    assert_eq!(streamed.report.result.totals, None, "nothing was milled");
}

#[test]
fn noise_is_left_out_kept_or_written_as_it_is() {
    let scan = landscape();
    let noise = of(&scan, |r| [7, 18].contains(&r[CLASS])).points() as u64;
    let (dropped, without) = ran(&scan, REDUCE, "noise = 'drop'\nwithheld = 'keep'");
    let (_, expected) =
        ran(&of(&scan, |r| ![7, 18].contains(&r[CLASS])), REDUCE, "withheld = 'keep'");
    assert_same(&without.records, &expected.records, "left out and never there");
    assert_eq!(removed(&dropped, "read", "noise"), noise);

    let (ignored, with) = ran(&scan, REDUCE, "noise = 'ignore'\nwithheld = 'keep'");
    let of_noise = of(&with, |r| [7, 18].contains(&r[CLASS]));
    let others = of(&with, |r| ![7, 18].contains(&r[CLASS]));
    assert_eq!(of_noise.points() as u64, noise, "all of it is written");
    assert_same(&others.records, &expected.records, "and none of it was looked at");
    assert_eq!(removed(&ignored, "read", "noise"), 0);

    let (_, kept) = ran(&scan, REDUCE, "noise = 'keep'\nwithheld = 'keep'");
    let (_, default) = ran(&scan, REDUCE, "withheld = 'keep'");
    assert_same(&kept.records, &default.records, "a pipeline keeps noise unless it is told");
    let left = classes(&kept);
    assert!(left[&7] + left[&18] < noise, "{left:?} of {noise} are reduced like all others");
}

#[test]
fn cells_by_class_keep_points_of_every_class_that_a_cell_has() {
    // Two classes by turns on one plane: a cell of both keeps one point of one of them.
    let mut scan = Scan::synthetic(Scene::Plane, 6_000, 5);
    let stride = scan.schema.stride;
    for (i, record) in scan.records.chunks_exact_mut(stride).enumerate() {
        record[CLASS] = if i % 200 == 0 { 6 } else { 2 };
    }
    let cells = |by: &str| REDUCE.replace("kind = 'cells'", &format!("kind = 'cells'\n{by}"));
    let by = "by = ['Classification']\nside = 0.3\nmax_angle = 3.0";
    let (mixed, _) = ran(&scan, &cells("side = 0.3\nmax_angle = 3.0"), "");
    let (apart, written) = ran(&scan, &cells(by), "");
    assert!(apart.count("crossing_cells") > 0 && apart.count("tiles") >= 8, "{:?}", apart.work);

    // The cells of brute force: a cube and a class each.
    let steps = scan.lattice().steps(0.3);
    let positions = scan.positions();
    let cube = |i: usize| positions[i].map(|v| v.div_euclid(steps));
    let all: BTreeSet<_> = (0..scan.points()).map(|i| (cube(i), scan.record(i)[CLASS])).collect();
    let cubes: BTreeSet<_> = (0..scan.points()).map(cube).collect();
    let counts = |ran: &Ran| ran.report.result.counts["cells_initial"];
    assert_eq!((counts(&mixed), counts(&apart)), (cubes.len() as u64, all.len() as u64));
    assert!(all.len() > cubes.len());
    // A wide angle divides nothing, so that each keeps one point.
    assert_eq!(written.points(), all.len());
    let kept = classes(&written);
    let expected = |class| all.iter().filter(|(_, of)| *of == class).count() as u64;
    assert_eq!((kept[&2], kept[&6]), (expected(2), expected(6)));
}

#[test]
fn cells_by_class_are_the_same_for_every_configuration() {
    let scan = landscape();
    for cells in ["by = ['Classification']", "by = ['Classification']\nside = 2.3\nkeep = '20%'"] {
        let stages = REDUCE.replace("kind = 'cells'", &format!("kind = 'cells'\n{cells}"));
        let (tiled, _) = ran(&scan, &stages, "noise = 'ignore'");
        assert!(tiled.count("tiles") >= 8 && tiled.spilled > 0, "{:?}", tiled.work);
        let folder = tempfile::tempdir().unwrap();
        let files = scan.write_split(folder.path(), 2, &mut Random(9));
        let keys = "noise = 'ignore'";
        let plain = run_with(folder.path(), &files, &stages, "laz", Settings::PLAIN, keys).unwrap();
        assert_same(&tiled.result, &plain.result, cells);
        assert!(tiled.report.result.ledger.kept < scan.points() as u64);
    }
}

/// Hears what a run says.
#[derive(Default)]
struct Heard(Mutex<Vec<String>>);

impl Watch for Heard {
    fn phase(&self, _name: &'static str, _total: Option<u64>) {}
    fn advance(&self, _points: u64) {}
    fn warn(&self, message: &str) {
        self.0.lock().unwrap().push(message.to_owned());
    }
}

fn heard(scan: &Scan, extension: &str, stages: &str, keys: &str) -> (Report, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(format!("{name}.{extension}"));
    scan.write(&at("in"));
    let text = format!(
        "[run]\n{keys}\n[[stage]]\nkind = 'read'\npath = {:?}\n{stages}\
         [[stage]]\nkind = 'write'\npath = {:?}\n",
        at("in"),
        at("out")
    );
    let heard = Heard::default();
    let pipeline = Graph::parse(&text, "test.toml", &Registry::builtin()).unwrap();
    let done = pipeline.plan(&Overrides::default()).unwrap().run(&heard).unwrap();
    (done.report, heard.0.into_inner().unwrap())
}

/// What was heard is one line that has all `parts`, and the report has it too.
fn assert_told((report, told): (Report, Vec<String>), parts: &[&str]) {
    let found = told.iter().filter(|line| parts.iter().all(|part| line.contains(part))).count();
    assert_eq!(found, 1, "{parts:?} in {told:#?}");
    assert!(told.iter().all(|line| report.run.warnings.contains(line)), "{told:#?}");
}

#[test]
fn what_is_left_out_without_being_asked_for_is_said() {
    let scan = landscape();
    let withheld = of(&scan, |r| r[FLAGS] & 4 != 0 && ![7, 18].contains(&r[CLASS])).points();
    let told = heard(&scan, "laz", REDUCE, "noise = 'ignore'");
    assert_told(told, &["with the withheld flag are left out, ", "`run.withheld = \"keep\"`"]);
    let (report, told) = heard(&scan, "laz", REDUCE, "noise = 'drop'\nwithheld = 'keep'");
    let noise = report.result.ledger.removed.iter().find(|r| r.reason == "noise").unwrap().records;
    let number = pointmill::internals::Grouped(noise).to_string();
    let table = report.table(None).to_string();
    assert!(table.contains(&format!("left out   {number} noise (read)")), "{table}");
    assert_told((report, told), &["(noise) are left out, ", &number]);
    assert!(withheld > 0);
    let (_, silent) = heard(&scan, "laz", REDUCE, "noise = 'keep'\nwithheld = 'keep'");
    assert!(!silent.iter().any(|line| line.contains("left out")), "{silent:#?}");
}

#[test]
fn a_limit_that_no_point_meets_is_said() {
    let scan = Scan::synthetic(Scene::Als, 3_000, 2);
    let limited = |limit: &str| REDUCE.replace("'\n", &format!("'\n{limit}\n"));
    let told = heard(&scan, "laz", &limited("classes = [40, 41]"), "");
    assert_told(
        told,
        &["no point is of class 40 or 41: what was asked for those points did nothing"],
    );
    let told = heard(&scan, "laz", &limited("with = ['synthetic']"), "");
    assert_told(told, &["no point is with the flag synthetic"]);
    let (_, silent) = heard(&scan, "laz", &limited("classes = [2]"), "");
    assert!(!silent.iter().any(|line| line.contains("no point is")), "{silent:#?}");
}

#[test]
fn a_run_that_leaves_nothing_says_so() {
    let scan = Scan::synthetic(Scene::Als, 3_000, 2);
    for stages in ["", REDUCE] {
        let filter = "[[stage]]\nkind = 'filter'\nkeep_classes = [40]\n";
        let told = heard(&scan, "laz", &format!("{filter}{stages}"), "");
        assert_eq!(told.0.result.ledger.kept, 0);
        assert_told(told, &["no point is left of 3,000: 3,000 removed (`filter.keep_classes`)"]);
    }
}

#[test]
fn a_scan_without_classes_has_none_to_keep_and_none_to_drop() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.ply");
    std::fs::write(&path, plain_ply()).unwrap();
    let run = |filter: &str| {
        let text = format!(
            "[[stage]]\nkind = 'read'\npath = {path:?}\n[[stage]]\nkind = 'filter'\n{filter}\n\
             [[stage]]\nkind = 'write'\npath = {:?}\n",
            folder.path().join("out.ply")
        );
        let pipeline = Graph::parse(&text, "test.toml", &Registry::builtin()).unwrap();
        pipeline.plan(&Overrides::default())?.run(&Heard::default())
    };
    let done = run("drop_classes = [7, 18]\ndrop_flags = ['withheld']").unwrap();
    assert_eq!(done.report.result.ledger.kept, 2);
    assert_eq!(
        done.report.run.warnings,
        [
            "the input has no classes: `filter.drop_classes` leaves no point out",
            "the input has no flag withheld: `filter.drop_flags` leaves no point out by it"
        ]
    );
    let error = run("keep_classes = [2]").unwrap_err();
    let told = error.to_string();
    assert!(
        told.contains(
            "`filter.keep_classes` selects points by Classification, which the input does not"
        ),
        "{told}"
    );
    assert!(error.remedy().unwrap().contains("filter.keep_classes"));
}

fn plain_ply() -> &'static str {
    "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\n\
     property double z\nend_header\n1 2 3\n4 5 6\n"
}

/// Point formats 0 to 5 have no overlap flag; overlap is class 12 there.
#[test]
fn overlap_of_old_point_formats_is_class_12() {
    let path = case_file("97-class12.las");
    let scan = Scan::read(&path, usize::MAX);
    let class = |i: usize| scan.record(i)[15] & 31;
    let overlap = (0..scan.points()).filter(|&i| class(i) == 12).count() as u64;
    assert!(overlap > 0 && overlap < scan.points() as u64);
    for (flags, kept) in [("keep_flags", overlap), ("drop_flags", scan.points() as u64 - overlap)] {
        let filter = format!("[[stage]]\nkind = 'filter'\n{flags} = ['overlap']\n");
        let (report, _) = heard(&scan, "las", &filter, "");
        assert_eq!(report.result.ledger.kept, kept, "{flags}");
    }
}
