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
}
