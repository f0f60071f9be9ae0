//! What is wrong with a file by the rules of its format: each rule with its clause, and the places
//! where it does not hold. Knows no format.

use serde::Serialize;

use crate::Error;

/// Places that are told of each rule; the others are counted.
pub const PLACES_TOLD: usize = 3;

/// How much it matters that a rule does not hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Severity {
    /// The specification forbids it, or the file cannot be read: the file is not valid.
    Fault,
    /// It is allowed or common, and programs may go wrong over it.
    Warning,
    /// Something that is worth knowing.
    Note,
}

impl Severity {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Severity::Fault => "fault",
            Severity::Warning => "warning",
            Severity::Note => "note",
        }
    }
}

/// A rule that files of a format are held to.
///
/// ```
/// use pointmill::stage::{Findings, Rule};
///
/// static COUNT: Rule = Rule::fault("count", "TOY 1.0, header", "as many points as there are");
/// let mut findings = Findings::default();
/// findings.at(&COUNT, 8, "the header counts 7 points, and there are 5");
/// assert!(findings.have_faults());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Rule {
    /// Its name, by which programs know it.
    pub name: &'static str,
    /// What it means that it does not hold.
    pub severity: Severity,
    /// The clause of the specification that says so.
    pub clause: &'static str,
    /// What should be there.
    pub should: &'static str,
}

impl Rule {
    /// A rule without which a file is not valid.
    pub const fn fault(name: &'static str, clause: &'static str, should: &'static str) -> Rule {
        Rule { name, severity: Severity::Fault, clause, should }
    }

    /// A rule that warns.
    pub const fn warning(name: &'static str, clause: &'static str, should: &'static str) -> Rule {
        Rule { name, severity: Severity::Warning, clause, should }
    }

    /// A rule that takes note of something.
    pub const fn note(name: &'static str, clause: &'static str, should: &'static str) -> Rule {
        Rule { name, severity: Severity::Note, clause, should }
    }
}

/// A place where a rule does not hold.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct FoundPlace {
    /// The number of the point in the file, from 0, if it is about one.
    pub point: Option<u64>,
    /// The byte of the file, where one can be named: compressed points have none of their own.
    pub byte: Option<u64>,
    /// What is there.
    pub found: String,
}

/// A rule that does not hold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// The rule.
    #[serde(flatten)]
    pub rule: Rule,
    /// In how many places.
    pub count: u64,
    /// The first of them.
    pub places: Vec<FoundPlace>,
}

/// The rules that do not hold for a file, each with its first places and how many there are: the
/// same whoever found them first.
#[derive(Debug, Clone, Default)]
pub struct Findings(Vec<Finding>);

impl Findings {
    fn of(&mut self, rule: &Rule) -> &mut Finding {
        let at = self.0.iter().position(|finding| finding.rule.name == rule.name);
        let at = at.unwrap_or_else(|| {
            self.0.push(Finding { rule: *rule, count: 0, places: Vec::new() });
            self.0.len() - 1
        });
        &mut self.0[at]
    }

    fn add(&mut self, rule: &Rule, place: FoundPlace) {
        let finding = self.of(rule);
        finding.count += 1;
        finding.put(place);
    }

    /// The rule does not hold for what stands from this byte of the file on.
    pub fn at(&mut self, rule: &Rule, byte: u64, found: impl Into<String>) {
        self.add(rule, FoundPlace { point: None, byte: Some(byte), found: found.into() });
    }

    /// The rule does not hold for the file as a whole.
    pub fn whole(&mut self, rule: &Rule, found: impl Into<String>) {
        self.add(rule, FoundPlace { point: None, byte: None, found: found.into() });
    }

    /// The rule does not hold for a point: its number in the file, and its byte where it has one.
    /// What is `found` is asked for the first places alone.
    pub fn point(
        &mut self,
        rule: &Rule,
        point: u64,
        byte: Option<u64>,
        found: impl FnOnce() -> String,
    ) {
        let finding = self.of(rule);
        finding.count += 1;
        let is_behind = |last: &FoundPlace| last.point.is_some_and(|last| last < point);
        if finding.places.len() == PLACES_TOLD && finding.places.last().is_some_and(is_behind) {
            return;
        }
        finding.put(FoundPlace { point: Some(point), byte, found: found() });
    }

