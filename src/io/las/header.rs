//! The public header block (LAS 1.4 R15, section 2.4), kept as its bytes: what is not recomputed is
//! carried exactly.

use super::fields::{at, encoding};
use super::file::InputFile;
use super::format;
use super::text::{split_at_room, text};
use crate::io::sniff;
use crate::point::GpsTime;
use crate::{Error, Result};

/// What is to be done about a header that cannot be.
const DAMAGED: &str = "the file is cut off, or its header is damaged: get another copy";

/// The bit of the format byte that says LAZ.
pub const COMPRESSED: u8 = 0x80;

/// The public header block of one file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    bytes: Vec<u8>,
}

impl Header {
    /// Bytes of the header of LAS 1.`minor`.
    pub fn size_of(minor: u8) -> usize {
        match minor {
            0..=2 => 227,
            3 => 235,
            _ => 375,
        }
    }

    /// A header of zeros with signature, version, size, format and record length.
    pub fn blank(minor: u8, format: u8, record_length: u16) -> Self {
        let size = Self::size_of(minor);
        let mut header = Header { bytes: vec![0; size] };
        header.put(0, b"LASF");
        header.put(at::VERSION, &[1, minor]);
        header.put(at::HEADER_SIZE, &(size as u16).to_le_bytes());
        header.put(at::FORMAT, &[format]);
        header.put(at::RECORD_LENGTH, &record_length.to_le_bytes());
        header
    }

