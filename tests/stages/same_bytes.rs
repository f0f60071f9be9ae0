//! The answer is a function of the points alone: random configurations of one scan and pipeline
//! give the same bytes, in runs that had every chance to differ.

use crate::support::random::Random;
use crate::support::runs::{Memory, Ran, Settings, assert_not_empty, instruction_sets, run};
use crate::support::scan::Scan;
use crate::support::{assert_same, scans};
use pointmill::internals::morton_cmp;
use pointmill::synth::Scene;

/// `normals`, `cells` and `median` with the given keys.
fn reduction(normals: &str, cells: &str) -> String {
    format!(
        "[[stage]]\nkind = \"normals\"\n{normals}\n[[stage]]\nkind = \"cells\"\n{cells}\n\
         [[stage]]\nkind = \"median\"\n"
    )
}

const NORMALS: &str = "dimensions = [\"NormalX\", \"NormalY\", \"NormalZ\"]";

/// One configuration: what must not matter.
#[derive(Debug)]
struct Configuration {
    settings: Settings,
    /// Files that the input is split into.
    files: usize,
    /// Seed of the order of points and files.
    seed: u64,
}

impl Configuration {
    /// Any configuration; every other one is cut into many tiles and spilled.
    fn any(number: usize, tile_points: &[usize], random: &mut Random) -> Configuration {
        let demanding = number.is_multiple_of(2);
        let memory = random.one_of(&[Memory::Least(0), Memory::Least(8), Memory::Least(40)]);
        let settings = Settings {
            tile_points: match demanding || random.below(3) > 0 {
                true => Some(random.one_of(tile_points)),
                false => None,
            },
            memory: if demanding { memory } else { random.one_of(&[memory, Memory::Ample]) },
            threads: 1 + random.below(4),
            spill: if demanding { "always" } else { random.one_of(&["auto", "always"]) },
            simd: random.one_of(&instruction_sets()),
        };
        Configuration { settings, files: 1 + random.below(4), seed: random.number() }
    }

    fn run(&self, scan: &Scan, stages: &str, write: &str) -> Ran {
        let mut random = Random(self.seed);
        let mut order: Vec<usize> = (0..scan.points()).collect();
        random.shuffle(&mut order);
        let folder = tempfile::tempdir().unwrap().keep();
        let mut files = scan.pick(&order).write_split(&folder, self.files, &mut random);
        random.shuffle(&mut files);
        run(&folder, &files, stages, write, self.settings)
            .unwrap_or_else(|error| panic!("{self:?}: {error:?}"))
    }
}

/// A scan and a pipeline to run it through in many configurations.
struct Family<'a> {
    scan: &'a Scan,
    stages: String,
    write: &'a str,
    /// Tile capacities, all small enough for 30 tiles.
    tile_points: &'a [usize],
    configurations: usize,
    seed: usize,
}

impl Family<'_> {
    fn same(self) {
        let Family { scan, stages, write, .. } = &self;
        let folder = tempfile::tempdir().unwrap();
        let whole = scan.write_split(folder.path(), 1, &mut Random(0));
        let plain = run(folder.path(), &whole, stages, write, Settings::PLAIN).unwrap();
        assert_eq!((plain.count("tiles"), plain.spilled), (1, 0), "the plain run is one tile");
        let (output, result) = (plain.bytes(), plain.result);
        let crosses = stages.contains("side = ");
        let mut random = Random(self.seed as u64);
        for number in 0..self.configurations {
            let configuration = Configuration::any(number, self.tile_points, &mut random);
            let ran = configuration.run(scan, stages, write);
            let what = format!("{configuration:?}\n{stages}");
            assert_same(&output, &ran.bytes(), &what);
            assert_same(&result, &ran.result, &what);
            if number.is_multiple_of(2) {
                assert_not_empty(&ran, crosses, &what);
            }
            std::fs::remove_dir_all(ran.output.parent().unwrap()).unwrap();
        }
    }
}

