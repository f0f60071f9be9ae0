//! Finds the lines with vertices in texts of OBJ, OFF and STL.

use std::fs::File;
use std::path::Path;

use super::kind::VerticesKind;
use crate::io::rows::fields::{Delimiter, Fields};
use crate::io::rows::lines::{Lines, shown};
use crate::stage::foreign;
use crate::{Error, Result};

/// The longest line that is looked at: faces of any number of corners are passed over.
pub(super) const LONGEST_LINE: usize = 1 << 16;

/// What OFF says of its vertices before the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct OffHead {
    pub vertices: u64,
    pub has_normals: bool,
    pub has_colors: bool,
    pub has_texture: bool,
}

/// The vertices of a text, one after the other.
pub(super) struct VertexTexts<'a> {
    lines: Lines<'a>,
    path: &'a Path,
    kind: VerticesKind,
    /// Of OFF.
    pub head: OffHead,
    /// Vertices that were given.
    given: u64,
    /// The last facet's normal, in STL: its place in the window would be gone.
    normal: Vec<u8>,
}

/// A line of a vertex: where its numbers begin, as it is read.
pub(super) struct VertexLine {
    /// In the window of the lines.
    span: (usize, usize),
    pub number: u64,
    pub byte: u64,
}

impl<'a> VertexTexts<'a> {
    /// The vertices of a file of `length` bytes; reads what OFF has before them.
    ///
    /// # Errors
    ///
    /// OFF that does not begin as such, is binary or has four coordinates.
    pub fn new(file: File, path: &'a Path, length: u64, kind: VerticesKind) -> Result<Self> {
        let lines = Lines::new(file, path, [0, length], 0, LONGEST_LINE);
        let head = OffHead::default();
        let mut all = VertexTexts { lines, path, kind, head, given: 0, normal: Vec::new() };
        if kind == VerticesKind::Off {
            all.head = all.off_head()?;
        }
        Ok(all)
    }

    /// The text of a line behind its comment's beginning is none.
    fn said(text: &[u8]) -> &[u8] {
        let end = text.iter().position(|&b| b == b'#').unwrap_or(text.len());
        text[..end].trim_ascii()
    }

    fn off_head(&mut self) -> Result<OffHead> {
        let foreign = || foreign(self.path, VerticesKind::Off.names()[1]);
        let mut words: Vec<String> = Vec::new();
        while words.len() < 4 {
            let next = self.lines.next().map_err(|error| match error.kind() {
                crate::ErrorKind::Data => foreign(),
                _ => error,
            })?;
            let Some((start, end)) = next else { break };
            let text =
                String::from_utf8_lossy(Self::said(self.lines.text(start, end))).into_owned();
            words.extend(text.split_whitespace().map(str::to_owned));
            let first = words.first().map_or("", String::as_str);
            if !words.is_empty() && prefix(first).is_none() {
                return Err(foreign());
            }
            if words.get(1).is_some_and(|word| word == "BINARY") {
                let told = "binary OFF is not read";
                return Err(Error::data(self.path, told).help("write it as text, or as PLY"));
            }
        }
        let marks = words.first().and_then(|first| prefix(first)).ok_or_else(foreign)?;
        if marks.contains('4') || marks.contains('n') {
            let told = "its vertices have other than three coordinates";
            return Err(Error::data(self.path, told).at_byte(0));
        }
        let vertices = words.get(1).and_then(|word| word.parse().ok());
        let Some(vertices) = vertices.filter(|_| words.len() == 4) else {
            let told = "it does not say how many vertices, faces and edges there are";
            return Err(Error::data(self.path, told).at_byte(0).help("correct its first lines"));
        };
        Ok(OffHead {
            vertices,
            has_normals: marks.contains('N'),
            has_colors: marks.contains('C'),
            has_texture: marks.contains("ST"),
        })
    }

