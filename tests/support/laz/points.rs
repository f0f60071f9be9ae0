//! Made-up records: as scanners make them, as nobody makes them, and as an encoder has most trouble with.

use super::super::las_file::STRIDES;
use super::super::random::Random;
use super::{Chunks, Recipe};

/// What records are like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Small steps, most fields as they were.
    Walk,
    /// Every byte at random.
    Noise,
    /// Walks, noise and the extremes of all fields by turns.
    Mixed,
    /// Fields that never change beside coordinates that do.
    Constant,
}

/// Where fields begin in a record of a format.
struct Places {
    format: u8,
    time: Option<usize>,
    beside: usize,
    end: usize,
}

impl Places {
    fn of(format: u8) -> Self {
        let time = match format {
            0 | 2 => None,
            6.. => Some(22),
            _ => Some(20),
        };
        let beside = time.map_or(20, |at| at + 8);
        Places { format, time, beside, end: STRIDES[usize::from(format)] }
    }

    /// Kinds of place before the time: byte and width of numbers that change by steps.
    fn numbers(&self) -> &'static [(usize, usize)] {
        match self.format {
            0..6 => &[(0, 4), (4, 4), (8, 4), (12, 2), (16, 1), (17, 1), (18, 2)],
            _ => &[(0, 4), (4, 4), (8, 4), (12, 2), (16, 1), (17, 1), (18, 2), (20, 2)],
        }
    }
}

fn number(record: &[u8], at: usize, width: usize) -> u64 {
    record[at..at + width].iter().rev().fold(0, |all, &byte| (all << 8) | u64::from(byte))
}

fn put_number(record: &mut [u8], at: usize, width: usize, value: u64) {
    record[at..at + width].copy_from_slice(&value.to_le_bytes()[..width]);
}

/// Makes records one after the other.
pub struct Maker {
    places: Places,
    random: Random,
    /// The record before.
    record: Vec<u8>,
    /// Pairs of return number and number of returns, still to be shown.
    returns: Vec<u8>,
    /// Times that sequences go on from, and their steps.
    times: [(i64, i64); 5],
}

impl Maker {
    pub fn new(recipe: &Recipe, seed: u64) -> Self {
        let mut random = Random(seed);
        let record = random.bytes(recipe.stride());
        let places = Places::of(recipe.format);
        let mut times = [(0, 0); 5];
        for (i, time) in times.iter_mut().enumerate() {
            *time = ((1e5 + 3e8 * i as f64).to_bits() as i64, 1000 + random.below(100_000) as i64);
        }
        let mut maker = Maker { places, random, record, returns: Vec::new(), times };
        maker.mend_time();
        maker
    }

    /// So many records of a kind.
    pub fn records(&mut self, kind: Kind, points: usize) -> Vec<u8> {
        let mut all = Vec::with_capacity(points * self.record.len());
        for i in 0..points {
            match kind {
                Kind::Walk => self.walk(),
                Kind::Noise => self.noise(),
                Kind::Constant => self.shift(),
                Kind::Mixed => match (i / 40 + self.random.below(2)) % 4 {
                    0 | 1 => self.walk(),
                    2 => self.noise(),
                    _ => self.extreme(),
                },
            }
            all.extend_from_slice(&self.record);
        }
        all
    }

    /// Coordinates alone change.
    fn shift(&mut self) {
        for at in [0, 4, 8] {
            let by = self.random.below(20) as u64;
            let value = number(&self.record, at, 4).wrapping_add(by);
            put_number(&mut self.record, at, 4, value);
        }
    }

    fn walk(&mut self) {
        self.shift();
        if self.random.one_in(3) {
            let (at, width) = self.random.one_of(self.places.numbers());
            let by = (self.random.below(9) as u64).wrapping_sub(4);
            let value = number(&self.record, at, width).wrapping_add(by);
            put_number(&mut self.record, at, width, value);
        }
        if self.random.one_in(2) {
            self.next_returns();
        }
        if self.random.one_in(5) {
            self.record[15] = self.record[15] & 0x0f | (self.random.number() as u8 & 0xf0);
        }
        if self.random.one_in(2) {
            self.next_time();
        }
        let behind = self.record.len() - self.places.beside;
        for _ in 0..self.random.below(4).min(behind) {
            let at = self.places.beside + self.random.below(behind);
            self.record[at] = self.record[at].wrapping_add(self.random.below(5) as u8);
        }
        if self.places.end > self.places.beside && self.random.one_in(2) {
            // Grey colours, and packets that follow each other.
            let grey = self.record[self.places.beside..self.places.beside + 2].to_vec();
            self.record[self.places.beside + 2..self.places.beside + 6]
                .copy_from_slice(&grey.repeat(2));
        }
        self.next_packet();
    }