/// 40,000 points of a landscape and more on a grid of 5 cm.
fn landscape() -> Scan {
    Scan::synthetic(Scene::Als, 40_000, 7).snapped(50).with_copies_and_an_outlier(1)
}

#[test]
fn a_landscape_reduces_to_the_same_bytes() {
    let scan = landscape();
    let tile_points = &[300, 500, 900];
    let families = [
        (reduction("", "side = 0.9"), "laz".to_owned()),
        (reduction("neighbors = 17", "side = 1.1\nsplit = \"octant\""), format!("las\n{NORMALS}")),
        (reduction("method = \"pca\"", ""), "laz".to_owned()),
    ];
    for (seed, (stages, write)) in families.into_iter().enumerate() {
        Family { scan: &scan, stages, write: &write, tile_points, configurations: 5, seed }.same();
    }
}

#[test]
fn a_part_with_sharp_edges_reduces_to_the_same_bytes() {
    // As PLY: the lattice is the binary one, records have floating-point coordinates.
    let folder = tempfile::tempdir().unwrap();
    let stored = Scan::synthetic(Scene::Part, 40_000, 3).snapped(12_500);
    let files = stored.write_split(folder.path(), 1, &mut Random(0));
    let ply = run(folder.path(), &files, "", "ply", Settings::PLAIN).unwrap();
    let scan = Scan::read(&ply.output, usize::MAX).with_copies_and_an_outlier(2);
    let tile_points = &[400, 700, 1200];
    let families = [
        (reduction("", "side = 1.9"), format!("ply\n{NORMALS}")),
        (
            reduction("method = \"pca\"", "side = 2.3\nsplit = \"octant\"\nmin_points = 4"),
            "ply\nencoding = \"ascii\"".to_owned(),
        ),
        (reduction("neighbors = 6", "max_angle = 0.4"), "laz\nscale = 0.001".to_owned()),
    ];
    for (seed, (stages, write)) in families.into_iter().enumerate() {
        Family { scan: &scan, stages, write: &write, tile_points, configurations: 4, seed }.same();
    }
}

