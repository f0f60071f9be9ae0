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

/// Bytes of one piece of a long text: some readers refuse header lines of 1,024 bytes.
const PIECE: usize = 900;

/// A text in pieces that fit a header line. Line ends become blanks, and no piece ends in a blank,
/// which readers may take off.
pub fn pieces(text: &str) -> Vec<String> {
    let mut pieces = vec![String::new()];
    for word in text.replace(['\n', '\r'], " ").split_inclusive(|c: char| !c.is_whitespace()) {
        match pieces.last_mut() {
            Some(last) if last.len() + word.len() <= PIECE || last.is_empty() => *last += word,
            _ => pieces.push(word.to_owned()),
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_text_is_cut_where_no_blank_is_lost() {
        let text = format!("A {}{} Ω end", "word ".repeat(400), " ".repeat(30));
        let cut = pieces(&text);
        assert!(cut.len() >= 3 && cut.iter().all(|p| p.len() <= PIECE), "{}", cut.len());
        assert!(cut.iter().all(|p| p.trim_end() == p));
        assert_eq!(cut.concat(), text);
    }
}
