//! The operation by which points come from one system to another, as EPSG has it, and what it is
//! good for.
//!
//! Between two datums there often are many: some for a country, some for one of its states, the
//! best of them by grids of measured differences that have to be there. The one that is taken is
//! meant for all of the place where the scan is, and of those the most accurate that can be
//! computed. None is taken where none is known: two datums are never treated as one.

use proj_core::{
    AreaOfInterest, Bounds, Coord, Coord3D, CoordinateOperationMetadata, CrsDef, SelectionOptions,
    SkippedOperationReason, Transform, lookup_epsg,
    operation_candidates_between_with_selection_options,
};

use super::systems::{HeightChange, PlacedSystem};
use crate::quantity::Figure;
use crate::report::Reprojection;
use crate::{Error, Result};

/// How points come from one system to another.
#[derive(Debug, Clone)]
pub struct PointTransform {
    transform: Transform,
    heights: HeightChange,
    /// Metres in a unit of the heights of the inputs.
    height_metres: f64,
}

impl PointTransform {
    /// From one system to another, of points in the box that `corners` gives in the first, whose
    /// heights are in such a unit.
    ///
    /// # Errors
    ///
    /// Systems between whose datums no operation is known for that place, or none but by a grid
    /// that is not there.
    pub fn between(
        from: &PlacedSystem,
        to: &PlacedSystem,
        (heights, height_metres): (HeightChange, f64),
        corners: Option<[[f64; 3]; 2]>,
    ) -> Result<(PointTransform, Reprojection)> {
        let names = [from.text(), to.text()];
        let refuse = |why: String| {
            let told = format!("`read.reproject`: from {} to {}: {why}", names[0], names[1]);
            Error::pipeline(told)
        };
        // Where there are no points, any operation will do.
        let place = corners.filter(|_| !from.has_datum_of(to));
        let place = place.map(|corners| area(&from.definition, corners)).transpose();
        let place = place.map_err(|why| refuse(why).help(MISPLACED))?;
        let pair = [&from.definition, &to.definition];
        let transform = match place {
            None => made(pair, heights, SelectionOptions::new()),
            Some(place) => chosen(pair, heights, place),
        };
        let transform = transform.map_err(|error| refused(&error, &refuse))?;
        let operation = transform.selected_operation();
        let is_known = !is_none(operation) && !operation.approximate && !operation.uses_grids;
        if place.is_some() && !is_known {
            let told = "no operation between their datums is known here that needs no grid";
            return Err(refuse(told.to_owned()).help(BY_PROJ));
        }
        let is_told = place.is_some();
        let told = Reprojection {
            from: names[0].clone(),
            to: names[1].clone(),
            operation: is_told.then(|| operation.name.clone()),
            code: operation.id.map(|id| id.0).filter(|_| is_told),
            accuracy: operation.accuracy.map(|accuracy| accuracy.meters),
            better: better(&transform).filter(|_| is_told),
        };
        Ok((PointTransform { transform, heights, height_metres }, told))
    }

    /// A point in the system behind; why there is none.
    pub fn apply(&self, [x, y, z]: [f64; 3]) -> std::result::Result<[f64; 3], String> {
        let failed = |error: proj_core::Error| error.to_string();
        let HeightChange::Times(factor) = self.heights else {
            let found = self.transform.convert_3d(Coord3D::new(x, y, z)).map_err(failed)?;
            return Ok([found.x, found.y, found.z]);
        };
        // From one ellipsoid to another, x and y depend on the height a little: a kilometre of it
        // makes some centimetres.
        let place = Coord3D::new(x, y, z * self.height_metres);
        let found = self.transform.convert_3d(place).map_err(failed)?;
        Ok([found.x, found.y, if factor == 1.0 { z } else { z * factor }])
    }

    /// What becomes of heights.
    pub fn heights(&self) -> HeightChange {
        self.heights
    }
}

/// The transform between two systems that `options` choose.
fn made(
    [one, two]: [&CrsDef; 2],
    heights: HeightChange,
    options: SelectionOptions,
) -> proj_core::Result<Transform> {
    match heights {
        HeightChange::WithPlace => {
            Transform::from_crs_defs_with_selection_options(one, two, options)
        }
        HeightChange::Times(_) => {
            Transform::from_horizontal_components_with_selection_options(one, two, options)
        }
    }
}

