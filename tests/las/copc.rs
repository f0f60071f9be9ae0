//! COPC as others read it: every point once, in a node around it, whatever the run was like.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use las::copc::{CopcInfoVlr, VoxelKey};
use las::{CopcReader, LodSelection};
use pointmill::synth::Scene;

use crate::support::command::{done, fails, pointmill};
use crate::support::records::read;
use crate::support::runs::{Memory, Settings, run};
use crate::support::scan::Scan;

/// What the nodes of a file hold, after it was looked at that all is as COPC has it: the points of
/// each level.
pub fn levels(path: &Path) -> Vec<u64> {
    let mut reader = CopcReader::from_path(path).unwrap();
    let header = reader.header().clone();
    assert!([6, 7, 8].contains(&header.point_format().to_u8().unwrap()));
    assert!(header.vlrs()[0].is_copc_info(), "the first record is that of COPC");
    let info = header.copc_info_vlr().unwrap();
    let entries: Vec<_> = reader.hierarchy_entries().collect();
    let keys: BTreeSet<_> = entries.iter().map(|e| (e.key.l, e.key.x, e.key.y, e.key.z)).collect();
    assert_eq!(keys.len(), entries.len());
    let mut levels: Vec<u64> = Vec::new();
    for entry in &entries {
        let above = entry.key.parent();
        assert!(keys.contains(&(above.l, above.x, above.y, above.z)), "{:?}", entry.key);
        let level = entry.key.l as usize;
        levels.resize(levels.len().max(level + 1), 0);
        levels[level] += entry.point_count as u64;
        if entry.point_count > 0 {
            let points = reader.read_entry(entry).unwrap();
            let scale = header.transforms().x.scale;
            check_node(&entry.key, &info, scale, points.points().map(|p| p.unwrap()));
        } else {
            assert_eq!((entry.offset, entry.byte_size), (0, 0));
        }
    }
    assert_eq!(levels.iter().sum::<u64>(), header.number_of_points());
    let root = reader.query(LodSelection::Level(0), las::BoundsSelection::All).unwrap();
    assert_eq!(root.len() as u64, levels[0]);
    levels
}

fn check_node(
    key: &VoxelKey,
    info: &CopcInfoVlr,
    scale: f64,
    points: impl Iterator<Item = las::Point>,
) {
    let bounds = key.bounds(info);
    let mut before = f64::NEG_INFINITY;
    for point in points {
        let [x, y, z] = [point.x, point.y, point.z];
        // The corner of a node is summed up, and coordinates are rounded.
        let edge = 1e-9 * info.center_x.abs().max(info.center_y.abs()).max(1.0) + scale / 2.0;
        let is_in = x >= bounds.min.x - edge
            && x <= bounds.max.x + edge
            && y >= bounds.min.y - edge
            && y <= bounds.max.y + edge
            && z >= bounds.min.z - edge
            && z <= bounds.max.z + edge;
        assert!(is_in, "{key:?} {bounds:?}: {x} {y} {z}");
        let time = point.gps_time.unwrap();
        assert!(time >= before, "{key:?} is not in the order of time");
        assert!((info.gpstime_minimum..=info.gpstime_maximum).contains(&time));
        before = time;
    }
}

/// Sorted records of a file.
fn sorted(path: &Path) -> Vec<Vec<u8>> {
    let (schema, records) = read(path);
    let mut all: Vec<_> = records.chunks_exact(schema.stride).map(<[u8]>::to_vec).collect();
    all.sort_unstable();
    all
}

