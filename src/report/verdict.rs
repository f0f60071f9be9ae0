//! Whether a result is accepted: what rules come to, beside the figures that a run found.

use serde::Serialize;

use super::accept::{AcceptBound, AcceptFigure, AcceptRule, AcceptTable};
use super::digits::{Grouped, Long};
use super::figures::{DeviationTotals, Totals};
use super::ledger::Ledger;

/// What the rules of a pipeline come to.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AcceptVerdict {
    /// True if all rules hold.
    pub passed: bool,
    /// Each rule, in order.
    pub rules: Vec<RuleVerdict>,
}

/// What a rule comes to.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RuleVerdict {
    /// The rule as it was written.
    pub rule: String,
    /// True if it holds.
    pub passed: bool,
    /// What was found: a length in the scan's unit, or records; None of what is no figure, and
    /// where nothing was measured.
    pub found: Option<f64>,
    /// The bound in the same unit.
    pub bound: Option<f64>,
    #[serde(skip)]
    pub(crate) figure: AcceptFigure,
}

impl RuleVerdict {
    /// True if the figure is a length.
    pub(crate) fn is_length(&self) -> bool {
        self.figure.is_deviation()
    }

    /// The rule and what was found, in words; `unit` is the sign of the unit of lengths.
    pub(crate) fn told(&self, unit: Option<&str>) -> String {
        let RuleVerdict { rule, found, figure, .. } = self;
        match (figure, found) {
            (AcceptFigure::Lossless, _) => rule.clone(),
            (AcceptFigure::Kept, Some(found)) => {
                format!("{rule}, and it is {}", Grouped(*found as u64))
            }
            (_, Some(found)) => format!("{rule}, and it is {}", Long(*found, unit)),
            (_, None) => format!("{rule}, which was not measured"),
        }
    }
}

impl AcceptVerdict {
    /// What `table` comes to by these figures; None without rules. Where no point was removed, none
    /// deviates; where some were and nothing was measured of them, the rule does not hold.
    pub(crate) fn of(
        table: &AcceptTable,
        ledger: &Ledger,
        totals: Option<&Totals>,
    ) -> Option<AcceptVerdict> {
        let rules: Vec<_> = table.all().map(|rule| judged(rule, ledger, totals)).collect();
        let passed = rules.iter().all(|rule| rule.passed);
        (!rules.is_empty()).then_some(AcceptVerdict { passed, rules })
    }
}

fn judged(rule: &AcceptRule, ledger: &Ledger, totals: Option<&Totals>) -> RuleVerdict {
    let found = match rule.figure {
        // That nothing else is written is checked before the run.
        AcceptFigure::Lossless => None,
        AcceptFigure::Kept => Some(ledger.kept as f64),
        figure => totals.and_then(|totals| deviation(figure, totals)),
    };
    let bound = match rule.bound {
        AcceptBound::None => None,
        AcceptBound::Length(length) => Some(length.value()),
        AcceptBound::Count(count) => Some(count as f64),
        AcceptBound::Part(part) => Some(part * ledger.read as f64),
    };
    let passed = match (found, bound) {
        (Some(found), Some(bound)) => rule.sign.holds(found, bound),
        _ => rule.figure == AcceptFigure::Lossless,
    };
    RuleVerdict { rule: rule.text.clone(), passed, found, bound, figure: rule.figure }
}

fn deviation(figure: AcceptFigure, totals: &Totals) -> Option<f64> {
    let Some(DeviationTotals { rms, p50, p95, p99, max, .. }) = totals.deviation else {
        return (totals.points.before == totals.points.after).then_some(0.0);
    };
    match figure {
        AcceptFigure::Max => Some(max),
        AcceptFigure::Rms => Some(rms),
        AcceptFigure::P50 => Some(p50),
        AcceptFigure::P95 => Some(p95),
        AcceptFigure::P99 => Some(p99),
        AcceptFigure::Kept | AcceptFigure::Lossless => None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::accept::AcceptRules;
    use super::super::figures::Pair;
    use super::*;
    use crate::expression::OneOrSeveral;

    fn table(text: &str) -> AcceptTable {
        AcceptTable { rules: Some(OneOrSeveral(vec![AcceptRules::parse(text).unwrap()])) }
    }

    fn totals(deviation: Option<DeviationTotals>, after: u64) -> Totals {
        let points = Pair { before: 1000, after };
        let none = Pair { before: None, after: None };
        Totals { tiles: 1, points, tile_plane: none, scan_plane: none, deviation, baseline: None }
    }

    fn judge(text: &str, totals: &Totals) -> Vec<bool> {
        let ledger = Ledger { read: 1000, kept: totals.points.after, removed: Vec::new() };
        let verdict = AcceptVerdict::of(&table(text), &ledger, Some(totals)).unwrap();
        assert_eq!(verdict.passed, verdict.rules.iter().all(|rule| rule.passed));
        verdict.rules.iter().map(|rule| rule.passed).collect()
    }

    #[test]
    fn each_rule_is_held_against_its_own_figure() {
        let found = DeviationTotals {
            points: 900,
            rms: 1.0,
            p50: 2.0,
            p95: 3.0,
            p99: 4.0,
            max: 5.0,
            at: [0.0; 3],
        };
        let totals = totals(Some(found), 100);
        let at_bound = "rms <= 1, p50 <= 2, p95 <= 3, p99 <= 4, max <= 5, kept >= 10%";
        assert_eq!(judge(at_bound, &totals), [true; 6]);
        let below = "rms < 1, p50 < 2, p95 < 3, p99 < 4, max < 5, kept > 10%, kept < 100";
        assert_eq!(judge(below, &totals), [false; 7]);
        assert_eq!(judge("lossless, kept <= 100, max <= 4.9", &totals), [true, true, false]);
    }

    #[test]
    fn what_was_not_measured_is_not_accepted_unless_nothing_was_removed() {
        assert_eq!(judge("max <= 9", &totals(None, 100)), [false]);
        assert_eq!(judge("max <= 9", &totals(None, 1000)), [true]);
        let nothing = AcceptTable::default();
        assert_eq!(AcceptVerdict::of(&nothing, &Ledger::default(), None), None);
    }
}
