//! The beginning of a text: what separates its numbers, how many there are on a line, and what a
//! heading calls them.

use std::fs::File;
use std::path::Path;

use super::columns::dimensions;
use super::names::{CALLED, LONGEST_LINE};
use crate::io::rows::fields::{Delimiter, is_comment, is_count, is_number};
use crate::io::rows::lines::Lines;
use crate::io::sniff;
use crate::stage::foreign;
use crate::{Error, Result};

/// Lines that are looked at for the first point.
const LINES_MOST: usize = 1000;

/// What the beginning of a text says.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TextHead {
    /// What stands between two numbers.
    pub separator: Delimiter,
    /// Numbers on a line.
    pub columns: usize,
    /// What a heading calls them.
    pub names: Option<Vec<String>>,
    /// Lines before the first point or count of points.
    pub lines: u64,
    /// Byte where that begins.
    pub body: u64,
    /// How many points it says that it has, as PTS does.
    pub claimed: Option<u64>,
}

impl TextHead {
    /// Reads the beginning of a text of `length` bytes; `reads` says which of its columns are read,
    /// where the user does: others may hold words.
    ///
    /// # Errors
    ///
    /// A file that is [`foreign`], and one whose heading names more or fewer columns than its first
    /// point has.
    pub fn read(file: File, path: &Path, length: u64, reads: Option<&[bool]>) -> Result<TextHead> {
        let mut lines = Lines::new(file, path, [0, length], 0, LONGEST_LINE);
        let (mut comment, mut heading, mut body, mut claimed) = (None, None, None, None);
        for _ in 0..LINES_MOST {
            let next = lines.next().map_err(|error| match error.kind() {
                crate::ErrorKind::Data => foreign(path, CALLED),
                _ => error,
            })?;
            let Some((start, end)) = next else {
                let comment = comment
                    .map(|(text, _)| text)
                    .filter(|text: &Vec<u8>| dimensions(&names(text)).is_ok());
                let heading = heading.map(|(text, _)| text);
                return Self::empty(path, length, heading.or(comment));
            };
            let line = without_mark(lines.text(start, end), lines.byte(start));
            if let Some(text) = is_comment(line) {
                comment = Some((text.to_vec(), lines.number()));
                continue;
            }
            let here = (lines.byte(start), lines.number() - 1);
            if is_count(line) {
                body.get_or_insert(here);
                let count = std::str::from_utf8(line.trim_ascii()).ok();
                claimed = claimed.or(count.and_then(|count| count.parse().ok()));
                continue;
            }
            let told =
                reads.and_then(|reads| Some((Delimiter::of_columns(line, reads)?, reads.len())));
            if let Some((separator, columns)) = told.or_else(|| Delimiter::of(line)) {
                let (body, before) = body.unwrap_or(here);
                let names = match (&heading, &comment) {
                    (Some((text, number)), _) => {
                        let names = names(text);
                        if names.len() != columns && told.is_none() {
                            return Err(unlike(path, *number, names.len(), columns));
                        }
                        Some(names)
                    }
                    (None, Some((text, _))) => Some(names(text)).filter(|n| n.len() == columns),
                    (None, None) => None,
                };
                return Ok(TextHead { separator, columns, names, lines: before, body, claimed });
            }
            if heading.is_some() || body.is_some() || names(line).len() < 3 || has_commas(line) {
                return Err(odd(path, line, lines.number(), lines.byte(start)));
            }
            heading = Some((line.to_vec(), lines.number()));
        }
        Err(foreign(path, CALLED))
    }

    /// That of a text without a point.
    fn empty(path: &Path, length: u64, heading: Option<Vec<u8>>) -> Result<TextHead> {
        let names = heading.map(|text| names(&text));
        let is_heading = names.as_ref().is_none_or(|names| dimensions(names).is_ok());
        if length == 0 || !is_heading {
            return Err(foreign(path, CALLED));
        }
        let columns = names.as_ref().map_or(3, Vec::len);
        let (separator, claimed) = (Delimiter::Blanks, None);
        Ok(TextHead { separator, columns, names, lines: 0, body: length, claimed })
    }
}

/// True if a file that begins so may be a text of numbers: a point is on its first line, or behind
/// one that may name columns.
pub(super) fn sniff(first: &[u8]) -> bool {
    let first = without_mark(first, 0);
    // Where there is more than what is looked at, the last line may be cut.
    let whole = first.iter().rposition(|b| *b == b'\n' || *b == b'\r');
    let end = whole.filter(|_| first.len() >= sniff::BYTES).unwrap_or(first.len());
    let is_said = |line: &&[u8]| {
        !line.trim_ascii().is_empty() && is_comment(line).is_none() && !is_count(line)
    };
    let mut lines = first[..end].split(|b| *b == b'\n' || *b == b'\r').filter(is_said);
    let Some(line) = lines.next() else { return false };
    let is_point = |line: &[u8]| Delimiter::of(line).is_some();
    is_point(line) || (dimensions(&names(line)).is_ok() && lines.next().is_some_and(is_point))
}

