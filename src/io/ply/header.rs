//! The header of a PLY file: text, line by line, to `end_header`.

use std::collections::BTreeSet;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

use crate::io::rows::Encoding;
use crate::io::rows::lines::shown;
use crate::point::Scalar;
use crate::stage::foreign;
use crate::{Error, Result};

/// What messages call a PLY file.
pub(super) const CALLED: &str = "a PLY file";

/// The longest header that is read, in bytes.
const LONGEST: u64 = 1 << 20;

/// The word for an encoding in the header's `format` line.
pub(super) fn word(encoding: Encoding) -> &'static str {
    match encoding {
        Encoding::Ascii => "ascii",
        Encoding::BinaryLittleEndian => "binary_little_endian",
        Encoding::BinaryBigEndian => "binary_big_endian",
    }
}

fn encoding_of(text: &str) -> Option<Encoding> {
    [Encoding::Ascii, Encoding::BinaryLittleEndian, Encoding::BinaryBigEndian]
        .into_iter()
        .find(|&encoding| word(encoding) == text)
}

/// What a header says.
#[derive(Debug, Clone)]
pub(super) struct PlyHeader {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
    pub comments: Vec<String>,
    pub obj_info: Vec<String>,
    /// Byte where the first element's values begin.
    pub body: u64,
    /// How many lines the header has.
    pub lines: u64,
}

/// A kind of thing in the file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Element {
    pub name: String,
    /// How many the header claims.
    pub count: u64,
    pub properties: Vec<Property>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Property {
    pub name: String,
    pub kind: PropertyKind,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum PropertyKind {
    Scalar(Scalar),
    List { count: Scalar, item: Scalar },
}

/// The classic name of a type, which every reader knows. (`int64` and `uint64` are an extension.)
pub(super) fn type_name(scalar: Scalar) -> &'static str {
    match scalar {
        Scalar::I8 => "char",
        Scalar::U8 => "uchar",
        Scalar::I16 => "short",
        Scalar::U16 => "ushort",
        Scalar::I32 => "int",
        Scalar::U32 => "uint",
        Scalar::I64 => "int64",
        Scalar::U64 => "uint64",
        Scalar::F32 => "float",
        Scalar::F64 => "double",
    }
}

/// The types that [`scalar_of`] knows, for messages.
const KINDS: &str = "char, uchar, short, ushort, int, uint, float and double, or int8 to int64, \
                     uint8 to uint64, float32 and float64";

fn scalar_of(word: &str) -> Option<Scalar> {
    Some(match word {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "int64" => Scalar::I64,
        "uint64" => Scalar::U64,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return None,
    })
}

impl PropertyKind {
    /// The type as a header words it.
    pub fn word(self) -> String {
        match self {
            PropertyKind::Scalar(scalar) => type_name(scalar).to_owned(),
            PropertyKind::List { count, item } => {
                format!("list {} {}", type_name(count), type_name(item))
            }
        }
    }
}

impl Element {
    /// Its lines in a header.
    pub fn lines(&self) -> String {
        let mut lines = format!("element {} {}\n", self.name, self.count);
        for property in &self.properties {
            lines += &format!("property {} {}\n", property.kind.word(), property.name);
        }
        lines
    }

    /// Bytes of one of them in a binary file; None if it has lists.
    pub fn size(&self) -> Option<u64> {
        self.properties
            .iter()
            .map(|p| match p.kind {
                PropertyKind::Scalar(scalar) => Some(scalar.size() as u64),
                PropertyKind::List { .. } => None,
            })
            .sum()
    }
}

impl PlyHeader {
    /// Reads the header of `file`, which is `length` bytes long. Errors name the byte where the
    /// offending line begins.
    pub fn read(file: &File, path: &Path, length: u64) -> Result<PlyHeader> {
        for limit in [1 << 16, LONGEST] {
            let held = limit.min(length);
            let mut bytes = vec![0; held as usize];
            file.read_exact_at(&mut bytes, 0)
                .map_err(|cause| Error::io(path, "read the header", cause))?;
            if let Some(header) = parse(&bytes, held == length, path)? {
                return Ok(header);
            }
            if held == length {
                return Err(Error::data(path, "the header has no end_header").at_byte(length));
            }
        }
        Err(Error::data(path, format!("the header is longer than {LONGEST} bytes"))
            .at_byte(LONGEST))
    }

    /// Place of the vertex element.
    pub fn vertex(&self) -> Option<usize> {
        self.elements.iter().position(|e| e.name == "vertex")
    }
}

/// The lines of a header. A file whose first line ends in a lone carriage return ends all header
/// lines so; every other one ends them with a line feed, a carriage return before it being dropped.
/// (The first line decides, because a binary body may begin with the byte of a line feed.)
struct HeaderLines<'a> {
    bytes: &'a [u8],
    at: usize,
    end: u8,
}

impl<'a> HeaderLines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let first = bytes.iter().position(|b| matches!(b, b'\r' | b'\n'));
        let lone = first.is_some_and(|i| bytes[i] == b'\r' && bytes.get(i + 1) != Some(&b'\n'));
        HeaderLines { bytes, at: 0, end: if lone { b'\r' } else { b'\n' } }
    }
}

