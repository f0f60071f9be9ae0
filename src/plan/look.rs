//! A look at some records before a run, so that values which an output cannot hold are told before
//! the work and not in the middle of it. It finds what is common, and proves nothing.

use crate::engine::pass::StreamOp;
use crate::engine::task::Schemas;
use crate::point::{PointBatch, Schema, Value};
use crate::report::Tally;
use crate::stage::{CreateSink, Source};
use crate::{Error, Result};

/// Parts that are looked at, spread evenly over the source.
const PARTS: usize = 8;
/// Records of each, from its beginning, and the most bytes that they take.
const RECORDS: usize = 1024;
const BYTES: usize = 1 << 20;

/// Records of a part that are looked at one by one where one does not fit.
const SINGLES: usize = 64;

/// What a look found that does not fit.
pub(crate) struct Unfit {
    /// What writing one of the records would be.
    pub error: Error,
    /// True if none of those that were looked at fits the output that one does not.
    pub none_fits: bool,
}

/// Looks at some records for all `sinks`. Returns the first error that writing one of them would
/// be; reading fails as a run would.
pub(crate) fn look(
    source: &dyn Source,
    sinks: &[Box<dyn CreateSink>],
    (transforms, schemas): (&[StreamOp], &Schemas),
    drop_nonfinite: bool,
) -> Result<Option<Unfit>> {
    let schema = &schemas.last;
    let looking: Vec<_> = sinks.iter().filter(|sink| sink.checks(schema)).collect();
    if looking.is_empty() || source.is_read_once() {
        return Ok(None);
    }
    let records = RECORDS.min(BYTES / schema.stride.max(1)).max(1);
    let mut batch = PointBatch::new(schema.clone(), records);
    let step = source.parts().div_ceil(PARTS).max(1);
    let parts = || (0..source.parts()).step_by(step);
    let read = |index: usize, batch: &mut PointBatch| {
        batch.clear();
        batch.relabel(source.schema());
        source.part(index)?.read(batch)?;
        moved(batch, transforms, schemas);
        if drop_nonfinite {
            batch.retain(|_, record| is_finite(record, schema));
        }
        Ok::<_, Error>(())
    };
    for index in parts() {
        read(index, &mut batch)?;
        for sink in &looking {
            let Err(error) = sink.check(source.metadata(), &batch) else { continue };
            let mut none_fits = true;
            for other in parts() {
                read(other, &mut batch)?;
                none_fits = none_fits && !any_fits(sink.as_ref(), &batch, source);
            }
            return Ok(Some(Unfit { error: error.at(sink.path()), none_fits }));
        }
    }
    Ok(None)
}

/// The error that writing a point at a corner of the box that headers claim would be. Where a scan
/// reaches to is seen by none of its first records.
pub(crate) fn look_at_corners(
    source: &dyn Source,
    sinks: &[Box<dyn CreateSink>],
    (transforms, schemas): (&[StreamOp], &Schemas),
) -> Result<Option<Error>> {
    let last = &schemas.last;
    let looking: Vec<_> = sinks.iter().filter(|sink| sink.checks(last)).collect();
    let can_look = !looking.is_empty() && source.parts() > 0 && !source.is_read_once();
    let Some(corners) = source.claimed_box().filter(|_| can_look) else { return Ok(None) };
    let schema = source.schema();
    let Some(axes) = schema.coordinates() else { return Ok(None) };
    let mut batch = PointBatch::new(schema.clone(), RECORDS);
    source.part(0)?.read(&mut batch)?;
    batch.truncate(1);
    let Some(record) = batch.iter().next().map(<[u8]>::to_vec) else { return Ok(None) };
    for n in 0..8 {
        batch.clear();
        batch.relabel(schema);
        let mut record = record.clone();
        let is_stored = axes.iter().enumerate().all(|(axis, field)| {
            let world = corners[n >> axis & 1][axis];
            let stored = ((world - field.origin) / field.scale).round();
            field.put(&mut record, schema.endian, Value::Double(stored))
        });
        // A box that the input itself cannot hold says nothing of its points.
        if !is_stored {
            continue;
        }
        batch.extend(&record);
        moved(&mut batch, transforms, schemas);
        for sink in &looking {
            if let Err(error) = sink.check(source.metadata(), &batch) {
                return Ok(Some(error.at(sink.path())));
            }
        }
    }
    Ok(None)
}

/// Moves the records of a batch to where stages of the decode move them; forgets them where one
/// cannot, since a stage above it may remove that.
fn moved(batch: &mut PointBatch, transforms: &[StreamOp], schemas: &Schemas) {
    for (stage, leaves) in transforms.iter().zip(&schemas.left_by) {
        if stage.moves() && stage.apply(batch, &mut Tally::default()).is_err() {
            batch.clear();
        }
        batch.relabel(leaves);
    }
}

/// True if one of some records of `batch` fits `sink`.
fn any_fits(sink: &dyn CreateSink, batch: &PointBatch, source: &dyn Source) -> bool {
    let mut single = PointBatch::new(batch.schema().clone(), 1);
    batch.iter().step_by(batch.len().div_ceil(SINGLES).max(1)).any(|record| {
        single.clear();
        single.extend(record);
        sink.check(source.metadata(), &single).is_ok()
    })
}

fn is_finite(record: &[u8], schema: &Schema) -> bool {
    let axes = schema.coordinates();
    axes.is_none_or(|axes| axes.iter().all(|d| d.world(record, schema.endian).is_finite()))
}