    /// Reads the header of `file` and checks it against the file's length.
    pub fn read(file: &InputFile) -> Result<Self> {
        let smallest = Self::size_of(0);
        let first = file.bytes(0, file.len().min(sniff::BYTES as u64) as usize)?;
        if !sniff::is_las(&first) {
            return Err(sniff::not("a LAS or LAZ file", file.path(), &first));
        }
        if file.len() < smallest as u64 {
            return Err(file
                .wrong(file.len(), "the file ends inside the LAS header")
                .help("a LAS header has at least 227 bytes: the file is cut off"));
        }
        let bytes = first;
        let (major, minor) = (bytes[at::VERSION], bytes[at::VERSION + 1]);
        if major != 1 || minor > 4 {
            return Err(file
                .wrong(at::VERSION as u64, format!("LAS {major}.{minor} is not read"))
                .help("LAS 1.0 to 1.4 are read: convert it with the program that wrote it"));
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
        let header = Header { bytes: file.bytes(0, usize::from(size))? };
        header.check(file).map(|()| header)
    }

    /// What the rest of the reader relies on.
    fn check(&self, file: &InputFile) -> Result<()> {
        let start = u64::from(self.points_start());
        if start < self.bytes.len() as u64 || start > file.len() {
            return Err(file.wrong(
                at::POINTS_START as u64,
                format!(
                    "points cannot start at byte {start}: the header has {} bytes and the file {}",
                    self.bytes.len(),
                    file.len()
                ),
            )
            .help(DAMAGED));
        }
        let Some(least) = format::record_size(self.format()) else {
            return Err(file
                .wrong(at::FORMAT as u64, format!("point format {} is not known", self.format()))
                .help("point formats 0 to 10 are read"));
        };
        if self.record_length() < least {
            return Err(file
                .wrong(
                    at::RECORD_LENGTH as u64,
                    format!(
                        "records of {} bytes cannot hold point format {}, which needs {least}",
                        self.record_length(),
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

    /// All bytes, those a writer added behind the standard fields included.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Bytes behind the standard fields of the version.
    pub fn custom(&self) -> &[u8] {
        &self.bytes[Self::size_of(self.minor())..]
    }

    /// `N` bytes of a field.
    pub fn get<const N: usize>(&self, at: usize) -> [u8; N] {
        std::array::from_fn(|i| self.bytes[at + i])
    }

    /// Replaces a field's bytes.
    pub fn put(&mut self, at: usize, bytes: &[u8]) {
        self.bytes[at..at + bytes.len()].copy_from_slice(bytes);
    }

    /// Replaces the header by one of LAS 1.`minor` with the same fields and `custom` behind them.
    pub fn resized(&self, minor: u8, custom: &[u8]) -> Self {
        let size = Self::size_of(minor);
        let mut bytes = self.bytes[..Self::size_of(self.minor()).min(size)].to_vec();
        bytes.resize(size, 0);
        bytes.extend_from_slice(custom);
        let len = u16::try_from(bytes.len()).unwrap_or(u16::MAX);
        bytes.truncate(usize::from(len));
        let mut header = Header { bytes };
        header.put(at::VERSION, &[1, minor]);
        header.put(at::HEADER_SIZE, &len.to_le_bytes());
        header
    }

    /// The minor version: LAS 1.`minor`.
    pub fn minor(&self) -> u8 {
        self.bytes[at::VERSION + 1]
    }

    /// Point data record format, without the bits that say LAZ.
    pub fn format(&self) -> u8 {
        self.bytes[at::FORMAT] & 0x3f
    }

    /// True if the points are LAZ.
    pub fn compressed(&self) -> bool {
        self.bytes[at::FORMAT] & COMPRESSED != 0
    }

    /// Bytes of a record.
    pub fn record_length(&self) -> u16 {
        u16::from_le_bytes(self.get(at::RECORD_LENGTH))
    }

    /// Where the points start.
    pub fn points_start(&self) -> u32 {
        u32::from_le_bytes(self.get(at::POINTS_START))
    }

    /// Variable length records claimed.
    pub fn vlrs(&self) -> u32 {
        u32::from_le_bytes(self.get(at::VLRS))
    }

    /// Points claimed: the 64-bit count where the version has one. Some writers of LAS 1.4 set the
    /// legacy one alone.
    pub fn points(&self) -> u64 {
        let legacy = u64::from(u32::from_le_bytes(self.get(at::LEGACY_POINTS)));
        if self.minor() < 4 {
            return legacy;
        }
        match u64::from_le_bytes(self.get(at::POINTS)) {
            0 => legacy,
            points => points,
        }
    }

    /// Byte and width of the counts of points by return, and the counts: those of 64 bits where the
    /// version has them and they are set.
    pub fn returns(&self) -> (usize, usize, Vec<u64>) {
        let wide = |i: usize| u64::from_le_bytes(self.get(at::RETURNS + 8 * i));
        if self.minor() >= 4 && (0..15).any(|i| wide(i) > 0) {
            return (at::RETURNS, 8, (0..15).map(wide).collect());
        }
        let narrow = |i: usize| u64::from(u32::from_le_bytes(self.get(at::LEGACY_RETURNS + 4 * i)));
        (at::LEGACY_RETURNS, 4, (0..5).map(narrow).collect())
    }

    /// What is odd about two counts of points that disagree. Formats 6 to 10 are to leave the one for
    /// older readers at 0, others may.
    pub fn odd_counts(&self) -> Option<String> {
        if self.minor() < 4 {
            return None;
        }
        let legacy = u64::from(u32::from_le_bytes(self.get(at::LEGACY_POINTS)));
        let points = u64::from_le_bytes(self.get(at::POINTS));
        let read = self.points();
        (legacy != 0 && legacy != points).then(|| {
            format!(
                "the header counts {points} points and, in the field for older readers, {legacy}: \
                 {read} are read"
            )
        })
    }

    /// Where the extended variable length records start and how many are claimed.
    pub fn evlrs(&self) -> (u64, u32) {
        if self.minor() < 4 {
            return (0, 0);
        }
        (u64::from_le_bytes(self.get(at::EVLR_START)), u32::from_le_bytes(self.get(at::EVLRS)))
    }

    /// Where the record of waveform packets starts; 0 for none.
    pub fn waveform_start(&self) -> u64 {
        if self.minor() < 3 { 0 } else { u64::from_le_bytes(self.get(at::WAVEFORM_START)) }
    }

    /// The global encoding bits (see [`encoding`]); 0 for LAS 1.0 and 1.1, which have none.
    pub fn encoding(&self) -> u16 {
        if self.minor() < 2 { 0 } else { u16::from_le_bytes(self.get(at::GLOBAL_ENCODING)) }
    }

    /// What GPS times count.
    pub fn gps_time(&self) -> GpsTime {
        match self.encoding() & encoding::GPS_STANDARD {
            0 => GpsTime::Week,
            _ => GpsTime::AdjustedStandard,
        }
    }

    /// Sets or clears one of the bits, which LAS 1.0 and 1.1 do not have.
    pub fn put_encoding(&mut self, bit: u16, set: bool) {
        if self.minor() >= 2 {
            let others = self.encoding() & !bit;
            let bits = if set { others | bit } else { others };
            self.put(at::GLOBAL_ENCODING, &bits.to_le_bytes());
        }
    }

    /// Sets a text field of 32 bytes; what exceeds it is cut off.
    pub fn put_text(&mut self, at: usize, text: &str) {
        let mut field = [0; 32];
        let (text, _) = split_at_room(text, field.len());
        field[..text.len()].copy_from_slice(text.as_bytes());
        self.put(at, &field);
    }

    /// World units of one stored unit, per axis.
    pub fn scale(&self) -> [f64; 3] {
        self.floats(at::SCALE)
    }

    /// World coordinates of stored 0.
    pub fn offset(&self) -> [f64; 3] {
        self.floats(at::OFFSET)
    }

    /// The claimed box: smallest corner, then largest. A hint that may lie.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let pairs: [[f64; 2]; 3] = std::array::from_fn(|axis| {
            [0, 8].map(|half| f64::from_le_bytes(self.get(at::BOX + 16 * axis + half)))
        });
        [pairs.map(|[_, lo]| lo), pairs.map(|[hi, _]| hi)]
    }

    /// Sets the box.
    pub fn put_bounds(&mut self, lo: [f64; 3], hi: [f64; 3]) {
        for axis in 0..3 {
            self.put(at::BOX + 16 * axis, &hi[axis].to_le_bytes());
            self.put(at::BOX + 16 * axis + 8, &lo[axis].to_le_bytes());
        }
    }

    /// Sets three floats.
    pub fn put_floats(&mut self, at: usize, values: [f64; 3]) {
        for (axis, value) in values.iter().enumerate() {
            self.put(at + 8 * axis, &value.to_le_bytes());
        }
    }

    fn floats(&self, at: usize) -> [f64; 3] {
        std::array::from_fn(|axis| f64::from_le_bytes(self.get(at + 8 * axis)))
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
        self.put(at::LEGACY_POINTS, &legacy.unwrap_or(0).to_le_bytes());
        for (i, &count) in returns.iter().take(5).enumerate() {
            let count = if legacy.is_some() { count as u32 } else { 0 };
            self.put(at::LEGACY_RETURNS + 4 * i, &count.to_le_bytes());
        }
        if self.minor() >= 4 {
            self.put(at::POINTS, &points.to_le_bytes());
            for (i, count) in returns.iter().enumerate() {
                self.put(at::RETURNS + 8 * i, &count.to_le_bytes());
            }
        }
        Ok(())
    }

    /// A text field without its trailing zeros, bytes that are no UTF-8 replaced.
    pub fn text(&self, at: usize) -> String {
        text(&self.get::<32>(at))
    }
}