#[test]
fn every_record_is_in_a_node_around_it_and_tiles_threads_and_memory_do_not_matter() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.laz");
    Scan::synthetic(Scene::Als, 150_000, 3).with_copies(2).write(&input);
    let mut first = None;
    for settings in [
        Settings::PLAIN,
        Settings { tile_points: Some(5_000), threads: 3, ..Settings::PLAIN },
        Settings { threads: 1, spill: "always", ..Settings::PLAIN },
        Settings { memory: Memory::Least(0), ..Settings::PLAIN },
    ] {
        let ran =
            run(folder.path(), std::slice::from_ref(&input), "", "copc.laz", settings).unwrap();
        let bytes = std::fs::read(&ran.output).unwrap();
        let first = first.get_or_insert_with(|| {
            let levels = levels(&ran.output);
            assert!(levels.len() > 1 && levels[0] > 500, "{levels:?}");
            assert!(sorted(&ran.output) == sorted(&input), "other records than the input's");
            bytes.clone()
        });
        assert!(*first == bytes, "{settings:?}");
    }
}

#[test]
fn what_a_reduction_leaves_is_written_and_made_again() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "als", "-n", "60000", "-o", "a.laz"]);
    done(at, &["reduce", "a.laz", "-o", "r.copc.laz", "--max-angle", "6deg", "--quiet"]);
    done(at, &["reduce", "a.laz", "-o", "r.laz", "--max-angle", "6deg", "--quiet"]);
    assert!(sorted(&at.join("r.copc.laz")) == sorted(&at.join("r.laz")));
    levels(&at.join("r.copc.laz"));
    assert!(done(at, &["reproduce", "r.copc.laz"]).contains("same"));
    // And back.
    done(at, &["convert", "r.copc.laz", "-o", "b.laz", "--quiet"]);
    assert!(sorted(&at.join("b.laz")) == sorted(&at.join("r.laz")));
    done(at, &["convert", "r.copc.laz", "-o", "c.COPC.LAZ", "--quiet"]);
    assert_eq!(levels(&at.join("c.COPC.LAZ")), levels(&at.join("r.copc.laz")));
}

/// The mean of the ranks that a reduction gave the points of a file, and how many there are.
fn mean_rank(path: &Path) -> (f64, usize) {
    let (schema, records) = read(path);
    let rank = schema.find("KeepRank").unwrap();
    let ranks = records.chunks_exact(schema.stride).map(|r| rank.world(r, schema.endian));
    let (sum, count) = ranks.fold((0.0, 0), |(sum, count), rank| (sum + rank, count + 1));
    (sum / count as f64, count)
}

#[test]
fn a_coarse_level_is_a_coarse_reduction_where_points_have_ranks() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "als", "-n", "400000", "-o", "a.laz", "--quiet"]);
    let reduce = ["reduce", "a.laz", "--keep", "50%", "--ranks", "--quiet", "-o"];
    let (code, _, told) = pointmill(at, &[&reduce[..], &["r.copc.laz"]].concat());
    assert_eq!(code, 0, "{told}");
    levels(&at.join("r.copc.laz"));
    let root = ["convert", "r.copc.laz", "-o", "root.laz", "--resolution", "1000", "--quiet"];
    done(at, &root);
    let (all, root) = (mean_rank(&at.join("r.copc.laz")), mean_rank(&at.join("root.laz")));
    assert!(root.1 < all.1 / 2, "{root:?} of {all:?}");
    // Where a hash decides, points of all ranks come as often. Eight ranks are a distance of √2.
    assert!(root.0 < all.0 - 16.0, "{root:?} of {all:?}");
    // From a file that has ranks, the same nodes.
    for to in ["b.copc.laz", "c.copc.laz"] {
        let from = if to == "b.copc.laz" { "r.copc.laz" } else { "b.copc.laz" };
        done(at, &["convert", from, "-o", to, "--quiet", "--no-provenance"]);
    }
    let bytes = |name: &str| std::fs::read(at.join(name)).unwrap();
    assert!(bytes("b.copc.laz") == bytes("c.copc.laz"));
}

