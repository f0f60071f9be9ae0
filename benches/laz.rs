//! The decoder of compressed points beside the `laz` crate, on the same file, in turn: CPU time of this
//! thread a point, and whether the bytes are the same.
//!
//! `cargo bench --bench laz -- SCAN.laz …`; with one scan and `pointmill` or `crate`, that one alone, once,
//! as a line of JSON.
//! `cargo bench --bench laz -- SCAN.laz layers` tells what each layer of formats 6 to 10 costs: the time of
//! the points without anything but x, y, returns and z, and what each other layer adds to that. With the
//! name of a dimension in the place of `layers`, that layer alone beside those, as a line of JSON: for a
//! profiler that counts instructions.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints and may fail")]

use std::fs::{self, File};
use std::io::{BufReader, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use laz::{LasZipDecompressor, LazVlr};
use pointmill::io::las;
use pointmill::point::PointBatch;

/// Times that each decodes a file; medians are told.
const ROUNDS: usize = 5;
/// Records that are decoded at once.
const AT_ONCE: usize = 4096;

/// CPU seconds of this thread.
fn cpu() -> f64 {
    let text = fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    text.split(' ').next().unwrap().parse::<f64>().unwrap() / 1e9
}

fn hash(sum: u64, bytes: &[u8]) -> u64 {
    let (words, rest) = bytes.as_chunks();
    let word = |sum: u64, word: &[u8; 8]| {
        (sum.rotate_left(5) ^ u64::from_le_bytes(*word)).wrapping_mul(0x517c_c1b7_2722_0a95)
    };
    let sum = words.iter().fold(sum, word);
    rest.iter().fold(sum, |sum, &byte| (sum.rotate_left(5) ^ u64::from(byte)).wrapping_mul(0x51ed))
}

/// CPU seconds, points and a checksum of the records.
type Run = (f64, u64, u64);

fn ours(path: &Path, checked: bool) -> Run {
    without(path, checked, |_| false)
}

/// The same without the dimensions that `unread` says.
fn without(path: &Path, checked: bool, unread: impl Fn(&str) -> bool) -> Run {
    let start = cpu();
    let source = las::open(&[path.to_owned()]).unwrap();
    let names = source.schema().dimensions.iter().map(|dimension| dimension.name.clone());
    let unread: Vec<String> = names.filter(|name| unread(name)).collect();
    let mut batch = PointBatch::new(source.schema().clone(), AT_ONCE);
    let (mut points, mut sum) = (0, 0);
    for part in 0..source.parts() {
        let mut part = source.part_without(part, &unread).unwrap();
        loop {
            part.read(&mut batch).unwrap();
            if batch.is_empty() {
                break;
            }
            points += batch.len() as u64;
            if checked {
                for record in batch.records().chunks_exact(source.schema().stride) {
                    sum = hash(sum, record);
                }
            }
        }
    }
    (cpu() - start, points, sum)
}

fn theirs(path: &Path, checked: bool) -> Run {
    let start = cpu();
    let bytes = fs::read(path).unwrap();
    let number = |at: usize, bytes_: usize| {
        let field = bytes[at..at + bytes_].iter().rev();
        field.fold(0u64, |all, &byte| all << 8 | u64::from(byte))
    };
    let mut at = number(94, 2) as usize;
    let mut laszip = None;
    for _ in 0..number(100, 4) {
        let payload = at + 54..at + 54 + number(at + 20, 2) as usize;
        if number(at + 18, 2) == u64::from(LazVlr::RECORD_ID) {
            laszip = Some(LazVlr::from_buffer(&bytes[payload.clone()]).unwrap());
        }
        at = payload.end;
    }
    let points = if number(25, 1) == 4 { number(247, 8) } else { number(107, 4) };
    let stride = number(105, 2) as usize;
    let points_start = number(96, 4);
    drop(bytes);
    let mut reader = BufReader::with_capacity(1 << 20, File::open(path).unwrap());
    reader.seek(SeekFrom::Start(points_start)).unwrap();
    let mut decoder = LasZipDecompressor::new(reader, laszip.unwrap()).unwrap();
    let mut buffer = vec![0; AT_ONCE * stride];
    let (mut left, mut sum) = (points, 0);
    while left > 0 {
        let now = left.min(AT_ONCE as u64);
        let records = &mut buffer[..now as usize * stride];
        decoder.decompress_many(records).unwrap();
        if checked {
            for record in records.chunks_exact(stride) {
                sum = hash(sum, record);
            }
        }
        left -= now;
    }
    (cpu() - start, points, sum)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Dimensions that are read whatever else is: those of the layer that all others need, and heights.
fn always(name: &str) -> bool {
    const OTHERS: [&str; 4] = ["X", "Y", "Z", "ReturnNumber"];
    OTHERS.contains(&name) || name == "NumberOfReturns"
}

/// What each layer of a file costs.
fn by_layer(path: &Path) {
    const LAYERS: [&str; 11] = [
        "Classification",
        "Withheld",
        "Intensity",
        "ScanAngle",
        "UserData",
        "PointSourceId",
        "GpsTime",
        "Red",
        "NIR",
        "WavePacketIndex",
        "*",
    ];
    let source = las::open(&[path.to_owned()]).unwrap();
    let has = |layer: &&&str| **layer == "*" || source.schema().find(layer).is_some();
    let layers: Vec<&str> = LAYERS.iter().filter(has).copied().collect();
    let mut times = vec![Vec::new(); layers.len() + 1];
    let mut points = 1;
    for _ in 0..ROUNDS {
        let (seconds, read, _) = without(path, false, |name| !always(name));
        points = read.max(1);
        times[0].push(seconds);
        for (layer, times) in layers.iter().zip(&mut times[1..]) {
            let all = *layer == "*";
            times.push(without(path, false, |name| !all && !always(name) && name != *layer).0);
        }
    }
    let mut each = times.into_iter().map(|times| median(times) * 1e9 / points as f64);
    let least = each.next().unwrap();
    println!("| layer | ns a point |\n|---|--:|\n| x, y, returns, z | {least:.1} |");
    for (layer, time) in layers.iter().zip(each) {
        match *layer {
            "*" => println!("| all | {time:.1} |"),
            layer => println!("| {layer} | + {:.1} |", time - least),
        }
    }
}

/// One decoder alone, as a line of JSON.
fn alone(path: &Path, decode: impl Fn(&Path, bool) -> Run) {
    let start = std::time::Instant::now();
    let (seconds, points, _) = decode(path, false);
    let wall = start.elapsed().as_secs_f64();
    println!("{{\"cpu_seconds\": {seconds}, \"wall_seconds\": {wall}, \"kept\": {points}}}");
}

fn main() {
    let paths: Vec<PathBuf> =
        std::env::args_os().skip(1).filter(|a| a != "--bench").map(PathBuf::from).collect();
    match &paths[..] {
        [path, which] if which.as_os_str() == "pointmill" => return alone(path, ours),
        [path, which] if which.as_os_str() == "crate" => return alone(path, theirs),
        [path, which] if which.as_os_str() == "layers" => return by_layer(path),
        [path, layer] if !layer.exists() => {
            let unread = |name: &str| !always(name) && layer.as_os_str() != name;
            return alone(path, |path, checked| without(path, checked, unread));
        }
        _ => {}
    }
    println!("| file | points | ns a point | laz crate | ratio | same |");
    println!("|---|--:|--:|--:|--:|---|");
    for path in &paths {
        let (a, b) = (ours(path, true), theirs(path, true));
        let same = if (a.1, a.2) == (b.1, b.2) { "yes" } else { "NO" };
        let points = a.1.max(1);
        let rounds = if points > 100_000 { ROUNDS } else { 1 };
        let (mut own, mut other) = (Vec::new(), Vec::new());
        for _ in 0..rounds {
            own.push(ours(path, false).0);
            other.push(theirs(path, false).0);
        }
        let each = |seconds: f64| seconds * 1e9 / points as f64;
        let (own, other) = (each(median(own)), each(median(other)));
        let name = path.file_name().unwrap().display();
        println!("| {name} | {points} | {own:.1} | {other:.1} | {:.2} | {same} |", other / own);
    }
}
