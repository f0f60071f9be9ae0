//! Where the waveform of a return is.
//!
//! Source: LAZ specification 1.4, sections of WAVEPACKET13 and WAVEPACKET14.

use super::coder::Cursor;
use super::integer::Integers;
use super::model::Model;

/// Bytes of the fields.
pub const SIZE: usize = 29;

/// The fields as numbers: those that are floats by their bits.
#[derive(Clone, Copy, Default)]
pub struct Packet {
    descriptor: u8,
    offset: u64,
    size: i32,
    place: i32,
    direction: [i32; 3],
}

impl Packet {
    /// Reads the fields as they are stored.
    pub fn unpack(bytes: &[u8; SIZE]) -> Self {
        let int = |at: usize| {
            i32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
        };
        let offset = (u64::from(int(5) as u32) << 32) | u64::from(int(1) as u32);
        Packet {
            descriptor: bytes[0],
            offset,
            size: int(9),
            place: int(13),
            direction: [int(17), int(21), int(25)],
        }
    }

    /// Stores the fields.
    pub fn pack(&self, bytes: &mut [u8; SIZE]) {
        bytes[0] = self.descriptor;
        bytes[1..9].copy_from_slice(&self.offset.to_le_bytes());
        bytes[9..13].copy_from_slice(&self.size.to_le_bytes());
        bytes[13..17].copy_from_slice(&self.place.to_le_bytes());
        for (bytes, value) in bytes[17..].as_chunks_mut().0.iter_mut().zip(self.direction) {
            *bytes = value.to_le_bytes();
        }
    }
}

/// The decoder of these fields.
#[derive(Clone)]
pub struct Waves {
    descriptors: Model<257, 256>,
    kinds: [Model<5, 16>; 4],
    kind: usize,
    step: i32,
    steps: Integers<32, 1>,
    sizes: Integers<32, 1>,
    places: Integers<32, 1>,
    directions: Integers<32, 3>,
}

impl Waves {
    /// Nothing is learned yet.
    pub const fn new() -> Self {
        Waves {
            descriptors: Model::new(256),
            kinds: [const { Model::new(4) }; 4],
            kind: 0,
            step: 0,
            steps: Integers::new(),
            sizes: Integers::new(),
            places: Integers::new(),
            directions: Integers::new(),
        }
    }

    /// Reads what follows `last`.
    pub fn read(&mut self, coder: &mut Cursor, last: &Packet) -> Packet {
        let mut packet = *last;
        packet.descriptor = coder.symbol(&mut self.descriptors) as u8;
        self.kind = coder.symbol(&mut self.kinds[self.kind & 3]);
        match self.kind {
            0 => {}
            1 => packet.offset = last.offset.wrapping_add(u64::from(last.size as u32)),
            2 => {
                self.step = self.steps.read(coder, self.step, 0);
                packet.offset = last.offset.wrapping_add_signed(i64::from(self.step));
            }
            _ => packet.offset = coder.long(),
        }
        packet.size = self.sizes.read(coder, last.size, 0);
        packet.place = self.places.read(coder, last.place, 0);
        for (i, value) in packet.direction.iter_mut().enumerate() {
            *value = self.directions.read(coder, *value, i);
        }
        packet
    }
}
