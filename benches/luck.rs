//! Structured bad luck beside an ordinary scan: CPU time a point, peak memory against the budget.
//!
//! `cargo bench --bench luck` reduces ten million points a scene;
//! `cargo bench --bench luck -- 1000000` another number;
//! `cargo bench --bench luck -- 1000000 line clusters` only the scenes whose names begin so.
//!
//! Scenes with more than twice the CPU time of the ordinary scan of their format are marked `!`.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints and may fail")]

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Budgets that every scene runs with; none is the default, half of what the machine has.
const BUDGETS: [Option<u64>; 2] = [Some(256), None];
/// Bytes of a LAS record that hold the coordinates.
const XYZ: usize = 12;
/// Degrees of latitude in a millimetre.
const DEGREES_A_MILLIMETRE: f64 = 1e-3 / 111_320.0;

/// A point of the ordinary scan, in millimetres, becomes one of a scene, in stored steps.
type Place = fn(i: u64, n: u64, p: [i32; 3]) -> [i64; 3];

struct Scene {
    name: &'static str,
    /// Written as LAS with the scales and offsets below, or as PLY of doubles.
    las: bool,
    scale: [f64; 3],
    offset: [f64; 3],
    place: Place,
}

const fn las(name: &'static str, scale: f64, place: Place) -> Scene {
    Scene { name, las: true, scale: [scale; 3], offset: [0.0; 3], place }
}

const fn ply(name: &'static str, scale: f64, place: Place) -> Scene {
    Scene { las: false, ..las(name, scale, place) }
}

const SCENES: [Scene; 11] = [
    las("ordinary", 1e-3, as_it_is),
    ply("ordinary, PLY", 1e-3, as_it_is),
    las("coincident", 1e-3, |_, _, _| [123_456, -654_321, 7]),
    las("line", 1e-3, |i, n, _| [3, -2, 1].map(|d| d * (i * 7919 % n) as i64)),
    las("lattice, every point twice", 1e-2, lattice),
    las("plane lattice, every point twice", 1e-2, plane_lattice),
    las("clusters 10,000 km apart", 1e-2, |i, n, p| apart(i, n, p.map(|v| v / 10), 500_000_000)),
    ply("clusters 10,000 km apart, PLY", 1e-3, |i, n, p| apart(i, n, p, 5_000_000_000)),
    Scene { scale: [1e-7, 1e-7, 1e-3], offset: [7.0, 45.0, 0.0], ..las("degrees", 0.0, degrees) },
    las("millimetres", 1.0, as_it_is),
    ply("millimetres, PLY", 1.0, as_it_is),
];

fn as_it_is(_: u64, _: u64, p: [i32; 3]) -> [i64; 3] {
    p.map(i64::from)
}

fn lattice(i: u64, n: u64, _: [i32; 3]) -> [i64; 3] {
    let distinct = n.div_ceil(2);
    let side = (distinct as f64).cbrt().ceil() as u64;
    let i = i * 7919 % distinct;
    [i % side, i / side % side, i / side / side].map(|v| v as i64 * 5)
}

fn plane_lattice(i: u64, n: u64, _: [i32; 3]) -> [i64; 3] {
    let distinct = n.div_ceil(2);
    let side = (distinct as f64).sqrt().ceil() as u64;
    let i = i * 7919 % distinct;
    [(i % side) as i64 * 5, (i / side) as i64 * 5, 0]
}

/// Every other point on either side of the world.
fn apart(i: u64, _: u64, p: [i32; 3], half: i64) -> [i64; 3] {
    let [x, y, z] = p.map(i64::from);
    [if i.is_multiple_of(2) { x - half } else { x + half }, y, z]
}

/// Longitude and latitude in steps of 1e-7 degrees, height in millimetres.
fn degrees(_: u64, _: u64, p: [i32; 3]) -> [i64; 3] {
    let steps = |v: i32| (f64::from(v) * DEGREES_A_MILLIMETRE * 1e7).round() as i64;
    [steps(p[0]), steps(p[1]), i64::from(p[2])]
}

impl Scene {
    /// Writes the scene made of the ordinary LAS file.
    fn write(&self, ordinary: &[u8], folder: &Path) -> PathBuf {
        let path = folder.join(if self.las { "scene.las" } else { "scene.ply" });
        let number = |at: usize| u32::from_le_bytes(ordinary[at..at + 4].try_into().unwrap());
        let (start, stride) = (number(96) as usize, usize::from(ordinary[105]));
        let n = ((ordinary.len() - start) / stride) as u64;
        let mut file = BufWriter::new(std::fs::File::create(&path).unwrap());
        file.write_all(&self.head(&ordinary[..start], n)).unwrap();
        for (i, record) in (0..n).zip(ordinary[start..].chunks_exact(stride)) {
            let stored: [i32; 3] = std::array::from_fn(|axis| {
                i32::from_le_bytes(record[axis * 4..axis * 4 + 4].try_into().unwrap())
            });
            let steps = (self.place)(i, n, stored);
            for (v, scale) in steps.iter().zip(self.scale) {
                if self.las {
                    file.write_all(&i32::try_from(*v).unwrap().to_le_bytes()).unwrap();
                } else {
                    file.write_all(&(*v as f64 * scale).to_le_bytes()).unwrap();
                }
            }
            if self.las {
                file.write_all(&record[XYZ..]).unwrap();
            }
        }
        file.flush().unwrap();
        path
    }