    /// The next line with a vertex.
    ///
    /// # Errors
    ///
    /// OFF that ends before all its vertices.
    pub fn next(&mut self) -> Result<Option<VertexLine>> {
        loop {
            let is_done = self.kind == VerticesKind::Off && self.given == self.head.vertices;
            if is_done {
                return Ok(None);
            }
            let Some((start, end)) = self.lines.next()? else {
                if self.kind == VerticesKind::Off {
                    let (given, all) = (self.given, self.head.vertices);
                    let told = format!("the file ends after {given} of {all} vertices");
                    return Err(Error::data(self.path, told)
                        .at_byte(self.lines.length())
                        .help("the file is cut short, or its header is wrong"));
                }
                return Ok(None);
            };
            let text = self.lines.text(start, end);
            let keyword = |word: &str| {
                let begun = text.len() - text.trim_ascii_start().len();
                let rest = text[begun..].strip_prefix(word.as_bytes())?;
                let is_word = rest.first().is_some_and(u8::is_ascii_whitespace);
                is_word.then_some(start + begun + word.len())
            };
            let begins = match self.kind {
                VerticesKind::Obj => keyword("v"),
                VerticesKind::Off => (!Self::said(text).is_empty()).then_some(start),
                VerticesKind::Stl => {
                    if let Some(from) = keyword("facet") {
                        let normal = self.lines.text(from, end).trim_ascii();
                        self.normal = normal.strip_prefix(b"normal").unwrap_or(&[]).to_vec();
                    }
                    keyword("vertex")
                }
            };
            if let Some(begins) = begins {
                self.given += 1;
                let (number, byte) = (self.lines.number(), self.lines.byte(begins));
                return Ok(Some(VertexLine { span: (begins, end), number, byte }));
            }
        }
    }

    /// The numbers of a line that was just read, then those of its facet's normal.
    pub fn numbers(&self, line: &VertexLine) -> impl Iterator<Item = &[u8]> {
        let text = Self::said(self.lines.text(line.span.0, line.span.1));
        let mut own = Fields::new(text, Delimiter::Blanks);
        let mut normal = Fields::new(&self.normal, Delimiter::Blanks);
        std::iter::from_fn(move || own.next().or_else(|| normal.next()))
    }

    /// The error of a line.
    pub fn fail(&self, line: &VertexLine, told: &str) -> Error {
        Error::data(self.path, format!("line {}: {told}", line.number))
            .at_byte(line.byte)
            .help("correct the line, or write the file again")
    }

    /// The error of a word on a line.
    pub fn no_number(&self, line: &VertexLine, word: &[u8]) -> Error {
        let word = shown(&String::from_utf8_lossy(word));
        self.fail(line, &format!("`{word}` is no number"))
    }
}

/// What stands before `OFF` in the first word, such as `C` for colours; None for another word.
fn prefix(word: &str) -> Option<&str> {
    let marks = word.strip_suffix("OFF")?;
    ["", "C", "N", "ST", "4", "n", "CN", "NC", "STC", "STN", "STCN", "STNC"]
        .contains(&marks)
        .then_some(marks)
}

/// True if a text that begins so is of this kind.
pub(super) fn sniff(first: &[u8], kind: VerticesKind) -> bool {
    let text = String::from_utf8_lossy(first);
    let said = |line: &&str| {
        let line = line.trim();
        !line.is_empty() && !line.starts_with('#')
    };
    let mut lines = text.lines().filter(said);
    match kind {
        VerticesKind::Off => {
            let word = lines.next().and_then(|line| line.split_whitespace().next());
            word.is_some_and(|word| prefix(word).is_some())
        }
        VerticesKind::Stl => {
            let is_solid = lines.next().is_some_and(|line| line.trim_start().starts_with("solid"));
            let is_facet = |line: &str| {
                let line = line.trim_start();
                line.starts_with("facet") || line.starts_with("endsolid")
            };
            is_solid && lines.next().is_none_or(is_facet) && !text.contains('\u{fffd}')
        }
        VerticesKind::Obj => {
            const WORDS: [&str; 8] = ["mtllib", "o", "g", "s", "v", "vn", "vt", "usemtl"];
            let word = |line: &str| line.split_whitespace().next().map(str::to_owned);
            let words: Vec<String> = lines.filter_map(word).collect();
            let is_word = |word: &String| WORDS.contains(&word.as_str());
            let whole = words.split_last().map_or(&[][..], |(_, whole)| whole);
            words.first().is_some_and(is_word) && whole.iter().all(is_word)
        }
    }
}
