//! Parts of inputs that differ, read as records of one form.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::convert::{Projection, Rounding};
use crate::error::shown;
use crate::point::{Dimension, PointBatch, Schema, Value};
use crate::report::Short;
use crate::stage::{BATCH, Part};
use crate::{Error, Result};

/// How the records of one input become those of all.
#[derive(Debug)]
pub struct ToOneForm {
    own: Arc<Schema>,
    projection: Projection,
    /// The bits of the largest rounding of a coordinate so far: those of numbers above 0 have their
    /// order.
    rounded: AtomicU64,
}

impl ToOneForm {
    /// Records of `own` become such of `to`, with these values in dimensions that `own` lacks and 0
    /// in the others; None where they are alike.
    pub fn of(
        own: Schema,
        to: &Schema,
        absent: &[(Dimension, Value)],
    ) -> Result<Option<ToOneForm>> {
        if own == *to {
            return Ok(None);
        }
        let mut projection = Projection::reading(&own, to)?;
        for (dimension, value) in absent {
            if !projection.preset(dimension, *value) {
                let told = format!("`{}` does not hold its own value for no data", dimension.name);
                return Err(Error::pipeline(told));
            }
        }
        Ok(Some(ToOneForm { own: Arc::new(own), projection, rounded: AtomicU64::new(0) }))
    }

    /// Bytes that a part takes for the file's own records.
    pub fn part_bytes(&self) -> u64 {
        (BATCH * self.own.stride) as u64
    }

    /// The part `inner` of the file at `path`, whose records are brought to the form.
    pub fn part<'a>(&'a self, inner: Box<dyn Part + 'a>, path: &'a Path) -> Box<dyn Part + 'a> {
        Box::new(UnitedPart { inner, form: self, path, own: None })
    }

    /// What rounding is to be told of the file at `path`.
    pub fn told(&self, path: &Path) -> Option<String> {
        let largest = f64::from_bits(self.rounded.load(Ordering::Relaxed));
        (largest > 0.0).then(|| {
            format!(
                "{}: coordinates were rounded to the scale and offset that all inputs are brought \
                 to, by at most {}",
                shown(path),
                Short(largest)
            )
        })
    }

    fn note(&self, rounding: Rounding) {
        self.rounded.fetch_max(rounding.largest.to_bits(), Ordering::Relaxed);
    }
}

struct UnitedPart<'a> {
    inner: Box<dyn Part + 'a>,
    form: &'a ToOneForm,
    path: &'a Path,
    /// As the file has them.
    own: Option<PointBatch>,
}

impl Part for UnitedPart<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        let make = || PointBatch::new(self.form.own.clone(), batch.capacity());
        let own = self.own.get_or_insert_with(make);
        self.inner.read(own)?;
        batch.source = own.source;
        let records = batch.refill(own.len());
        let rounding = self.form.projection.project_into(own.records(), records);
        self.form.note(rounding.map_err(|error| error.at(self.path))?);
        Ok(())
    }
}
