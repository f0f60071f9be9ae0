//! A number for each record, by which of several conditions holds: `Classification == 6 ? 3 : 1`.

use std::ops::Range;

use super::bind::Names;
use super::condition::Condition;
use super::fault::ExpressionFault;
use super::text::{FromText, is_its_text};
use crate::{Error, Result};

/// What a record counts, as it was written: a number above 0, or `CONDITION ? NUMBER : OTHERWISE`,
/// where what stands behind the colon may be such a choice again. The first condition that holds
/// decides.
///
/// ```
/// use pointmill::expression::Weight;
///
/// let weight = Weight::parse("Classification == 6 ? 3 : Z > 100 ? 2 : 1")?;
/// assert_eq!(weight.conditions().count(), 2);
/// assert_eq!(weight.of(|number| number == 1), 2.0);
/// assert_eq!(weight.of(|_| false), 1.0);
/// assert!(Weight::parse("Classification == 6").is_err());
/// # Ok::<(), pointmill::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Weight {
    text: String,
    /// Each condition with the byte of the text that it begins at, and what is counted if it holds.
    choices: Vec<(Condition, usize, f64)>,
    otherwise: f64,
}

is_its_text!(Weight);

/// What helps where it is none.
const HELP: &str = "write CONDITION ? NUMBER : NUMBER, such as \"Classification == 6 ? 3 : 1\"";

impl FromText for Weight {
    const NAME: &'static str = "Weight";
    const EXPECTED: &'static str =
        "a choice of numbers in quotes, such as \"Classification == 6 ? 3 : 1\"";

    fn read(text: &str) -> std::result::Result<Weight, ExpressionFault> {
        let mut choices = Vec::new();
        let mut begin = 0;
        while let Some(mark) = outside_names(&text[begin..], '?') {
            let condition = Condition::read(text[begin..begin + mark].trim_end());
            let condition = condition.map_err(|fault| shifted(fault, begin))?;
            let behind = begin + mark + 1;
            let Some(colon) = text[behind..].find(':') else {
                let told = "there is no `:` behind `?`";
                return Err(ExpressionFault::new(begin + mark..behind, told).help(HELP));
            };
            choices.push((condition, begin, number(text, behind..behind + colon)?));
            begin = behind + colon + 1;
        }
        let otherwise = number(text, begin..text.len())?;
        Ok(Weight { text: text.to_owned(), choices, otherwise })
    }
}

/// The first `mark` that is no part of a name in backticks.
fn outside_names(text: &str, mark: char) -> Option<usize> {
    let mut is_name = false;
    let found = text.char_indices().find(|(_, c)| {
        is_name ^= *c == '`';
        !is_name && *c == mark
    });
    found.map(|(at, _)| at)
}

fn number(text: &str, span: Range<usize>) -> std::result::Result<f64, ExpressionFault> {
    let written = &text[span.clone()];
    let number = written.trim().parse::<f64>().ok();
    number.filter(|number| number.is_normal() && *number > 0.0).ok_or_else(|| {
        let before = written.len() - written.trim_start().len();
        let begin = (span.start + before).min(span.end);
        let end = (begin + written.trim().len()).max(begin);
        ExpressionFault::new(begin..end, "a weight is a number above 0").help(HELP)
    })
}

/// A fault of a part of the text that begins at byte `by`.
fn shifted(fault: ExpressionFault, by: usize) -> ExpressionFault {
    ExpressionFault { span: fault.span.start + by..fault.span.end + by, ..fault }
}

impl Weight {
    /// Reads a weight.
    ///
    /// # Errors
    ///
    /// What is none, with its place in the text.
    pub fn parse(text: &str) -> Result<Weight> {
        Weight::read(text).map_err(|fault| fault.error(text))
    }

    /// As it was written.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Its conditions, in the order in which they decide.
    pub fn conditions(&self) -> impl Iterator<Item = &Condition> {
        self.choices.iter().map(|(condition, ..)| condition)
    }

    /// What is counted where `holds` says of the conditions, by their number from 0, which hold.
    pub fn of(&self, holds: impl Fn(usize) -> bool) -> f64 {
        let first = self.choices.iter().enumerate().find(|(number, _)| holds(*number));
        first.map_or(self.otherwise, |(_, (_, _, counted))| *counted)
    }

    /// Refuses names that are not there.
    pub(crate) fn check(&self, names: Names<'_>) -> std::result::Result<(), ExpressionFault> {
        self.choices.iter().try_for_each(|(condition, begin, _)| {
            condition.bind_names(names).map(drop).map_err(|fault| shifted(fault, *begin))
        })
    }

    /// The names of dimensions in it.
    pub(crate) fn names(&self) -> Vec<&str> {
        self.conditions().flat_map(Condition::names).collect()
    }
}

impl TryFrom<&str> for Weight {
    type Error = Error;

    fn try_from(text: &str) -> Result<Weight> {
        Weight::parse(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(text: &str) -> (Range<usize>, String) {
        let fault = Weight::read(text).unwrap_err();
        (fault.span, fault.told)
    }

    #[test]
    fn the_first_condition_that_holds_decides() {
        let weight = Weight::parse("`a?b` == 1 ? 3 : Z in [1, 2] ? 0.5 : 1e1").unwrap();
        assert_eq!(weight.names(), ["a?b", "Z"]);
        let of = |all: [bool; 2]| weight.of(|number| all[number]);
        assert_eq!([of([true, true]), of([false, true]), of([false, false])], [3.0, 0.5, 10.0]);
        assert_eq!(Weight::parse("2").unwrap().of(|_| true), 2.0);
    }

    #[test]
    fn what_is_wrong_has_its_place() {
        assert_eq!(told("Z > 1 ? 3").0, 6..7);
        assert_eq!(told("Z > 1 ? -3 : 1"), (8..10, "a weight is a number above 0".to_owned()));
        assert_eq!(told("Z > 1 ? 3 : nan").0, 12..15);
        assert_eq!(told("Z > 1 ? 3 : Z = 2 ? 1 : 2").0, 14..15);
        assert_eq!(told("").0, 0..0);
        assert_eq!(told("Classification").1, "a weight is a number above 0");
    }
}