    /// An error of reading the file, unless a fault says of its byte what is wrong.
    pub fn error(&mut self, rule: &Rule, error: &Error) {
        let is_told = |finding: &Finding| {
            finding.rule.severity == Severity::Fault
                && finding.places.iter().any(|place| place.byte == error.byte())
        };
        if error.byte().is_some() && self.0.iter().any(is_told) {
            return;
        }
        let found = told(error);
        self.add(rule, FoundPlace { point: None, byte: error.byte(), found });
    }

    /// The first place of the first rule that is broken, in words.
    pub fn first_fault(&self) -> Option<String> {
        let fault = self.0.iter().find(|finding| finding.rule.severity == Severity::Fault)?;
        fault.places.first().map(|place| place.found.clone())
    }

    /// Adds what was found elsewhere.
    pub fn merge(&mut self, other: Findings) {
        for theirs in other.0 {
            let mine = self.of(&theirs.rule);
            mine.count += theirs.count;
            theirs.places.into_iter().for_each(|place| mine.put(place));
        }
    }

    /// True if the file is not valid.
    pub fn have_faults(&self) -> bool {
        self.0.iter().any(|finding| finding.rule.severity == Severity::Fault)
    }

    /// True if the rule of this name does not hold.
    pub fn have(&self, rule: &Rule) -> bool {
        self.0.iter().any(|finding| finding.rule.name == rule.name)
    }

    /// All of them: faults first, and in the order of the file.
    pub fn sorted(mut self) -> Vec<Finding> {
        let place = |finding: &Finding| {
            let first = finding.places.first();
            let byte = first.and_then(|place| place.byte).unwrap_or(u64::MAX);
            (finding.rule.severity, first.and_then(|place| place.point), byte, finding.rule.name)
        };
        self.0.sort_by_key(place);
        self.0
    }
}

impl Finding {
    /// Adds a place, and forgets the last where there are too many.
    fn put(&mut self, place: FoundPlace) {
        let at = self.places.partition_point(|other| *other <= place);
        self.places.insert(at, place);
        self.places.truncate(PLACES_TOLD);
    }
}

/// What an error says but for the file and the byte: its message and its causes.
fn told(error: &Error) -> String {
    let causes = std::iter::successors(std::error::Error::source(error), |cause| cause.source());
    causes.fold(error.message().to_owned(), |told, cause| format!("{told}: {cause}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    static FAR: Rule = Rule::fault("far", "TOY, points", "near");
    static ODD: Rule = Rule::note("odd", "TOY, header", "even");

    #[test]
    fn the_first_places_are_told_whoever_found_them_first() {
        let found = |points: &[u64]| {
            let mut findings = Findings::default();
            points.iter().for_each(|&n| findings.point(&FAR, n, Some(n * 10), || format!("{n}")));
            findings
        };
        let mut one = found(&[70, 80, 90, 100, 20]);
        let mut two = found(&[5, 60, 75]);
        two.at(&ODD, 4, "odd");
        let mut other = two.clone();
        other.merge(one.clone());
        one.merge(two);
        let (one, other) = (one.sorted(), other.sorted());
        assert_eq!(one, other);
        let places: Vec<Option<u64>> = one[0].places.iter().map(|place| place.point).collect();
        assert_eq!((one[0].count, places), (8, vec![Some(5), Some(20), Some(60)]));
        assert_eq!((one[1].rule.name, one[1].count), ("odd", 1));
    }

    #[test]
    fn an_error_at_a_byte_of_which_a_fault_tells_is_not_told_again() {
        let error = |byte| Error::data("a.toy", "it cannot be").at_byte(byte).because("a cause");
        let mut findings = Findings::default();
        findings.at(&ODD, 8, "a note");
        findings.error(&FAR, &error(8));
        findings.error(&FAR, &error(8));
        assert!(findings.have_faults() && findings.have(&ODD));
        let all = findings.sorted();
        assert_eq!((all.len(), all[0].count), (2, 1));
        assert_eq!(all[0].places[0].found, "it cannot be: a cause");
    }
}
