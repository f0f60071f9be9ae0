//! Colours, byte by byte: red from the colour before, green and blue from how red and green
//! changed.
//!
//! Source: LAZ specification 1.4, sections of RGB12 (versions 1 and 2), RGB14 and RGBNIR14.

use super::coder::Cursor;
use super::integer::Integers;
use super::model::Model;

/// Red, green and blue.
pub type Rgb = [u16; 3];

type ColorModel = Model<257, 256>;

/// Reads a colour as it is stored.
pub fn unpack(bytes: &[u8]) -> Rgb {
    let mut rgb = [0; 3];
    for (value, bytes) in rgb.iter_mut().zip(bytes.as_chunks().0) {
        *value = u16::from_le_bytes(*bytes);
    }
    rgb
}

/// Stores a colour.
#[inline(always)]
pub fn pack(rgb: Rgb, bytes: &mut [u8]) {
    for (bytes, value) in bytes.as_chunks_mut().0.iter_mut().zip(rgb) {
        *bytes = value.to_le_bytes();
    }
}

/// The decoder of version 1.
#[derive(Clone)]
pub struct FirstColor {
    changes: Model<65, 64>,
    bytes: Integers<8, 6>,
}

impl FirstColor {
    /// Nothing is learned yet.
    pub const fn new() -> Self {
        FirstColor { changes: Model::new(64), bytes: Integers::new() }
    }

    /// Reads the colour that follows `last`.
    pub fn read(&mut self, coder: &mut Cursor, last: Rgb) -> Rgb {
        let changed = coder.symbol(&mut self.changes);
        let mut bytes = last.map(u16::to_le_bytes);
        for (i, byte) in bytes.as_flattened_mut().iter_mut().enumerate() {
            if changed & (1 << i) != 0 {
                *byte = self.bytes.read(coder, i32::from(*byte), i) as u8;
            }
        }
        bytes.map(u16::from_le_bytes)
    }
}

/// The decoder of version 2 and of the layer.
#[derive(Clone)]
pub struct SecondColor {
    changes: Model<129, 128>,
    /// Lower and upper bytes of red, green and blue.
    bytes: [[ColorModel; 2]; 3],
}

impl SecondColor {
    /// Nothing is learned yet.
    pub const fn new() -> Self {
        SecondColor {
            changes: Model::new(128),
            bytes: [const { [const { Model::new(256) }; 2] }; 3],
        }
    }

    /// Reads the colour that follows `last`.
    #[inline(always)]
    pub fn read(&mut self, coder: &mut Cursor, last: Rgb) -> Rgb {
        let changed = coder.symbol(&mut self.changes);
        let [r, g, b] = last.map(u16::to_le_bytes);
        let (mut red, mut green, mut blue) = (r, g, b);
        for half in 0..2 {
            if changed & (1 << half) != 0 {
                red[half] = r[half].wrapping_add(coder.symbol(&mut self.bytes[0][half]) as u8);
            }
        }
        if changed & 64 == 0 {
            return [u16::from_le_bytes(red); 3];
        }
        for half in 0..2 {
            let moved = difference(red[half], r[half]);
            if changed & (4 << half) != 0 {
                let by = coder.symbol(&mut self.bytes[1][half]) as u8;
                green[half] = by.wrapping_add(shifted(g[half], moved));
            }
            if changed & (16 << half) != 0 {
                let moved = (moved + difference(green[half], g[half])) / 2;
                let by = coder.symbol(&mut self.bytes[2][half]) as u8;
                blue[half] = by.wrapping_add(shifted(b[half], moved));
            }
        }
        [red, green, blue].map(u16::from_le_bytes)
    }
}

fn difference(byte: u8, before: u8) -> i32 {
    i32::from(byte) - i32::from(before)
}

fn shifted(byte: u8, by: i32) -> u8 {
    (i32::from(byte) + by).clamp(0, 255) as u8
}

/// The decoder of the infrared layer.
#[derive(Clone)]
pub struct Infrared {
    changes: Model<5, 16>,
    bytes: [ColorModel; 2],
}

impl Infrared {
    /// Nothing is learned yet.
    pub const fn new() -> Self {
        Infrared { changes: Model::new(4), bytes: [const { Model::new(256) }; 2] }
    }

    /// Reads the value that follows `last`.
    #[inline(always)]
    pub fn read(&mut self, coder: &mut Cursor, last: u16) -> u16 {
        let changed = coder.symbol(&mut self.changes);
        let mut bytes = last.to_le_bytes();
        for (half, byte) in bytes.iter_mut().enumerate() {
            if changed & (1 << half) != 0 {
                *byte = byte.wrapping_add(coder.symbol(&mut self.bytes[half]) as u8);
            }
        }
        u16::from_le_bytes(bytes)
    }
}
