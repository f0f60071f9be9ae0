//! A look at some records before a run, so that values which an output cannot hold are told before the
//! work and not in the middle of it. It finds what is common, and proves nothing.

use crate::point::{PointBatch, Schema};
use crate::stage::{CreateSink, Source};
use crate::{Error, Result};

/// Parts that are looked at, spread evenly over the source.
const PARTS: usize = 8;
/// Records of each, from its beginning, and the most bytes that they take.
const RECORDS: usize = 1024;
const BYTES: usize = 1 << 20;

/// Looks at some records for all `sinks`. Returns the first error that writing one of them would be;
/// reading fails as a run would.
pub(super) fn look(
    source: &dyn Source,
    sinks: &[Box<dyn CreateSink>],
    drop_nonfinite: bool,
) -> Result<Option<Error>> {
    let schema = source.schema();
    let looking: Vec<_> = sinks.iter().filter(|sink| sink.checks(schema)).collect();
    if looking.is_empty() {
        return Ok(None);
    }
    let records = RECORDS.min(BYTES / schema.stride.max(1)).max(1);
    let mut batch = PointBatch::new(schema.clone(), records);
    let parts = source.parts();
    let step = parts.div_ceil(PARTS).max(1);
    for index in (0..parts).step_by(step) {
        source.part(index)?.read(&mut batch)?;
        if drop_nonfinite {
            batch.retain(|_, record| is_finite(record, schema));
        }
        for sink in &looking {
            if let Err(error) = sink.check(source.metadata(), &batch) {
                return Ok(Some(error.at(sink.path())));
            }
        }
    }
    Ok(None)
}

fn is_finite(record: &[u8], schema: &Schema) -> bool {
    let axes = schema.coordinates();
    axes.is_none_or(|axes| axes.iter().all(|d| d.world(record, schema.endian).is_finite()))
}
