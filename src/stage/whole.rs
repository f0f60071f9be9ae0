//! The rules that hold for files of every format: they can be read to their end, and say how many
//! points they have.

use super::findings::{Findings, Rule};
use super::source::Source;
use super::walk::PointWalk;
use crate::report::Grouped;
use crate::{Error, Result};

/// Rules that files of every format are held to.
pub static WHOLE_RULES: [&Rule; 5] = [&READABLE, &POINT_COUNT, &HEADER_BELIED, &FINITE, &TOLD];

static READABLE: Rule =
    Rule::fault("readable", "the file as a whole", "a file that can be read to its end");
static POINT_COUNT: Rule =
    Rule::fault("count", "the header's count", "as many points as the header counts");
static HEADER_BELIED: Rule =
    Rule::fault("header-belied", "the header", "a header that says of the points what is so");
static FINITE: Rule = Rule::warning("finite", "coordinates", "coordinates that are finite numbers");
static TOLD: Rule =
    Rule::note("told", "reading", "nothing that has to be told of reading the file");

/// Enters an error that ends the look at a file.
pub(crate) fn enter_error(findings: &mut Findings, error: &Error) {
    findings.error(&READABLE, error);
}

/// What a thread found.
#[derive(Debug, Default)]
struct WholeSeen {
    points: u64,
    /// Points with a coordinate that is no finite number.
    nowhere: u64,
    findings: Findings,
}

/// Reads all of a source and enters what the rules say of it.
///
/// # Errors
///
/// A memory that does not do.
pub fn read_whole(
    source: &dyn Source,
    walk: &PointWalk<'_>,
    findings: &mut Findings,
) -> Result<()> {
    let schema = source.schema();
    let axes = schema.coordinates();
    let states = walk.each_batch(
        source,
        &[],
        size_of::<WholeSeen>() as u64,
        WholeSeen::default,
        |seen, _, _, batch| {
            seen.points += batch.len() as u64;
            if let Some(axes) = axes {
                let is_somewhere = |record: &[u8]| {
                    axes.iter().all(|axis| axis.world(record, schema.endian).is_finite())
                };
                seen.nowhere += batch.iter().filter(|record| !is_somewhere(record)).count() as u64;
            }
        },
        |seen, _, error| {
            seen.findings.error(&READABLE, &error);
            Ok(())
        },
    )?;
    let mut all = WholeSeen::default();
    for seen in states {
        all.points += seen.points;
        all.nowhere += seen.nowhere;
        all.findings.merge(seen.findings);
    }
    let was_read = !all.findings.have_faults();
    findings.merge(all.findings);
    if all.nowhere > 0 {
        let (nowhere, points) = (Grouped(all.nowhere), Grouped(all.points));
        findings.whole(&FINITE, format!("{nowhere} of {points} points have others"));
    }
    let counted: u64 = source.inputs().iter().map(|input| input.points).sum();
    if was_read && counted != all.points && !source.inputs().is_empty() {
        let (counted, points) = (Grouped(counted), Grouped(all.points));
        findings
            .whole(&POINT_COUNT, format!("the header counts {counted}, and there are {points}"));
    }
    for told in source.contradictions() {
        findings.at(&HEADER_BELIED, told.byte, told.message);
    }
    let inputs = source.inputs();
    let path = inputs.first().map(|input| crate::error::shown(&input.path).to_string());
    for warning in source.warnings() {
        let bare = path.as_ref().and_then(|path| warning.strip_prefix(path)?.strip_prefix(": "));
        findings.whole(&TOLD, bare.unwrap_or(&warning));
    }
    Ok(())
}
