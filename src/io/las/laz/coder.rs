//! The arithmetic decoder: symbols from a stream of bytes.
//!
//! It never fails in the middle: what no encoder can have written and bytes that are not there are
//! kept in mind, and asked for after some points. No step depends on them for its safety: every
//! symbol is one of its model, whatever the bytes are.
//!
//! Each symbol waits for the interval that the one before left: a shift, a division, a look into a
//! table, two products. Nothing else is to stand in that way: the interval of a stream is held in a
//! [`Cursor`], which the compiler can keep in registers, and what would be a branch that nothing
//! can foresee is computed.
//!
//! Source: A. Said, HPL-2004-76, section 3, with the constants of the LAZ specification 1.4.

use super::model::{BEHIND, BIT_BITS, BITS, Bit, Model};
use super::stream::{Buffer, ByteStream, peek};

/// Shortest interval; shorter ones take in another byte.
const SHORTEST: u32 = 1 << 24;

/// Where a decoder stands: the interval that is left, the code value in it, and the next byte.
#[derive(Clone, Copy)]
struct State {
    value: u32,
    length: u32,
    next: usize,
    wrong: bool,
}

/// An arithmetic decoder and the bytes that it reads.
pub struct Coder {
    value: u32,
    length: u32,
    wrong: bool,
    bytes: ByteStream,
}

/// A decoder that is reading; see [`Coder::enter`].
pub struct Cursor<'a> {
    state: State,
    buffer: &'a Buffer,
}

/// What a [`Cursor`] leaves behind.
pub struct Left(State);

impl Coder {
    /// A decoder that has nothing to read yet.
    pub fn new(bytes: ByteStream) -> Self {
        Coder { value: 0, length: u32::MAX, wrong: false, bytes }
    }

    /// Begins with the next bytes.
    pub fn start(&mut self) {
        let mut first = [0; 4];
        self.bytes.take(&mut first);
        self.value = u32::from_be_bytes(first);
        self.length = u32::MAX;
        self.wrong = self.value == self.length;
        self.value = self.value.min(self.length - 1);
    }

    /// The bytes that it reads.
    pub fn bytes(&mut self) -> &mut ByteStream {
        &mut self.bytes
    }

    /// True if no encoder can have written what was read.
    pub fn is_wrong(&self) -> bool {
        self.wrong
    }

    /// True if an encoder can have ended here: its last bytes are determined by where its interval
    /// lies.
    pub fn is_end(&self) -> bool {
        if self.length > 2 * SHORTEST {
            (1..=SHORTEST).contains(&self.value)
        } else {
            (SHORTEST / 2 - (1 << 16) + 1..=SHORTEST / 2).contains(&self.value)
        }
    }

    /// Reads what costs `bytes` at most, a quarter of a window or less.
    #[inline(always)]
    pub fn enter(&mut self, bytes: usize) -> Cursor<'_> {
        self.bytes.ensure(bytes);
        let (buffer, next) = self.bytes.window();
        let state = State { value: self.value, length: self.length, next, wrong: self.wrong };
        Cursor { state, buffer }
    }

    /// Goes on from where a cursor stood.
    #[inline(always)]
    pub fn leave(&mut self, Left(state): Left) {
        (self.value, self.length, self.wrong) = (state.value, state.length, state.wrong);
        self.bytes.set_next(state.next);
    }
}

