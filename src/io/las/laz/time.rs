//! GPS times: differences between their bits as whole numbers, as multiples of the difference
//! before, in up to four sequences at once.
//!
//! Source: LAZ specification 1.4, sections of GPSTIME11 (versions 1 and 2) and of the GPS time
//! layer.

use super::coder::Cursor;
use super::integer::Integers;
use super::model::Model;

/// A multiplier this large, and more, is told as this.
const MOST: i32 = 500;
/// The same of negative ones.
const LEAST: i32 = -10;
/// Number of symbols for multipliers from 0 to [`MOST`] and from -1 to [`LEAST`].
const MULTIPLIERS: usize = (MOST - LEAST) as usize + 1;
/// Multipliers of another size in a row after which the difference is taken to have changed.
const PATIENCE: u8 = 3;

/// Which symbols mean what: layers have none for a time that did not change.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum TimeForm {
    /// Among other fields, version 2.
    Item,
    /// A layer.
    Layer,
}

/// Times from up to four sequences.
#[derive(Clone)]
pub struct Times {
    multiples: Model<518, 256>,
    kinds: Model<7, 16>,
    integers: Integers<32, 9>,
    now: usize,
    newest: usize,
    times: [i64; 4],
    differences: [i32; 4],
    extremes: [u8; 4],
}

impl Times {
    const ITEM: Times = Times::new(MULTIPLIERS + 5, 6);
    const LAYER: Times = Times::new(MULTIPLIERS + 4, 5);

    const fn new(multiples: usize, kinds: usize) -> Self {
        Times {
            multiples: Model::new(multiples),
            kinds: Model::new(kinds),
            integers: Integers::new(),
            now: 0,
            newest: 0,
            times: [0; 4],
            differences: [0; 4],
            extremes: [0; 4],
        }
    }

    /// Begins with a time.
    pub fn begin(kind: TimeForm, first: i64) -> Box<Self> {
        static ITEM: Times = Times::ITEM;
        static LAYER: Times = Times::LAYER;
        let mut times = Box::new(if kind == TimeForm::Item { ITEM.clone() } else { LAYER.clone() });
        times.times[0] = first;
        times
    }

    /// The next time of a layer, where it changed.
    #[inline(always)]
    pub fn read(&mut self, coder: &mut Cursor, kind: TimeForm) -> i64 {
        // One symbol may say that the next is of another sequence, and no encoder says so twice.
        if !self.step(coder, kind) && !self.step(coder, kind) {
            coder.refuse();
        }
        self.times[self.now]
    }

    /// False if only the sequence was changed.
    #[inline(always)]
    fn step(&mut self, coder: &mut Cursor, kind: TimeForm) -> bool {
        // The symbols of a layer are those of an item without the one for a time that did not
        // change.
        let skipped = usize::from(kind == TimeForm::Layer);
        if self.differences[self.now] == 0 {
            match coder.symbol(&mut self.kinds) + skipped {
                0 => {}
                1 => self.near(coder),
                2 => self.apart(coder),
                symbol => return self.change(symbol - 2),
            }
            return true;
        }
        let symbol = coder.symbol(&mut self.multiples);
        if symbol < MULTIPLIERS {
            self.multiple(coder, symbol as i32);
            return true;
        }
        match symbol - MULTIPLIERS + skipped {
            0 => {}
            1 => self.apart(coder),
            symbol => return self.change(symbol - 1),
        }
        true
    }

    /// Goes on with another sequence.
    fn change(&mut self, by: usize) -> bool {
        self.now = (self.now + by) & 3;
        false
    }

    /// A time whose sequence has no difference yet.
    fn near(&mut self, coder: &mut Cursor) {
        let difference = self.integers.read(coder, 0, 0);
        self.differences[self.now] = difference;
        self.times[self.now] = self.times[self.now].wrapping_add(i64::from(difference));
        self.extremes[self.now] = 0;
    }

