//! Conversions as a user runs them, beside what bounds them: the bare `laz` crate on the same file,
//! and the system alone, which copies files of the same sizes. CPU seconds of one thread, in turn.
//!
//! `cargo bench --bench convert` makes an airborne scan of 10 million points first;
//! `cargo bench --bench convert -- SCAN.laz` takes a scan of yours;
//! `cargo bench --bench convert -- SCAN.laz OTHER` times another build of the program too, and compares
//! the bytes that the two write.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints and may fail")]

use std::fs::{self, File};
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use laz::{LasZipCompressor, LasZipDecompressor, LazVlr};

/// Times that each job runs; medians are told.
const ROUNDS: usize = 5;
/// Records that the bare crate takes at once.
const AT_ONCE: usize = 50_000;
/// Bytes that are copied at once.
const BLOCK: usize = 1 << 20;

/// What of a LAS or LAZ file the bare crate must be told.
struct Layout {
    points_start: u64,
    stride: usize,
    points: u64,
    laszip: Option<LazVlr>,
}

impl Layout {
    fn of(path: &Path) -> Layout {
        let mut head = vec![0; 1 << 20];
        let length = File::open(path).unwrap().read(&mut head).unwrap();
        let number = |at: usize, bytes: usize| {
            let field = head[..length][at..at + bytes].iter().rev();
            field.fold(0u64, |all, &byte| all << 8 | u64::from(byte))
        };
        let mut at = number(94, 2) as usize;
        let mut laszip = None;
        for _ in 0..number(100, 4) {
            let payload = at + 54..at + 54 + number(at + 20, 2) as usize;
            if number(at + 18, 2) == u64::from(LazVlr::RECORD_ID) {
                laszip = Some(LazVlr::from_buffer(&head[payload.clone()]).unwrap());
            }
            at = payload.end;
        }
        let points = match number(25, 1) {
            4 => number(247, 8),
            _ => number(107, 4),
        };
        Layout { points_start: number(96, 4), stride: number(105, 2) as usize, points, laszip }
    }

    fn reader(&self, path: &Path) -> BufReader<File> {
        let mut reader = BufReader::with_capacity(BLOCK, File::open(path).unwrap());
        reader.seek(SeekFrom::Start(self.points_start)).unwrap();
        reader
    }

    /// Calls `take` with buffers for all records, the last of which may be shorter.
    fn each(&self, mut take: impl FnMut(&mut [u8])) {
        let mut buffer = vec![0; AT_ONCE * self.stride];
        let mut left = self.points;
        while left > 0 {
            let now = left.min(AT_ONCE as u64);
            take(&mut buffer[..now as usize * self.stride]);
            left -= now;
        }
    }
}

/// A file that forgets what is written to it.
#[derive(Default)]
struct Nowhere {
    at: u64,
    end: u64,
}

impl Write for Nowhere {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.at += bytes.len() as u64;
        self.end = self.end.max(self.at);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Nowhere {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = match to {
            SeekFrom::Start(at) => at,
            SeekFrom::Current(by) => self.at.saturating_add_signed(by),
            SeekFrom::End(by) => self.end.saturating_add_signed(by),
        };
        Ok(self.at)
    }
}

/// Decodes `laz` and leaves the records.
fn decode(laz: &Path) {
    let layout = Layout::of(laz);
    let vlr = layout.laszip.clone().unwrap();
    let mut decoder = LasZipDecompressor::new(layout.reader(laz), vlr).unwrap();
    layout.each(|records| decoder.decompress_many(records).unwrap());
}

/// Encodes the records of `las` as `laz` is and leaves the outcome.
fn encode(las: &Path, laz: &Path) {
    let (layout, vlr) = (Layout::of(las), Layout::of(laz).laszip.unwrap());
    let mut reader = layout.reader(las);
    let mut encoder = LasZipCompressor::new(Nowhere::default(), vlr).unwrap();
    layout.each(|records| {
        reader.read_exact(records).unwrap();
        encoder.compress_many(records).unwrap();
    });
    encoder.done().unwrap();
}

/// Reads `from` and writes as many bytes as `like` has, to the disk: what any program must ask of
/// the system that reads the one and writes the other.
fn copy(from: &Path, like: &Path, to: &Path) {
    let mut buffer = vec![1; BLOCK];
    let mut read = File::open(from).unwrap();
    let mut write = File::create(to).unwrap();
    let mut left = fs::metadata(like).unwrap().len();
    loop {
        let held = read.read(&mut buffer).unwrap();
        let now = left.min(BLOCK as u64);
        write.write_all(&buffer[..now as usize]).unwrap();
        left -= now;
        if held == 0 && left == 0 {
            break;
        }
    }
    write.sync_all().unwrap();
}

