//! The numbers on a line of text.

use super::number;
use crate::point::Scalar;

/// What stands between two numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Delimiter {
    /// Blanks and tabs, one or more.
    Blanks,
    /// This character, and perhaps blanks around it.
    Mark(u8),
}

impl Delimiter {
    /// In the order in which they are tried.
    const ALL: [Delimiter; 3] = [Delimiter::Mark(b','), Delimiter::Mark(b';'), Delimiter::Blanks];

    /// What separates the numbers of `line`, and how many they are; None if it is not one of
    /// numbers alone, or of fewer than three.
    pub fn of(line: &[u8]) -> Option<(Delimiter, usize)> {
        let count = |s: Delimiter| s.numbers(line).filter(|&count| count >= 3);
        Delimiter::ALL.into_iter().find_map(|s| Some((s, count(s)?)))
    }

    /// What separates the fields of `line`, if there are as many as `reads` has, and numbers where
    /// that is true.
    pub fn of_columns(line: &[u8], reads: &[bool]) -> Option<Delimiter> {
        let fits = |separator: &Delimiter| {
            let mut fields = Fields::new(line, *separator);
            let read = reads
                .iter()
                .all(|reads| fields.next().is_some_and(|field| !reads || is_number(field)));
            read && fields.next().is_none()
        };
        Delimiter::ALL.into_iter().find(fits)
    }

    /// What separates the numbers of a line that should have blanks between them: some programs
    /// write commas.
    pub fn blanks_or_commas(line: &[u8]) -> Delimiter {
        if line.contains(&b',') { Delimiter::Mark(b',') } else { Delimiter::Blanks }
    }

    /// How many numbers a line has; None if it has anything else.
    pub fn numbers(self, line: &[u8]) -> Option<usize> {
        let mut fields = Fields::new(line, self);
        let mut count = 0;
        while let Some(field) = fields.next() {
            count += usize::from(is_number(field).then_some(true)?);
        }
        Some(count)
    }

    /// What it is called.
    pub fn word(self) -> &'static str {
        match self {
            Delimiter::Mark(b',') => "comma",
            Delimiter::Mark(_) => "semicolon",
            Delimiter::Blanks => "blanks",
        }
    }
}

/// The fields of a line, one after the other.
pub(crate) struct Fields<'a> {
    line: &'a [u8],
    separator: Delimiter,
    /// Where the next begins.
    at: usize,
}

impl<'a> Fields<'a> {
    pub fn new(line: &'a [u8], separator: Delimiter) -> Self {
        Fields { line, separator, at: 0 }
    }

    /// Where the last one ended, or what separates it from the next.
    pub fn place(&self) -> usize {
        self.at.min(self.line.len())
    }

    /// The next field; None at the end of the line, a separator behind the last one included.
    #[inline]
    pub fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.line.get(self.at..)?;
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let rest = &rest[start..];
        let length = match self.separator {
            Delimiter::Blanks => rest.iter().position(u8::is_ascii_whitespace),
            Delimiter::Mark(mark) => rest.iter().position(|&b| b == mark),
        };
        let length = length.unwrap_or(rest.len());
        self.at += start + length;
        if let Delimiter::Mark(_) = self.separator {
            self.at += 1;
            return Some(rest[..length].trim_ascii_end());
        }
        Some(&rest[..length])
    }
}

/// The text of a comment.
pub(crate) fn is_comment(line: &[u8]) -> Option<&[u8]> {
    let line = line.trim_ascii_start();
    line.strip_prefix(b"#").or_else(|| line.strip_prefix(b"//"))
}

/// True for a line with one whole number, as PTS has how many points follow.
pub(crate) fn is_count(line: &[u8]) -> bool {
    let line = line.trim_ascii();
    !line.is_empty() && line.iter().all(u8::is_ascii_digit)
}

/// True for a number.
pub(crate) fn is_number(field: &[u8]) -> bool {
    number::parse(field, Scalar::F64, &mut [0; 8])
}
