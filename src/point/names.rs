//! The names of the dimensions that formats share. A dimension of one format is the same dimension
//! of another when its name is the same; every other name is an extra dimension.

#![expect(missing_docs, reason = "each name says what it is")]

/// Coordinates, in world units once scale and origin are applied.
pub const XYZ: [&str; 3] = ["X", "Y", "Z"];
/// Unit surface normal, computed by the stage `normals` or read from a file.
pub const NORMAL: [&str; 3] = ["NormalX", "NormalY", "NormalZ"];

pub const INTENSITY: &str = "Intensity";
pub const RETURN_NUMBER: &str = "ReturnNumber";
pub const NUMBER_OF_RETURNS: &str = "NumberOfReturns";
pub const SCAN_DIRECTION_FLAG: &str = "ScanDirectionFlag";
pub const EDGE_OF_FLIGHT_LINE: &str = "EdgeOfFlightLine";
pub const CLASSIFICATION: &str = "Classification";
pub const SYNTHETIC: &str = "Synthetic";
pub const KEY_POINT: &str = "KeyPoint";
pub const WITHHELD: &str = "Withheld";
pub const OVERLAP: &str = "Overlap";
pub const SCANNER_CHANNEL: &str = "ScannerChannel";
/// Degrees; LAS point formats 6 to 10 count in 0.006°, earlier ones in whole degrees.
pub const SCAN_ANGLE: &str = "ScanAngle";
pub const USER_DATA: &str = "UserData";
pub const POINT_SOURCE_ID: &str = "PointSourceId";
pub const GPS_TIME: &str = "GpsTime";
/// When a reduction kept the point: those of lower ranks are a coarser reduction.
pub const KEEP_RANK: &str = "KeepRank";
/// Row of an organised scan, such as the pixels of a depth camera.
pub const ROW: &str = "Row";
/// Column of an organised scan.
pub const COLUMN: &str = "Column";
pub const RED: &str = "Red";
pub const GREEN: &str = "Green";
pub const BLUE: &str = "Blue";
pub const NIR: &str = "Nir";
pub const WAVE_DESCRIPTOR: &str = "WavePacketDescriptorIndex";
pub const WAVE_OFFSET: &str = "WavePacketByteOffset";
pub const WAVE_SIZE: &str = "WavePacketSize";
pub const WAVE_RETURN: &str = "WaveReturnPoint";
/// Direction of the waveform, per picosecond.
pub const WAVE_DIRECTION: [&str; 3] = ["WaveXt", "WaveYt", "WaveZt"];
