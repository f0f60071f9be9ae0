//! Comments of a PLY header that say more than a comment does: the coordinate reference system,
//! what GPS times count, who wrote the file.

use crate::point::GpsTime;

/// What begins the comment that holds the coordinate reference system, and its further pieces.
pub const CRS: &str = "crs: ";
pub const CRS_MORE: &str = "crs+ ";

/// What begins the comment that says what the values of `GpsTime` count, and how it goes on.
pub const GPS_TIME: &str = "gps_time: ";
pub const GPS_TIMES: [(GpsTime, &str); 2] = [
    (GpsTime::Week, "seconds of the GPS week"),
    (GpsTime::AdjustedStandard, "seconds of GPS time minus 1e9"),
];

/// What says who wrote a file, and with blanks behind it brings every header of one file to one
/// length, whatever its count of vertices.
pub const MADE: &str = "made by pointmill";

pub fn made(points: u64) -> String {
    format!("{MADE}{}", " ".repeat(20 - points.to_string().len()))
}

/// True for a comment of [`made`], or for what earlier versions had in its place.
pub fn is_made(comment: &str, points: u64) -> bool {
    let dots = || comment.len() == 21 - points.to_string().len();
    comment.trim_end() == MADE || (comment.bytes().all(|b| b == b'.') && dots())
}
