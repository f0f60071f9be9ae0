//! LZF, which packs `binary_compressed` PCD, unpacked as a stream.
//!
//! All values of a field stand together there, so a point is spread over the whole file, and LZF
//! can be unpacked from its beginning alone. But it refers back 8 KiB at most: who keeps these and
//! the place of the next packed byte can go on from there. One walk over the file leaves such marks
//! where the values of each part of each field begin; parts are then read by all threads, each
//! field from its mark, and none holds more than windows.
//!
//! Source: the format of Marc Lehmann's liblzf: a control byte below 32 is followed by so many + 1
//! literal bytes; else its upper 3 bits are the length less 2 of a copy (7: one more byte adds to
//! it), its lower 5 with the next byte the distance less 1.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::Arc;

use crate::{Error, Result};

/// How far back a copy reaches.
pub(super) const REACH: usize = 1 << 13;
/// Longest copy.
const LONGEST_COPY: usize = 264;
/// Packed bytes read at once.
const WINDOW: usize = 1 << 16;

/// What helps where packed bytes are wrong, and why nothing else does.
pub(super) const ALL_OR_NONE: &str = "the file is damaged or cut short: copy or make it again; \
                                      packed PCD has all values of a field before those of the \
                                      next, and none is sure behind damage, so no point can be \
                                      saved";

/// Where unpacking may go on.
#[derive(Debug, Clone)]
pub(super) struct LzfMark {
    /// Byte of the file of the next control byte.
    packed: u64,
    /// The last bytes before it, unpacked.
    back: Box<[u8]>,
    /// How many of them are before the mark.
    given: usize,
}

impl LzfMark {
    /// Bytes that a mark holds at most.
    pub const BYTES: usize = size_of::<LzfMark>() + REACH + LONGEST_COPY;
}

/// Unpacks a stretch of a file.
pub(super) struct Unpacker<'a> {
    file: Arc<File>,
    path: &'a Path,
    /// Packed bytes: a window of the file, the place of the next in it, its first byte, and where
    /// the packed bytes end.
    window: Vec<u8>,
    next: usize,
    from: u64,
    end: u64,
    /// Unpacked bytes: those that may be referred to, then those that are not given out.
    out: Vec<u8>,
    given: usize,
}

impl<'a> Unpacker<'a> {
    /// Bytes that it holds.
    pub const BYTES: usize = WINDOW + 4 * REACH;

    /// From the beginning of packed bytes.
    pub fn new(file: Arc<File>, path: &'a Path, [from, end]: [u64; 2]) -> Self {
        let out = Vec::with_capacity(3 * REACH);
        Unpacker { file, path, window: Vec::new(), next: 0, from, end, out, given: 0 }
    }

    /// From a mark on.
    pub fn at(file: Arc<File>, path: &'a Path, mark: &LzfMark, end: u64) -> Self {
        let mut unpacker = Self::new(file, path, [mark.packed, end]);
        unpacker.out.extend_from_slice(&mark.back);
        unpacker.given = mark.given;
        unpacker
    }

    /// A mark for what comes next.
    pub fn mark(&self) -> LzfMark {
        let start = self.out.len().saturating_sub(REACH).min(self.given);
        let packed = self.from + self.next as u64;
        LzfMark { packed, back: self.out[start..].into(), given: self.given - start }
    }

    fn fail(&self, told: &str) -> Error {
        Error::data(self.path, told).at_byte(self.from + self.next as u64).help(ALL_OR_NONE)
    }

    fn byte(&mut self) -> Result<u8> {
        if self.next == self.window.len() {
            self.from += self.next as u64;
            let held = (self.end - self.from).min(WINDOW as u64) as usize;
            if held == 0 {
                return Err(self.fail("its packed bytes end before its points do"));
            }
            self.window.resize(held, 0);
            self.next = 0;
            let read = self.file.read_exact_at(&mut self.window, self.from);
            read.map_err(|e| Error::io(self.path, "read points", e).at_byte(self.from))?;
        }
        let byte = self.window[self.next];
        self.next += 1;
        Ok(byte)
    }

    /// Unpacks one control byte's bytes.
    fn step(&mut self) -> Result<()> {
        // All is given out.
        if self.out.len() >= 2 * REACH {
            self.out.drain(..self.out.len() - REACH);
            self.given = self.out.len();
        }
        let control = usize::from(self.byte()?);
        if control < 32 {
            for _ in 0..=control {
                let byte = self.byte()?;
                self.out.push(byte);
            }
            return Ok(());
        }
        let mut length = control >> 5;
        if length == 7 {
            length += usize::from(self.byte()?);
        }
        let distance = (control & 31) << 8 | usize::from(self.byte()?);
        let Some(start) = self.out.len().checked_sub(distance + 1) else {
            return Err(self.fail("its packed bytes refer to what is before their beginning"));
        };
        // A copy may reach into itself.
        for at in start..start + length + 2 {
            self.out.push(self.out[at]);
        }
        Ok(())
    }

