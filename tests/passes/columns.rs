//! Columns that stages from outside the crate add: computed over tiles, read of neighbours by later
//! stages, written by name; against brute force over all of the scan.

#![allow(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use std::collections::BTreeMap;
use std::path::Path;

use pointmill::internals::morton_cmp;
use pointmill::point::{Column, Dimension, Position, distance2, names};
use pointmill::report::Tally;
use pointmill::stage::{Needs, Role, RoleName, StageKind, StagePlace, TileOp};
use pointmill::synth::Scene;
use pointmill::tile::Tile;
use pointmill::{Done, Graph, Overrides, Quiet, Registry, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::support::scan::Scan;

/// Neighbours that the stages look at.
const K: usize = 6;

/// The mean rise to the neighbours, in lattice steps.
const RISE: Column<f32> = Column::new("Rise", &[]);
/// The largest and the smallest rise among the neighbours, and their number.
const RISES: Column<[f32; 3]> = Column::new("Rises", &["RiseMost", "RiseLeast", "RiseCount"]);
/// Intensity, as the records have it, and the sum of the neighbours'.
const INTENSITY: Column<f64> = Column::new(names::INTENSITY, &[]);
const GLOW: Column<u32> = Column::new("Glow", &[]);

/// Defines a stage without keys.
macro_rules! stage {
    ($name:ident, $kind:literal, $needs:expr, |$tile:ident| $run:block) => {
        #[derive(Debug, Serialize, Deserialize, JsonSchema)]
        struct $name {}

        impl StageKind for $name {
            const KIND: &'static str = $kind;
            const ROLE: RoleName = RoleName::OnTiles;
            const ABOUT: &'static str = "Computes a column.";

            fn build(self, _: &StagePlace) -> Result<Role> {
                Ok(Role::TileOp(Box::new(self)))
            }
        }

        impl TileOp for $name {
            fn needs(&self) -> Needs {
                $needs
            }

            fn run(&self, $tile: &mut Tile, _: &mut Tally) -> Result<()> {
                $run
            }
        }
    };
}

stage!(Rise, "rise", Needs::none().neighbors(K).writes(&RISE), |tile| {
    let mut rise = tile.columns.take(&RISE)?;
    tile.each_neighborhood(K, |i, neighbors| {
        let sum: i64 = neighbors.offsets().iter().map(|offset| offset[2]).sum();
        rise[i] = sum as f32 / neighbors.offsets().len() as f32;
    })?;
    tile.columns.put(rise);
    Ok(())
});

stage!(Rises, "rises", Needs::none().reads_of_neighbors(&RISE, K).writes(&RISES), |tile| {
    let mut rises = tile.columns.take(&RISES)?;
    tile.each_neighborhood_with(K, &RISE, |i, _, values| {
        let most = values.iter().copied().fold(f32::MIN, f32::max);
        let least = values.iter().copied().fold(f32::MAX, f32::min);
        rises[i] = [most, least, values.len() as f32];
    })?;
    tile.columns.put(rises);
    Ok(())
});

stage!(Glow, "glow", Needs::none().reads_of_neighbors(&INTENSITY, K).writes(&GLOW), |tile| {
    let mut glow = tile.columns.take(&GLOW)?;
    tile.each_neighborhood_with(K, &INTENSITY, |i, _, values| {
        glow[i] = values.iter().map(|value| *value as u32).sum();
    })?;
    let own = tile.columns.get(&INTENSITY)?;
    glow.iter_mut().zip(own).for_each(|(glow, own)| *glow += 1_000_000 * u32::from(*own > 9.0));
    tile.columns.put(glow);
    Ok(())
});

stage!(Sneaky, "sneaky", Needs::none().reads(&RISE).neighbors(K), |tile| {
    tile.each_neighborhood_with(K, &RISE, |_, _, _| {})
});

stage!(Greedy, "greedy", Needs::none().neighbors(K), |tile| {
    tile.each_neighborhood(K + 1, |_, _| {})
});

stage!(Curious, "curious", Needs::none(), |tile| {
    tile.columns.get(&RISE)?;
    Ok(())
});

stage!(Thief, "thief", Needs::none().writes(&RISE), |tile| {
    tile.columns.take(&RISE)?;
    Ok(())
});

stage!(Wordy, "wordy", Needs::none().writes(&WORDY), |_tile| { Ok(()) });

const WORDY: Column<u8> = Column::new("MoreThanThirtyTwoBytesAreALongName", &[]);

stage!(Other, "other", Needs::none().writes(&OTHER_RISE), |_tile| { Ok(()) });

/// A column that is called as another and of another type.
const OTHER_RISE: Column<f64> = Column::new("Rise", &[]);

fn registry() -> Registry {
    let registry = Registry::builtin().with::<Rise>().with::<Rises>().with::<Glow>();
    let registry = registry.with::<Greedy>().with::<Curious>();
    registry.with::<Sneaky>().with::<Thief>().with::<Other>().with::<Wordy>()
}

const TILED: &str =
    "withheld = 'keep'\ntile_points = 100\nspill = 'always'\nthreads = 2\nmemory = '800MiB'\n";
const WHOLE: &str = "withheld = 'keep'\nthreads = 1\n";

fn run(folder: &Path, run: &str, stages: &str, write: &str, output: &str) -> Result<Done> {
    let text = format!(
        "[run]\n{run}[[stage]]\nkind = 'read'\npath = '{}'\n{stages}[[stage]]\nkind = 'write'\n\
         path = '{}'\n{write}\n",
        folder.join("scan.las").display(),
        folder.join(output).display(),
    );
    let graph = Graph::parse(&text, "columns.toml", &registry())?;
    graph.plan(&Overrides::default())?.run(&Quiet)
}

/// A landscape with copies that differ in class, flags and intensity.
fn scene() -> Scan {
    let scan = Scan::synthetic(Scene::Als, 6_000, 21).snapped(60);
    let mut scan = scan.with_copies(5).with_classes_and_flags(6);
    let (stride, intensity) = (scan.schema.stride, dimension(&scan, names::INTENSITY).offset);
    for (i, record) in scan.records.chunks_exact_mut(stride).enumerate() {
        record[intensity..intensity + 2].copy_from_slice(&(i as u16 % 23).to_le_bytes());
    }
    scan
}

fn dimension(scan: &Scan, name: &str) -> Dimension {
    scan.schema.find(name).unwrap_or_else(|| panic!("no {name}")).clone()
}

/// The values of a dimension by position, which must be the same for all records of one.
fn by_position(scan: &Scan, name: &str) -> BTreeMap<Position, f64> {
    let field = dimension(scan, name);
    let mut all = BTreeMap::new();
    for (i, p) in scan.positions().into_iter().enumerate() {
        let value = field.get(scan.record(i), scan.schema.endian).as_f64();
        assert_eq!(*all.entry(p).or_insert(value), value, "{name} at {p:?}");
    }
    all
}

/// The positions, and the K nearest others of each.
fn neighborhoods(scan: &Scan) -> BTreeMap<Position, Vec<Position>> {
    let mut positions = scan.positions();
    positions.sort_by(morton_cmp);
    positions.dedup();
    let nearest = |p: &Position| {
        let mut others: Vec<_> = positions.iter().filter(|q| *q != p).collect();
        others.sort_by(|a, b| distance2(*p, **a).cmp(&distance2(*p, **b)).then(morton_cmp(a, b)));
        others.into_iter().take(K).copied().collect()
    };
    positions.iter().map(|p| (*p, nearest(p))).collect()
}

const RISE_STAGES: &str = "[[stage]]\nkind = 'rise'\n[[stage]]\nkind = 'rises'\n";

#[test]
fn a_stage_adds_a_column_another_reads_its_neighbors_values_and_outputs_have_both() {
    let folder = tempfile::tempdir().unwrap();
    let scan = scene();
    scan.write(&folder.path().join("scan.las"));
    let write = "dimensions = ['RiseMost', 'Rise', 'RiseLeast', 'RiseCount']";
    let done = run(folder.path(), TILED, RISE_STAGES, write, "out.las").unwrap();
    let work = &done.report.run.work;
    assert!(work["tiles"] >= 2 * 30 && work["tile_levels"] >= 2, "{work:?}");
    assert!(work["unproven"] > 0 && work["tied"] > 0, "{work:?}");
    assert!(done.report.run.spill_bytes > 0);
    let written = Scan::read(&folder.path().join("out.las"), usize::MAX);
    let neighbors = neighborhoods(&scan);
    let mean = |p: &Position| {
        let sum: i64 = neighbors[p].iter().map(|q| q[2] - p[2]).sum();
        sum as f32 / K as f32
    };
    let rise = by_position(&written, "Rise");
    assert_eq!(rise.len(), neighbors.len());
    assert!(rise.iter().all(|(p, rise)| *rise == f64::from(mean(p))));
    for (name, of) in [("RiseMost", f32::max as fn(f32, f32) -> f32), ("RiseLeast", f32::min)] {
        for (p, value) in by_position(&written, name) {
            let expected = neighbors[&p].iter().map(&mean).reduce(of).unwrap();
            assert_eq!(value, f64::from(expected), "{name} at {p:?}");
        }
    }
    assert!(by_position(&written, "RiseCount").values().all(|count| *count == K as f64));
    run(folder.path(), WHOLE, RISE_STAGES, write, "whole.las").unwrap();
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert!(read("out.las") == read("whole.las"), "the cut into tiles shows");
}

#[test]
fn a_column_goes_into_every_format_and_into_outputs_in_any_order() {
    let folder = tempfile::tempdir().unwrap();
    let scan = scene();
    scan.write(&folder.path().join("scan.las"));
    let rises = |name: &str, write: &str| {
        let write = format!("dimensions = ['Rise']\n{write}");
        let stages = "[[stage]]\nkind = 'rise'\n[[stage]]\nkind = 'grid'\nside = 2\n";
        run(folder.path(), TILED, stages, &write, name).unwrap();
        by_position(&Scan::read(&folder.path().join(name), usize::MAX), "Rise")
    };
    let expected = rises("a.las", "");
    assert!(expected.len() > 300 && expected.len() < 5_000, "{}", expected.len());
    assert!(rises("b.laz", "") == expected);
    assert!(rises("c.las", "order = 'input'") == expected);
    let ply = "drop = ['ScanDirectionFlag']";
    let ply: Vec<f64> =
        rises("d.ply", &format!("{ply}\nencoding = 'binary'")).into_values().collect();
    let mut las: Vec<f64> = expected.into_values().collect();
    let mut ply = ply;
    las.sort_by(f64::total_cmp);
    ply.sort_by(f64::total_cmp);
    assert!(ply == las, "PLY has the same values");
}

#[test]
fn stages_read_dimensions_of_records_at_neighbors_of_the_first_record_of_a_position() {
    let folder = tempfile::tempdir().unwrap();
    let scan = scene();
    scan.write(&folder.path().join("scan.las"));
    let glow = "[[stage]]\nkind = 'glow'\n";
    for (stages, keeps) in
        [(glow.to_owned(), false), (format!("{glow}classes = [2]\nsees = 'all'\n"), true)]
    {
        let write = "dimensions = ['Glow']";
        let done = run(folder.path(), TILED, &stages, write, "out.las").unwrap();
        let work = &done.report.run.work;
        assert!(work["tiles"] >= 30 && work["unproven"] > 0, "{work:?}");
        let written = Scan::read(&folder.path().join("out.las"), usize::MAX);
        run(folder.path(), WHOLE, &stages, write, "whole.las").unwrap();
        let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
        assert!(read("out.las") == read("whole.las"), "the cut into tiles shows");
        // The canonical first record of each position: of the class, where one is of it.
        let field = dimension(&scan, names::INTENSITY);
        let class = dimension(&scan, names::CLASSIFICATION);
        let value = |of: &Dimension, record: &[u8]| of.get(record, scan.schema.endian).as_f64();
        let mut first: BTreeMap<Position, (bool, &[u8])> = BTreeMap::new();
        for (i, p) in scan.positions().into_iter().enumerate() {
            let record = scan.record(i);
            let found = (keeps && value(&class, record) != 2.0, record);
            let known = first.entry(p).or_insert(found);
            *known = (*known).min(found);
        }
        let intensity = |p: &Position| value(&field, first[p].1) as u32;
        let neighbors = neighborhoods(&scan);
        let mut told = 0;
        for (p, glow) in by_position(&written, "Glow") {
            if first[&p].0 {
                continue;
            }
            let sum: u32 = neighbors[&p].iter().map(&intensity).sum();
            let expected = sum + 1_000_000 * u32::from(intensity(&p) > 9);
            assert_eq!(glow as u32, expected, "{p:?} {stages}");
            told += 1;
        }
        assert!(told > 300, "{told}");
    }
}

#[test]
fn what_no_stage_gives_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    scene().write(&folder.path().join("scan.las"));
    let refused = |stages: &str, write: &str| {
        let error = run(folder.path(), WHOLE, stages, write, "out.las").err().unwrap();
        format!("{error} ({})", error.remedy().unwrap_or_default())
    };
    let told = refused("[[stage]]\nkind = 'rises'\n", "");
    assert!(told.contains("`rises` needs Rise, which nothing before it gives"), "{told}");
    let told = refused("[[stage]]\nkind = 'rise'\n", "dimensions = ['Raise']");
    assert!(told.contains("the output wants Raise, which no stage computes"), "{told}");
    let told = refused("", "dimensions = ['NormalX']");
    assert!(told.contains("put a `normals` stage before it"), "{told}");
    let twice = format!("{RISE_STAGES}[[stage]]\nkind = 'rise'\n[[stage]]\nkind = 'rise'\n");
    let told = refused(&twice, "dimensions = ['Rise']");
    assert!(told.contains("would replace values of Rise that nothing has read"), "{told}");
    let told = refused("[[stage]]\nkind = 'rise'\n", "dimensions = ['Raise', 'Rise']");
    assert!(
        told.contains("dimensions = [") && told.contains("the stages above compute Rise"),
        "{told}"
    );
    let told = refused("[[stage]]\nkind = 'normals'\n", "dimensions = ['Normal']");
    assert!(told.contains("the numbers of Normal are NormalX, NormalY and NormalZ"), "{told}");
    let rise = "[[stage]]\nkind = 'rise'\n";
    let told = refused(&format!("{rise}[[stage]]\nkind = 'sneaky'\n"), "");
    let sneaky = "the stage `sneaky` reads Rise of its neighbours and does not declare it";
    assert!(told.contains(sneaky), "{told}");
    let told = refused("[[stage]]\nkind = 'greedy'\n", "");
    assert!(told.contains("the stage `greedy` looks for 7 neighbours and declares 6"), "{told}");
    let told = refused("[[stage]]\nkind = 'curious'\n", "");
    assert!(told.contains("the stage `curious` asks for the column Rise, which it"), "{told}");
    let told = refused("[[stage]]\nkind = 'thief'\n", "dimensions = ['Rise']");
    assert!(told.contains("took the column Rise and did not put it back"), "{told}");
    let told = refused(&format!("{rise}[[stage]]\nkind = 'other'\n"), "");
    assert!(told.contains("`other` computes Rise of another type"), "{told}");
    let long = format!("dimensions = ['{}']", WORDY.kind().name());
    let told = refused("[[stage]]\nkind = 'wordy'\n", &long);
    assert!(told.contains("longer than the 32 bytes that LAS has for the name"), "{told}");
    assert!(!folder.path().join("out.las").exists());
}

