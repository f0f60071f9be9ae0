//! The answer is a function of the points alone, for stages of two phases, passes, selections,
//! marks and several sinks too: random configurations of one scan and pipeline give the same bytes
//! of every output and of the report's `result`.

use std::collections::BTreeMap;
use std::path::Path;

use crate::support::assert_same;
use crate::support::random::Random;
use crate::support::runs::{Memory, Ran, Settings, instruction_sets, run_with};
use crate::support::scan::Scan;
use pointmill::synth::Scene;

/// A pipeline to run the scan through in many configurations.
#[derive(Clone, Copy)]
struct Family<'a> {
    stages: &'a str,
    write: &'a str,
    /// More keys under `[run]`.
    run: &'a str,
    /// What the counts of work must show besides tiles and a spill.
    shows: &'a [&'a str],
    /// Kinds of stages that must have removed something.
    removes: &'a [&'a str],
}

const FAMILY: Family<'static> = Family {
    stages: "",
    write: "laz",
    run: "",
    shows: &["unproven", "tied", "rim_positions"],
    removes: &[],
};

/// Every file in the folder of a run but what it read and the report.
fn outputs(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let named = entries.filter(|path| path.is_file()).map(|path| {
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        (name, std::fs::read(path).unwrap())
    });
    named.filter(|(name, _)| name != "report.json").collect()
}

fn one(family: &Family<'_>, scan: &Scan, files: usize, settings: Settings, seed: u64) -> Ran {
    let mut random = Random(seed);
    let mut order: Vec<usize> = (0..scan.points()).collect();
    random.shuffle(&mut order);
    let folder = tempfile::tempdir().unwrap().keep();
    let inputs = folder.join("inputs");
    std::fs::create_dir(&inputs).unwrap();
    let mut paths = scan.pick(&order).write_split(&inputs, files, &mut random);
    random.shuffle(&mut paths);
    let Family { stages, write, run, .. } = family;
    run_with(&folder, &paths, stages, write, settings, run)
        .unwrap_or_else(|error| panic!("{settings:?}\n{stages}: {error:?}"))
}

impl Family<'_> {
    /// Runs it once in one piece and then in `configurations` of many pieces.
    fn same(&self, scan: &Scan, tile_points: &[usize], configurations: usize, seed: u64) {
        let plain = one(self, scan, 1, Settings::PLAIN, seed);
        let folder = plain.output.parent().unwrap().to_owned();
        let expected = outputs(&folder);
        let passes = plain.report.result.passes.len() as u64;
        let stages = self.stages;
        assert_eq!((plain.count("tiles"), plain.spilled), (passes, 0), "one tile a pass\n{stages}");
        self.did_something(scan, &plain);
        let mut random = Random(seed);
        for number in 0..configurations {
            let settings = Settings {
                tile_points: Some(random.one_of(tile_points)),
                memory: random.one_of(&[Memory::Least(0), Memory::Least(6), Memory::Ample]),
                threads: 1 + number % 3,
                spill: if number % 3 == 2 { "auto" } else { "always" },
                simd: random.one_of(&instruction_sets()),
            };
            let files = 1 + random.below(4);
            let ran = one(self, scan, files, settings, random.number());
            let what = format!("{settings:?}, {files} files\n{stages}");
            let folder = ran.output.parent().unwrap();
            let outputs = outputs(folder);
            assert!(outputs.keys().eq(expected.keys()), "{what}");
            for (name, bytes) in &outputs {
                assert_same(&expected[name], bytes, &format!("{name} of {what}"));
            }
            assert_same(&plain.result, &ran.result, &what);
            let count = |name| ran.count(name);
            assert!(count("tiles") >= 30, "{} tiles: {what}", count("tiles"));
            assert!(count("tile_levels") >= 2, "{} levels", count("tile_levels"));
            assert!(count("runs") > 1, "{} runs: {what}", count("runs"));
            assert!(ran.spilled > 0 || settings.spill == "auto", "nothing spilled: {what}");
            for shown in self.shows {
                assert!(count(shown) > 0, "no {shown}: {what}\n{:?}", ran.work);
            }
            std::fs::remove_dir_all(folder).unwrap();
        }
        std::fs::remove_dir_all(folder).unwrap();
    }

    /// The run removed or marked a good part of the points and kept another.
    fn did_something(&self, scan: &Scan, ran: &Ran) {
        let result = &ran.report.result;
        let stages = self.stages;
        assert_eq!(result.ledger.read, scan.points() as u64);
        let marked: u64 = result
            .counts
            .iter()
            .filter(|(name, _)| name.ends_with("_marked"))
            .map(|(_, n)| n)
            .sum();
        assert!(result.ledger.removed_records() + marked > 20, "{:?}\n{stages}", result.ledger);
        assert!(result.ledger.kept > 100, "{:?}\n{stages}", result.ledger);
        for kind in self.removes {
            let of = result.ledger.removed.iter().filter(|r| r.stage == *kind);
            assert!(of.map(|r| r.records).sum::<u64>() > 0, "{kind} removed nothing\n{stages}");
        }
        let (before, after) = result
            .classes
            .iter()
            .fold((0, 0), |sum, class| (sum.0 + class.before, sum.1 + class.after));
        assert_eq!(before, result.ledger.read, "{:?}", result.classes);
        assert!(after <= result.ledger.kept);
    }
}

