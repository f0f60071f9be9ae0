//! What a result must be to be accepted, as pipelines write it: `max <= 5mm, p99 <= 2mm, lossless`.
//! Reads rules; knows no result.

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::rule_text::{RuleText, length};
use crate::expression::{ExpressionFault, FromText, OneOrSeveral, is_its_text};
use crate::point::Units;
use crate::quantity::{Figure, Length, parse_count};
use crate::{Error, Result};

/// What a result must be to be accepted. The outputs are written in any case; a run whose result is
/// not accepted says so in its report and in its closing table, and the command line ends with exit
/// code 3.
///
/// # Rules
///
/// A text has rules between commas. A rule is a figure, `<=` or `<` (for `kept` also `>=` or `>`),
/// and a bound:
///
/// - `max`, `rms`, `p50`, `p95` and `p99` are how far removed points are from the surface of what
///   stands for them: the largest, the root of the mean square, and what 50, 95 and 99 of 100 are
///   no farther than; of the points for which something stands, as the report counts them. A bound
///   is a length: in the scan's unit, or such as `5mm`.
/// - `kept` is how many of the points that were read are written. A bound is a number such as
///   `250k`, or a part such as `10%`.
/// - `lossless` has no bound: the records that are written are those that were read, byte for byte,
///   but for what stages computed and is written behind them.
///
/// Each branch of a pipeline is held to all rules. A rule on what a run of the pipeline does not
/// measure, or cannot keep, is refused before the run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AcceptTable {
    /// Rules that all must hold; none: any result is accepted.
    pub rules: Option<OneOrSeveral<AcceptRules>>,
}

impl AcceptTable {
    /// The rules, in order.
    pub(crate) fn all(&self) -> impl Iterator<Item = &AcceptRule> {
        self.rules.iter().flat_map(|texts| &texts.0).flat_map(|text| &text.rules)
    }

    /// The same with all lengths in the unit of x and y, which `units` tell.
    ///
    /// # Errors
    ///
    /// A length with a unit where the scan's is not known or is an angle.
    pub(crate) fn in_scan(mut self, units: &Units) -> Result<Self> {
        let texts = self.rules.iter_mut().flat_map(|texts| &mut texts.0);
        for rule in texts.flat_map(|text| &mut text.rules) {
            if let AcceptBound::Length(length) = &mut rule.bound {
                let (figure, sign) = (rule.figure.name(), rule.sign.text());
                let metres = Figure(length.metres().unwrap_or_default());
                let help = format!("write a number: `{figure} {sign} {metres}` where it is metres");
                let told = |error: Error| error.help(help.clone());
                *length = length.in_scan(units, RULES).map_err(told)?;
            }
        }
        Ok(self)
    }
}

/// The address of the rules, as messages name settings.
pub(crate) const RULES: &str = "accept.rules";

/// Rules between commas, as they were written.
#[derive(Debug, Clone)]
pub struct AcceptRules {
    text: String,
    rules: Vec<AcceptRule>,
}

is_its_text!(AcceptRules);

impl FromText for AcceptRules {
    const NAME: &'static str = "AcceptRules";
    const EXPECTED: &'static str = "rules in quotes, such as \"max <= 5mm, lossless\"";

    fn read(text: &str) -> Result<Self, ExpressionFault> {
        let rules = RuleText::each(text, "`max <= 5mm`", AcceptRule::read)?;
        Ok(AcceptRules { text: text.to_owned(), rules })
    }
}

impl AcceptRules {
    /// Reads rules.
    ///
    /// ```
    /// use pointmill::report::AcceptRules;
    ///
    /// assert!(AcceptRules::parse("max <= 5mm, p99 <= 2mm, lossless").is_ok());
    /// let wrong = AcceptRules::parse("max <= 5mm, p98 <= 2mm").unwrap_err();
    /// assert!(wrong.to_string().starts_with("there is no figure `p98`"));
    /// ```
    ///
    /// # Errors
    ///
    /// What is no rule, with its place in the text.
    pub fn parse(text: &str) -> Result<AcceptRules> {
        AcceptRules::read(text).map_err(|fault| fault.error(text))
    }
}