    fn head(&self, las: &[u8], n: u64) -> Vec<u8> {
        if !self.las {
            return format!(
                "ply\nformat binary_little_endian 1.0\nelement vertex {n}\nproperty double x\n\
                 property double y\nproperty double z\nend_header\n"
            )
            .into_bytes();
        }
        let mut head = las.to_vec();
        let numbers = self.scale.iter().chain(&self.offset).flat_map(|v| v.to_le_bytes());
        head[131..179].iter_mut().zip(numbers).for_each(|(byte, new)| *byte = new);
        head
    }
}

fn pointmill(arguments: &[&str]) {
    let status = Command::new(env!("CARGO_BIN_EXE_pointmill"))
        .args(arguments)
        .stdout(std::process::Stdio::null())
        .status()
        .unwrap();
    assert!(status.success(), "{arguments:?}");
}

/// Reduces a scan and prints a line; gives CPU seconds a million points.
fn reduce(scene: &Scene, scan: &Path, budget: Option<u64>, ordinary: Option<f64>) -> f64 {
    let folder = scan.parent().unwrap();
    let output = folder.join(if scene.las { "reduced.las" } else { "reduced.ply" });
    let report = folder.join("reduced.json");
    let [from, to, told] = [scan, &output, &report].map(|path| path.to_str().unwrap());
    let mut arguments = vec!["reduce", from, "-o", to, "--report", told, "--progress", "never"];
    let memory = budget.map(|mebibytes| format!("{mebibytes}MiB"));
    memory.iter().for_each(|memory| arguments.extend(["--memory", memory]));
    pointmill(&arguments);
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap();
    let run = &json["run"];
    let ledger = &json["result"]["ledger"];
    let read = ledger["read"].as_f64().unwrap();
    let cpu = run["cpu_seconds"].as_f64().unwrap() * 1e6 / read;
    let ratio = cpu / ordinary.unwrap_or(cpu);
    let mib = |name: &str| run[name].as_f64().unwrap() / f64::from(1 << 20);
    let phases: Vec<String> = run["phases"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| format!("{} {:.1}", p["name"].as_str().unwrap(), p["seconds"].as_f64().unwrap()))
        .collect();
    println!(
        "{:<33} {:>8} {cpu:>6.2} {ratio:>5.2}{} {:>6.0} MiB peak {:>6.0} spilled {:>9} kept  {} \
         tiles, {} unproven; {}",
        scene.name,
        memory.unwrap_or_default(),
        if ratio > 2.0 { '!' } else { ' ' },
        mib("peak_memory_bytes"),
        mib("spill_bytes"),
        ledger["kept"],
        run["work"]["tiles"],
        run["work"]["unproven"],
        phases.join(", "),
    );
    assert!(budget.is_none_or(|limit| mib("peak_memory_bytes") <= limit as f64), "over the budget");
    cpu
}

fn main() {
    // `cargo bench` passes `--bench` on.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let points = arguments.first().map_or("10000000", String::as_str);
    let wanted = |scene: &&Scene| {
        let names = arguments.get(1..).unwrap_or_default();
        names.is_empty() || names.iter().any(|name| scene.name.starts_with(name.as_str()))
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ordinary.las");
    pointmill(&["synth", "als", "-n", points, "-o", path.to_str().unwrap()]);
    let ordinary = std::fs::read(path).unwrap();
    let [plain_las, plain_ply] = [0, 1].map(|i| {
        let beside = tempfile::tempdir_in(folder.path()).unwrap().keep();
        SCENES[i].write(&ordinary, &beside)
    });
    println!("{points} points: CPU s a million points, ratio to the ordinary scan beside it");
    for scene in SCENES.iter().filter(wanted) {
        let scan = scene.write(&ordinary, folder.path());
        for budget in BUDGETS {
            // Run beside each other, so that a machine that slows down slows both.
            let (plain, at) = if scene.las { (0, &plain_las) } else { (1, &plain_ply) };
            let beside = reduce(&SCENES[plain], at, budget, None);
            if !scene.name.starts_with("ordinary") {
                reduce(scene, &scan, budget, Some(beside));
            }
        }
        std::fs::remove_file(scan).unwrap();
    }
}
