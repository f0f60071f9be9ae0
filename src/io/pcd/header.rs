//! The header of a PCD file: lines of text to the one that says how the points are written.
//!
//! Source: the Point Cloud Library, "The PCD (Point Cloud Data) file format", versions .5 to .7.

use std::fs::File;
use std::path::Path;

use super::names::CALLED;
use crate::io::rows::lines::{Lines, shown};
use crate::point::Scalar;
use crate::stage::foreign;
use crate::{Error, Result};

/// The longest line of a header.
pub(super) const LONGEST_LINE: usize = 1 << 16;
/// Lines that a header has at most, comments included.
const LINES_MOST: usize = 1000;
/// Numbers of a point at most.
const NUMBERS_MOST: usize = 4096;

/// How the points are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PcdData {
    /// A line a point.
    Ascii,
    /// A record a point.
    Binary,
    /// All values of a field, then all of the next, packed by LZF.
    Compressed,
}

impl PcdData {
    pub fn word(self) -> &'static str {
        match self {
            PcdData::Ascii => "ascii",
            PcdData::Binary => "binary",
            PcdData::Compressed => "binary_compressed",
        }
    }
}

/// One field of a point.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct PcdField {
    pub name: String,
    /// None for padding.
    pub scalar: Option<Scalar>,
    /// Bytes of one number.
    pub size: usize,
    /// Numbers of a point.
    pub count: usize,
}

impl PcdField {
    pub fn bytes(&self) -> usize {
        self.size * self.count
    }

    /// As the header's line has the type.
    pub fn letter(&self) -> char {
        match self.scalar {
            Some(Scalar::F32 | Scalar::F64) => 'F',
            Some(Scalar::I8 | Scalar::I16 | Scalar::I32 | Scalar::I64) => 'I',
            _ => 'U',
        }
    }
}

/// What a header says.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PcdHeader {
    pub version: String,
    pub fields: Vec<PcdField>,
    /// Points of a row, and rows.
    pub width: u64,
    pub height: u64,
    /// What `POINTS` says, or the product of both where nothing does; and the byte of that entry.
    pub points: u64,
    pub points_at: u64,
    /// Where the sensor was, and how it was turned (a quaternion, w first).
    pub viewpoint: Option<[f64; 7]>,
    pub data: PcdData,
    pub comments: Vec<String>,
    /// Byte where the points begin, and lines before it.
    pub body: u64,
    pub lines: u64,
}

impl PcdHeader {
    /// Bytes of a point in binary.
    pub fn stride(&self) -> usize {
        self.fields.iter().map(PcdField::bytes).sum()
    }

    /// Points of all rows.
    pub fn cells(&self) -> u64 {
        self.width.saturating_mul(self.height)
    }

    /// What is wrong with its counts of points, if they are not the same.
    pub fn disagrees(&self) -> Option<String> {
        let PcdHeader { points, width, height, .. } = self;
        (self.cells() != *points)
            .then(|| format!("`POINTS {points}` is not `WIDTH {width}` times `HEIGHT {height}`"))
    }

    /// Reads the header of a file of `length` bytes. Its counts of points may differ.
    ///
    /// # Errors
    ///
    /// A file that does not begin as PCD does, and what is missing or wrong in its header.
    pub fn read(file: File, path: &Path, length: u64) -> Result<PcdHeader> {
        let mut reader = HeaderReader { path, found: Vec::new() };
        let mut lines = Lines::new(file, path, [0, length], 0, LONGEST_LINE);
        let mut comments = Vec::new();
        for _ in 0..LINES_MOST {
            let next = lines.next().map_err(|error| match error.kind() {
                crate::ErrorKind::Data => foreign(path, CALLED),
                _ => error,
            })?;
            let Some((start, end)) = next else { break };
            let text = String::from_utf8_lossy(lines.text(start, end)).into_owned();
            let text = text.trim();
            if let Some(comment) = text.strip_prefix('#') {
                comments.push(comment.trim().to_owned());
                continue;
            }
            let (key, value) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
            if !KEYS.contains(&key) {
                let (number, at) = (lines.number(), lines.byte(start));
                return Err(match reader.found.is_empty() {
                    true => foreign(path, CALLED),
                    false => {
                        let told =
                            format!("line {number}: `{}` is no entry of its header", shown(key));
                        Error::data(path, told).at_byte(at).help(DAMAGED)
                    }
                });
            }
            reader.found.push((key.to_owned(), value.trim().to_owned(), lines.byte(start)));
            if key == "DATA" {
                return reader.header(comments, lines.at(), lines.number());
            }
        }
        match reader.found.is_empty() {
            true => Err(foreign(path, CALLED)),
            false => Err(reader.fail("it has no line `DATA`".to_owned(), length)),
        }
    }
}

