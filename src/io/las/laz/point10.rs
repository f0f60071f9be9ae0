//! Points of formats 0 to 5, among the other fields of a record.
//!
//! Source: LAZ specification 1.4, sections of POINT10 (versions 1 and 2).

use super::coder::Cursor;
use super::integer::Integers;
use super::model::{Model, learned};
use super::predict::{RETURNS, RunningMedian, level};

/// Bytes of the fields.
pub const SIZE: usize = 20;

type ByteModel = Model<257, 256>;
type ByteModels = [Option<Box<ByteModel>>; 256];

/// Where bytes are in a record.
mod at {
    pub const RETURNS: usize = 14;
    pub const CLASS: usize = 15;
    pub const ANGLE: usize = 16;
    pub const USER: usize = 17;
}

/// The point before, as it is stored.
#[derive(Clone, Copy)]
struct Last {
    position: [i32; 3],
    intensity: u16,
    source: u16,
    bytes: [u8; SIZE],
}

impl Last {
    const NEW: Last = Last { position: [0; 3], intensity: 0, source: 0, bytes: [0; SIZE] };

    fn of(record: &[u8; SIZE]) -> Self {
        let int = |at: usize| {
            i32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]])
        };
        Last {
            position: [int(0), int(4), int(8)],
            intensity: u16::from_le_bytes([record[12], record[13]]),
            source: u16::from_le_bytes([record[18], record[19]]),
            bytes: *record,
        }
    }

    #[inline(always)]
    fn put(&self, record: &mut [u8; SIZE]) {
        *record = self.bytes;
        record[0..4].copy_from_slice(&self.position[0].to_le_bytes());
        record[4..8].copy_from_slice(&self.position[1].to_le_bytes());
        record[8..12].copy_from_slice(&self.position[2].to_le_bytes());
        record[12..14].copy_from_slice(&self.intensity.to_le_bytes());
        record[18..20].copy_from_slice(&self.source.to_le_bytes());
    }

    /// Reads a byte whose likely values depend on what it was.
    #[inline(always)]
    fn byte(&mut self, at: usize, coder: &mut Cursor, models: &mut ByteModels) {
        let byte = &mut self.bytes[at];
        *byte = coder.symbol(learned(&mut models[usize::from(*byte)], 256)) as u8;
    }
}

/// The decoder of version 1.
pub struct FirstPoint10 {
    last: Last,
    dxs: [i32; 3],
    dys: [i32; 3],
    next: usize,
    dx: Integers<32, 1>,
    dy: Integers<32, 20>,
    z: Integers<32, 20>,
    intensity: Integers<16, 1>,
    angle: Integers<8, 2>,
    source: Integers<16, 1>,
    changes: Model<65, 64>,
    returns: ByteModels,
    classes: ByteModels,
    users: ByteModels,
}

/// The median of three.
fn median([a, b, c]: [i32; 3]) -> i32 {
    a.min(b).max(a.max(b).min(c))
}

impl FirstPoint10 {
    /// Nothing is learned yet.
    pub fn new() -> Box<Self> {
        Box::new(FirstPoint10 {
            last: Last::NEW,
            dxs: [0; 3],
            dys: [0; 3],
            next: 0,
            dx: const { Integers::new() },
            dy: const { Integers::new() },
            z: const { Integers::new() },
            intensity: const { Integers::new() },
            angle: const { Integers::new() },
            source: const { Integers::new() },
            changes: const { Model::new(64) },
            returns: [const { None }; 256],
            classes: [const { None }; 256],
            users: [const { None }; 256],
        })
    }

    /// Begins with the first point of a chunk.
    pub fn begin(&mut self, record: &[u8; SIZE]) {
        self.last = Last::of(record);
    }

