//! Inputs that differ, read as records of one form: what their records have together, and parts
//! that are brought to it.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::convert::{Projection, Rounding};
use super::rows::facts::holding;
use super::rows::lines;
use crate::error::shown;
use crate::point::names::XYZ;
use crate::point::{Dimension, PointBatch, Scalar, Schema, Value};
use crate::report::Short;
use crate::stage::{Assumption, BATCH, Part, ReadKeys};
use crate::{Error, Result};

/// Names that a message lists at most.
const NAMED: usize = 8;

/// True if what some inputs lack is taken to be nothing.
pub fn assumes_dimensions(keys: &ReadKeys) -> bool {
    keys.assume.contains(&Assumption::Dimensions)
}

/// The dimensions of all records, each in a type that holds all of its numbers: in the order of all
/// if they have one, else by name behind the coordinates, so that the order of inputs plays no
/// part. The error is the number of a schema whose type of this dimension fits none before it.
pub fn together(
    own: &[Arc<Schema>],
) -> std::result::Result<Vec<(String, Scalar)>, (usize, String)> {
    let lists = own.iter().map(|schema| schema.dimensions.iter().map(|d| d.name.clone()).collect());
    let order = in_order(lists.collect());
    let mut fields = Vec::new();
    for name in order {
        let mut held = None;
        for (n, schema) in own.iter().enumerate() {
            let Some(own) = schema.find(&name) else { continue };
            held = match held {
                None => Some(own.scalar),
                Some(scalar) => Some(holding(scalar, own.scalar).ok_or_else(|| (n, name.clone()))?),
            };
        }
        fields.extend(held.map(|scalar| (name, scalar)));
    }
    Ok(fields)
}

/// The names of all lists, in their order if all are the same, else sorted, coordinates first.
pub fn in_order(mut lists: Vec<Vec<String>>) -> Vec<String> {
    if lists.windows(2).all(|pair| pair[0] == pair[1]) {
        return lists.pop().unwrap_or_default();
    }
    let all: BTreeSet<String> = lists.into_iter().flatten().collect();
    let mut all: Vec<String> = all.into_iter().collect();
    all.sort_by_key(|name| XYZ.iter().position(|axis| axis == name).unwrap_or(XYZ.len()));
    all
}

/// Refuses the file at `path`, whose dimensions, which its format calls `called`, are `own` and not
/// the `others` of the file at `first`.
pub fn unlike<'a>(
    [path, first]: [&Path; 2],
    called: &str,
    own: impl IntoIterator<Item = &'a String>,
    others: impl IntoIterator<Item = &'a String>,
) -> Error {
    let [own, others]: [BTreeSet<_>; 2] = [own.into_iter().collect(), others.into_iter().collect()];
    let list = |what: &str, names: Vec<&&String>| {
        let listed = names.iter().take(NAMED).map(|name| format!("`{}`", lines::shown(name)));
        let listed = listed.collect::<Vec<_>>().join(", ");
        let more = if names.len() > NAMED { " and others" } else { "" };
        (!names.is_empty()).then(|| format!("{what} {listed}{more}"))
    };
    let lacks = list("it lacks", others.difference(&own).collect());
    let has = list("it alone has", own.difference(&others).collect());
    let why = match lacks.into_iter().chain(has).collect::<Vec<_>>() {
        none if none.is_empty() => "their types or their order are others".to_owned(),
        both => both.join("; "),
    };
    Error::data(path, format!("its {called} are not those of {}: {why}", shown(first))).help(
        "`read.assume = [\"dimensions\"]` reads them as one scan all the same: what a file lacks \
         is 0 in its points; or convert one of them first",
    )
}

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