    /// Unpacks the next bytes into `into`.
    pub fn read(&mut self, mut into: &mut [u8]) -> Result<()> {
        while !into.is_empty() {
            if self.given == self.out.len() {
                self.step()?;
            }
            let (now, rest) = into.split_at_mut(into.len().min(self.out.len() - self.given));
            now.copy_from_slice(&self.out[self.given..self.given + now.len()]);
            self.given += now.len();
            into = rest;
        }
        Ok(())
    }

    /// True if nothing is left, unpacked or packed.
    pub fn is_at_end(&self) -> bool {
        self.given == self.out.len() && self.from + self.next as u64 == self.end
    }

    /// Passes over bytes.
    pub fn pass(&mut self, mut bytes: u64) -> Result<()> {
        while bytes > 0 {
            if self.given == self.out.len() {
                self.step()?;
            }
            let now = bytes.min((self.out.len() - self.given) as u64);
            self.given += now as usize;
            bytes -= now;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Packs by literals, and copies of what was just there.
    fn pack(bytes: &[u8]) -> Vec<u8> {
        let (mut packed, mut at) = (Vec::new(), 0);
        while at < bytes.len() {
            let run = |distance: usize| {
                let same = (0..264.min(bytes.len() - at))
                    .take_while(|n| at >= distance && bytes[at + n] == bytes[at + n - distance]);
                same.count()
            };
            let best =
                [1, 3, 4, 777, REACH].into_iter().max_by_key(|&distance| run(distance)).unwrap();
            let length = run(best);
            if length >= 3 {
                let (code, distance) = (length - 2, best - 1);
                packed.push(((code.min(7)) << 5 | distance >> 8) as u8);
                if code >= 7 {
                    packed.push((code - 7) as u8);
                }
                packed.push(distance as u8);
                at += length;
            } else {
                let literal = 32.min(bytes.len() - at).min(1 + at % 32);
                packed.push(literal as u8 - 1);
                packed.extend_from_slice(&bytes[at..at + literal]);
                at += literal;
            }
        }
        packed
    }

    fn sample() -> Vec<u8> {
        let mut seed = 7u32;
        let mut bytes = Vec::new();
        for n in 0..60_000u32 {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let is_new = n % 50 == 0 || n < 9000;
            bytes.push(if is_new { (seed >> 24) as u8 } else { bytes[n as usize - REACH] });
        }
        bytes
    }

    #[test]
    fn packed_bytes_come_back_from_the_beginning_and_from_any_mark() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let bytes = sample();
        let packed = pack(&bytes);
        assert!(packed.len() < bytes.len());
        std::fs::write(&path, &packed).unwrap();
        let (file, end) = (Arc::new(File::open(&path).unwrap()), packed.len() as u64);
        let mut all = Unpacker::new(file.clone(), &path, [0, end]);
        let (mut back, mut at) = (vec![0; bytes.len()], 0);
        let mut marks = Vec::new();
        while at < bytes.len() {
            marks.push((at, all.mark()));
            let now = 997.min(bytes.len() - at);
            all.read(&mut back[at..at + now]).unwrap();
            at += now;
        }
        assert_eq!(back, bytes);
        for (at, mark) in marks {
            assert!(mark.back.len() <= LzfMark::BYTES);
            let mut from = Unpacker::at(file.clone(), &path, &mark, end);
            from.pass(3.min(bytes.len() - at) as u64).unwrap();
            let mut rest = vec![0; bytes.len() - at - 3.min(bytes.len() - at)];
            from.read(&mut rest).unwrap();
            assert_eq!(rest, bytes[bytes.len() - rest.len()..]);
        }
    }

    #[test]
    fn what_ends_early_or_refers_to_nothing_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let told = |packed: &[u8]| {
            std::fs::write(&path, packed).unwrap();
            let file = Arc::new(File::open(&path).unwrap());
            let mut unpacker = Unpacker::new(file, &path, [0, packed.len() as u64]);
            unpacker.read(&mut [0; 8]).unwrap_err().to_string()
        };
        assert!(told(&[3, 1, 2]).contains("end before"));
        assert!(told(&[]).contains("end before"));
        assert!(told(&[0, 1, 0x20, 9]).contains("before their beginning"));
    }
}
