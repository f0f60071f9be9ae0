//! Damage to the compressed points of a file, and what reading it comes to.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use pointmill::io::las::open;
use pointmill::point::PointBatch;
use pointmill::{Error, ErrorKind, Result};

use super::super::las_file::STRIDES;
use super::super::random::Random;
use super::read_file;

/// Time that reading a file may take.
const MOST_TIME: Duration = Duration::from_secs(20);
/// Bytes at the end of a stream that are told apart.
const LAST: usize = 8;

/// A kind of damage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Harm {
    /// One bit is another.
    Flip,
    /// One byte is another.
    Byte,
    /// 4 bytes to 4 KiB are equal: zeros, ones or 0x55.
    Hole,
}

impl Harm {
    /// Every kind.
    pub const ALL: [Harm; 3] = [Harm::Flip, Harm::Byte, Harm::Hole];

    /// Harms `bytes`; the stretch that was harmed.
    fn harm(self, random: &mut Random, bytes: &mut [u8]) -> (usize, usize) {
        let at = random.below(bytes.len());
        match self {
            Harm::Flip => bytes[at] ^= 1 << random.below(8),
            Harm::Byte => bytes[at] ^= 1 + random.below(255) as u8,
            Harm::Hole => {
                let length = (4 << random.below(10)) + random.below(1 << 11);
                let length = length.min(1 << (2 + random.below(11))).min(bytes.len());
                let at = random.below(bytes.len() - length + 1);
                bytes[at..at + length].fill([0x00, 0xff, 0x55][random.below(3)]);
                return (at, length);
            }
        }
        (at, 1)
    }
}

/// What reading a damaged file came to.
#[derive(Debug)]
pub enum Outcome {
    /// The records are what they were.
    Harmless,
    /// An error.
    Found(Error),
    /// Other records, which contradict the header, or a warning.
    Contradicted,
    /// Other records and no word of it: how many, and which is the first.
    Untold { at: usize, others: usize, first: usize },
}

/// A file to be harmed, again and again.
pub struct Victim {
    pub path: PathBuf,
    file: File,
    whole: Vec<u8>,
    records: Vec<u8>,
    stride: usize,
    format: u8,
    /// Where its compressed points are.
    start: usize,
    end: usize,
}

fn number(bytes: &[u8], at: usize, size: usize) -> usize {
    let field = bytes[at..at + size].iter().rev();
    field.fold(0, |all, &byte| (all << 8) | usize::from(byte))
}

impl Victim {
    /// Of a sound file.
    pub fn new(path: &Path) -> Self {
        let whole = std::fs::read(path).unwrap();
        let records = read_file(path, 4096).unwrap();
        let points = number(&whole, 96, 4);
        let laszip = whole.windows(14).position(|w| w == b"laszip encoded").unwrap();
        let point_wise = number(&whole, laszip + 52, 2) == 1;
        let (start, end) = if point_wise {
            (points, whole.len())
        } else {
            (points + 8, number(&whole, points, 8))
        };
        let file = OpenOptions::new().write(true).open(path).unwrap();
        let (stride, format) = (number(&whole, 105, 2), whole[104] & 0x3f);
        let victim =
            Victim { path: path.to_owned(), file, whole, records, stride, format, start, end };
        assert_eq!(victim.read().unwrap(), (0, usize::MAX, false), "a sound file tells nothing");
        victim
    }

    /// Bytes of its compressed points.
    pub fn bytes(&self) -> usize {
        self.end - self.start
    }

    /// Points that it holds.
    pub fn points(&self) -> usize {
        self.records.len() / self.stride
    }

    /// Harms it, reads it, and heals it. Panics if reading takes too long, or fails otherwise than it may.
    pub fn suffer(&self, harm: Harm, random: &mut Random) -> Outcome {
        let mut bytes = self.whole[self.start..self.end].to_vec();
        let (at, length) = harm.harm(random, &mut bytes);
        let place = (self.start + at) as u64;
        self.file.write_all_at(&bytes[at..at + length], place).unwrap();
        let begun = Instant::now();
        let outcome = self.read();
        let what = format!("{}: {length} bytes at {place}, {harm:?}", self.path.display());
        assert!(begun.elapsed() < MOST_TIME, "{what}: reading takes {:?}", begun.elapsed());
        let healed = &self.whole[self.start + at..self.start + at + length];
        self.file.write_all_at(healed, place).unwrap();
        match outcome {
            Ok((0, ..)) => Outcome::Harmless,
            Ok((.., true)) => Outcome::Contradicted,
            Ok((others, first, _)) => Outcome::Untold { at, others, first },
            Err(error) => {
                let text = error.to_string();
                let names_it = error.path() == Some(&self.path) && error.byte().is_some();
                assert!(error.kind() == ErrorKind::Data && names_it, "{what}: {error:?}");
                assert!(text.contains("chunk"), "{what}: {error:?}");
                Outcome::Found(error)
            }
        }
    }

