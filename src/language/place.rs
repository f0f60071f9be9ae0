//! Where something is written in the texts of a pipeline.

use std::ops::Range;

/// A stretch of one of the texts that make up a pipeline: the file (0) or an argument (1, 2, …).
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct TextPlace {
    /// Which text.
    pub source: usize,
    /// First byte of the stretch.
    pub start: usize,
    /// The byte behind its last.
    pub end: usize,
}

impl TextPlace {
    /// The bytes `span` of text `source`.
    pub fn new(source: usize, span: Range<usize>) -> Self {
        TextPlace { source, start: span.start, end: span.end }
    }

    /// The bytes `span` of the value `text` that is written here: in quotes, in three quotes or in
    /// none. Where escapes shift them, all of the place.
    pub fn within(&self, text: &str, span: &Range<usize>) -> TextPlace {
        let quotes = match (self.end - self.start).checked_sub(text.len()) {
            Some(0) => 0,
            Some(2) => 1,
            Some(6) => 3,
            _ => return self.clone(),
        };
        let start = self.start + quotes;
        TextPlace { source: self.source, start: start + span.start, end: start + span.end }
    }
}

/// A word of a text and where it is written.
pub(crate) type PlacedWord = (String, TextPlace);