/// A stage of a kind with the keys given.
fn stage(kind: &str, keys: &str) -> String {
    format!("[[stage]]\nkind = \"{kind}\"\n{keys}\n")
}

/// Stages, each a kind and its keys.
fn stages(each: &[(&str, &str)]) -> String {
    each.iter().map(|(kind, keys)| stage(kind, keys)).collect()
}

/// 24,000 points of a landscape and copies on a grid of 10 cm, copies of different class and flags
/// at one position among them.
fn landscape() -> Scan {
    let scan = Scan::synthetic(Scene::Als, 24_000, 7).snapped(100);
    scan.with_copies(1).with_classes_and_flags(2)
}

const TILES: &[usize] = &[150, 220, 300];
const NORMALS: &str = "dimensions = [\"NormalX\", \"NormalY\", \"NormalZ\"]";

#[test]
fn outliers_are_the_same_bytes() {
    let scan = landscape();
    let statistical = stages(&[("outliers", "multiplier = 1.0")]);
    let before = stages(&[
        ("outliers", "neighbors = 7\nmultiplier = 1.5"),
        ("normals", ""),
        ("cells", "side = 3.3"),
        ("median", ""),
    ]);
    let radius = stages(&[
        ("outliers", "method = \"radius\"\nradius = 0.9\nmin_neighbors = 4"),
        ("outliers", "neighbors = 3\nmultiplier = 0.5\nclasses = [2, 5]\nsees = \"all\""),
        ("outliers", "neighbors = 5\nmultiplier = 0.5\nclasses = [6]\nsees = \"selected\""),
    ]);
    for (seed, (stages, removes)) in
        [(&statistical, &["outliers"][..]), (&before, &["outliers", "median"]), (&radius, &[])]
            .into_iter()
            .enumerate()
    {
        Family { stages, removes, ..FAMILY }.same(&scan, TILES, 3, seed as u64);
    }
}

#[test]
fn grids_are_the_same_bytes() {
    let scan = landscape();
    for (seed, (side, pick)) in
        [("1.3", "center"), ("0.7", "median"), ("0.9", "first"), ("0.256", "median")]
            .into_iter()
            .enumerate()
    {
        let stages = stages(&[("grid", &format!("side = {side}\npick = \"{pick}\""))]);
        let shows: &[&str] = if side == "0.256" { &[] } else { &["rim_positions"] };
        let family = Family { stages: &stages, shows, removes: &["grid"], ..FAMILY };
        family.same(&scan, TILES, 3, seed as u64);
    }
    // Behind normals, of a class: the cubes of a power of two and the lengths of a lattice of 1 mm.
    let limited = stages(&[
        ("normals", "neighbors = 8"),
        ("grid", "side = 1.024\nclasses = [2, 6]\nwithout = [\"synthetic\"]"),
        ("grid", "side = 2.1\npick = \"median\"\nclasses = [5]"),
    ]);
    let family = Family { stages: &limited, removes: &["grid"], ..FAMILY };
    family.same(&scan, TILES, 3, 9);
}

