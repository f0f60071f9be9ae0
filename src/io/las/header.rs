//! The public header block (LAS 1.4 R15, section 2.4): the fields as the crate `las` reads and
//! writes them, behind checks against the length of the file, which its own reader does not make.
//! What is not recomputed is carried exactly, fields without a meaning and odd numbers too.

use std::array;
use std::ops::{Deref, DerefMut};

use las::raw::header::{Evlr, LargeFile};
use las::{Version, raw};

use super::fields::{OF_1_5, at};
use super::file::InputFile;
use super::format;
use crate::point::GpsTime;
use crate::stage::foreign;
use crate::{Error, Result};

/// What a file begins with.
pub const SIGNATURE: &[u8] = b"LASF";

/// What messages call such a file.
pub const CALLED: &str = "a LAS or LAZ file";

/// What is to be done about a header that cannot be.
const DAMAGED: &str = "the file is cut off, or its header is damaged: get another copy";

/// The bit of the format byte that says LAZ.
pub const COMPRESSED: u8 = 0x80;

/// The public header block of one file: all its fields, those behind the standard ones included.
#[derive(Debug, Clone)]
pub struct Header(raw::Header);

impl Deref for Header {
    type Target = raw::Header;

    fn deref(&self) -> &raw::Header {
        &self.0
    }
}

impl DerefMut for Header {
    fn deref_mut(&mut self) -> &mut raw::Header {
        &mut self.0
    }
}

impl Header {
    /// Bytes of the header of LAS 1.`minor`.
    fn size_of(minor: u8) -> usize {
        let own = if minor >= 5 { OF_1_5 } else { 0 };
        usize::from(Version::new(1, minor.min(4)).header_size()) + own
    }

    /// A header of LAS 1.4 of zeros but for signature, version, size, format and record length.
    pub fn blank(format: u8, record_length: u16) -> Self {
        let blank = raw::Header {
            point_data_record_format: format,
            point_data_record_length: record_length,
            ..raw::Header::default()
        };
        Header(blank).resized(4, &[])
    }

    /// Reads the header of `file` and checks it against the file's length.
    pub fn read(file: &InputFile) -> Result<Self> {
        let smallest = Self::size_of(0);
        let first = file.bytes(0, file.len().min(Self::size_of(5) as u64) as usize)?;
        if !first.starts_with(SIGNATURE) {
            return Err(foreign(file.path(), CALLED));
        }
        if file.len() < smallest as u64 {
            return Err(file
                .wrong(file.len(), "the file ends inside the LAS header")
                .help("a LAS header has at least 227 bytes: the file is cut off"));
        }
        let bytes = first;
        let (major, minor) = (bytes[at::VERSION], bytes[at::VERSION + 1]);
        if major != 1 || minor > 5 {
            return Err(file
                .wrong(at::VERSION as u64, format!("LAS {major}.{minor} is not read"))
                .help("LAS 1.0 to 1.5 are read: convert it with the program that wrote it"));
        }
        let size = u16::from_le_bytes([bytes[at::HEADER_SIZE], bytes[at::HEADER_SIZE + 1]]);
        let needed = Self::size_of(minor);
        if usize::from(size) < needed || u64::from(size) > file.len() {
            return Err(file
                .wrong(
                    at::HEADER_SIZE as u64,
                    format!(
                        "a header of {size} bytes cannot be: LAS 1.{minor} has {needed} and the \
                         file {} bytes",
                        file.len()
                    ),
                )
                .help(DAMAGED));
        }
        let mut bytes = file.bytes(0, usize::from(size))?;
        // The crate takes versions that it does not know for old ones.
        bytes[at::VERSION + 1] = minor.min(4);
        let changed = |e| file.wrong(0, "the header changed while it was read").because(e);
        let mut header = Header(raw::Header::read_from(&bytes[..]).map_err(changed)?);
        header.version = Version::new(1, minor);
        // The crate leaves out a place without a count and a count without a place.
        header.evlr = (minor >= 4).then(|| Evlr {
            start_of_first_evlr: u64::from_le_bytes(array::from_fn(|i| bytes[at::EVLR_START + i])),
            number_of_evlrs: u32::from_le_bytes(array::from_fn(|i| bytes[at::EVLRS + i])),
        });
        header.check(file).map(|()| header)
    }