    /// Records that differ, the first of them, and whether something else tells that.
    fn read(&self) -> Result<(usize, usize, bool)> {
        let source = open(std::slice::from_ref(&self.path))?;
        let mut batch = PointBatch::new(source.schema().clone(), 4096);
        let (mut at, mut others, mut first) = (0, 0, usize::MAX);
        for index in 0..source.parts() {
            let mut part = source.part(index)?;
            loop {
                part.read(&mut batch)?;
                if batch.is_empty() {
                    break;
                }
                let right = self.records.get(at..at + batch.records().len()).unwrap_or_default();
                if batch.records() != right {
                    let both = batch.records().chunks(self.stride).zip(right.chunks(self.stride));
                    for (i, _) in both.enumerate().filter(|(_, (ours, right))| ours != right) {
                        others += 1;
                        first = first.min(at / self.stride + i);
                    }
                }
                at += batch.records().len();
            }
        }
        if at != self.records.len() {
            others += self.records.len().abs_diff(at) / self.stride;
        }
        let told = !source.warnings().is_empty() || !source.contradictions().is_empty();
        Ok((others, first, told))
    }

    /// What lies at a byte of the first chunk.
    pub fn place(&self, at: usize) -> String {
        let chunk = &self.whole[self.start..self.end];
        if at < self.stride {
            return "the first record".to_owned();
        }
        let near = |what: &str, end: usize| {
            if at + LAST >= end { format!("the last {LAST} bytes of {what}") } else { what.into() }
        };
        const FIELDS: [usize; 11] = [0, 0, 0, 0, 0, 0, 9, 10, 11, 10, 12];
        const NAMES: [&str; 9] =
            ["x, y", "z", "class", "flags", "intensity", "angle", "user", "source", "time"];
        let format = usize::from(self.format);
        if format < 6 {
            return near("the stream", self.end - self.start);
        }
        let layers = FIELDS[format] + self.stride - STRIDES[format];
        let mut end = self.stride + 4 + 4 * layers;
        if at < end {
            return "the lengths of the layers".to_owned();
        }
        for layer in 0..layers {
            end += number(chunk, self.stride + 4 + 4 * layer, 4);
            if at < end {
                return near(NAMES.get(layer).unwrap_or(&"others"), end);
            }
        }
        "behind the first chunk".to_owned()
    }
}

/// How often which outcome there was.
#[derive(Debug, Default)]
pub struct Tally {
    pub harmless: usize,
    pub found: usize,
    pub contradicted: usize,
    pub untold: usize,
    /// Places of the damage that was not told.
    pub places: BTreeMap<String, usize>,
}

impl Tally {
    /// Harms a file so many times.
    pub fn of(victim: &Victim, harm: Harm, times: usize, seed: u64) -> Self {
        let (mut tally, mut random) = (Tally::default(), Random(seed));
        for _ in 0..times {
            match victim.suffer(harm, &mut random) {
                Outcome::Harmless => tally.harmless += 1,
                Outcome::Found(_) => tally.found += 1,
                Outcome::Contradicted => tally.contradicted += 1,
                Outcome::Untold { at, others, first } => {
                    tally.untold += 1;
                    let spread = if others == 1 { "one record" } else { "records" };
                    let whole = if first == 0 { " from the first on" } else { "" };
                    let place = format!("{}: {spread}{whole}", victim.place(at));
                    *tally.places.entry(place).or_default() += 1;
                }
            }
        }
        tally
    }

    /// Share of the harm that an error tells.
    pub fn share(&self) -> f64 {
        let harmed = self.found + self.contradicted + self.untold;
        if harmed == 0 { 1.0 } else { self.found as f64 / harmed as f64 }
    }
}