    fn noise(&mut self) {
        self.record = self.random.bytes(self.record.len());
        self.mend_time();
    }

    fn extreme(&mut self) {
        for &(at, width) in self.places.numbers() {
            const ENDS: [u64; 8] =
                [0, 1, u64::MAX, 0x7f, 0x80, 0x7fff_8000, 0x7fff_ffff, 0x8000_0000];
            let end = self.random.one_of(&ENDS);
            put_number(&mut self.record, at, width, end);
        }
        self.next_returns();
        self.record[15] = self.random.one_of(&[0, 0xff, 0x30, 0xcf]);
        self.next_time();
        let fill = self.random.one_of(&[0, 1, 0x7f, 0x80, 0xff]);
        self.record[self.places.beside..].fill(fill);
    }

    /// Another combination of return number and number of returns, all of them by and by.
    fn next_returns(&mut self) {
        if self.returns.is_empty() {
            self.returns = (0..=255).collect();
            for i in (1..256).rev() {
                self.returns.swap(i, self.random.below(i + 1));
            }
        }
        self.record[14] = self.returns.pop().unwrap();
    }

    /// A time as one of several sequences has it next, or one that is none.
    fn next_time(&mut self) {
        const ODD: [f64; 10] = [
            0.0,
            1.0,
            -1e300,
            1e300,
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MIN_POSITIVE,
            3e8,
            -3e8,
        ];
        let Some(at) = self.places.time else { return };
        let sequence = self.random.below(self.times.len());
        let by: i64 = match self.random.below(12) {
            0 => 0,
            1 => self.random.below(600) as i64,
            2 => -(self.random.below(12) as i64),
            3 => 1 << 40,
            4 => self.random.number() as i64 >> 20,
            _ => 1,
        };
        let (time, step) = &mut self.times[sequence];
        *time = time.wrapping_add(step.wrapping_mul(by)).wrapping_add(self.random.below(3) as i64);
        if self.random.one_in(40) {
            *step = self.random.number() as i64 >> (24 + self.random.below(40));
        }
        let mut bits = self.times[sequence].0 as u64;
        if self.random.one_in(30) {
            bits = self.random.one_of(&ODD).to_bits() ^ self.random.below(2) as u64;
        }
        put_number(&mut self.record, at, 8, bits);
        self.mend_time();
    }

    /// The encoder of formats 6 to 10 compares times as numbers: -0.0 is no change after 0.0.
    fn mend_time(&mut self) {
        if let Some(at) = self.places.time
            && number(&self.record, at, 8) == (-0.0f64).to_bits()
            && self.places.format >= 6
        {
            put_number(&mut self.record, at, 8, 0);
        }
    }

    /// A waveform packet behind the one before, mostly.
    fn next_packet(&mut self) {
        if !matches!(self.places.format, 4 | 5 | 9 | 10) {
            return;
        }
        let at = self.places.end - 29;
        let (offset, size) = (number(&self.record, at + 1, 8), number(&self.record, at + 9, 4));
        let next = match self.random.below(6) {
            0 => offset,
            1 => offset.wrapping_add(self.random.below(5000) as u64),
            2 if self.random.one_in(8) => self.random.number(),
            _ => offset.wrapping_add(size),
        };
        put_number(&mut self.record, at + 1, 8, next);
    }
}

/// Chunks in all ways that a format can have them.
pub fn ways(format: u8, random: &mut Random, points: usize) -> Vec<Chunks> {
    let mut sizes = vec![1];
    while sizes.iter().sum::<usize>() < points {
        sizes.push(match random.below(8) {
            0 => 1,
            1 | 2 => 127 + random.below(4),
            _ => 1 + random.below(300),
        });
    }
    let fixed = if points < 50 { 1 } else { random.one_of(&[7, 128, 129, 500]) };
    let mut all = vec![Chunks::Fixed(50_000), Chunks::Fixed(fixed), Chunks::Varying(sizes)];
    if format < 6 {
        all.push(Chunks::None);
    }
    all
}