/// One rule.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct AcceptRule {
    /// As it was written.
    pub text: String,
    pub figure: AcceptFigure,
    pub sign: AcceptSign,
    pub bound: AcceptBound,
}

/// What a rule is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum AcceptFigure {
    Max,
    Rms,
    P50,
    P95,
    P99,
    Kept,
    Lossless,
}

impl AcceptFigure {
    const ALL: [(&str, AcceptFigure); 7] = [
        ("max", AcceptFigure::Max),
        ("rms", AcceptFigure::Rms),
        ("p50", AcceptFigure::P50),
        ("p95", AcceptFigure::P95),
        ("p99", AcceptFigure::P99),
        ("kept", AcceptFigure::Kept),
        ("lossless", AcceptFigure::Lossless),
    ];

    /// As it is written.
    pub fn name(self) -> &'static str {
        AcceptFigure::ALL.iter().find(|(_, figure)| *figure == self).map_or("", |(name, _)| name)
    }

    /// True if it is a deviation, which is a length.
    pub fn is_deviation(self) -> bool {
        !matches!(self, AcceptFigure::Kept | AcceptFigure::Lossless)
    }
}

/// How a figure is compared with its bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum AcceptSign {
    AtMost,
    Below,
    AtLeast,
    Above,
}

impl AcceptSign {
    const ALL: [(&str, AcceptSign); 4] = [
        ("<=", AcceptSign::AtMost),
        (">=", AcceptSign::AtLeast),
        ("<", AcceptSign::Below),
        (">", AcceptSign::Above),
    ];

    fn text(self) -> &'static str {
        AcceptSign::ALL.iter().find(|(_, sign)| *sign == self).map_or("", |(text, _)| text)
    }

    /// True if `found` is to the bound as the sign says.
    pub fn holds(self, found: f64, bound: f64) -> bool {
        match self {
            AcceptSign::AtMost => found <= bound,
            AcceptSign::Below => found < bound,
            AcceptSign::AtLeast => found >= bound,
            AcceptSign::Above => found > bound,
        }
    }
}

/// What a figure is compared with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum AcceptBound {
    None,
    Length(Length),
    Count(u64),
    /// A part of the points that were read, up to 1.
    Part(f64),
}

impl AcceptRule {
    fn read(rule: &RuleText<'_>) -> Result<AcceptRule, ExpressionFault> {
        let name = rule.name;
        let figure = AcceptFigure::ALL.iter().find(|(known, _)| *known == name);
        let Some(&(_, figure)) = figure else {
            let told = format!("there is no figure `{name}`");
            let all = AcceptFigure::ALL.map(|(name, _)| name.to_owned());
            return Err(ExpressionFault::word(rule.name_place(), told, name, "figures", &all));
        };
        let text = rule.text.to_owned();
        if figure == AcceptFigure::Lossless {
            let (sign, bound) = (AcceptSign::AtLeast, AcceptBound::None);
            return rule.alone(AcceptRule { text, figure, sign, bound });
        }
        let (behind, place) = rule.behind();
        let (sign, length) = sign(figure, behind, place)?;
        let (behind, place) = rule.bound(length);
        Ok(AcceptRule { text, figure, sign, bound: bound(figure, behind, place)? })
    }
}

