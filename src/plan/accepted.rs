//! Whether a run can be held to the rules of its pipeline: what they ask of it must be measured, or
//! be so for every record, before anyone waits for it.

use super::sorted::Sorted;
use crate::Error;
use crate::engine::pass::StreamOp;
use crate::error::listed;
use crate::point::Schema;
use crate::report::{ACCEPT_RULES, AcceptFigure, AcceptTable};
use crate::stage::Source;

/// The rules in the unit of the scan. Added to what is `wrong`: all rules on what a run of these
/// stages does not measure or keep, and lengths in units that the scan does not tell.
pub(super) fn accepted(
    table: AcceptTable,
    sorted: &Sorted,
    (source, schema): (&dyn Source, &Schema),
    wrong: &mut Vec<Error>,
) -> AcceptTable {
    for rule in table.all() {
        let name = rule.figure.name();
        if rule.figure.is_deviation() && !sorted.ops.iter().any(|s| s.op.tile().needs().measures) {
            let told =
                format!("`{ACCEPT_RULES}`: a run of this pipeline does not measure `{name}`");
            let help = "it measures `kept` and `lossless`; how far removed points are from what \
                        stands for them is measured where `median`, `graded`, `grid`, `scanline`, \
                        `triangles`, `wavelet` or `fourier` reduces";
            wrong.push(Error::pipeline(told).help(help));
        }
        if rule.figure == AcceptFigure::Lossless {
            wrong.extend(losing(sorted, schema));
        }
    }
    match table.in_scan(&source.metadata().units) {
        Ok(table) => table,
        Err(error) => {
            wrong.push(error);
            AcceptTable::default()
        }
    }
}

/// Why records are not written as they were read; None if they are.
fn losing(sorted: &Sorted, schema: &Schema) -> Option<Error> {
    let changes = |s: &&StreamOp| !s.changes().is_empty();
    let streams = sorted.transforms.iter().chain(&sorted.filters).filter(changes);
    let marks = sorted.ops.iter().filter(|stage| stage.op.tile().needs().mark.is_some());
    let stages = streams.map(|s| &s.kind).chain(marks.map(|stage| &stage.kind));
    let stages: Vec<String> = stages.map(|kind| format!("`{kind}`")).collect();
    let told = |why: String| {
        Error::pipeline(format!(
            "`{ACCEPT_RULES}`: a run of this pipeline is not `lossless`: {why}"
        ))
    };
    if let [_, ..] = &stages[..] {
        let verb = if stages.len() == 1 { "changes" } else { "change" };
        let why = format!("{} {verb} records", listed(&stages, "and"));
        return Some(told(why).help("leave the rule out, or the stages"));
    }
    let other = sorted.sinks.iter().find(|sink| !sink.carries(schema))?;
    let why = "records are written in another form than they are read in";
    let help = "leave the rule out, or write the format of the input, without settings that change \
                its records";
    Some(told(why.to_owned()).at(other.path()).help(help))
}