#[test]
fn graded_reductions_are_the_same_bytes() {
    let scan = landscape();
    for (seed, keys) in [
        "keep = \"10%\"",
        "keep = 700\nseed = 4\nclasses = [2, 6]",
        "keep = \"30%\"\nranks = true\neffort = \"low\"",
        "tolerance = 0.2\nmax_spacing = 2.5",
    ]
    .into_iter()
    .enumerate()
    {
        let stages = stages(&[("graded", keys)]);
        let family = Family { stages: &stages, shows: &[], removes: &["graded"], ..FAMILY };
        family.same(&scan, TILES, 3, seed as u64);
    }
    // Behind stages that remove, of two branches' worth of rounds.
    let chain = stages(&[("grid", "side = 0.6"), ("graded", "keep = \"20%\"")]);
    let family = Family { stages: &chain, shows: &[], removes: &["grid", "graded"], ..FAMILY };
    family.same(&scan, TILES, 3, 9);
}

#[test]
fn cells_with_a_target_are_the_same_bytes() {
    let scan = landscape();
    let cells = [
        ("", "keep = \"10%\"\nside = 3.7"),
        ("method = \"pca\"", "keep = \"20%\"\nside = 3.1\nsplit = \"octant\""),
        ("orient = \"up\"", "keep = \"25%\"\nmeasure = \"cone\"\nside = 2.9"),
        ("orient = \"viewpoint\"\nviewpoint = [10.0, 20.0, 500.0]", "keep = \"12%\""),
        ("neighbors = 12", "keep = 4000\nreference = [0.3, 0.2, 1.0]\nmin_points = 3\nside = 2.3"),
        ("", "keep = \"60%\"\nmax_side = 1.1\nmin_spacing = 0.45\nside = 1.9"),
    ];
    for (seed, (normals, cells)) in cells.into_iter().enumerate() {
        let stages = stages(&[("normals", normals), ("cells", cells), ("median", "")]);
        let write = if seed % 2 == 0 { format!("laz\n{NORMALS}") } else { "las".to_owned() };
        let family = Family { stages: &stages, write: &write, removes: &["median"], ..FAMILY };
        let crossing = &["unproven", "tied", "rim_positions", "crossing_cells"][..];
        let shows = if cells.contains("side = ") { crossing } else { FAMILY.shows };
        Family { shows, ..family }.same(&scan, TILES, 2, seed as u64);
    }
}

#[test]
fn a_lattice_whose_angles_tie_meets_its_target_with_the_same_bytes() {
    // Steps of a stair: few different normals, so the last range is shared by many divisions.
    let mut scan = Scan::synthetic(Scene::Als, 12_000, 3);
    for (i, record) in scan.records.chunks_exact_mut(scan.schema.stride).enumerate() {
        let (x, y) = ((i % 110) as i32, (i / 110) as i32);
        let z = x / 7 % 3 + y / 11 % 2;
        for (axis, v) in [x, y, z].into_iter().enumerate() {
            record[4 * axis..4 * axis + 4].copy_from_slice(&(v * 400).to_le_bytes());
        }
    }
    for (seed, keys) in
        ["keep = \"57%\"\nside = 1.7", "keep = 3000\nsplit = \"octant\"\nside = 1.7"]
            .into_iter()
            .enumerate()
    {
        let stages = stages(&[("normals", "neighbors = 8"), ("cells", keys), ("median", "")]);
        Family { stages: &stages, ..FAMILY }.same(&scan, TILES, 4, seed as u64);
    }
}