/// User and system seconds of the children that ended.
fn children() -> [f64; 2] {
    let stat = fs::read_to_string("/proc/self/stat").unwrap();
    let behind_name = stat.rsplit_once(')').unwrap().1;
    let fields: Vec<&str> = behind_name.split_ascii_whitespace().collect();
    // Fields 16 and 17 of proc(5), in the 100th of a second that Linux tells everyone.
    [fields[13], fields[14]].map(|ticks| ticks.parse::<f64>().unwrap() / 100.0)
}

fn run(command: &mut Command) -> [f64; 2] {
    let before = children();
    let done = command.stdout(Stdio::null()).status().unwrap();
    assert!(done.success(), "{command:?}");
    let after = children();
    [after[0] - before[0], after[1] - before[1]]
}

/// Something to time.
struct Job {
    name: String,
    command: Command,
    /// What it writes; removed before it runs, so that the pages of the last are free again.
    output: Option<PathBuf>,
    /// A file that must be the same bytes.
    same: Option<PathBuf>,
    /// Jobs that bound it: decode, encode, or the system.
    bounds: Vec<usize>,
    times: Vec<[f64; 2]>,
}

impl Job {
    fn new(name: String, program: &Path, arguments: &[&dyn AsRef<std::ffi::OsStr>]) -> Job {
        let mut command = Command::new(program);
        for argument in arguments {
            command.arg(argument.as_ref());
        }
        Job { name, command, output: None, same: None, bounds: Vec::new(), times: Vec::new() }
    }

    fn median(&self, of: impl Fn(&[f64; 2]) -> f64) -> f64 {
        let mut all: Vec<f64> = self.times.iter().map(of).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    }

    fn cpu(&self) -> f64 {
        self.median(|[user, system]| user + system)
    }
}

/// The conversions: input, output.
const CONVERSIONS: [(&str, &str); 6] = [
    ("laz", "laz"),
    ("laz", "las"),
    ("las", "laz"),
    ("las", "ply"),
    ("ply", "las"),
    ("las", "las"),
];

fn convert(program: &Path, from: &Path, to: &Path, more: &[String]) -> Command {
    let mut command = Command::new(program);
    command.args(["convert", "--threads", "1", "--quiet", "--progress", "never"]);
    command.arg(from).arg("-o").arg(to).args(more);
    command
}

/// The scale and the offset of the file's coordinates, as arguments: those that PLY does not hold.
fn steps(las: &Path) -> [String; 2] {
    let mut head = [0; 179];
    File::open(las).unwrap().read_exact(&mut head).unwrap();
    let axis = |at: usize| f64::from_le_bytes(head[at..at + 8].try_into().unwrap());
    [("scale", 131), ("offset", 155)]
        .map(|(name, at)| format!("--{name}={},{},{}", axis(at), axis(at + 8), axis(at + 16)))
}

/// Reprojection of the scan that is made here, which lies in Germany: on one datum, and by an
/// operation between two.
const REPROJECTED: [(&str, &str); 2] = [("one datum", "EPSG:25833"), ("two datums", "EPSG:31467")];

/// The jobs that reproject `scan`.
fn reprojecting(folder: &Path, scan: &Path, program: &Path) -> impl Iterator<Item = Job> {
    REPROJECTED.into_iter().map(move |(name, to)| {
        let output = folder.join("reprojected.laz");
        let more = ["--crs", "EPSG:25832", "--reproject", to].map(str::to_owned);
        Job {
            command: convert(program, scan, &output, &more),
            output: Some(output),
            bounds: vec![0, 1],
            ..Job::new(format!("laz → laz, {name}"), program, &[])
        }
    })
}

