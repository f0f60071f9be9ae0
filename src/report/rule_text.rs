//! The text of rules by which results are accepted: names between commas, each alone or with what
//! bounds it. Knows no rule; what is wrong is told at its place.

use std::ops::Range;

use crate::expression::ExpressionFault;
use crate::quantity::{Angle, Length};

/// One rule of a text.
pub(crate) struct RuleText<'a> {
    /// As it was written.
    pub text: &'a str,
    /// What stands before a sign.
    pub name: &'a str,
    /// Byte of the whole text at which it begins.
    start: usize,
    /// Byte of its own text at which the name ends.
    end: usize,
}

impl<'a> RuleText<'a> {
    /// Reads the rules of `text` one by one; `example` says what one may be.
    pub fn each<T>(
        text: &'a str,
        example: &str,
        read: impl Fn(&RuleText<'a>) -> Result<T, ExpressionFault>,
    ) -> Result<Vec<T>, ExpressionFault> {
        let (mut rules, mut at) = (Vec::new(), 0);
        for part in text.split(',') {
            rules.push(read(&RuleText::of(part, at, example)?)?);
            at += part.len() + 1;
        }
        Ok(rules)
    }

    /// `part` of a text, which begins at byte `at` of it.
    fn of(part: &'a str, at: usize, example: &str) -> Result<RuleText<'a>, ExpressionFault> {
        let text = part.trim();
        let start = at + part.len() - part.trim_start().len();
        let end = text.find(['<', '>', '=', '!']).unwrap_or(text.len());
        let name = text[..end].trim_end();
        if name.is_empty() {
            let told = if text.is_empty() { "a rule is missing" } else { "a rule has no figure" };
            let place = start..start + text.len().max(usize::from(!part.is_empty()));
            let help = format!("write a rule such as {example}");
            return Err(ExpressionFault::new(place, told).help(help));
        }
        Ok(RuleText { text, name, start, end })
    }

    /// The place of its name.
    pub fn name_place(&self) -> Range<usize> {
        self.start..self.start + self.name.len()
    }

    /// What stands behind its name, from the sign on, and the place of it.
    pub fn behind(&self) -> (&'a str, Range<usize>) {
        (&self.text[self.end..], self.start + self.end..self.start + self.text.len())
    }

    /// What stands behind the sign, which has `length` bytes, and the place of it.
    pub fn bound(&self, length: usize) -> (&'a str, Range<usize>) {
        let bound = self.text[self.end + length..].trim_start();
        let end = self.start + self.text.len();
        (bound, end - bound.len()..end)
    }

    /// `rule`, which has no bound.
    pub fn alone<T>(&self, rule: T) -> Result<T, ExpressionFault> {
        let (behind, place) = self.behind();
        if behind.is_empty() {
            return Ok(rule);
        }
        let told = format!("`{}` has no bound", self.name);
        Err(ExpressionFault::new(place, told).help(format!("write `{}` alone", self.name)))
    }
}

/// The length that bounds the figure `name`: `text`, at `place`.
pub(crate) fn length(
    name: &str,
    text: &str,
    place: Range<usize>,
) -> Result<Length, ExpressionFault> {
    let number = text.parse().ok().and_then(Length::of);
    number.or_else(|| Length::read(text)).ok_or_else(|| {
        let told = format!("`{name}` is bounded by a length above 0");
        let help = "write it in the scan's unit, or with mm, cm, m, km, in, ft or us-ft";
        ExpressionFault::new(place, told).help(help)
    })
}

/// The angle that bounds the figure `name`: `text`, at `place`.
pub(crate) fn angle(name: &str, text: &str, place: Range<usize>) -> Result<Angle, ExpressionFault> {
    let number = text.parse().ok().and_then(Angle::radians);
    let read = number.or_else(|| Angle::read(text)).filter(|angle| angle.in_radians() > 0.0);
    read.ok_or_else(|| {
        let told = format!("`{name}` is bounded by an angle above 0");
        ExpressionFault::new(place, told).help("write it in degrees such as 5deg, or in radians")
    })
}