#[test]
fn what_a_stage_lacks_is_one_mistake() {
    let case = crate::support::case::Case::new();
    case.ply(&[([0.0, 0.0, 0.0], 1), ([1.0, 0.0, 0.0], 2)]);
    let error = case.run("", "[[stage]]\nkind = 'scanline'\nmax_distance = 1\n", "").unwrap_err();
    let told = error.to_string();
    let names = "GpsTime, PointSourceId, ScanDirectionFlag and EdgeOfFlightLine";
    assert!(told.contains(&format!("`scanline` needs {names}, which nothing before")), "{told}");
    assert!(!told.contains("mistakes"), "{told}");
}

#[test]
fn a_partition_that_another_replaces_is_refused() {
    let case = crate::support::case::Case::new();
    let points: Vec<([f64; 3], u32)> =
        (0..60u32).map(|n| ([f64::from(n % 8), f64::from(n / 8), 0.0], n)).collect();
    case.ply(&points);
    let stage = |text: &str| format!("[[stage]]\nkind = {text}\n");
    let [normals, image, cells, median] = [
        "'normals'\nneighbors = 5",
        "'gaussian-image'\nside = 4",
        "'cells'\nside = 4\nmax_angle = 0.2",
        "'median'",
    ]
    .map(stage);
    for (first, second) in [(&image, &cells), (&cells, &image), (&cells, &cells)] {
        let stages = format!("{normals}{first}{second}{median}");
        let told = case.run("", &stages, "").unwrap_err().to_string();
        assert!(told.contains("which nothing has taken"), "{told}");
        let stages = format!("{normals}{first}{median}{normals}{second}{median}");
        case.run("", &stages, "").unwrap();
    }
}
