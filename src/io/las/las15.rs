//! LAS 1.5 (ASPRS, 2025): what its header says more than that of LAS 1.4, of which the records are
//! the same. Outputs are LAS 1.4, which many more programs read.

use super::fields::{OF_1_5, at, encoding};
use super::file::InputFile;
use super::header::Header;
use crate::Result;

/// The offset of GPS times that earlier versions have, in millions of seconds.
const ADJUSTED: u16 = 1000;

impl Header {
    /// Refuses times that mean what no earlier version can say.
    pub fn check_times(&self, file: &InputFile) -> Result<()> {
        let Some(offset) = self.time_offset().filter(|offset| *offset != ADJUSTED) else {
            return Ok(());
        };
        let told = format!(
            "GPS times are those of satellites less {offset} million seconds, which are not read"
        );
        Err(file.wrong(at::TIME_OFFSET as u64, told).help(
            "an offset of 1000 is read: bring the times to it with the program that wrote them",
        ))
    }

    /// Millions of seconds that GPS times are less than those of satellites (LAS 1.5, section 2.4,
    /// Time Offset), where the header says that they are.
    fn time_offset(&self) -> Option<u16> {
        let is_given = self.minor() >= 5 && self.global_encoding & encoding::TIME_OFFSET != 0;
        let field = self.padding.get(OF_1_5 - 2..OF_1_5).filter(|_| is_given)?;
        Some(u16::from_le_bytes([field[0], field[1]]))
    }

    /// The header that outputs have: of LAS 1.5, which says more of GPS times alone, that of LAS
    /// 1.4 with the same meaning.
    pub fn for_outputs(&self) -> Self {
        if self.minor() < 5 {
            return self.clone();
        }
        let mut header = self.resized(4, self.padding.get(OF_1_5..).unwrap_or_default());
        let has_offset = self.time_offset().is_some();
        header.global_encoding &= !encoding::TIME_OFFSET;
        header.put_encoding(encoding::GPS_STANDARD, has_offset || self.is_standard());
        header
    }

    /// True if GPS times are those of satellites less 1e9 seconds.
    pub fn is_standard(&self) -> bool {
        self.encoding() & (encoding::GPS_STANDARD | encoding::TIME_OFFSET) != 0
    }
}
