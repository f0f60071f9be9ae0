//! What two scans must be beside each other to be accepted: `same`, `subset`, `max <= 5mm`.

use std::fmt;
use std::ops::Range;

use serde::Serialize;

use super::clouds::{CloudDistances, CloudFigures};
use super::same::{PartOf, RecordsComparison, open};
use crate::expression::ExpressionFault;
use crate::language::Registry;
use crate::quantity::{Figure, Length};
use crate::report::{ACCEPT_RULES, Long, RuleText, length};
use crate::{Error, ErrorKind, Result};

/// What two scans must be beside each other, as rules between commas:
///
/// - `same`: both have the same records, each as often, in any order.
/// - `same-order`: they are in the same order besides.
/// - `subset`: every record of the second scan is one of the first, as often at most.
/// - `ordered-subset`: they are in the same order besides.
/// - `max`, `mean`, `rms`, `p50`, `p95` or `p99`, then `<=` or `<` and a length (in the scan's
///   unit, or such as `5mm`): how far points are from the nearest of the other scan, both ways; the
///   larger of the two figures counts.
#[derive(Debug, Clone)]
pub struct CompareRules(Vec<CompareRule>);

/// One rule as it was written.
#[derive(Debug, Clone)]
struct CompareRule {
    text: String,
    of: RuleOf,
}

/// What a rule is about.
#[derive(Debug, Clone, Copy)]
enum RuleOf {
    Records(RecordsWord),
    /// A figure, whether it may be as large as the bound, and the bound.
    Distance(DistanceWord, bool, Length),
}

/// What records must be.
#[derive(Debug, Clone, Copy, PartialEq)]
enum RecordsWord {
    Same,
    SameOrder,
    Subset,
    OrderedSubset,
}

/// A figure of distances.
type DistanceWord = fn(&CloudFigures) -> f64;

const RECORDS: [(&str, RecordsWord); 4] = [
    ("same", RecordsWord::Same),
    ("same-order", RecordsWord::SameOrder),
    ("subset", RecordsWord::Subset),
    ("ordered-subset", RecordsWord::OrderedSubset),
];

const DISTANCES: [(&str, DistanceWord); 6] = [
    ("max", |figures| figures.max),
    ("mean", |figures| figures.mean),
    ("rms", |figures| figures.rms),
    ("p50", |figures| figures.p50),
    ("p95", |figures| figures.p95),
    ("p99", |figures| figures.p99),
];

impl CompareRules {
    /// Reads rules.
    ///
    /// ```
    /// use pointmill::compare::CompareRules;
    ///
    /// assert!(CompareRules::parse("max <= 5mm, rms <= 1mm, subset").is_ok());
    /// let wrong = CompareRules::parse("max <= 5mm, subsets").unwrap_err();
    /// assert!(wrong.to_string().starts_with("there is no rule `subsets`"));
    /// ```
    ///
    /// # Errors
    ///
    /// What is no rule, with its place in the text.
    pub fn parse(text: &str) -> Result<CompareRules> {
        CompareRules::read(text).map_err(|fault| fault.error(text))
    }

    fn read(text: &str) -> Result<CompareRules, ExpressionFault> {
        let example = "`same` or `max <= 5mm`";
        RuleText::each(text, example, CompareRule::read).map(CompareRules)
    }

    /// True if a rule is on distances.
    pub(super) fn measures(&self) -> bool {
        self.0.iter().any(|rule| matches!(rule.of, RuleOf::Distance(..)))
    }

    /// The same with all lengths in the unit of the scan at `paths`.
    pub(super) fn in_scan(&self, paths: &[String], registry: &Registry) -> Result<CompareRules> {
        let mut rules = self.clone();
        if !rules.measures() {
            return Ok(rules);
        }
        let source = open(paths, registry)?.open()?;
        for rule in &mut rules.0 {
            if let RuleOf::Distance(_, _, bound) = &mut rule.of {
                let metres = Figure(bound.metres().unwrap_or_default());
                let name = rule.text.split(['<', ' ']).next().unwrap_or_default();
                let help = format!("write a number: `{name} <= {metres}` where it is metres");
                let told = |error: Error| error.help(help.clone());
                *bound = bound.in_scan(&source.metadata().units, ACCEPT_RULES).map_err(told)?;
            }
        }
        Ok(rules)
    }

    /// What the rules come to. Where nothing was measured, a rule on distances does not hold.
    pub(super) fn judge(
        &self,
        records: &RecordsComparison,
        distances: Option<&CloudDistances>,
    ) -> CompareVerdict {
        let unit = distances.and_then(|distances| distances.unit);
        let judged = |rule: &CompareRule| {
            let (passed, found, bound) = match rule.of {
                RuleOf::Records(word) => (word.holds(records), None, None),
                RuleOf::Distance(figure, may_be_equal, bound) => {
                    let found = distances.and_then(|distances| distances.larger(figure));
                    let bound = bound.value();
                    let is_within = |v: f64| v < bound || may_be_equal && v == bound;
                    (found.is_some_and(is_within), found, Some(bound))
                }
            };
            CompareRuleVerdict { rule: rule.text.clone(), passed, found, bound }
        };
        let rules: Vec<CompareRuleVerdict> = self.0.iter().map(judged).collect();
        CompareVerdict { passed: rules.iter().all(|rule| rule.passed), rules, unit }
    }
}

