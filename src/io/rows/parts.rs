//! Parts of several files, numbered one file behind the other.

/// For each file, the number of parts up to its end.
pub(crate) struct PartEnds(Vec<usize>);

impl PartEnds {
    /// Of files with so many parts.
    pub fn of(counts: impl IntoIterator<Item = usize>) -> Self {
        let mut parts = 0usize;
        let each = counts.into_iter().map(|count| {
            parts = parts.saturating_add(count);
            parts
        });
        PartEnds(each.collect())
    }

    /// All parts.
    pub fn parts(&self) -> usize {
        self.0.last().copied().unwrap_or(0)
    }

    /// The number of the file of a part, and that of the part in it.
    pub fn place(&self, index: usize) -> (usize, usize) {
        let number = self.0.partition_point(|&end| end <= index);
        (number, index - number.checked_sub(1).map_or(0, |before| self.0[before]))
    }
}
