//! Packed points: where the values of each field are, and how they become records.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::Arc;

use super::header::PcdHeader;
use super::lzf::{ALL_OR_NONE, LzfMark, Unpacker};
use crate::{Error, Result};

/// Points of a part at least.
const PART_POINTS: u64 = 1 << 17;
/// Bytes that the marks of a file take at most, about.
const MARKS: u64 = 8 << 20;

/// Where packed bytes are, and into which parts their points are cut.
#[derive(Debug, Clone, Copy)]
pub(super) struct Packed {
    /// The packed bytes in the file.
    pub span: [u64; 2],
    /// How many bytes they are said to be when they are unpacked.
    pub unpacked: u64,
    /// Points of each part but the last.
    pub part_points: u64,
}

impl Packed {
    /// Reads how many bytes are packed, and holds that against the file's length.
    pub fn read(file: &File, path: &Path, header: &PcdHeader, length: u64) -> Result<Packed> {
        if header.points == 0 && header.cells() == 0 {
            return Ok(Packed { span: [header.body; 2], unpacked: 0, part_points: PART_POINTS });
        }
        let from = header.body + 8;
        let cut = |told: String| Error::data(path, told).at_byte(header.body).help(ALL_OR_NONE);
        if from > length {
            return Err(cut("the file ends where its packed points begin".to_owned()));
        }
        let [packed, unpacked] = read_sizes(file, path, header.body)?;
        if from + packed > length {
            let there = length - from;
            return Err(cut(format!("{packed} bytes are said to be packed, {there} are there")));
        }
        let span = [from, from + packed];
        Ok(Packed { span, unpacked, part_points: PART_POINTS })
    }

    /// Cuts it into parts, as the header counts its points.
    pub fn cut(&mut self, header: &PcdHeader) {
        let fields = header.fields.len() as u64;
        let at_once = header.points.saturating_mul(fields * LzfMark::BYTES as u64) / MARKS;
        self.part_points = PART_POINTS.max(at_once);
    }

    /// What is wrong with the number of bytes that are packed, if it is not that of the header's
    /// points.
    pub fn disagrees(&self, header: &PcdHeader) -> Option<String> {
        let said = header.points.saturating_mul(header.stride() as u64);
        let unpacked = self.unpacked;
        (unpacked != said).then(|| {
            format!("{unpacked} bytes are said to be packed, the header's points have {said}")
        })
    }

    /// How many points are packed, whatever the header says: as many as all bytes that are said to
    /// be packed make, if these are there.
    ///
    /// # Errors
    ///
    /// Where bytes are missing or left over: each field begins where the one before it ends, so
    /// without their number nobody knows where.
    pub fn holds(&self, file: File, path: &Path, header: &PcdHeader) -> Result<u64> {
        let (stride, unpacked) = (header.stride() as u64, self.unpacked);
        let fail = |told: String| Error::data(path, told).at_byte(header.body).help(ALL_OR_NONE);
        if !unpacked.is_multiple_of(stride) {
            let told = format!("{unpacked} bytes are said to be packed, a point has {stride}");
            return Err(fail(told));
        }
        let mut unpacker = Unpacker::new(Arc::new(file), path, self.span);
        unpacker.pass(unpacked)?;
        match unpacker.is_at_end() {
            true => Ok(unpacked / stride),
            false => Err(fail(format!("more than the {unpacked} bytes that it says are packed"))),
        }
    }

    /// Parts of the file.
    pub fn parts(&self, header: &PcdHeader) -> u64 {
        header.points.div_ceil(self.part_points)
    }

    /// Bytes that the marks take.
    pub fn bytes(&self, header: &PcdHeader) -> u64 {
        self.parts(header).saturating_mul(header.fields.len() as u64 * LzfMark::BYTES as u64)
    }

    /// Marks for the values of every field in every part: those of a part side by side.
    pub fn walk(&self, file: File, path: &Path, header: &PcdHeader) -> Result<Vec<LzfMark>> {
        let parts = self.parts(header);
        let mut unpacker = Unpacker::new(Arc::new(file), path, self.span);
        let mut by_field: Vec<Vec<LzfMark>> = Vec::new();
        for field in &header.fields {
            let mut of_field = Vec::new();
            for part in 0..parts {
                of_field.push(unpacker.mark());
                let points = self.part_points.min(header.points - part * self.part_points);
                unpacker.pass(points * field.bytes() as u64)?;
            }
            by_field.push(of_field);
        }
        let mut marks = Vec::new();
        for part in 0..parts as usize {
            marks.extend(by_field.iter().map(|of_field| of_field[part].clone()));
        }
        Ok(marks)
    }
}

/// How many bytes are packed, and how many they are unpacked, as the packed points begin.
fn read_sizes(file: &File, path: &Path, at: u64) -> Result<[u64; 2]> {
    let mut bytes = [[0; 4]; 2];
    let read = file.read_exact_at(bytes.as_flattened_mut(), at);
    read.map_err(|e| Error::io(path, "read how many bytes are packed", e).at_byte(at))?;
    Ok(bytes.map(|four| u64::from(u32::from_le_bytes(four))))
}