impl RecordsWord {
    fn holds(self, records: &RecordsComparison) -> bool {
        match self {
            RecordsWord::Same => records.same,
            RecordsWord::SameOrder => records.same_order,
            RecordsWord::Subset => records.second_in_first != PartOf::No,
            RecordsWord::OrderedSubset => records.second_in_first == PartOf::InOrder,
        }
    }
}

impl CompareRule {
    fn read(rule: &RuleText<'_>) -> Result<CompareRule, ExpressionFault> {
        let name = rule.name;
        let written = |of| CompareRule { text: rule.text.to_owned(), of };
        if let Some((_, word)) = RECORDS.iter().find(|(known, _)| *known == name) {
            return rule.alone(written(RuleOf::Records(*word)));
        }
        let Some((_, figure)) = DISTANCES.iter().find(|(known, _)| *known == name) else {
            let told = format!("there is no rule `{name}`");
            let records = RECORDS.iter().map(|(name, _)| (*name).to_owned());
            let distances = DISTANCES.iter().map(|(name, _)| (*name).to_owned());
            let all: Vec<String> = records.chain(distances).collect();
            return Err(ExpressionFault::word(rule.name_place(), told, name, "rules", &all));
        };
        let (behind, place) = rule.behind();
        let (may_be_equal, sign) = sign(name, behind, place)?;
        let (behind, place) = rule.bound(sign);
        let bound = length(name, behind, place)?;
        Ok(written(RuleOf::Distance(*figure, may_be_equal, bound)))
    }
}

/// Whether the sign that `text`, at `place`, begins with lets a figure be equal to its bound, and
/// its length.
fn sign(name: &str, text: &str, place: Range<usize>) -> Result<(bool, usize), ExpressionFault> {
    if text.starts_with("<=") {
        return Ok((true, 2));
    }
    if text.starts_with('<') {
        return Ok((false, 1));
    }
    let told = match text.is_empty() {
        true => format!("`{name}` needs a bound"),
        false => format!("a rule bounds `{name}` from above"),
    };
    Err(ExpressionFault::new(place, told).help(format!("write `{name} <= 5mm`")))
}

/// What the rules of a comparison come to.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CompareVerdict {
    /// True if all rules hold.
    pub passed: bool,
    /// Each rule, in order.
    pub rules: Vec<CompareRuleVerdict>,
    #[serde(skip)]
    unit: Option<&'static str>,
}

/// What a rule comes to.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CompareRuleVerdict {
    /// The rule as it was written.
    pub rule: String,
    /// True if it holds.
    pub passed: bool,
    /// What was found, in the scan's unit; None of what is no figure, and where nothing was
    /// measured.
    pub found: Option<f64>,
    /// The bound in the same unit.
    pub bound: Option<f64>,
}

impl CompareVerdict {
    /// A rule and what was found, in words.
    fn told(&self, rule: &CompareRuleVerdict) -> String {
        match (rule.bound, rule.found) {
            (Some(_), Some(found)) => {
                format!("{}, and it is {}", rule.rule, Long(found, self.unit))
            }
            (Some(_), None) => format!("{}, and a scan without points has no distance", rule.rule),
            (None, _) => rule.rule.clone(),
        }
    }

    /// The error of rules that do not hold, if one does not.
    pub(super) fn accepted(&self) -> Result<()> {
        let failed = self.rules.iter().filter(|rule| !rule.passed);
        let failed: Vec<String> = failed.map(|rule| self.told(rule)).collect();
        match failed.is_empty() {
            true => Ok(()),
            false => {
                let told = format!("the result is not accepted: {}", failed.join(", "));
                Err(Error::new(ErrorKind::NotAccepted, told))
            }
        }
    }
}

impl fmt::Display for CompareVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, rule) in self.rules.iter().enumerate() {
            let before = if n == 0 { "accept    " } else { "\n          " };
            let verdict = if rule.passed { "PASS" } else { "FAIL" };
            write!(f, "{before} {verdict}  {}", self.told(rule))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_are_words_and_bounded_figures() {
        let read = CompareRules::read(" max<=5mm , p99 < 0.002,same, ordered-subset ").unwrap();
        let texts: Vec<&str> = read.0.iter().map(|rule| rule.text.as_str()).collect();
        assert_eq!(texts, ["max<=5mm", "p99 < 0.002", "same", "ordered-subset"]);
        assert!(read.measures());
        assert!(!CompareRules::read("subset,same-order").unwrap().measures());
    }

    #[test]
    fn what_is_no_rule_is_told_at_its_place() {
        for (text, place, told) in [
            ("", 0..0, "a rule is missing"),
            ("same,", 5..5, "a rule is missing"),
            ("<= 5mm", 0..6, "a rule has no figure"),
            ("same, sam", 6..9, "there is no rule `sam`"),
            ("same <= 1", 5..9, "`same` has no bound"),
            ("p99", 3..3, "`p99` needs a bound"),
            ("p99 >= 1", 4..8, "a rule bounds `p99` from above"),
            ("p99 <= 5%", 7..9, "`p99` is bounded by a length above 0"),
            ("p99 <= 0", 7..8, "`p99` is bounded by a length above 0"),
        ] {
            let fault = CompareRules::read(text).unwrap_err();
            assert_eq!((fault.span, fault.told.as_str()), (place, told), "{text}");
            assert!(!fault.help.is_empty(), "{text}");
        }
    }
}
