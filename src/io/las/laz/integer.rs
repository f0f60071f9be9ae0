//! Whole numbers, as their difference from a prediction: how many bits the difference has, then
//! where it lies among the numbers of so many bits.
//!
//! Source: LAZ specification 1.4, section "Integer compression".

use super::coder::Cursor;
use super::model::{Bit, Model};

/// Bits of a difference that have a model; those below are alike.
const HIGH: u32 = 8;

/// Numbers of `BITS` bits, predicted in `CONTEXTS` kinds of place.
#[derive(Clone)]
pub struct Integers<const BITS: usize, const CONTEXTS: usize> {
    bits: u32,
    kinds: [Model<34, 64>; CONTEXTS],
    bit: Bit,
    differences: [Model<257, 256>; BITS],
}

impl<const BITS: usize, const CONTEXTS: usize> Integers<BITS, CONTEXTS> {
    /// Nothing is learned yet.
    pub const fn new() -> Self {
        let kinds = [const { Model::new(BITS + 1) }; CONTEXTS];
        let mut differences = [const { Model::new(1 << HIGH) }; BITS];
        let mut bits = 1;
        while bits < HIGH as usize && bits <= BITS {
            differences[bits - 1] = Model::new(1 << bits);
            bits += 1;
        }
        Integers { bits: 0, kinds, bit: Bit::new(), differences }
    }

    /// Bits of the last difference: what other fields take as their kind of place.
    #[inline(always)]
    pub fn bits(&self) -> u32 {
        self.bits
    }

    /// The next number, which was predicted as `predicted` in the kind of place `context`.
    #[inline(always)]
    pub fn read(&mut self, coder: &mut Cursor, predicted: i32, context: usize) -> i32 {
        let difference = self.difference(coder, context);
        let number = predicted.wrapping_add(difference);
        if BITS >= 32 {
            return number;
        }
        let range = 1 << BITS;
        if number < 0 {
            number.wrapping_add(range)
        } else if number >= range {
            number - range
        } else {
            number
        }
    }

    #[inline(always)]
    fn difference(&mut self, coder: &mut Cursor, context: usize) -> i32 {
        let kind = &mut self.kinds[context];
        self.bits = coder.symbol(kind) as u32;
        if self.bits == 0 {
            return i32::from(coder.bit(&mut self.bit));
        }
        if self.bits >= 32 {
            return i32::MIN;
        }
        let Some(model) = self.differences.get_mut(self.bits as usize - 1) else { return i32::MIN };
        let mut at = coder.symbol(model) as u32;
        if self.bits > HIGH {
            let low = self.bits - HIGH;
            at = (at << low) | coder.bits(low);
        }
        // The lower half stands for -(2^bits - 1) to -2^(bits - 1), the upper for the same above 0.
        let half = 1u32 << (self.bits - 1);
        let below = if at < half { 2 * half } else { 0 };
        (at + 1).wrapping_sub(below) as i32
    }
}