#[test]
fn what_is_cut_out_turned_thinned_and_sampled_is_the_same_bytes() {
    let scan = landscape();
    let axes = scan.schema.coordinates().unwrap();
    let of = |axis: usize| {
        let at = |record| axes[axis].world(record, scan.schema.endian);
        let mut all: Vec<f64> = scan.records.chunks_exact(scan.schema.stride).map(at).collect();
        all.sort_by(f64::total_cmp);
        [all[all.len() / 10], all[all.len() * 9 / 10]]
    };
    let ([x0, x1], [y0, y1]) = (of(0), of(1));
    let polygon = format!("POLYGON(({x0} {y0}, {x1} {y0}, {x1} {y1}, {x0} {y1}))");
    let stages = format!(
        "[[stage]]\nkind = 'crop'\npolygon = '{polygon}'\n\
         [[stage]]\nkind = 'transform'\nrotate = {{axis = [1, 2, 9], angle = '33 deg'}}\n\
         [[stage]]\nkind = 'sample'\nfraction = '80%'\n\
         [[stage]]\nkind = 'normals'\n\
         [[stage]]\nkind = 'sample'\ndistance = 1.3\nseed = 2\n"
    );
    let write = &format!("laz\n{NORMALS}");
    let tile_points = &[200, 300, 500];
    Family { scan: &scan, stages, write, tile_points, configurations: 6, seed: 11 }.same();
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn a_city_on_a_grid_of_a_centimetre_reduces_to_the_same_bytes() {
    let scans = scans();
    let city = Scan::read(&scans.join("big/marblemm_city_10M.laz"), 400_000).crop(40_000);
    let tile_points = &[300, 700, 1500];
    let families = [
        (reduction("", "side = 0.37"), format!("laz\n{NORMALS}")),
        (reduction("", ""), "las".to_owned()),
    ];
    for (seed, (stages, write)) in families.into_iter().enumerate() {
        Family { scan: &city, stages, write: &write, tile_points, configurations: 4, seed }.same();
    }
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn airborne_scans_reduce_to_the_same_bytes() {
    let scans = scans();
    let tile = "ign-pdal-tools/test_data_77055_627760_LA93_IGN69.laz";
    let families = [
        ("lidR/Megaplot.laz", reduction("", "side = 3.1"), "laz".to_owned()),
        (tile, reduction("neighbors = 12", "side = 0.57"), format!("ply\n{NORMALS}")),
    ];
    for (seed, (name, stages, write)) in families.into_iter().enumerate() {
        let scan = Scan::read(&scans.join(name), usize::MAX).crop(40_000);
        let tile_points = &[500, 1000];
        Family { scan: &scan, stages, write: &write, tile_points, configurations: 4, seed }.same();
    }
}

#[test]
fn a_sorted_copy_is_the_same_for_every_order_of_the_input() {
    let scan = landscape();
    let folder = tempfile::tempdir().unwrap();
    let mut records: Vec<&[u8]> = scan.records.chunks_exact(scan.schema.stride).collect();
    records.sort_unstable();
    for extension in ["las", "laz"] {
        let write = format!("{extension}\norder = \"canonical\"");
        let whole = scan.write_split(folder.path(), 1, &mut Random(0));
        let plain = run(folder.path(), &whole, "", &write, Settings::PLAIN).unwrap();
        let sorted = Scan::read(&plain.output, usize::MAX);
        let positions = sorted.positions();
        let canonical = |i: &usize| {
            let records = || sorted.record(*i).cmp(sorted.record(i + 1));
            morton_cmp(&positions[*i], &positions[i + 1]).then_with(records).is_le()
        };
        assert!((0..positions.len() - 1).all(|i| canonical(&i)));
        let mut written: Vec<&[u8]> = sorted.records.chunks_exact(scan.schema.stride).collect();
        written.sort_unstable();
        assert!(written == records, "every record once");
        let (output, mut random) = (plain.bytes(), Random(5));
        let (mut spilled, mut runs) = (0, 0);
        for number in 0..4 {
            let configuration = Configuration::any(number, &[300, 2000], &mut random);
            let ran = configuration.run(&scan, "", &write);
            assert_same(&output, &ran.bytes(), &format!("{configuration:?}"));
            assert_same(&plain.result, &ran.result, &format!("{configuration:?}"));
            (spilled, runs) = (spilled.max(ran.spilled), runs.max(ran.count("runs")));
            assert!(ran.count("tiles") >= 30 || number % 2 == 1, "{configuration:?}");
            std::fs::remove_dir_all(ran.output.parent().unwrap()).unwrap();
        }
        assert!(spilled > 0 && runs > 4, "{spilled} bytes spilled, {runs} runs");
    }
}

#[test]
fn a_stream_keeps_the_order_of_its_input_whatever_the_threads() {
    // Parts are many: several files, and more chunks than threads.
    let scan = Scan::synthetic(Scene::Als, 400_000, 11);
    let mut random = Random(9);
    let mut order: Vec<usize> = (0..scan.points()).collect();
    random.shuffle(&mut order);
    let scan = scan.pick(&order);
    for write in ["las", "laz", "ply"] {
        let mut outputs: Vec<Vec<u8>> = Vec::new();
        for threads in 1..=4 {
            let folder = tempfile::tempdir().unwrap();
            let files = scan.write_split(folder.path(), 1 + threads % 3, &mut random);
            let settings = Settings { threads, ..Settings::PLAIN };
            let ran = run(folder.path(), &files, "", write, settings).unwrap();
            if write != "ply" {
                let written = Scan::read(&ran.output, usize::MAX);
                assert_same(&scan.records, &written.records, &format!("{threads} threads"));
            }
            assert_eq!(ran.count("tiles"), 0, "nothing is milled");
            outputs.push(ran.bytes());
        }
        outputs.iter().for_each(|output| assert_same(&outputs[0], output, write));
    }
}
