//! Where the fields of the public header block are (LAS 1.4 R15, section 2.4).

/// Bytes of the header of LAS 1.5 behind those of 1.4: the largest and the smallest GPS time, and
/// their offset.
pub const OF_1_5: usize = 18;
/// Byte offsets of the fields that messages name.
pub mod at {
    pub const VERSION: usize = 24;
    pub const HEADER_SIZE: usize = 94;
    pub const POINTS_START: usize = 96;
    pub const VLRS: usize = 100;
    pub const FORMAT: usize = 104;
    pub const RECORD_LENGTH: usize = 105;
    pub const LEGACY_POINTS: usize = 107;
    pub const LEGACY_RETURNS: usize = 111;
    pub const SCALE: usize = 131;
    pub const BOX: usize = 179;
    pub const WAVEFORM_START: usize = 227;
    pub const EVLR_START: usize = 235;
    pub const EVLRS: usize = 243;
    pub const RETURNS: usize = 255;
    pub const TIME_OFFSET: usize = 391;
}

/// Bits of the global encoding field.
pub mod encoding {
    /// GPS times are standard time minus 1e9 rather than week time.
    pub const GPS_STANDARD: u16 = 1;
    /// Waveform packets are in this file.
    pub const WAVEFORM_INTERNAL: u16 = 2;
    /// Waveform packets are in a file beside this one.
    pub const WAVEFORM_EXTERNAL: u16 = 4;
    /// The CRS is WKT.
    pub const WKT: u16 = 16;
    /// GPS times are less by the time offset of the header (LAS 1.5).
    pub const TIME_OFFSET: u16 = 64;
}
