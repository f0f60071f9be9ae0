//! The ledger: every record read is kept or removed for a reason that is named.

use std::path::Path;

use serde::Serialize;

use super::Tally;
use crate::{Error, Result};

/// Records that a stage removed for one reason.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Removed {
    /// Kind of the stage.
    pub stage: String,
    /// Why.
    pub reason: String,
    /// How many.
    pub records: u64,
}

/// What became of the records read: read = kept + removed, per stage and reason.
///
/// `read` is what the source counted, `kept` what went to the sinks, `removed` what the stages
/// entered: three counts made apart, or the balance would prove nothing.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Ledger {
    /// Records that the source yielded.
    pub read: u64,
    /// Records that the sinks were given.
    pub kept: u64,
    /// Records that stages removed, by stage and reason in alphabetical order.
    pub removed: Vec<Removed>,
}

impl Ledger {
    /// The ledger of a run whose stages reported `tally`.
    pub(crate) fn new(read: u64, kept: u64, tally: &Tally) -> Self {
        let removed = tally.removed.iter().map(|((stage, reason), &records)| Removed {
            stage: stage.clone(),
            reason: reason.clone().into_owned(),
            records,
        });
        Ledger { read, kept, removed: removed.collect() }
    }

    /// Records removed by all stages.
    pub fn removed_records(&self) -> u64 {
        self.removed.iter().fold(0, |sum, r| sum.saturating_add(r.records))
    }

    /// Fails with [`ErrorKind::Internal`](crate::ErrorKind::Internal), naming every figure, if the
    /// ledger does not balance.
    pub(crate) fn check(&self) -> Result<()> {
        if self.kept.checked_add(self.removed_records()) == Some(self.read) {
            return Ok(());
        }
        let mut removed = String::new();
        for entry in &self.removed {
            removed +=
                &format!(" + {} removed by {} as {}", entry.records, entry.stage, entry.reason);
        }
        Err(Error::internal(format!(
            "the ledger does not balance: {} records read, but {} kept{removed}",
            self.read, self.kept
        ))
        .help(
            "no output was written; please report this with the pipeline and the inputs' headers",
        ))
    }
}

/// Fails with [`ErrorKind::Internal`](crate::ErrorKind::Internal) if the sink of `output` wrote
/// another number of records than the `given` ones.
pub fn check_written(output: &Path, given: u64, written: u64) -> Result<()> {
    if written == given {
        return Ok(());
    }
    Err(Error::internal(format!(
        "the ledger does not balance: {given} records kept, but {written} written"
    ))
    .at(output))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorKind;

    fn tally() -> Tally {
        let mut tally = Tally::default();
        tally.remove("median", "represented", 60);
        tally.remove("median", "coincident", 5);
        tally.remove("read", "not finite", 1);
        tally
    }

    #[test]
    fn a_balanced_ledger_passes() {
        let ledger = Ledger::new(100, 34, &tally());
        assert_eq!(ledger.removed_records(), 66);
        ledger.check().unwrap();
        check_written(Path::new("out.las"), 34, 34).unwrap();
        Ledger::default().check().unwrap();
    }

    #[test]
    fn an_imbalance_is_an_internal_error_that_names_every_figure() {
        let error = Ledger::new(100, 35, &tally()).check().unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Internal);
        let message = error.to_string();
        for part in [
            "100 records read",
            "35 kept",
            "5 removed by median as coincident",
            "60 removed",
            "not finite",
        ] {
            assert!(message.contains(part), "{message}");
        }
    }

    #[test]
    fn figures_at_the_end_of_u64_do_not_wrap_into_balance() {
        let mut tally = Tally::default();
        tally.remove("a", "b", u64::MAX);
        assert!(Ledger::new(0, 1, &tally).check().is_err());
    }

    #[test]
    fn an_output_with_another_count_is_named() {
        let error = check_written(Path::new("out.las"), 3, 2);
        assert_eq!(
            error.unwrap_err().to_string(),
            "out.las: the ledger does not balance: 3 records kept, but 2 written"
        );
    }
}