    /// What the rest of the reader relies on.
    fn check(&self, file: &InputFile) -> Result<()> {
        let (start, size) = (u64::from(self.offset_to_point_data), self.header_size);
        if start < u64::from(size) || start > file.len() {
            return Err(file
                .wrong(
                    at::POINTS_START as u64,
                    format!(
                        "points cannot start at byte {start}: the header has {size} bytes and the \
                         file {}",
                        file.len()
                    ),
                )
                .help(DAMAGED));
        }
        self.check_times(file)?;
        let Some(least) = format::record_size(self.format()) else {
            return Err(file
                .wrong(at::FORMAT as u64, format!("point format {} is not known", self.format()))
                .help("point formats 0 to 10 are read"));
        };
        if self.point_data_record_length < least {
            return Err(file
                .wrong(
                    at::RECORD_LENGTH as u64,
                    format!(
                        "records of {} bytes cannot hold point format {}, which needs {least}",
                        self.point_data_record_length,
                        self.format()
                    ),
                )
                .help(DAMAGED));
        }
        if self.points() > 0 && !self.places() {
            return Err(file
                .wrong(
                    at::SCALE as u64,
                    format!(
                        "scale {:?} with offset {:?} places no point",
                        self.scale(),
                        self.offset()
                    ),
                )
                .help("the header is damaged: its scales are above 0, 0.01 or 0.001 mostly"));
        }
        Ok(())
    }

    /// True if every stored coordinate is a finite one in the world.
    fn places(&self) -> bool {
        let axes = self.scale().into_iter().zip(self.offset());
        let farthest = |scale: f64, offset: f64| scale.abs() * 2f64.powi(31) + offset.abs();
        axes.into_iter().all(|(scale, offset)| scale != 0.0 && farthest(scale, offset).is_finite())
    }

    /// What is odd about scales that can be read all the same.
    pub fn odd_scales(&self) -> Option<String> {
        let scale = self.scale();
        let why = if self.points() == 0 {
            return None;
        } else if scale.iter().any(|s| *s < 0.0) {
            "negative: the scan is mirrored, or its header damaged"
        } else if scale.iter().any(|s| *s < 1e-9) {
            "below 1e-9: points so near to each other share a position"
        } else {
            return None;
        };
        Some(format!("the scale {scale:?} is {why}"))
    }

    /// Its bytes, as in the file.
    pub fn bytes(&self) -> Result<Vec<u8>> {
        let mut bytes = Vec::with_capacity(usize::from(self.header_size));
        let failed = |e| Error::internal("a header could not be written").because(e);
        self.write_to(&mut bytes).map_err(failed)?;
        Ok(bytes)
    }

    /// The header of LAS 1.`minor`, no older, with the same fields and `custom` bytes behind them.
    pub fn resized(&self, minor: u8, custom: &[u8]) -> Self {
        let mut header = self.clone();
        let room = usize::from(u16::MAX) - Self::size_of(minor);
        header.version = Version::new(1, minor);
        header.padding = custom[..custom.len().min(room)].to_vec();
        header.header_size = (Self::size_of(minor) + header.padding.len()) as u16;
        if minor >= 4 {
            header.evlr.get_or_insert_default();
            header.large_file.get_or_insert_default();
        }
        header
    }

    /// The minor version: LAS 1.`minor`.
    pub fn minor(&self) -> u8 {
        self.version.minor
    }

    /// Point data record format, without the bits that say LAZ.
    pub fn format(&self) -> u8 {
        self.point_data_record_format & 0x3f
    }

    /// True if the points are LAZ.
    pub fn compressed(&self) -> bool {
        self.point_data_record_format & COMPRESSED != 0
    }

    /// Points claimed: the 64-bit count where the version has one. Some writers of LAS 1.4 set the
    /// legacy one alone.
    pub fn points(&self) -> u64 {
        let wide = self.large_file.map(|wide| wide.number_of_point_records);
        wide.filter(|points| *points > 0).unwrap_or(u64::from(self.number_of_point_records))
    }

    /// Byte and width of the counts of points by return, and the counts: those of 64 bits where the
    /// version has them and they are set.
    pub fn returns(&self) -> (usize, usize, Vec<u64>) {
        let wide = self.large_file.map(|wide| wide.number_of_points_by_return.to_vec());
        match wide.filter(|counts| counts.iter().any(|count| *count > 0)) {
            Some(counts) => (at::RETURNS, 8, counts),
            None => {
                let counts = self.number_of_points_by_return.map(u64::from);
                (at::LEGACY_RETURNS, 4, counts.to_vec())
            }
        }
    }

    /// What is odd about two counts of points that disagree. Formats 6 to 10 are to leave the one
    /// for older readers at 0, others may.
    pub fn odd_counts(&self) -> Option<String> {
        let points = self.large_file?.number_of_point_records;
        let (legacy, read) = (u64::from(self.number_of_point_records), self.points());
        (legacy != 0 && legacy != points).then(|| {
            format!(
                "the header counts {points} points and, in the field for older readers, {legacy}: \
                 {read} are read"
            )
        })
    }

    /// Where the extended variable length records start and how many are claimed.
    pub fn evlrs(&self) -> (u64, u32) {
        self.evlr.map_or((0, 0), |evlr| (evlr.start_of_first_evlr, evlr.number_of_evlrs))
    }