impl Cursor<'_> {
    /// Where it stands.
    #[inline(always)]
    pub fn left(self) -> Left {
        Left(self.state)
    }

    /// Keeps in mind that no encoder can have written what was read.
    pub fn refuse(&mut self) {
        self.state.wrong = true;
    }

    /// The next symbol of a model.
    #[inline(always)]
    pub fn symbol<const N: usize, const T: usize>(&mut self, model: &mut Model<N, T>) -> usize {
        self.state.symbol(self.buffer, model)
    }

    /// The same where it is seldom asked for, which keeps loops small.
    #[inline(always)]
    pub fn rare_symbol<const N: usize, const T: usize>(
        &mut self,
        model: &mut Model<N, T>,
    ) -> usize {
        let (state, symbol) = rare_symbol(self.state, self.buffer, model);
        self.state = state;
        symbol
    }

    /// The next bit.
    #[inline(always)]
    pub fn bit(&mut self, model: &mut Bit) -> bool {
        self.state.bit(self.buffer, model)
    }

    /// The next `count` bits, 1 to 32, all values alike.
    #[inline(always)]
    pub fn bits(&mut self, count: u32) -> u32 {
        if count > 19 {
            let low = self.state.few(self.buffer, 16);
            (self.state.few(self.buffer, count - 16) << 16) | low
        } else {
            self.state.few(self.buffer, count)
        }
    }

    /// The next 32 bits.
    #[inline(always)]
    pub fn word(&mut self) -> u32 {
        let low = self.state.few(self.buffer, 16);
        (self.state.few(self.buffer, 16) << 16) | low
    }

    /// The next 64 bits.
    #[inline(always)]
    pub fn long(&mut self) -> u64 {
        let low = self.word();
        (u64::from(self.word()) << 32) | u64::from(low)
    }
}

#[inline(never)]
fn rare_symbol<const N: usize, const T: usize>(
    mut state: State,
    buffer: &Buffer,
    model: &mut Model<N, T>,
) -> (State, usize) {
    let symbol = state.symbol(buffer, model);
    (state, symbol)
}

impl State {
    /// Lengthens an interval that is too short by the next bytes. Without a branch: when it happens
    /// cannot be foreseen.
    #[inline(always)]
    fn lengthen(&mut self, buffer: &Buffer) {
        let shift = (self.length | 1).leading_zeros() & 24;
        let both = (u64::from(self.value) << 32) | u64::from(peek(buffer, self.next));
        self.value = ((both << shift) >> 32) as u32;
        self.length <<= shift;
        self.next += (shift >> 3) as usize;
    }

    #[inline(always)]
    fn symbol<const N: usize, const T: usize>(
        &mut self,
        buffer: &Buffer,
        model: &mut Model<N, T>,
    ) -> usize {
        let unit = self.length >> BITS;
        let at = self.value.checked_div(unit).unwrap_or(0);
        // Values of the rest of the interval belong to the last symbol: the scan comes to it.
        let entry = (at >> Model::<N, T>::SHIFT) as usize & (T - 1);
        let mut symbol = usize::from(model.table[entry]);
        if symbol > N - 2 {
            symbol = 0; // No table has such an entry.
        }
        while u32::from(model.lows[symbol + 1]) <= at && symbol < N - 2 {
            symbol += 1;
        }
        let (low, next) = (model.lows[symbol], model.lows[symbol + 1]);
        let low = u32::from(low) * unit;
        let high = if next == BEHIND { self.length } else { u32::from(next) * unit };
        self.value -= low;
        self.length = high - low;
        self.lengthen(buffer);
        model.count(symbol);
        symbol
    }

    #[inline(always)]
    fn bit(&mut self, buffer: &Buffer, model: &mut Bit) -> bool {
        let zeros = model.zero * (self.length >> BIT_BITS);
        let bit = self.value >= zeros;
        let passed = if bit { zeros } else { 0 };
        self.length = if bit { self.length - zeros } else { zeros };
        self.value -= passed;
        self.lengthen(buffer);
        model.count(bit);
        bit
    }

    #[inline(always)]
    fn few(&mut self, buffer: &Buffer, count: u32) -> u32 {
        self.length >>= count;
        let mut value = self.value.checked_div(self.length).unwrap_or(0);
        if value >> count != 0 {
            // The interval has a rest that no encoder uses.
            self.wrong = true;
            value = (1 << count) - 1;
            self.value = value * self.length;
        }
        self.value -= value * self.length;
        self.lengthen(buffer);
        value
    }
}
