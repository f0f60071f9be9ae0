//! Stages that stream, fitted to the records that come to them.

use std::sync::Arc;

use super::sorted::{Sorted, blame};
use crate::engine::pass::StreamOp;
use crate::engine::task::Schemas;
use crate::point::Schema;
use crate::stage::Source;
use crate::{Error, Result};

/// What records of `schema` become on their way through the stages that stream, and what is wrong
/// with stages that cannot work on what comes to them.
pub(super) fn fit_transforms(sorted: &Sorted, schema: &Arc<Schema>) -> (Schemas, Vec<Error>) {
    let (mut written, mut wrong) = (Vec::new(), Vec::new());
    let (mut last, mut left_by) = (schema.clone(), Vec::new());
    for stage in &sorted.transforms {
        let unfit = wrong.len();
        wrong.extend(fit(stage, &last, &mut written));
        if wrong.len() == unfit {
            match leaves(stage, &last) {
                Ok(None) => {}
                Ok(Some(leaves)) => last = Arc::new(leaves),
                Err(error) => wrong.push(blame(&*stage.written, error)),
            }
        }
        left_by.push(last.clone());
    }
    for stage in &sorted.filters {
        wrong.extend(fit(stage, &last, &mut written));
        if stage.moves() && !stage.of_tiles {
            let told = format!(
                "`{}` moves points, and stands behind stages that looked at where they are, or on \
                 one of several branches",
                stage.kind
            );
            let help = "put it above stages that work on tiles, and above branches";
            wrong.push(stage.written.wrong(told).help(help));
        }
    }
    (Schemas { left_by, last }, wrong)
}

/// What is wrong with a stage that gets records of `schema`, where those before it have `written`
/// some dimensions.
fn fit(stage: &StreamOp, schema: &Schema, written: &mut Vec<String>) -> Vec<Error> {
    let StreamOp { kind, transform, .. } = stage;
    let needs = transform.needs();
    let there = |name: &&String| schema.find(name).is_some() || written.contains(name);
    let missing = needs.dimensions.iter().find(|name| !there(name)).map(|missing| {
        let told = format!("`{kind}` needs {missing}, which nothing before it gives");
        Error::pipeline(told).help("the input has no such dimension")
    });
    let unfit = transform.check(schema).err();
    written.extend(needs.changes);
    let here = |error| blame(&*stage.written, error);
    missing.into_iter().chain(unfit).map(here).collect()
}

/// The schema of what a stage leaves, if it is another; what it may not change of it is an error.
fn leaves(stage: &StreamOp, from: &Schema) -> Result<Option<Schema>> {
    let Some(to) = stage.transform.leaves(from)? else { return Ok(None) };
    let kind = &stage.kind;
    let is_same = to.stride == from.stride
        && to.dimensions.len() == from.dimensions.len()
        && from.dimensions.iter().zip(&to.dimensions).all(|(a, b)| {
            (&a.name, a.scalar, a.offset, a.bits) == (&b.name, b.scalar, b.offset, b.bits)
        });
    if !is_same || !stage.moves() {
        let told = format!("the stage {kind} changes more of its records than it says");
        return Err(Error::internal(told));
    }
    match stage.choice.is_all() {
        true => Ok(Some(to)),
        false => {
            let told = format!("`{kind}` stores the coordinates of all points anew");
            Err(stage.written.wrong(told).help("limit it to none of them"))
        }
    }
}

/// Refuses stages that read the numbers of records where these are not known.
pub(super) fn check_numbers(sorted: &Sorted, source: &dyn Source) -> Result<()> {
    let reads = |stage: &&StreamOp| stage.reads_record_numbers();
    if let Some(stage) = sorted.filters.iter().find(reads) {
        let told = format!(
            "`{}` goes by the numbers that records have in the input, and stands where they do not \
             come in its order",
            stage.kind
        );
        let help = "put it above stages that work on tiles, and above branches";
        return Err(stage.written.wrong(told).help(help));
    }
    let unknown = |part: &usize| source.first_record(*part).is_none();
    match sorted.transforms.iter().find(reads) {
        Some(stage) if (0..source.parts()).any(|part| unknown(&part)) => {
            let told = format!(
                "`{}` goes by the numbers that records have in the input, which `{}` does not \
                 know before it has read them",
                stage.kind, sorted.source.0
            );
            Err(stage.written.wrong(told).help("write the points to a file first, and read that"))
        }
        _ => Ok(()),
    }
}