/// All jobs on the files `scan.*` of `folder`.
fn jobs(folder: &Path, scan: &Path, programs: &[PathBuf]) -> Vec<Job> {
    let own = std::env::current_exe().unwrap();
    let input = |kind: &str| match kind {
        "laz" => scan.to_owned(),
        kind => folder.join(format!("scan.{kind}")),
    };
    let (las, steps) = (input("las"), steps(scan));
    let mut jobs = vec![
        Job::new("bare decode".into(), &own, &[&"--bare", &"decode", &scan]),
        Job::new("bare encode".into(), &own, &[&"--bare", &"encode", &las, &scan]),
    ];
    for (from, to) in CONVERSIONS {
        let (from_path, name) = (input(from), format!("{from} → {to}"));
        let copied = folder.join("copied");
        let arguments: [&dyn AsRef<std::ffi::OsStr>; 5] =
            [&"--bare", &"copy", &from_path, &input(to), &copied];
        let system = Job::new(format!("system {name}"), &own, &arguments);
        jobs.push(Job { output: Some(copied.clone()), ..system });
        let system = jobs.len() - 1;
        for (number, program) in programs.iter().enumerate() {
            let outcome = |number: usize| folder.join(format!("{from}-{number}.{to}"));
            let more: &[String] = if from == "ply" { &steps } else { &[] };
            let label = if number == 0 { name.clone() } else { format!("{name} (other)") };
            jobs.push(Job {
                command: convert(program, &from_path, &outcome(number), more),
                output: Some(outcome(number)),
                same: (number > 0).then(|| outcome(0)),
                bounds: match (from, to) {
                    ("laz", "laz") => vec![0, 1],
                    ("laz", _) => vec![0],
                    (_, "laz") => vec![1],
                    _ => vec![system],
                },
                ..Job::new(label, program, &[])
            });
        }
    }
    jobs
}

fn table(jobs: &[Job], points: u64) {
    println!("{:<22} {:>7} {:>7} {:>9} {:>7}", "", "CPU s", "of sys", "Mpts/s", "bound");
    for job in jobs {
        let bound: f64 = job.bounds.iter().map(|&number| jobs[number].cpu()).sum();
        let times =
            if bound > 0.0 { format!("{:.2} ×", job.cpu() / bound) } else { String::new() };
        println!(
            "{:<22} {:>7.2} {:>7.2} {:>9.2} {:>7}",
            job.name,
            job.cpu(),
            job.median(|[_, system]| *system),
            points as f64 / 1e6 / job.cpu(),
            times
        );
    }
}

fn same(one: &Path, other: &Path) -> bool {
    let (mut one, mut other) = (File::open(one).unwrap(), File::open(other).unwrap());
    let (mut a, mut b) = (Vec::new(), Vec::new());
    loop {
        a.clear();
        b.clear();
        (&mut one).take(BLOCK as u64).read_to_end(&mut a).unwrap();
        (&mut other).take(BLOCK as u64).read_to_end(&mut b).unwrap();
        if a != b || a.is_empty() {
            return a == b;
        }
    }
}

fn main() {
    // `cargo bench` passes `--bench` on.
    let arguments: Vec<PathBuf> =
        std::env::args_os().skip(1).filter(|a| a != "--bench").map(PathBuf::from).collect();
    if arguments.first().is_some_and(|a| a.as_os_str() == "--bare") {
        match arguments[1].to_str() {
            Some("decode") => decode(&arguments[2]),
            Some("encode") => encode(&arguments[2], &arguments[3]),
            _ => copy(&arguments[2], &arguments[3], &arguments[4]),
        }
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let program = PathBuf::from(env!("CARGO_BIN_EXE_pointmill"));
    let scan = arguments.first().cloned().unwrap_or_else(|| {
        let scan = folder.join("scan.laz");
        let mut synth = Command::new(&program);
        run(synth.args(["synth", "als", "-n", "10000000", "-o"]).arg(&scan));
        scan
    });
    let (las, ply) = (folder.join("scan.las"), folder.join("scan.ply"));
    run(&mut convert(&program, &scan, &las, &[]));
    run(&mut convert(&program, &las, &ply, &[]));
    let mut programs = vec![program];
    programs.extend(arguments.get(1).cloned());
    let mut jobs = jobs(folder, &scan, &programs);
    if arguments.is_empty() {
        jobs.extend(reprojecting(folder, &scan, &programs[0]));
    }
    // In turn, so that a machine that slows down slows all of them.
    for _ in 0..ROUNDS {
        for job in &mut jobs {
            if let Some(output) = &job.output {
                let _ = fs::remove_file(output);
            }
            let time = run(&mut job.command);
            job.times.push(time);
            if let (Some(one), Some(output)) = (&job.same, &job.output) {
                assert!(same(one, output), "{}: other bytes", job.name);
            }
        }
    }
    println!("{}: medians of {ROUNDS} runs in turn, one thread each", scan.display());
    table(&jobs, Layout::of(&scan).points);
}
