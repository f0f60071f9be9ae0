//! What the records of COPC 1.0 are called, and where they stand.

/// Who defined the records.
pub const USER: &str = "copc";
/// The record that says where the octree is.
pub const INFO: u16 = 1;
/// The extended record that holds its hierarchy.
pub const HIERARCHY: u16 = 1000;
/// What the name of a file ends with, behind a dot.
pub const EXTENSION: &str = "copc.laz";
/// Bytes of the record that says where the octree is.
pub const INFO_BYTES: usize = 160;
/// Byte of the file at which it stands, behind its head: it is the first behind the header.
pub const INFO_AT: u64 = 375 + 54;
/// Point formats that COPC has.
pub const POINT_FORMATS: [u8; 3] = [6, 7, 8];
/// Byte of the GPS time of a record of these, and of its return number.
pub const TIME: usize = 22;
/// See [`TIME`].
pub const RETURN: usize = 14;