    /// Where the record of waveform packets starts; 0 for none.
    pub fn waveform_start(&self) -> u64 {
        self.start_of_waveform_data_packet_record.unwrap_or(0)
    }

    /// The global encoding bits (see [`encoding`]); 0 for LAS 1.0 and 1.1, which have none.
    pub fn encoding(&self) -> u16 {
        if self.minor() < 2 { 0 } else { self.global_encoding }
    }

    /// What GPS times count.
    pub fn gps_time(&self) -> GpsTime {
        match self.is_standard() {
            false => GpsTime::Week,
            true => GpsTime::AdjustedStandard,
        }
    }

    /// Sets or clears one of the bits, which LAS 1.0 and 1.1 do not have.
    pub fn put_encoding(&mut self, bit: u16, set: bool) {
        if self.minor() >= 2 {
            let others = self.encoding() & !bit;
            self.global_encoding = if set { others | bit } else { others };
        }
    }

    /// World units of one stored unit, per axis.
    pub fn scale(&self) -> [f64; 3] {
        [self.x_scale_factor, self.y_scale_factor, self.z_scale_factor]
    }

    /// World coordinates of stored 0.
    pub fn offset(&self) -> [f64; 3] {
        [self.x_offset, self.y_offset, self.z_offset]
    }

    /// Sets the scales.
    pub fn put_scale(&mut self, scale: [f64; 3]) {
        [self.x_scale_factor, self.y_scale_factor, self.z_scale_factor] = scale;
    }

    /// Sets the offsets.
    pub fn put_offset(&mut self, offset: [f64; 3]) {
        [self.x_offset, self.y_offset, self.z_offset] = offset;
    }

    /// The claimed box: smallest corner, then largest. A hint that may lie.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        [[self.min_x, self.min_y, self.min_z], [self.max_x, self.max_y, self.max_z]]
    }

    /// Sets the box.
    pub fn put_bounds(&mut self, lo: [f64; 3], hi: [f64; 3]) {
        [self.min_x, self.min_y, self.min_z] = lo;
        [self.max_x, self.max_y, self.max_z] = hi;
    }

    /// Sets the counts of points, in all and by return: the legacy fields too, which LAS 1.4 wants
    /// zero for formats 6 to 10 and for counts beyond them.
    pub fn put_counts(&mut self, points: u64, returns: &[u64; 15]) -> Result<()> {
        let narrow = u32::try_from(points).ok();
        if self.minor() < 4 && narrow.is_none() {
            return Err(Error::pipeline(format!(
                "{points} points do not fit in LAS 1.{}, which counts to 4,294,967,295",
                self.minor()
            ))
            .help("split the output, or start from inputs of LAS 1.4"));
        }
        let legacy = narrow.filter(|_| self.minor() < 4 || self.format() < 6);
        self.number_of_point_records = legacy.unwrap_or(0);
        // Counts that a point total of 32 bits holds have 32 bits.
        let narrow = |i: usize| if legacy.is_some() { returns[i] as u32 } else { 0 };
        self.number_of_points_by_return = array::from_fn(narrow);
        self.large_file = self.large_file.map(|_| LargeFile {
            number_of_point_records: points,
            number_of_points_by_return: *returns,
        });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_header_of_any_bytes_is_written_as_it_was_read(
            mut bytes in vec(any::<u8>(), 375 + 40), minor in 0..=4u8, custom in 0..40usize,
            format in 0..=10u8, bits in 0..4u8, has_place: bool, has_count: bool,
        ) {
            // Half of what belongs together may be there.
            if !has_place {
                bytes[at::EVLR_START..at::EVLRS].fill(0);
            }
            if !has_count {
                bytes[at::EVLRS..at::EVLRS + 4].fill(0);
            }
            // A signalling NaN must not become a quiet one.
            bytes[at::BOX..at::BOX + 8].copy_from_slice(&0x7ff0_0000_0000_0001u64.to_le_bytes());
            let size = Header::size_of(minor) + custom;
            bytes.truncate(size);
            let mut put = |at: usize, field: &[u8]| {
                bytes[at..at + field.len()].copy_from_slice(field);
            };
            put(0, SIGNATURE);
            put(at::VERSION, &[1, minor]);
            put(at::HEADER_SIZE, &(size as u16).to_le_bytes());
            put(at::POINTS_START, &(size as u32).to_le_bytes());
            put(at::FORMAT, &[format | (bits << 6)]);
            put(at::RECORD_LENGTH, &100u16.to_le_bytes());
            let places = [0.01f64, -1.0, 1e-300, 0.0, -1e9, f64::MIN_POSITIVE];
            put(at::SCALE, places.map(f64::to_le_bytes).as_flattened());
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), &bytes).unwrap();
            let header = Header::read(&InputFile::open(file.path()).unwrap()).unwrap();
            prop_assert_eq!(header.bytes().unwrap(), bytes);
        }
    }
}