    /// A time too far from all sequences begins one.
    #[cold]
    fn apart(&mut self, coder: &mut Cursor) {
        let upper = self.integers.read(coder, (self.times[self.now] >> 32) as i32, 8);
        let lower = coder.word();
        self.newest = (self.newest + 1) & 3;
        self.now = self.newest;
        self.times[self.now] = (i64::from(upper) << 32) | i64::from(lower);
        self.differences[self.now] = 0;
        self.extremes[self.now] = 0;
    }

    /// A time whose difference is about a multiple of the last.
    #[inline(always)]
    fn multiple(&mut self, coder: &mut Cursor, symbol: i32) {
        let now = self.now;
        let last = self.differences[now];
        let (multiplier, context) = match symbol {
            1 => (1, 1),
            0 => (0, 7),
            2..10 => (symbol, 2),
            10..MOST => (symbol, 3),
            MOST => (MOST, 4),
            _ if MOST - symbol > LEAST => (MOST - symbol, 5),
            _ => (LEAST, 6),
        };
        let predicted = multiplier.wrapping_mul(last);
        let difference = self.integers.read(coder, predicted, context);
        self.times[now] = self.times[now].wrapping_add(i64::from(difference));
        match context {
            1 => self.extremes[now] = 0,
            4 | 6 | 7 => {
                self.extremes[now] += 1;
                if self.extremes[now] > PATIENCE {
                    self.differences[now] = difference;
                    self.extremes[now] = 0;
                }
            }
            _ => {}
        }
    }
}

/// The decoder of version 1: one sequence.
pub struct FirstTime {
    multiples: Model<513, 256>,
    kinds: Model<4, 16>,
    integers: Integers<32, 6>,
    time: i64,
    difference: i32,
    extremes: u8,
}

impl FirstTime {
    /// Multiplier of a time that is far, and of one that did not change, where there is a
    /// difference.
    const FAR: usize = 510;

    /// Nothing is learned yet.
    pub fn new() -> Box<Self> {
        Box::new(FirstTime {
            multiples: const { Model::new(512) },
            kinds: const { Model::new(3) },
            integers: const { Integers::new() },
            time: 0,
            difference: 0,
            extremes: 0,
        })
    }

    /// Begins with a time.
    pub fn begin(&mut self, first: i64) {
        self.time = first;
    }

    /// The next time.
    #[inline(always)]
    pub fn read(&mut self, coder: &mut Cursor) -> i64 {
        if self.difference == 0 {
            match coder.symbol(&mut self.kinds) {
                0 => {}
                1 => {
                    self.difference = self.integers.read(coder, 0, 0);
                    self.time = self.time.wrapping_add(i64::from(self.difference));
                }
                _ => self.time = coder.long() as i64,
            }
            return self.time;
        }
        match coder.symbol(&mut self.multiples) {
            Self::FAR => self.time = coder.long() as i64,
            symbol if symbol < Self::FAR => self.multiple(coder, symbol as i32),
            _ => {}
        }
        self.time
    }

    #[inline(always)]
    fn multiple(&mut self, coder: &mut Cursor, symbol: i32) {
        let last = self.difference;
        let (predicted, context) = match symbol {
            1 => (last, 1),
            0 => (last / 4, 2),
            2..10 => (symbol.wrapping_mul(last), 3),
            10..50 => (symbol.wrapping_mul(last), 4),
            _ => (symbol.wrapping_mul(last), 5),
        };
        let difference = self.integers.read(coder, predicted, context);
        self.time = self.time.wrapping_add(i64::from(difference));
        if symbol == 1 {
            self.difference = difference;
            self.extremes = 0;
        } else if symbol == 0 || symbol == Self::FAR as i32 - 1 {
            self.extremes += 1;
            if self.extremes > PATIENCE {
                self.difference = difference;
                self.extremes = 0;
            }
        }
    }
}