const KEYS: [&str; 11] = [
    "VERSION",
    "FIELDS",
    "COLUMNS",
    "SIZE",
    "TYPE",
    "COUNT",
    "WIDTH",
    "HEIGHT",
    "VIEWPOINT",
    "POINTS",
    "DATA",
];

pub(super) const DAMAGED: &str = "correct the header, or write the file again";

struct HeaderReader<'a> {
    path: &'a Path,
    /// Keys and values, and where their lines begin.
    found: Vec<(String, String, u64)>,
}

impl HeaderReader<'_> {
    fn fail(&self, told: String, at: u64) -> Error {
        Error::data(self.path, told).at_byte(at).help(DAMAGED)
    }

    fn get(&self, key: &str) -> Option<(&str, u64)> {
        let found = self.found.iter().find(|(known, ..)| known == key);
        found.map(|(_, value, at)| (value.as_str(), *at))
    }

    /// The words of an entry, as many as there are fields.
    fn words<'a>(&'a self, key: &str, fields: usize) -> Result<Option<(Vec<&'a str>, u64)>> {
        let Some((value, at)) = self.get(key) else { return Ok(None) };
        let words: Vec<&str> = value.split_whitespace().collect();
        match words.len() == fields {
            true => Ok(Some((words, at))),
            false => {
                let told = format!("`{key}` is of {} fields, `FIELDS` of {fields}", words.len());
                Err(self.fail(told, at))
            }
        }
    }

    fn number(&self, key: &str) -> Result<Option<u64>> {
        let Some((value, at)) = self.get(key) else { return Ok(None) };
        let number = value.parse::<u64>();
        let told = || format!("`{key} {}` is no whole number", shown(value));
        number.map(Some).map_err(|_| self.fail(told(), at))
    }

    fn fields(&self) -> Result<Vec<PcdField>> {
        let Some((names, at)) = self.get("FIELDS").or_else(|| self.get("COLUMNS")) else {
            return Err(self.fail("it has no line `FIELDS`".to_owned(), 0));
        };
        let names: Vec<&str> = names.split_whitespace().collect();
        let Some((sizes, size_at)) = self.words("SIZE", names.len())? else {
            return Err(self.fail("it has no line `SIZE`".to_owned(), at));
        };
        let types = self.words("TYPE", names.len())?;
        let counts = self.words("COUNT", names.len())?;
        let mut fields = Vec::new();
        for (n, name) in names.iter().enumerate() {
            let letter = types.as_ref().map_or("F", |(types, _)| types[n]);
            let count = counts.as_ref().map_or("1", |(counts, _)| counts[n]);
            let count =
                count.parse::<usize>().ok().filter(|count| (1..=NUMBERS_MOST).contains(count));
            let (size, is_padding) = (sizes[n].parse::<usize>().ok(), *name == "_");
            let scalar = size.and_then(|size| scalar(letter, size));
            match (count, size.filter(|size| (1..=8).contains(size))) {
                (Some(count), Some(size)) if is_padding || scalar.is_some() => {
                    let scalar = scalar.filter(|_| !is_padding);
                    fields.push(PcdField { name: (*name).to_owned(), scalar, size, count });
                }
                (None, _) => {
                    let told = format!("the count of field `{}` is no count", shown(name));
                    return Err(self.fail(told, at));
                }
                _ => {
                    let told = format!(
                        "field `{}` is of type {} and size {}, which is no number",
                        shown(name),
                        shown(letter),
                        shown(sizes[n])
                    );
                    return Err(self.fail(told, size_at));
                }
            }
        }
        match fields.iter().map(|field| field.count).sum::<usize>() {
            1..=NUMBERS_MOST => Ok(fields),
            n => Err(self.fail(format!("a point of {n} numbers is not read"), at)),
        }
    }

    fn header(&self, comments: Vec<String>, body: u64, lines: u64) -> Result<PcdHeader> {
        let fields = self.fields()?;
        let (value, at) = self.get("DATA").unwrap_or_default();
        let all = [PcdData::Ascii, PcdData::Binary, PcdData::Compressed];
        // As some versions of pypcd4 misspell it.
        let said = if value == "binaryscompressed" { PcdData::Compressed.word() } else { value };
        let Some(data) = all.into_iter().find(|data| data.word() == said) else {
            return Err(self.fail(format!("`DATA {}` is not known", shown(value)), at));
        };
        let (width, height) = (self.number("WIDTH")?, self.number("HEIGHT")?);
        let points = self.number("POINTS")?;
        let height = height.unwrap_or(1);
        let Some(width) = width.or(points) else {
            return Err(self.fail("it says neither `WIDTH` nor `POINTS`".to_owned(), body));
        };
        let points = points.unwrap_or(width.saturating_mul(height));
        let points_at = self.get("POINTS").map_or(0, |(_, at)| at);
        let viewpoint = self.get("VIEWPOINT").and_then(|(value, _)| {
            let numbers: Vec<f64> = value.split_whitespace().flat_map(str::parse).collect();
            numbers.try_into().ok()
        });
        let version = self.get("VERSION").map_or(String::new(), |(value, _)| value.to_owned());
        Ok(PcdHeader {
            version,
            fields,
            width,
            height,
            points,
            points_at,
            viewpoint,
            data,
            comments,
            body,
            lines,
        })
    }
}