#[test]
fn bounds_and_measures_of_cells_are_the_same_bytes() {
    let scan = landscape();
    for (seed, cells) in [
        "measure = \"cone\"\nmax_angle = 0.3\nside = 0.9",
        "reference = \"z\"\nmax_side = 0.5\nmin_spacing = 0.15\nside = 0.9\nsplit = \"octant\"",
        "reference = [1, 2, 3]\nmax_side = 0.6\nside = 0.8",
    ]
    .into_iter()
    .enumerate()
    {
        let stages = stages(&[("normals", "orient = \"up\""), ("cells", cells), ("median", "")]);
        let shows = &["unproven", "tied", "rim_positions", "crossing_cells"];
        Family { stages: &stages, shows, ..FAMILY }.same(&scan, TILES, 3, seed as u64);
    }
}

#[test]
fn repeated_passes_are_the_same_bytes() {
    let scan = landscape();
    let plain = stages(&[("normals", ""), ("cells", "side = 2.2"), ("median", "passes = 3")]);
    let limited = stages(&[
        ("outliers", "mark = 7\nmultiplier = 1.0"),
        ("normals", "neighbors = 6\nclasses = [2, 5]\nsees = \"all\""),
        ("cells", "max_angle = 0.4\nclasses = [2, 5]"),
        ("median", "passes = 2\nclasses = [2, 5]"),
    ]);
    for (seed, stages) in [plain, limited].into_iter().enumerate() {
        let write = format!("laz\n{NORMALS}");
        let family = Family { stages: &stages, write: &write, removes: &["median"], ..FAMILY };
        family.same(&scan, TILES, 3, seed as u64);
    }
}

#[test]
fn marks_are_the_same_bytes() {
    let scan = landscape();
    for (seed, mark) in ["\"key-point\"", "\"withheld\"", "7", "18"].into_iter().enumerate() {
        let mark = format!("mark = {mark}");
        let stages = match seed % 2 {
            0 => stages(&[("normals", ""), ("cells", "side = 1.9"), ("median", &mark)]),
            _ => stages(&[
                ("outliers", &format!("multiplier = 1.0\n{mark}")),
                ("normals", ""),
                ("cells", "keep = \"20%\"\nside = 2.9"),
                ("median", "mark = \"key-point\""),
            ]),
        };
        Family { stages: &stages, ..FAMILY }.same(&scan, TILES, 3, seed as u64);
    }
}

#[test]
fn rules_by_class_and_flag_are_the_same_bytes() {
    let scan = landscape();
    let by_class = |sees: &str| {
        let limited = |keys: &str, limits: &str| format!("{keys}\n{limits}\nsees = \"{sees}\"");
        let (ground, rest) = ("classes = [2]", "classes = [5, 6]\nwithout = [\"overlap\"]");
        stages(&[
            ("normals", &limited("neighbors = 8", ground)),
            ("cells", &limited("max_angle = 0.2\nside = 2.6", ground)),
            ("median", &limited("", ground)),
            ("normals", &limited("neighbors = 14", rest)),
            ("cells", &limited("keep = \"30%\"\nside = 3.1", rest)),
            ("median", &limited("", rest)),
        ])
    };
    let flagged = stages(&[
        ("outliers", "multiplier = 0.8\nwith = [\"overlap\"]\nsees = \"all\""),
        ("normals", ""),
        ("cells", "side = 2.3\nwithout = [\"key-point\"]"),
        ("median", "without = [\"key-point\"]"),
    ]);
    let all = [by_class("selected"), by_class("all"), flagged];
    for (seed, (stages, run)) in
        all.iter().zip(["drop", "keep", "ignore"].iter().cycle()).enumerate()
    {
        let run = format!("withheld = \"{run}\"");
        Family { stages, run: &run, ..FAMILY }.same(&scan, TILES, 3, seed as u64);
    }
    for (seed, run) in ["drop", "keep", "ignore"].into_iter().enumerate() {
        let stages = stages(&[("normals", ""), ("cells", "side = 0.9"), ("median", "")]);
        let run = format!("withheld = \"{run}\"");
        Family { stages: &stages, run: &run, ..FAMILY }.same(&scan, TILES, 2, seed as u64);
    }
}
