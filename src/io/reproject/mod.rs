//! Points brought from the system that the inputs are in to another as they are read, so that all
//! that a pipeline does happens there. Knows no format.

mod form;
mod operation;
mod place;
mod systems;
#[cfg(test)]
mod tests;

use std::sync::Arc;

pub use form::AskedSteps;
use form::ReprojectedForm;
use operation::PointTransform;
use place::{image, place_of, turn};
use systems::{PlacedSystem, heights};

use crate::Result;
use crate::io::wkt;
use crate::point::names::NORMAL;
use crate::point::{Metadata, PointBatch, Schema};
use crate::report::{LostPoints, Reprojection};
use crate::stage::{BATCH, Contradiction, Input, Part, Source};

/// The scan of `inner` in the system `to`, which is given by EPSG codes.
///
/// # Errors
///
/// Inputs that do not say in which system they are, systems that are not known, and systems between
/// which no operation is known or none but by a grid; see [`PointTransform::between`] and
/// [`heights`].
pub fn reprojected(inner: Box<dyn Source>, to: &str, asked: AskedSteps) -> Result<Box<dyn Source>> {
    let metadata = inner.metadata();
    let from = PlacedSystem::of_inputs(metadata.crs.as_deref())?;
    let mut to = PlacedSystem::of_code(to)?;
    let (change, up) = heights(&from, &to, &metadata.units)?;
    to.up = up;
    let place = place_of(&*inner)?;
    let change = (change, metadata.units.vertical.unwrap_or(1.0));
    let (transform, told) = PointTransform::between(&from, &to, change, place)?;
    let place = place.and_then(|corners| image(&transform, corners));
    let keeps = transform.keeps_heights();
    let metres = [from.metres(), to.metres()];
    let form = ReprojectedForm::of(inner.schema(), asked, metres, place, keeps)?;
    let are_degrees = [from, to.clone()].map(|system| system.is_in_degrees());
    let how = Arc::new(HowReprojected { transform, form, told, are_degrees, crs: to.text() });
    Ok(Box::new(ReprojectedSource::new(inner, how, place)))
}

/// All that is decided before the points are read.
struct HowReprojected {
    transform: PointTransform,
    form: ReprojectedForm,
    told: Reprojection,
    /// Whether the systems are in degrees; None of axes from the centre of the Earth.
    are_degrees: [Option<bool>; 2],
    /// The system that the points are in then.
    crs: String,
}

impl HowReprojected {
    /// What a file of the points says besides them.
    fn metadata(&self, own: &Metadata) -> Metadata {
        let (crs, units) = (Some(self.crs.clone()), wkt::units(&self.crs));
        Metadata { crs, units, moved: true, ..own.clone() }
    }
}

struct ReprojectedSource {
    inner: Box<dyn Source>,
    how: Arc<HowReprojected>,
    schema: Arc<Schema>,
    metadata: Metadata,
    place: Option<[[f64; 3]; 2]>,
}

impl ReprojectedSource {
    fn new(inner: Box<dyn Source>, how: Arc<HowReprojected>, place: Option<[[f64; 3]; 2]>) -> Self {
        let (schema, metadata) =
            (Arc::new(how.form.schema.clone()), how.metadata(inner.metadata()));
        ReprojectedSource { inner, how, schema, metadata, place }
    }

    /// The part `inner` in the other system.
    fn brought<'a>(&'a self, inner: Box<dyn Part + 'a>) -> Box<dyn Part + 'a> {
        Box::new(ReprojectedPart { inner, source: self, own: None })
    }

    /// What is to be told of normals, which nothing turns.
    fn told_of_normals(&self) -> Option<String> {
        self.schema.find(NORMAL[0])?;
        let HowReprojected { transform, told, are_degrees, .. } = &*self.how;
        let turn = match (self.inner.claimed_box(), are_degrees) {
            (Some(corners), [Some(from), Some(to)]) => turn(transform, corners, [*from, *to]),
            _ => None,
        };
        let turn = turn.map_or("the axes of the two turn".to_owned(), |turn| {
            format!("north turns by {turn:.3}° in the middle of the scan")
        });
        let (from, to) = (&told.from, &told.to);
        Some(format!("normals are kept as they are; from {from} to {to} {turn}"))
    }

    /// What is to be told of the operation, where points are not exactly where they were.
    fn told(&self) -> Option<String> {
        let told = &self.how.told;
        let operation = told.operation.as_ref()?;
        let code = told.code.map_or(String::new(), |code| format!(" (EPSG:{code})"));
        let accuracy = match told.accuracy {
            Some(metres) => format!("which is accurate to {metres} m"),
            None => "whose accuracy nothing says".to_owned(),
        };
        let better = told.better.as_ref().map_or(String::new(), |better| {
            format!("; {better} is possible, which pointmill does not have")
        });
        Some(format!(
            "points come from {} to {} by `{operation}`{code}, {accuracy}{better}",
            told.from, told.to
        ))
    }
}

impl Source for ReprojectedSource {
    fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn claimed_box(&self) -> Option<[[f64; 3]; 2]> {
        self.inner.claimed_box().and(self.place)
    }

    fn inputs(&self) -> Vec<Input> {
        self.inner.inputs()
    }

    fn metadata_of(&self, input: usize) -> Result<Metadata> {
        Ok(self.how.metadata(&self.inner.metadata_of(input)?))
    }

    fn points(&self) -> u64 {
        self.inner.points()
    }

    fn part_bytes(&self) -> u64 {
        self.inner.part_bytes() + (BATCH * self.inner.schema().stride) as u64
    }

    fn parts(&self) -> usize {
        self.inner.parts()
    }

    fn first_record(&self, index: usize) -> Option<u64> {
        self.inner.first_record(index)
    }

    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>> {
        Ok(self.brought(self.inner.part(index)?))
    }

    fn part_without(&self, index: usize, unread: &[String]) -> Result<Box<dyn Part + '_>> {
        Ok(self.brought(self.inner.part_without(index, unread)?))
    }

    fn coarser(&self, points: u64) -> Option<Box<dyn Source>> {
        let inner = self.inner.coarser(points)?;
        Some(Box::new(ReprojectedSource::new(inner, self.how.clone(), self.place)))
    }

    fn is_read_once(&self) -> bool {
        self.inner.is_read_once()
    }

    fn warnings(&self) -> Vec<String> {
        let own = self.told().into_iter().chain(self.told_of_normals());
        self.inner.warnings().into_iter().chain(own).collect()
    }

    fn lost(&self) -> Vec<LostPoints> {
        self.inner.lost()
    }

    fn contradictions(&self) -> Vec<Contradiction> {
        self.inner.contradictions()
    }

    fn reprojection(&self) -> Option<Reprojection> {
        Some(self.how.told.clone())
    }
}

struct ReprojectedPart<'a> {
    inner: Box<dyn Part + 'a>,
    source: &'a ReprojectedSource,
    /// As the inputs have them.
    own: Option<PointBatch>,
}

impl Part for ReprojectedPart<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        let schema = self.source.inner.schema();
        let make = || PointBatch::new(schema.clone(), batch.capacity());
        let own = self.own.get_or_insert_with(make);
        self.inner.read(own)?;
        batch.source = own.source;
        let how = &self.source.how;
        let filled = how.form.fill(own, batch.refill(own.len()), |at| how.transform.apply(at));
        filled.map_err(|error| match self.source.inner.inputs().get(own.source as usize) {
            Some(input) => error.at(&input.path),
            None => error,
        })
    }
}