/// The text of a first line without the mark that some programs begin UTF-8 with.
pub(super) fn without_mark(line: &[u8], at: u64) -> &[u8] {
    line.strip_prefix(b"\xef\xbb\xbf").filter(|_| at == 0).unwrap_or(line)
}

/// The words of a heading, quotes taken off.
pub(super) fn names(line: &[u8]) -> Vec<String> {
    let text = String::from_utf8_lossy(line);
    let text = text.trim();
    let by = |separator: char| text.split(separator).map(str::trim).collect::<Vec<_>>();
    let words: Vec<&str> = match [',', ';', '\t'].into_iter().find(|&mark| text.contains(mark)) {
        Some(separator) => by(separator),
        None => text.split_whitespace().collect(),
    };
    let quotes = ['"', '\''];
    words.into_iter().map(|word| word.trim_matches(quotes).trim().to_owned()).collect()
}

fn unlike(path: &Path, line: u64, names: usize, columns: usize) -> Error {
    let told = format!(
        "line {line} names {names} columns, and the first point behind it has {columns} numbers"
    );
    Error::data(path, told).help("correct the line, or say with `read.columns` what they are")
}

/// True for numbers with commas before their decimals.
fn has_commas(line: &[u8]) -> bool {
    let is_number = |word: &[u8]| {
        let dotted: Vec<u8> = word.iter().map(|&b| if b == b',' { b'.' } else { b }).collect();
        is_number(&dotted)
    };
    let words = || line.split(|b| b.is_ascii_whitespace() || *b == b';').filter(|w| !w.is_empty());
    words().count() >= 3 && words().all(is_number)
}

/// The error of a line that should be a point and is none.
fn odd(path: &Path, line: &[u8], number: u64, byte: u64) -> Error {
    if has_commas(line) {
        return Error::data(path, format!("line {number} has decimal commas"))
            .at_byte(byte)
            .help("write the file again with decimal points");
    }
    foreign(path, CALLED)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head(text: &str) -> Result<TextHead> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        std::fs::write(&path, text).unwrap();
        TextHead::read(File::open(&path).unwrap(), &path, text.len() as u64, None)
    }

    #[test]
    fn separators_and_headings_are_found() {
        use Delimiter::{Blanks, Mark};
        let found = |text: &str| {
            let head = head(text).unwrap();
            assert!(sniff(text.as_bytes()) || head.body == text.len() as u64, "{text}");
            (head.separator, head.columns, head.names.map(|n| n.join("|")), head.lines, head.body)
        };
        let named = |names: &str| Some(names.to_owned());
        assert_eq!(found("1 2 3\n"), (Blanks, 3, None, 0, 0));
        assert_eq!(found("\n 1\t2  3 4\r\n"), (Blanks, 4, None, 1, 1));
        assert_eq!(found("0, .5, -1e3\n"), (Mark(b','), 3, None, 0, 0));
        assert_eq!(found("1;2;3;\n"), (Mark(b';'), 3, None, 0, 0));
        assert_eq!(found("X, Y, Z\n\n1,2,3"), (Mark(b','), 3, named("X|Y|Z"), 2, 9));
        assert_eq!(found("\"X\",\"Y\",\"Z\"\n1 2 3"), (Blanks, 3, named("X|Y|Z"), 1, 12));
        assert_eq!(found("\u{feff}//X Y Z\n1 2 3"), (Blanks, 3, named("X|Y|Z"), 1, 11));
        assert_eq!(found("# by me\n1 2 3 4"), (Blanks, 4, None, 1, 8));
        assert_eq!(found("2\n1 2 3 4"), (Blanks, 4, None, 0, 0));
        assert_eq!(found("# nothing\n\n"), (Blanks, 3, None, 0, 11));
        assert_eq!(found("//X Y Z R\n"), (Blanks, 4, named("X|Y|Z|R"), 0, 10));
    }

    #[test]
    fn what_is_no_text_of_numbers_is_told() {
        let told = |text: &str| head(text).unwrap_err().to_string();
        assert!(told("1,5 2,5 3,5\n").contains("decimal commas"));
        assert!(told("x\n1,5;2,5;3,5\n").contains("first bytes"));
        assert!(told("X,Y,Z\n1,2,3,4\n").contains("names 3 columns"));
        for odd in ["", "This is no file of numbers.", "{\"a\": 1}", "1 2\n3 4\n", "a b c\nd e f\n"]
        {
            assert!(told(odd).contains("by its first bytes"), "{odd}");
            assert!(!sniff(odd.as_bytes()), "{odd}");
        }
    }
}
