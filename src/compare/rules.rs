//! What two scans must be beside each other to be accepted: `same`, `subset`, `max <= 5mm`.

use std::fmt;
use std::ops::Range;

use serde::Serialize;

use super::figures::{FigureWord, Judged, RuleBound, example};
use super::same::{PartOf, RecordsComparison, open};
use crate::expression::ExpressionFault;
use crate::language::Registry;
use crate::quantity::Figure;
use crate::report::{ACCEPT_RULES, Grouped, Long, RuleText};
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
/// - `normals.max` and the others likewise with an angle (radians, or such as `5deg`): the angle
///   between the normal of a point and that of the nearest point of the other scan.
/// - `depth.rms`, `depth.mean` or `depth.max` with a length, and `depth.ssd` with a number, which
///   is in the square of the scan's unit: what depth images differ by.
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
    Figure(FigureWord, bool, RuleBound),
}

/// What records must be.
#[derive(Debug, Clone, Copy, PartialEq)]
enum RecordsWord {
    Same,
    SameOrder,
    Subset,
    OrderedSubset,
}

const RECORDS: [(&str, RecordsWord); 4] = [
    ("same", RecordsWord::Same),
    ("same-order", RecordsWord::SameOrder),
    ("subset", RecordsWord::Subset),
    ("ordered-subset", RecordsWord::OrderedSubset),
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
        self.is_on(|figure| matches!(figure, FigureWord::Distance(_)))
    }

    /// True if a rule is on the angles of normals.
    pub(super) fn is_on_normals(&self) -> bool {
        self.is_on(|figure| matches!(figure, FigureWord::Normals(_)))
    }

    /// True if a rule is on depth images.
    pub(super) fn is_on_depth(&self) -> bool {
        self.is_on(|figure| matches!(figure, FigureWord::Depth(_)))
    }

    fn is_on(&self, is_it: impl Fn(&FigureWord) -> bool) -> bool {
        self.0.iter().any(|rule| matches!(&rule.of, RuleOf::Figure(figure, ..) if is_it(figure)))
    }

    /// The same with all lengths in the unit of the scan at `paths`.
    pub(super) fn in_scan(&self, paths: &[String], registry: &Registry) -> Result<CompareRules> {
        let mut rules = self.clone();
        if !rules.measures() && !rules.is_on_depth() {
            return Ok(rules);
        }
        let source = open(paths, registry)?.open()?;
        for rule in &mut rules.0 {
            if let RuleOf::Figure(_, _, RuleBound::Length(bound)) = &mut rule.of {
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
    pub(super) fn judge(&self, all: &Judged<'_>) -> CompareVerdict {
        let judged = |rule: &CompareRule| {
            let (mut unit, mut left_out) = (None, None);
            let (passed, found, bound) = match rule.of {
                RuleOf::Records(word) => (word.holds(all.records), None, None),
                RuleOf::Figure(figure, may_be_equal, bound) => {
                    (unit, left_out) = (bound.unit(all), figure.left_out(all));
                    let found = figure.of(all);
                    let bound = bound.value();
                    let is_within = |v: f64| v < bound || may_be_equal && v == bound;
                    (found.is_some_and(is_within), found, Some(bound))
                }
            };
            CompareRuleVerdict { rule: rule.text.clone(), passed, found, bound, unit, left_out }
        };
        let rules: Vec<CompareRuleVerdict> = self.0.iter().map(judged).collect();
        CompareVerdict { passed: rules.iter().all(|rule| rule.passed), rules }
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
        let Some(figure) = FigureWord::named(name) else {
            let told = format!("there is no rule `{name}`");
            let records = RECORDS.iter().map(|(name, _)| (*name).to_owned());
            let all: Vec<String> = records.chain(FigureWord::names()).collect();
            return Err(ExpressionFault::word(rule.name_place(), told, name, "rules", &all));
        };
        let (behind, place) = rule.behind();
        let (may_be_equal, sign) = sign(name, behind, place)?;
        let (behind, place) = rule.bound(sign);
        let bound = figure.bound(name, behind, place)?;
        Ok(written(RuleOf::Figure(figure, may_be_equal, bound)))
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
    let help = format!("write `{name} <= {}`", example(name));
    Err(ExpressionFault::new(place, told).help(help))
}

/// What the rules of a comparison come to.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CompareVerdict {
    /// True if all rules hold.
    pub passed: bool,
    /// Each rule, in order.
    pub rules: Vec<CompareRuleVerdict>,
}

/// What a rule comes to.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CompareRuleVerdict {
    /// The rule as it was written.
    pub rule: String,
    /// True if it holds.
    pub passed: bool,
    /// What was found: lengths in the scan's unit, angles in degrees; None of what is no figure,
    /// and where nothing was measured.
    pub found: Option<f64>,
    /// The bound in the same unit.
    pub bound: Option<f64>,
    #[serde(skip)]
    unit: Option<&'static str>,
    /// Of how many points the figure is, and how many of these have no angle, where some have none.
    #[serde(skip)]
    left_out: Option<[u64; 2]>,
}

impl CompareRuleVerdict {
    /// The rule and what was found, in words.
    fn told(&self) -> String {
        let left_out = self.left_out.map_or(String::new(), |[all, without]| {
            format!("; {} of {} points have no angle", Grouped(without), Grouped(all))
        });
        match (self.bound, self.found) {
            (Some(_), Some(found)) => {
                format!("{}, and it is {}{left_out}", self.rule, Long(found, self.unit))
            }
            (Some(_), None) => {
                format!("{}, and the scans have no such figure{left_out}", self.rule)
            }
            (None, _) => self.rule.clone(),
        }
    }
}

impl CompareVerdict {
    /// The error of rules that do not hold, if one does not.
    pub(super) fn accepted(&self) -> Result<()> {
        let failed = self.rules.iter().filter(|rule| !rule.passed);
        let failed: Vec<String> = failed.map(CompareRuleVerdict::told).collect();
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
            write!(f, "{before} {verdict}  {}", rule.told())?;
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
        assert!(read.measures() && !read.is_on_normals() && !read.is_on_depth());
        assert!(!CompareRules::read("subset,same-order").unwrap().measures());
        let read = CompareRules::read("normals.p95 <= 5deg, depth.ssd < 2").unwrap();
        assert!(!read.measures() && read.is_on_normals() && read.is_on_depth());
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
            ("normal.p99 <= 0", 0..10, "there is no rule `normal.p99`"),
            ("normals.p99 <= 5mm", 15..18, "`normals.p99` is bounded by an angle above 0"),
            ("normals.p99 <= 5", 15..16, "`normals.p99` is bounded by an angle above 0"),
            ("depth.p99 <= 5", 0..9, "there is no rule `depth.p99`"),
            ("depth.rms <= 5deg", 13..17, "`depth.rms` is bounded by a length above 0"),
            ("depth.ssd <= 5mm", 13..16, "`depth.ssd` is bounded by a number above 0"),
        ] {
            let fault = CompareRules::read(text).unwrap_err();
            assert_eq!((fault.span, fault.told.as_str()), (place, told), "{text}");
            assert!(!fault.help.is_empty(), "{text}");
        }
    }
}