#[test]
fn other_point_formats_and_formats_become_those_of_copc() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let text = "x,y,z,red,green,blue,quality\n1.5,2,3,65535,1,0,7\n-100,20.25,3,0,0,0,8\n";
    std::fs::write(at.join("a.csv"), text).unwrap();
    let copc = |from: &str, to: &str, more: &[&str]| {
        done(at, &[&["convert", from, "-o", to, "--quiet"], more].concat());
        levels(&at.join(to));
        std::fs::read(at.join(to)).unwrap()[104] & 63
    };
    assert_eq!(copc("a.csv", "a.copc.laz", &["--scale", "0.01"]), 7);
    for (point_format, expected) in [("1", 6), ("2", 7), ("3", 7), ("8", 8)] {
        let mut las = vec!["convert", "a.csv", "-o", "b.las", "--quiet", "--scale", "0.01"];
        las.extend(["--point-format", point_format]);
        if point_format == "1" {
            las.extend(["--drop", "Red,Green,Blue"]);
        }
        done(at, &las);
        assert_eq!(copc("b.las", "b.copc.laz", &[]), expected, "{point_format}");
        done(at, &["convert", "b.copc.laz", "-o", "back.csv", "--quiet"]);
        let text = std::fs::read_to_string(at.join("back.csv")).unwrap();
        assert!(text.lines().next().unwrap().ends_with(",quality"), "{text}");
        assert!(text.contains("1.50,2.00,3.00,") && text.contains(",8\n"), "{text}");
    }
    // Steps of another scale are not those of the lattice.
    done(at, &["synth", "part", "-n", "30000", "-o", "p.ply"]);
    assert_eq!(copc("p.ply", "p.copc.laz", &["--scale", "0.0007"]), 6);
    assert_eq!(copc("p.copc.laz", "q.copc.laz", &["--scale", "0.013", "--point-format", "7"]), 7);
}

#[test]
fn few_points_and_none_are_files_too() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "als", "-n", "2000", "-o", "a.laz"]);
    for (name, keep) in [("none", "X < -1e9"), ("one", "GpsTime == 1e300")] {
        let out = format!("{name}.copc.laz");
        let text = format!("read a.laz ! filter where=\"{keep}\" ! write {out}");
        let (code, _, told) = pointmill(at, &["run", &text, "--quiet"]);
        assert_eq!(code, 0, "{told}");
        assert_eq!(levels(&at.join(out)), [0]);
    }
    std::fs::write(at.join("p.xyz"), "7 8 9\n".repeat(70_000)).unwrap();
    done(at, &["convert", "p.xyz", "-o", "p.copc.laz", "--scale", "0.001", "--quiet"]);
    assert_eq!(levels(&at.join("p.copc.laz")).iter().sum::<u64>(), 70_000);
}

#[test]
fn what_copc_cannot_be_is_refused() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "als", "-n", "20000", "-o", "a.laz"]);
    let copc = ["convert", "a.laz", "-o", "b.copc.laz"];
    fails(at, &[&copc[..], &["--point-format", "1"]].concat(), 2, &["no point format 1", "6, 7"]);
    let ordered = ["reduce", "a.laz", "-o", "b.copc.laz", "--order", "input"];
    fails(at, &ordered, 2, &["--order", "order of its own"]);
    let ordered = ["run", "read a.laz ! write folder=o format=copc order=input"];
    fails(at, &ordered, 2, &["order of its own"]);
    let bytes = ["run", "read a.laz ! write \"{number}.copc.laz\" bytes=1MB"];
    fails(at, &bytes, 2, &["known when a file of it is complete", "write.points"]);
    for write in ["write b.copc.laz", "write \"{x}_{y}.copc.laz\" side=100"] {
        let text = format!("read a.laz ! grid side=1 ! {write}");
        let stretched = ["run", &text, "--set", "run.z_scale=3"];
        fails(at, &stretched, 2, &["COPC has cubes in the unit of the coordinates"]);
    }
    let smooth = "read a.laz ! normals ! smooth ! write s.copc.laz";
    let (code, _, told) = pointmill(at, &["run", smooth]);
    assert_eq!(code, 2, "{told}");
    assert!(told.contains("out of its place") && told.contains("write LAZ"), "{told}");
    let names: Vec<PathBuf> =
        std::fs::read_dir(at).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(names, [at.join("a.laz")], "nothing is left behind");
}