    /// Reads the next point.
    #[inline(always)]
    pub fn read(&mut self, coder: &mut Cursor, record: &mut [u8; SIZE]) {
        let last = &mut self.last;
        let dx = self.dx.read(coder, median(self.dxs), 0);
        let bits = self.dx.bits();
        let dy = self.dy.read(coder, median(self.dys), bits.min(19) as usize);
        let bits = (bits + self.dy.bits()) / 2;
        last.position[0] = last.position[0].wrapping_add(dx);
        last.position[1] = last.position[1].wrapping_add(dy);
        last.position[2] = self.z.read(coder, last.position[2], bits.min(19) as usize);

        let changed = coder.symbol(&mut self.changes);
        if changed & 32 != 0 {
            last.intensity = self.intensity.read(coder, i32::from(last.intensity), 0) as u16;
        }
        if changed & 16 != 0 {
            last.byte(at::RETURNS, coder, &mut self.returns);
        }
        if changed & 8 != 0 {
            last.byte(at::CLASS, coder, &mut self.classes);
        }
        if changed & 4 != 0 {
            let angle = &mut last.bytes[at::ANGLE];
            *angle = self.angle.read(coder, i32::from(*angle), usize::from(bits < 3)) as u8;
        }
        if changed & 2 != 0 {
            last.byte(at::USER, coder, &mut self.users);
        }
        if changed & 1 != 0 {
            last.source = self.source.read(coder, i32::from(last.source), 0) as u16;
        }
        self.dxs[self.next] = dx;
        self.dys[self.next] = dy;
        self.next = (self.next + 1) % 3;
        self.last.put(record);
    }
}

/// The decoder of version 2.
pub struct SecondPoint10 {
    last: Last,
    changes: Model<65, 64>,
    returns: ByteModels,
    intensity: Integers<16, 4>,
    intensities: [u16; 16],
    classes: ByteModels,
    angles: [ByteModel; 2],
    users: ByteModels,
    source: Integers<16, 1>,
    dx: Integers<32, 2>,
    dy: Integers<32, 22>,
    dxs: [RunningMedian; 16],
    dys: [RunningMedian; 16],
    z: Integers<32, 20>,
    zs: [i32; 8],
}

impl SecondPoint10 {
    /// Nothing is learned yet.
    pub fn new() -> Box<Self> {
        Box::new(SecondPoint10 {
            last: Last::NEW,
            changes: const { Model::new(64) },
            returns: [const { None }; 256],
            intensity: const { Integers::new() },
            intensities: [0; 16],
            classes: [const { None }; 256],
            angles: [const { Model::new(256) }; 2],
            users: [const { None }; 256],
            source: const { Integers::new() },
            dx: const { Integers::new() },
            dy: const { Integers::new() },
            dxs: [RunningMedian::NEW; 16],
            dys: [RunningMedian::NEW; 16],
            z: const { Integers::new() },
            zs: [0; 8],
        })
    }

    /// Begins with the first point of a chunk. Its intensity predicts none.
    pub fn begin(&mut self, record: &[u8; SIZE]) {
        self.last = Last { intensity: 0, ..Last::of(record) };
    }

    /// Reads the next point.
    #[inline(always)]
    pub fn read(&mut self, coder: &mut Cursor, record: &mut [u8; SIZE]) {
        let changed = coder.symbol(&mut self.changes);
        let last = &mut self.last;
        if changed & 32 != 0 {
            last.byte(at::RETURNS, coder, &mut self.returns);
        }
        let returns = last.bytes[at::RETURNS];
        let (n, r) = (usize::from((returns >> 3) & 7), usize::from(returns & 7));
        let kind = usize::from(RETURNS[n][r] & 15);
        if changed != 0 {
            if changed & 16 != 0 {
                let before = i32::from(self.intensities[kind]);
                self.intensities[kind] = self.intensity.read(coder, before, kind.min(3)) as u16;
            }
            last.intensity = self.intensities[kind];
            if changed & 8 != 0 {
                last.byte(at::CLASS, coder, &mut self.classes);
            }
            if changed & 4 != 0 {
                let forward = usize::from((returns >> 6) & 1);
                let by = coder.symbol(&mut self.angles[forward]) as u8;
                last.bytes[at::ANGLE] = last.bytes[at::ANGLE].wrapping_add(by);
            }
            if changed & 2 != 0 {
                last.byte(at::USER, coder, &mut self.users);
            }
            if changed & 1 != 0 {
                last.source = self.source.read(coder, i32::from(last.source), 0) as u16;
            }
        }
        let single = usize::from(n == 1);
        let by = self.dx.read(coder, self.dxs[kind].get(), single);
        last.position[0] = last.position[0].wrapping_add(by);
        self.dxs[kind].add(by);

        let bits = self.dx.bits();
        let context = single + (bits.min(20) & !1) as usize;
        let by = self.dy.read(coder, self.dys[kind].get(), context);
        last.position[1] = last.position[1].wrapping_add(by);
        self.dys[kind].add(by);

        let bits = (bits + self.dy.bits()) / 2;
        let context = single + (bits.min(18) & !1) as usize;
        let level = level(n, r);
        self.zs[level] = self.z.read(coder, self.zs[level], context);
        last.position[2] = self.zs[level];
        self.last.put(record);
    }
}
