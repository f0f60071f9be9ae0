//! Comments of a header that say more than a comment does: the coordinate reference system, what
//! GPS times count, who wrote the file.

use super::noted::{self, pieces};
use crate::point::{GpsTime, Metadata};

/// What begins the comment that holds the coordinate reference system, and its further pieces.
const CRS: &str = "crs: ";
const CRS_MORE: &str = "crs+ ";

/// What begins the comment that says what the values of `GpsTime` count, and how it goes on.
const GPS_TIME: &str = "gps_time: ";
const GPS_TIMES: [(GpsTime, &str); 2] = [
    (GpsTime::Week, "seconds of the GPS week"),
    (GpsTime::AdjustedStandard, "seconds of GPS time minus 1e9"),
];

/// What comments say, and what they say besides.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Said {
    pub crs: Option<String>,
    pub gps_time: Option<GpsTime>,
    /// How the file was made.
    pub note: Option<String>,
    /// The others.
    pub others: Vec<String>,
}

impl Said {
    pub fn of(mut comments: Vec<String>) -> Said {
        let mut said = Said { note: noted::take(&mut comments), ..Said::default() };
        // Only pieces right behind the first belong to it: other comments are free to look alike.
        let mut more = false;
        for comment in comments {
            if let (Some(text), None) = (comment.strip_prefix(CRS), &said.crs) {
                said.crs = Some(text.to_owned());
                more = true;
                continue;
            }
            if let (Some(text), true) = (comment.strip_prefix(CRS_MORE), more) {
                said.crs.get_or_insert_default().push_str(text);
                continue;
            }
            more = false;
            match (gps_time_told(&comment), said.gps_time) {
                (Some(kind), None) => said.gps_time = Some(kind),
                _ => said.others.push(comment),
            }
        }
        said
    }
}

/// What GPS times count, if `comment` is the one that says it.
fn gps_time_told(comment: &str) -> Option<GpsTime> {
    let text = comment.strip_prefix(GPS_TIME)?;
    GPS_TIMES.iter().find(|(_, told)| *told == text).map(|(kind, _)| *kind)
}

/// A comment that begins so, a line end within it being a blank: it would begin a line of its own.
pub fn line(begins: &str, text: &str) -> String {
    format!("{begins}{}\n", text.replace(['\n', '\r'], " "))
}

/// The comments that say what `metadata` does of coordinates, and of times if there are any.
pub fn lines(begins: &str, metadata: &Metadata, has_times: bool) -> String {
    let mut all = String::new();
    for (n, piece) in metadata.crs.iter().flat_map(|crs| pieces(crs)).enumerate() {
        all += &line(begins, &format!("{}{piece}", if n == 0 { CRS } else { CRS_MORE }));
    }
    let told = metadata.gps_time.filter(|_| has_times);
    for (_, text) in GPS_TIMES.iter().filter(|(kind, _)| Some(*kind) == told) {
        all += &line(begins, &format!("{GPS_TIME}{text}"));
    }
    all
}

/// What says who wrote a file, and with blanks behind it brings every header of one file to one
/// length, whatever the counts of its elements.
pub const MADE: &str = "made by pointmill";

pub fn made(counts: &[u64]) -> String {
    let left = counts.iter().map(|count| 20 - count.to_string().len()).sum();
    format!("{MADE}{}", " ".repeat(left))
}

/// True for a comment of [`made`], or for what earlier versions had in its place.
pub fn is_made(comment: &str, points: u64) -> bool {
    let dots = || comment.len() == 21 - points.to_string().len();
    comment.trim_end() == MADE || (comment.bytes().all(|b| b == b'.') && dots())
}
