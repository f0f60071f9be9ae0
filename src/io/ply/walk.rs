//! Finds the end of the elements that stand before the vertices of a binary file.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

use super::header::{Element, PropertyKind};
use crate::io::rows::Encoding;
use crate::io::rows::lines::shown;
use crate::point::{Dimension, Endian, Scalar, Value};
use crate::{Error, Result};

/// Bytes of the window through which lists are walked.
const WINDOW: usize = 1 << 16;

/// Byte behind `elements`, which begin at byte `start` of a file of `length` bytes. Lists are
/// walked one by one, each from its count; everything else is stepped over.
pub(super) fn past(
    file: &File,
    path: &Path,
    elements: &[Element],
    start: u64,
    length: u64,
    encoding: Encoding,
) -> Result<u64> {
    let mut walk = ElementWalk {
        file,
        path,
        length,
        endian: encoding.endian(),
        at: start,
        window: Vec::new(),
        from: 0,
    };
    for element in elements {
        match element.size() {
            Some(size) => walk.step(element, element.count.checked_mul(size))?,
            None => {
                for _ in 0..element.count {
                    walk.one(element)?; // takes a byte at least, so the file's length ends it
                }
            }
        }
    }
    Ok(walk.at)
}

struct ElementWalk<'a> {
    file: &'a File,
    path: &'a Path,
    length: u64,
    endian: Endian,
    at: u64,
    window: Vec<u8>,
    /// Byte of the file where the window begins.
    from: u64,
}

impl ElementWalk<'_> {
    fn one(&mut self, element: &Element) -> Result<()> {
        for property in &element.properties {
            let bytes = match property.kind {
                PropertyKind::Scalar(scalar) => Some(scalar.size() as u64),
                PropertyKind::List { count, item } => {
                    self.count(element, count)?.checked_mul(item.size() as u64)
                }
            };
            self.step(element, bytes)?;
        }
        Ok(())
    }

    /// Steps over `bytes`, None being more than there can be.
    fn step(&mut self, element: &Element, bytes: Option<u64>) -> Result<()> {
        match bytes.and_then(|bytes| self.at.checked_add(bytes)).filter(|&at| at <= self.length) {
            Some(at) => {
                self.at = at;
                Ok(())
            }
            None => Err(Error::data(
                self.path,
                format!(
                    "the file ends within element `{}`, before its vertices",
                    shown(&element.name)
                ),
            )
            .at_byte(self.at)),
        }
    }

    /// Reads the count of a list and steps over it.
    fn count(&mut self, element: &Element, scalar: Scalar) -> Result<u64> {
        let at = self.at;
        self.step(element, Some(scalar.size() as u64))?;
        if at < self.from || self.at > self.from + self.window.len() as u64 {
            let held = (self.length - at).min(WINDOW as u64) as usize;
            self.window.resize(held, 0);
            self.from = at;
            self.file
                .read_exact_at(&mut self.window, at)
                .map_err(|cause| Error::io(self.path, "read a list", cause).at_byte(at))?;
        }
        let stored = Dimension::new("count", scalar, (at - self.from) as usize);
        match stored.get(&self.window, self.endian) {
            Value::Unsigned(count) => Ok(count),
            Value::Signed(count) if count >= 0 => Ok(count as u64),
            _ => Err(Error::data(
                self.path,
                format!("a list of element `{}` has a negative count", shown(&element.name)),
            )
            .at_byte(at)),
        }
    }
}
