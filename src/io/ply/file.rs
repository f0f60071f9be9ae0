//! One PLY file: where its vertices are, and whether it is long enough for them.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use super::header::{Element, PlyHeader, Property, PropertyKind};
use super::walk;
use crate::io::damage::Losses;
use crate::io::origin::Origin;
use crate::io::rows::Encoding;
use crate::io::rows::lines::shown;
use crate::io::rows::names::dimension_of;
use crate::stage::OnError;
use crate::{Error, Result};

/// One file, its header read.
pub(super) struct PlyFile {
    pub path: PathBuf,
    pub origin: Origin,
    pub header: PlyHeader,
    pub points: u64,
    pub length: u64,
    /// Byte of the first vertex in a binary file, of the first element in a text file.
    pub body: u64,
    /// Lines of text before the first vertex line, behind the header.
    pub skipped_lines: u64,
    /// Place of `vertex` among the elements.
    pub vertex: usize,
    /// Set when a text file turns out to have more lines than its header counts.
    pub more_lines: AtomicBool,
    /// Numbers of a text read so far that have more digits than the `float` that holds them.
    pub rounded: AtomicU64,
    /// True for a text whose last vertex ends where the file does: nobody knows whether its last
    /// number has all its digits.
    pub ends_in_a_number: bool,
    /// What is lost of it.
    pub losses: Losses,
    /// True if it ends before its vertices do.
    pub is_cut: bool,
}

impl PlyFile {
    /// Reads the header, and what stands before the vertices of a binary file.
    pub fn open(path: &Path, on_error: OnError) -> Result<PlyFile> {
        let (file, origin) = Origin::open(path)?;
        let length = origin.length();
        let header = PlyHeader::read(&file, path, length)?;
        let Some(vertex) = header.vertex() else {
            let elements: Vec<String> =
                header.elements.iter().map(|e| format!("`{}`", shown(&e.name))).collect();
            let found = match elements.len() {
                0 => "no element at all".to_owned(),
                _ => elements.join(", "),
            };
            return Err(Error::data(path, format!("no element `vertex`: the file has {found}")));
        };
        let element = &header.elements[vertex];
        check(path, element)?;
        let before = &header.elements[..vertex];
        let (body, skipped_lines) = match header.encoding {
            Encoding::Ascii => (header.body, text_lines(before)),
            encoding => (walk::past(&file, path, before, header.body, length, encoding)?, 0),
        };
        let ends_open = header.encoding == Encoding::Ascii && ends_open(&file, path, length)?;
        let mut file = PlyFile {
            path: path.to_owned(),
            origin,
            points: element.count,
            length,
            body,
            skipped_lines,
            vertex,
            more_lines: AtomicBool::new(false),
            rounded: AtomicU64::new(0),
            ends_in_a_number: false,
            losses: Losses::new(on_error),
            is_cut: false,
            header,
        };
        file.bound()?;
        file.ends_in_a_number = ends_open && file.points > 0 && file.ends_with_vertices();
        Ok(file)
    }

    /// The names of the lists that its vertices have, which are not read.
    pub fn lists(&self) -> Vec<&str> {
        let is_list = |p: &&Property| matches!(p.kind, PropertyKind::List { .. });
        self.properties().iter().filter(is_list).map(|p| p.name.as_str()).collect()
    }

    /// The properties of its vertices.
    pub fn properties(&self) -> &[Property] {
        &self.header.elements[self.vertex].properties
    }

    /// True if nothing that the header names stands behind the vertices.
    pub fn ends_with_vertices(&self) -> bool {
        let behind = &self.header.elements[self.vertex + 1..];
        behind.iter().all(|e| e.count == 0 || e.properties.is_empty())
    }

    /// What is to be said of bytes behind the last element that the header names. Of a text file it
    /// is known once all is read; of elements with lists never.
    pub fn unread(&self) -> Option<String> {
        let what = if self.header.encoding == Encoding::Ascii {
            self.more_lines.load(Ordering::Relaxed).then(|| "lines".to_owned())?
        } else {
            let behind = &self.header.elements[self.vertex..];
            let mut sizes = behind.iter().map(|e| e.size()?.checked_mul(e.count));
            let end = sizes.try_fold(self.body, |end, size| end.checked_add(size?))?;
            // Some writers end a binary file with an empty line.
            let bytes = self.length.checked_sub(end).filter(|&bytes| bytes > 2)?;
            format!("{bytes} bytes")
        };
        Some(format!(
            "{what} behind the {} vertices that the header counts are not read",
            self.points
        ))
    }

    /// A warning for numbers that lost digits, known once all is read.
    pub fn rounded(&self) -> Option<String> {
        let numbers = self.rounded.load(Ordering::Relaxed);
        (numbers > 0).then(|| {
            format!(
                "{}: {numbers} numbers of `float` properties have more digits than a `float` holds \
                 and were rounded to it; `double` in its header keeps them",
                crate::error::shown(&self.path)
            )
        })
    }

    /// Refuses a count of vertices that the file is too short for, or goes on with those that there
    /// are.
    fn bound(&mut self) -> Result<()> {
        let room = self.length.saturating_sub(self.body);
        let holds = match self.header.elements[self.vertex].size() {
            Some(size) if self.header.encoding != Encoding::Ascii => room / size.max(1),
            None if self.header.encoding != Encoding::Ascii => {
                let least = |p: &Property| match p.kind {
                    PropertyKind::Scalar(scalar) => scalar.size() as u64,
                    PropertyKind::List { count, .. } => count.size() as u64,
                };
                room / self.properties().iter().map(least).sum::<u64>().max(1)
            }
            // A value takes a digit and a separator, which the last may lack.
            _ => (room + 1) / (2 * self.properties().len().max(1) as u64),
        };
        if self.points <= holds {
            return Ok(());
        }
        let told = format!(
            "the header claims {} vertices, the file ends after {holds} at most",
            self.points
        );
        let error = Error::data(&self.path, told)
            .at_byte(self.length)
            .help("the file is cut short, or its header is wrong");
        self.losses.lose(&self.path, self.length, self.points - holds, error)?;
        (self.points, self.is_cut) = (holds, true);
        Ok(())
    }
}

/// True if the last byte of a file is no blank and no end of a line.
fn ends_open(file: &File, path: &Path, length: u64) -> Result<bool> {
    let Some(at) = length.checked_sub(1) else { return Ok(false) };
    let mut last = [0];
    let read = file.read_exact_at(&mut last, at);
    read.map_err(|cause| Error::io(path, "read its end", cause).at_byte(at))?;
    Ok(!last[0].is_ascii_whitespace())
}

/// Lines that `elements` take in a text file. One without properties takes none.
fn text_lines(elements: &[Element]) -> u64 {
    elements
        .iter()
        .filter(|e| !e.properties.is_empty())
        .fold(0, |lines, e| lines.saturating_add(e.count))
}

/// Refuses a vertex element that lacks a coordinate.
fn check(path: &Path, vertex: &Element) -> Result<()> {
    let missing: Vec<&str> = ["x", "y", "z"]
        .into_iter()
        .filter(|axis| {
            let dimension = dimension_of(axis);
            let is_it = |p: &Property| p.name == *axis || p.name == dimension;
            let is_number = |p: &&Property| matches!(p.kind, PropertyKind::Scalar(_));
            !vertex.properties.iter().filter(is_number).any(is_it)
        })
        .collect();
    if missing.is_empty() {
        return Ok(());
    }
    Err(Error::data(path, format!("element `vertex` has no property {}", missing.join(", "))))
}
