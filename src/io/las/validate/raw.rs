//! The public header block as its bytes, whatever is in them: what the reader refuses can be told
//! field by field.

use crate::Result;
use crate::io::las::file::InputFile;
use crate::io::las::header::{CALLED, SIGNATURE};
use crate::stage::foreign;

/// What a version of LAS has: bytes of its header, its highest point format, the bits of the global
/// encoding that it defines. A version that is to be checked is a row here.
const VERSIONS: [(u16, u8, u16); 6] = [
    (227, 1, 0),
    (227, 1, 0),
    (227, 3, 0b1),
    (235, 5, 0b1111),
    (375, 10, 0b1_1111),
    (393, 10, 0b101_1111),
];
/// Bytes of the longest of these headers.
const LONGEST: usize = 393;

/// The header of a file, zeros where the file or its version ends before.
pub struct RawHeader {
    bytes: [u8; LONGEST],
    /// Bytes of the file.
    pub length: u64,
}

impl RawHeader {
    /// Reads it.
    pub fn read(file: &InputFile) -> Result<RawHeader> {
        let first = file.bytes(0, file.len().min(LONGEST as u64) as usize)?;
        if !first.starts_with(SIGNATURE) {
            return Err(foreign(file.path(), CALLED));
        }
        let least = usize::from(VERSIONS[0].0);
        if first.len() < least {
            return Err(file
                .wrong(file.len(), "the file ends inside the LAS header")
                .help("a LAS header has at least 227 bytes: the file is cut off"));
        }
        let mut bytes = [0; LONGEST];
        let version = VERSIONS.get(usize::from(first[25])).map_or(LONGEST, |v| usize::from(v.0));
        let own = first.len().min(version);
        bytes[..own].copy_from_slice(&first[..own]);
        Ok(RawHeader { bytes, length: file.len() })
    }

    pub fn bytes(&self, at: usize, length: usize) -> &[u8] {
        &self.bytes[at..at + length]
    }

    fn array<const N: usize>(&self, at: usize) -> [u8; N] {
        std::array::from_fn(|i| self.bytes[at + i])
    }

    pub fn byte(&self, at: usize) -> u8 {
        self.bytes[at]
    }

    pub fn short(&self, at: usize) -> u16 {
        u16::from_le_bytes(self.array(at))
    }

    pub fn word(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.array(at))
    }

    pub fn long(&self, at: usize) -> u64 {
        u64::from_le_bytes(self.array(at))
    }

    pub fn float(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.array(at))
    }

    /// Three floats, of x, y and z, each `step` bytes behind the one before.
    pub fn axes(&self, at: usize, step: usize) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.float(at + step * axis))
    }

    /// LAS 1.`minor`.
    pub fn minor(&self) -> u8 {
        self.byte(25)
    }

    /// What the version has, if it is one of those that are checked.
    pub fn version(&self) -> Option<(u16, u8, u16)> {
        VERSIONS.get(usize::from(self.minor())).copied().filter(|_| self.byte(24) == 1)
    }

    /// The point format without the bits that say LAZ.
    pub fn format(&self) -> u8 {
        self.byte(104) & 0x3f
    }

    /// True if the points are said to be LAZ.
    pub fn is_compressed(&self) -> bool {
        self.byte(104) & 0x80 != 0
    }

    /// The bits of the global encoding; 0 for LAS 1.0 and 1.1, which have none.
    pub fn encoding(&self) -> u16 {
        if self.minor() < 2 { 0 } else { self.short(6) }
    }

    /// Bytes of the header.
    pub fn size(&self) -> u16 {
        self.short(94)
    }

    /// Where the points begin.
    pub fn points_start(&self) -> u64 {
        self.word(96).into()
    }

    /// Points that the header counts: those of the field of the version.
    pub fn points(&self) -> u64 {
        if self.minor() >= 4 { self.long(247) } else { self.word(107).into() }
    }

    /// Points by return: the first byte of the counts, bytes of one, and the counts.
    pub fn returns(&self) -> (usize, usize, Vec<u64>) {
        match self.minor() {
            4.. => (255, 8, (0..15).map(|i| self.long(255 + 8 * i)).collect()),
            _ => (111, 4, (0..5).map(|i| self.word(111 + 4 * i).into()).collect()),
        }
    }

    /// Where the extended records start, and how many there are.
    pub fn evlrs(&self) -> (u64, u32) {
        (self.long(235), self.word(243))
    }
}