/// The sign that `text`, at `place`, begins with, and its length.
fn sign(
    figure: AcceptFigure,
    text: &str,
    place: Range<usize>,
) -> Result<(AcceptSign, usize), ExpressionFault> {
    let name = figure.name();
    let example = if figure.is_deviation() { "<= 5mm" } else { ">= 10%" };
    let help = format!("write `{name} {example}`");
    if text.is_empty() {
        return Err(ExpressionFault::new(place, format!("`{name}` needs a bound")).help(help));
    }
    let known = AcceptSign::ALL.iter().find(|(sign, _)| text.starts_with(sign));
    let length = known.map_or(1, |(sign, _)| sign.len());
    let at = place.start..place.start + length;
    match known {
        None => {
            let told = format!("a rule has no `{}`", &text[..1]);
            Err(ExpressionFault::new(at, told).help("write `<=`, `<`, `>=` or `>`"))
        }
        Some((_, AcceptSign::AtLeast | AcceptSign::Above)) if figure.is_deviation() => {
            let told = format!("a rule bounds `{name}` from above");
            Err(ExpressionFault::new(at, told).help(help))
        }
        Some((_, sign)) => Ok((*sign, length)),
    }
}

/// The bound that `text`, at `place`, is.
fn bound(
    figure: AcceptFigure,
    text: &str,
    place: Range<usize>,
) -> Result<AcceptBound, ExpressionFault> {
    if figure.is_deviation() {
        return length(figure.name(), text, place).map(AcceptBound::Length);
    }
    let part = text.strip_suffix('%').and_then(|number| number.trim().parse::<f64>().ok());
    let part = part.filter(|part| (0.0..=100.0).contains(part));
    let part = part.map(|part| AcceptBound::Part(part / 100.0));
    part.or_else(|| parse_count(text).ok().map(AcceptBound::Count)).ok_or_else(|| {
        let told = "`kept` is bounded by a number of points or a part of them";
        ExpressionFault::new(place, told).help("write it as 250k, 1e6 or 10%")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(text: &str) -> AcceptRule {
        AcceptRules::read(text).unwrap().rules.pop().unwrap()
    }

    #[test]
    fn rules_are_figures_signs_and_bounds() {
        let read = AcceptRules::read(" max<=5mm , p99 < 0.002,lossless, kept >= 10 % ").unwrap();
        let texts: Vec<&str> = read.rules.iter().map(|rule| rule.text.as_str()).collect();
        assert_eq!(texts, ["max<=5mm", "p99 < 0.002", "lossless", "kept >= 10 %"]);
        assert_eq!(rule("rms <= 2").bound, AcceptBound::Length(Length::of(2.0).unwrap()));
        assert_eq!(rule("max <= 5mm").bound, AcceptBound::Length(Length::read("5mm").unwrap()));
        assert_eq!(rule("kept <= 250k").bound, AcceptBound::Count(250_000));
        assert_eq!(rule("kept > 2.5%").bound, AcceptBound::Part(0.025));
        assert_eq!(rule("kept > 2.5%").sign, AcceptSign::Above);
    }

    #[test]
    fn what_is_no_rule_is_told_at_its_place() {
        for (text, place, told) in [
            ("", 0..0, "a rule is missing"),
            ("max <= 1,", 9..9, "a rule is missing"),
            ("<= 5mm", 0..6, "a rule has no figure"),
            ("lossless, mxa <= 1", 10..13, "there is no figure `mxa`"),
            ("lossless <= 1", 9..13, "`lossless` has no bound"),
            ("p99", 3..3, "`p99` needs a bound"),
            ("p99 = 1", 4..5, "a rule has no `=`"),
            ("p99 >= 1", 4..6, "a rule bounds `p99` from above"),
            ("p99 <= 5%", 7..9, "`p99` is bounded by a length above 0"),
            ("p99 <= 0", 7..8, "`p99` is bounded by a length above 0"),
            ("kept >= 5mm", 8..11, "`kept` is bounded by a number of points or a part of them"),
            ("kept >= 101%", 8..12, "`kept` is bounded by a number of points or a part of them"),
            ("kept >=", 7..7, "`kept` is bounded by a number of points or a part of them"),
        ] {
            let fault = AcceptRules::read(text).unwrap_err();
            assert_eq!((fault.span, fault.told.as_str()), (place, told), "{text}");
            assert!(!fault.help.is_empty(), "{text}");
        }
    }
}