fn scalar(letter: &str, size: usize) -> Option<Scalar> {
    Some(match (letter, size) {
        ("U", 1) => Scalar::U8,
        ("U", 2) => Scalar::U16,
        ("U", 4) => Scalar::U32,
        ("U", 8) => Scalar::U64,
        ("I", 1) => Scalar::I8,
        ("I", 2) => Scalar::I16,
        ("I", 4) => Scalar::I32,
        ("I", 8) => Scalar::I64,
        ("F", 4) => Scalar::F32,
        ("F", 8) => Scalar::F64,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(text: &str) -> Result<PcdHeader> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pcd");
        std::fs::write(&path, text).unwrap();
        PcdHeader::read(File::open(&path).unwrap(), &path, text.len() as u64)
    }

    const FIRST: &str = "# .PCD v.7\nVERSION .7\nFIELDS x y z _ fpfh\nSIZE 4 4 8 1 4\n";

    #[test]
    fn entries_are_read_and_old_headers_filled_in() {
        let rest = "TYPE F F F U F\nCOUNT 1 1 1 4 33\nWIDTH 3\nHEIGHT 2\nVIEWPOINT 1 2 3 1 0 0 0\n\
                    POINTS 6\nDATA binary\nrest";
        let read = header(&format!("{FIRST}{rest}")).unwrap();
        assert_eq!((read.points, read.stride()), (6, 4 + 4 + 8 + 4 + 4 * 33));
        assert_eq!(read.viewpoint.unwrap()[..3], [1.0, 2.0, 3.0]);
        assert_eq!(read.fields[3].scalar, None);
        assert_eq!(read.body as usize, FIRST.len() + rest.len() - 4);
        let old = header("COLUMNS x y z\nSIZE 4 4 4\nWIDTH 5\nDATA ascii\r\n").unwrap();
        assert_eq!((old.points, old.height, old.fields.len()), (5, 1, 3));
        assert_eq!(old.disagrees(), None);
        let odd = header(&format!("{FIRST}WIDTH 3\nPOINTS 4\nDATA ascii\n")).unwrap();
        assert_eq!(odd.disagrees().unwrap(), "`POINTS 4` is not `WIDTH 3` times `HEIGHT 1`");
        assert_eq!(odd.points_at as usize, FIRST.len() + "WIDTH 3\n".len());
    }

    #[test]
    fn what_is_wrong_is_told() {
        let told = |text: &str| header(text).unwrap_err().to_string();
        for odd in ["", "1 2 3\n", "ply\n", "\0\0\0"] {
            assert!(told(odd).contains("by its first bytes"), "{odd:?}");
        }
        let with = |rest: &str| told(&format!("{FIRST}{rest}"));
        assert!(with("WIDTH 3\n").contains("no line `DATA`"));
        assert!(with("HUH 3\nDATA ascii\n").contains("`HUH` is no entry"));
        assert!(with("COUNT 1 1\nDATA ascii\n").contains("`COUNT` is of 2 fields, `FIELDS` of 5"));
        assert!(with("DATA ascii\n").contains("neither"));
        assert!(with("WIDTH 3\nDATA zip\n").contains("`DATA zip`"));
        assert!(with("TYPE F F F U Q\nWIDTH 3\nDATA ascii\n").contains("of type Q and size 4"));
        assert!(with("COUNT 1 1 1 1 99999\nWIDTH 1\nDATA ascii\n").contains("no count"));
    }
}