/// The transform by the best operation that is meant for all of a place: from one datum to the
/// other, or by way of WGS 84 where none is known between the two, by grids or not.
fn chosen(
    pair: [&CrsDef; 2],
    heights: HeightChange,
    place: AreaOfInterest,
) -> proj_core::Result<Transform> {
    let options = SelectionOptions::new().with_area_of_interest(place).require_exact_area_match();
    let transform = match made(pair, heights, options.clone()) {
        Err(error) if error.to_string().contains(NO_OPERATION) => {
            made(pair, heights, options.clone().with_wgs84_pivot())?
        }
        made => made?,
    };
    if !is_none(transform.selected_operation()) {
        return Ok(transform);
    }
    // Datums that differ by less than the crate minds: whatever operation there is says how much.
    let base = |system: &CrsDef| lookup_epsg(system.base_geographic_crs_epsg()?);
    let (Some(one), Some(two)) = (base(pair[0]), base(pair[1])) else { return Ok(transform) };
    let all = operation_candidates_between_with_selection_options(&one, &two, &options)?;
    let known = all.iter().filter(|known| !known.uses_grids && !known.approximate);
    match known.filter_map(|known| known.id).next() {
        Some(id) => made(pair, heights, options.with_operation(id)),
        None => Ok(transform),
    }
}

/// True if nothing is done to come from one datum to the other.
fn is_none(operation: &CoordinateOperationMetadata) -> bool {
    operation.id.is_none() && operation.name == "Identity"
}

const MISPLACED: &str = "see whether `read.crs` has to say which system the inputs are in; if the \
                         box in a header is wrong, `convert` the file first";
const BY_PROJ: &str = "reproject with a program that uses PROJ and its grids, such as PDAL";

/// Where the scan is, as operations are chosen by it: in degrees of its own datum.
fn area(from: &CrsDef, [lo, hi]: [[f64; 3]; 2]) -> std::result::Result<AreaOfInterest, String> {
    let failed = |error: proj_core::Error| error.to_string();
    let known = |code: u32| lookup_epsg(code).ok_or(format!("EPSG:{code} is not known"));
    if from.is_geocentric() {
        // Of a box around axes from the centre of the Earth, the middle says where it is.
        let there = Transform::from_crs_defs(&known(GEOCENTRIC)?, &known(GEOGRAPHIC_3D)?);
        let [x, y, z] = std::array::from_fn(|axis| f64::midpoint(lo[axis], hi[axis]));
        let place = there.map_err(failed)?.convert_3d(Coord3D::new(x, y, z)).map_err(failed)?;
        return Ok(AreaOfInterest::geographic_point(Coord::new(place.x, place.y)));
    }
    let bounds = Bounds::new(lo[0], lo[1], hi[0], hi[1]);
    let degrees = known(from.base_geographic_crs_epsg().unwrap_or(0))?;
    let there = Transform::from_horizontal_components(from, &degrees).map_err(failed)?;
    let bounds = there.transform_bounds(bounds, ALONG).map_err(failed)?;
    Ok(AreaOfInterest::geographic_bounds(bounds))
}

/// Points along an edge of the box of a scan that are looked at for where it is.
const ALONG: usize = 21;

/// WGS 84 by axes from the centre of the Earth, and by degrees and heights.
const GEOCENTRIC: u32 = 4978;
const GEOGRAPHIC_3D: u32 = 4979;

/// What hinders an operation between two systems, in words of ours.
fn refused(error: &proj_core::Error, refuse: &dyn Fn(String) -> Error) -> Error {
    let text = error.to_string();
    match text.split_once(GRID) {
        Some((_, grid)) => {
            let told = format!("it takes the grid {grid}, which pointmill does not have");
            refuse(told).help(BY_PROJ)
        }
        None if text.contains(NO_OPERATION) => {
            let told = "no operation between their datums is known for where the scan is";
            refuse(told.to_owned()).help(MISPLACED)
        }
        None => refuse(text).help(BY_PROJ),
    }
}

/// What errors have where there is no operation.
const NO_OPERATION: &str = "no compatible registry operation";
/// What stands before the name of a grid that is not there.
const GRID: &str = "grid resource unavailable: ";

/// The most accurate operation that would have been taken if its grid were there.
fn better(transform: &Transform) -> Option<String> {
    let own = transform.selected_operation().accuracy.map_or(f64::MAX, |own| own.meters);
    let skipped = transform.selection_diagnostics().skipped_operations.iter();
    let by_grid = skipped.filter(|skipped| skipped.reason == SkippedOperationReason::MissingGrid);
    let told = by_grid.filter_map(|skipped| {
        let accuracy = skipped.metadata.accuracy?.meters;
        let grid = skipped.detail.split_once(GRID)?.1;
        (accuracy < own).then_some((accuracy, grid))
    });
    let (accuracy, grid) = told.min_by(|one, two| one.0.total_cmp(&two.0))?;
    Some(format!("{} m by the grid {grid}", Figure(accuracy)))
}