impl<'a> Iterator for HeaderLines<'a> {
    /// Where the line begins, the line, and whether it has its end.
    type Item = (usize, &'a [u8], bool);

    fn next(&mut self) -> Option<Self::Item> {
        let start = self.at;
        let rest = self.bytes.get(start..).filter(|rest| !rest.is_empty())?;
        let (line, ended) = match rest.iter().position(|&b| b == self.end) {
            Some(length) => (&rest[..length], true),
            None => (rest, false),
        };
        self.at = start + line.len() + usize::from(ended);
        Some((start, line.strip_suffix(b"\r").unwrap_or(line), ended))
    }
}

/// Parses a header that `bytes` begin with; None if they hold no end of it. `whole` says that they
/// are the whole file, whose last line needs no end.
fn parse(bytes: &[u8], whole: bool, path: &Path) -> Result<Option<PlyHeader>> {
    let fail = |at: usize, message: String| Error::data(path, message).at_byte(at as u64);
    let mut lines = HeaderLines::new(bytes);
    // Asked of a line without an end too: what is no PLY is told as such, whatever its size.
    if lines.next().is_none_or(|(_, line, _)| line.trim_ascii() != b"ply") {
        return Err(foreign(path, CALLED));
    }
    let mut header = Partial { lines: 1, ..Partial::default() };
    while let Some((at, line, ended)) = lines.next() {
        if !ended && !whole {
            break;
        }
        header.lines += 1;
        if line.trim_ascii() == b"end_header" {
            let encoding = header
                .encoding
                .ok_or_else(|| fail(at, "the header has no `format` line".into()))?;
            return Ok(Some(PlyHeader {
                encoding,
                elements: header.elements,
                comments: header.comments,
                obj_info: header.obj_info,
                body: lines.at as u64,
                lines: header.lines,
            }));
        }
        header.line(line).map_err(|message| fail(at, message))?;
    }
    Ok(None)
}

/// A header as far as it is read.
#[derive(Default)]
struct Partial {
    encoding: Option<Encoding>,
    elements: Vec<Element>,
    element_names: BTreeSet<String>,
    /// Names of the last element's properties.
    names: BTreeSet<String>,
    comments: Vec<String>,
    obj_info: Vec<String>,
    lines: u64,
}

impl Partial {
    fn line(&mut self, line: &[u8]) -> Result<(), String> {
        let line = text(line);
        let line = line.trim_start();
        let (keyword, rest) =
            line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
        let words: Vec<&str> = rest.split_ascii_whitespace().collect();
        // The other line ends are none here; written, they are spaces, and say the same as these.
        let told = || rest.replace(['\n', '\r'], " ");
        match (keyword, words.as_slice()) {
            ("", _) => Ok(()),
            ("comment", _) => {
                self.comments.push(told());
                Ok(())
            }
            ("obj_info", _) => {
                self.obj_info.push(told());
                Ok(())
            }
            ("format", words) => self.format(words),
            ("element", words) => self.element(words),
            ("property", words) => self.property(words),
            _ => Err(format!(
                "`{}` is no header keyword (format, comment, obj_info, element, property, \
                 end_header)",
                shown(keyword)
            )),
        }
    }

    fn format(&mut self, words: &[&str]) -> Result<(), String> {
        let &[encoding, version] = words else {
            return Err("a `format` line is `format ENCODING 1.0`".into());
        };
        if self.encoding.is_some() {
            return Err("a second `format` line".into());
        }
        if version != "1.0" {
            return Err(format!("PLY version {} is not known; 1.0 is", shown(version)));
        }
        self.encoding = Some(encoding_of(encoding).ok_or_else(|| {
            format!(
                "encoding `{}` is not known (ascii, binary_little_endian, binary_big_endian)",
                shown(encoding)
            )
        })?);
        Ok(())
    }

    fn element(&mut self, words: &[&str]) -> Result<(), String> {
        let &[name, count] = words else {
            return Err("an `element` line is `element NAME COUNT`".into());
        };
        let count = count
            .parse()
            .map_err(|_| format!("`{}` is no count of element `{}`", shown(count), shown(name)))?;
        if !self.element_names.insert(name.to_owned()) {
            return Err(format!("a second element `{}`", shown(name)));
        }
        self.elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
        self.names.clear();
        Ok(())
    }

    fn property(&mut self, words: &[&str]) -> Result<(), String> {
        let scalar = |word: &str| {
            scalar_of(word).ok_or_else(|| {
                let (word, known) = (shown(word), KINDS);
                format!("no property has the type `{word}`; types are {known}")
            })
        };
        let (name, kind) = match *words {
            ["list", count, item, name] => {
                let (count, item) = (scalar(count)?, scalar(item)?);
                if count.is_float() {
                    return Err(format!("list `{}` has a count that is no integer", shown(name)));
                }
                (name, PropertyKind::List { count, item })
            }
            [kind, name] => (name, PropertyKind::Scalar(scalar(kind)?)),
            _ => {
                return Err("a `property` line is `property TYPE NAME` or \
                            `property list COUNT_TYPE TYPE NAME`"
                    .into());
            }
        };
        let Some(element) = self.elements.last_mut() else {
            return Err(format!("property `{}` stands before any element", shown(name)));
        };
        if !self.names.insert(name.to_owned()) {
            return Err(format!(
                "a second property `{}` of element `{}`",
                shown(name),
                shown(&element.name)
            ));
        }
        element.properties.push(Property { name: name.to_owned(), kind });
        Ok(())
    }
}

/// A line as text: UTF-8, else Latin-1, so that no byte is lost.
fn text(line: &[u8]) -> String {
    match std::str::from_utf8(line) {
        Ok(text) => text.to_owned(),
        Err(_) => line.iter().map(|&b| char::from(b)).collect(),
    }
}
