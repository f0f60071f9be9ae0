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
use form::{BadPoint, ReprojectedForm, has_steps};
use operation::PointTransform;
use place::{ScanPlace, image, place_of, turn};
use systems::{PlacedSystem, heights};

use crate::io::wkt;
use crate::point::names::{NORMAL, WAVE_DIRECTION};
use crate::point::{Metadata, PointBatch, Schema};
use crate::report::{LostPoints, Reprojection};
use crate::stage::{BATCH, Contradiction, Input, Part, Source};
use crate::{Error, Result};

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
    let heights = heights(&from, &to, &metadata.units)?;
    to.up = heights.up;
    // Neither the operation nor the records depend on it else.
    let is_needed = !from.has_datum_of(&to) || has_steps(inner.schema());
    let place = if is_needed { place_of(&*inner)? } else { None };
    let corners = place.map(|place| place.corners);
    let up = from.height_unit(metadata.units.vertical);
    let (transform, told) = PointTransform::between(&from, &to, (heights.change, up), corners)?;
    let image = corners.and_then(|corners| image(&transform, corners));
    let [was, is] = [from.metres(), to.metres()];
    let metres = [[was, was, up], [is, is, up / heights.change.factor()]];
    let form = ReprojectedForm::of(inner.schema(), asked, metres, image, heights.change)?;
    let are_degrees = [&from, &to].map(PlacedSystem::is_in_degrees);
    let notes = heights.told;
    let how = HowReprojected { transform, form, told, notes, are_degrees, place, image };
    Ok(Box::new(ReprojectedSource::new(inner, Arc::new(how))))
}

/// All that is decided before the points are read.
struct HowReprojected {
    transform: PointTransform,
    form: ReprojectedForm,
    told: Reprojection,
    /// What is to be told of heights.
    notes: Option<String>,
    /// Where the scan is, if that had to be known, and what becomes of that box.
    place: Option<ScanPlace>,
    image: Option<[[f64; 3]; 2]>,
    /// Whether the systems are in degrees; None of axes from the centre of the Earth.
    are_degrees: [Option<bool>; 2],
}

impl HowReprojected {
    /// What a file of the points says besides them.
    fn metadata(&self, own: &Metadata) -> Metadata {
        let (crs, units) = (Some(self.told.to.clone()), wkt::units(&self.told.to));
        Metadata { crs, units, moved: true, ..own.clone() }
    }
}

struct ReprojectedSource {
    inner: Box<dyn Source>,
    how: Arc<HowReprojected>,
    schema: Arc<Schema>,
    metadata: Metadata,
}

impl ReprojectedSource {
    fn new(inner: Box<dyn Source>, how: Arc<HowReprojected>) -> Self {
        let schema = Arc::new(how.form.schema.clone());
        let metadata = how.metadata(inner.metadata());
        ReprojectedSource { inner, how, schema, metadata }
    }

    /// The part `inner` in the other system.
    fn brought<'a>(&'a self, inner: Box<dyn Part + 'a>) -> Box<dyn Part + 'a> {
        Box::new(ReprojectedPart { inner, source: self, own: None })
    }

    /// What is to be told of directions, which nothing turns.
    fn told_of_directions(&self) -> Option<String> {
        let has = |name: &str| self.schema.find(name).is_some();
        let what = match (has(NORMAL[0]), has(WAVE_DIRECTION[0])) {
            (false, false) => return None,
            (true, false) => "normals",
            (false, true) => "directions of waveforms",
            (true, true) => "normals and directions of waveforms",
        };
        let HowReprojected { transform, told, are_degrees, place, .. } = &*self.how;
        let turn = match (place, are_degrees) {
            (Some(place), [Some(from), Some(to)]) => turn(transform, place.corners, [*from, *to]),
            _ => None,
        };
        let turn = turn.map_or("the axes of the two turn".to_owned(), |turn| {
            format!("north turns by {turn:.3}° in the middle of the scan")
        });
        let (from, to) = (&told.from, &told.to);
        Some(format!("{what} are kept as they are; from {from} to {to} {turn}"))
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
        let is_claimed = self.how.place.is_some_and(|place| place.is_claimed);
        self.how.image.filter(|_| is_claimed)
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
        Some(Box::new(ReprojectedSource::new(inner, self.how.clone())))
    }

    fn is_read_once(&self) -> bool {
        self.inner.is_read_once()
    }

    fn warnings(&self) -> Vec<String> {
        let how = &self.how;
        let own = self.told().into_iter().chain(how.notes.clone()).chain(how.form.coarser.clone());
        self.inner.warnings().into_iter().chain(own).chain(self.told_of_directions()).collect()
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
        filled.map_err(|bad| match bad {
            BadPoint::Other(error) => error,
            BadPoint::Place(told, help) => {
                let inputs = self.source.inner.inputs();
                match inputs.get(own.source as usize) {
                    Some(input) => Error::data(&input.path, told).help(help),
                    None => Error::pipeline(told).help(help),
                }
            }
        })
    }
}
