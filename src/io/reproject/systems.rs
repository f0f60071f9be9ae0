//! From which system to which points are brought, by EPSG codes, and what becomes of heights.
//!
//! Heights above mean sea level differ from one country's to the next by a surface that has to be
//! measured, a grid, and so do those from heights above the ellipsoid: no formula has it. So
//! heights are kept, or change their unit alone, or both systems have them above an ellipsoid.

use proj_core::{AxisOrder, CrsDef, lookup_epsg, registry};

use crate::io::meaning::SystemMeaning;
use crate::io::{epsg, wkt};
use crate::point::{Horizontal, Units};
use crate::quantity::Figure;
use crate::{Error, Result};

/// A system of x and y, and that of heights where it is named.
#[derive(Debug, Clone)]
pub struct PlacedSystem {
    pub code: u32,
    pub up: Option<u32>,
    pub definition: CrsDef,
}

/// What becomes of z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HeightChange {
    /// It is multiplied by this, which is 1 where heights are kept.
    Times(f64),
    /// It changes with x and y: heights above an ellipsoid, or three axes from the centre of the
    /// Earth.
    WithPlace,
}

impl PlacedSystem {
    /// The system that inputs say they are in, by `text`.
    pub fn of_inputs(text: Option<&str>) -> Result<PlacedSystem> {
        let Some(text) = text else {
            let told = "`read.reproject` needs the coordinate reference system of the inputs, and \
                        they name none";
            return Err(Error::pipeline(told).help("`read.crs = \"EPSG:25832\"` says it"));
        };
        let known = wkt::codes(text).or_else(|| by_meaning(text));
        // A unit alone is a system of heights that has no code; it is among the units all the same.
        let known = known.or_else(|| Some((wkt::horizontal_code(text)?, None)));
        let (code, up) = known.ok_or_else(|| {
            let told = "`read.reproject` goes by EPSG codes, and none is known for the \
                        coordinate reference system of the inputs";
            Error::pipeline(told).help("`read.crs = \"EPSG:25832\"` says which it is")
        })?;
        let own = SystemMeaning::said(text).filter(|_| wkt::is_wkt(text));
        let by_code = SystemMeaning::said(&format!("EPSG:{code}"));
        if own.is_some_and(|own| by_code.is_some_and(|by_code| by_code.contradicts(&own))) {
            let told = format!(
                "the coordinate reference system of the inputs has the code EPSG:{code}, and other \
                 numbers than that"
            );
            return Err(Error::pipeline(told).help("`read.crs = \"EPSG:25832\"` says which it is"));
        }
        PlacedSystem::of_codes(code, up)
    }

    /// The system that `text` is by its EPSG codes.
    pub fn of_code(text: &str) -> Result<PlacedSystem> {
        let (code, up) = wkt::codes(text).ok_or_else(|| {
            Error::pipeline(format!("`read.reproject`: `{text}` has no EPSG code"))
                .help("name the system as `EPSG:25832`, or `EPSG:25832+7837` with its heights")
        })?;
        PlacedSystem::of_codes(code, up)
    }

    fn of_codes(code: u32, up: Option<u32>) -> Result<PlacedSystem> {
        let definition = lookup_epsg(code).ok_or_else(|| {
            let told = format!("`read.reproject`: how EPSG:{code} is computed is not known here");
            Error::pipeline(told).help("bring the points to another system by PROJ")
        })?;
        let meaning = SystemMeaning::said(&format!("EPSG:{code}"));
        if definition.is_geographic() && meaning.is_some_and(|meaning| !meaning.is_in_degrees()) {
            let told = format!("`read.reproject`: EPSG:{code} has angles that are no degrees");
            return Err(Error::pipeline(told).help("bring the points to another system by PROJ"));
        }
        Ok(PlacedSystem { code, up, definition })
    }

    /// Its codes as text.
    pub fn text(&self) -> String {
        let up = self.up.map_or(String::new(), |up| format!("+{up}"));
        format!("EPSG:{}{up}", self.code)
    }

    /// The code of its datum.
    pub fn datum(&self) -> Option<u32> {
        registry::lookup_datum_code_for_crs(self.code)
    }

    /// True if both are known to be on one datum.
    pub fn has_datum_of(&self, other: &PlacedSystem) -> bool {
        self.datum().is_some() && self.datum() == other.datum()
    }

    /// Metres in a unit of heights that are not named, as everybody takes it: that of x and y.
    pub fn height_unit(&self, said: Option<f64>) -> f64 {
        said.unwrap_or(if self.definition.is_projected() { self.metres() } else { 1.0 })
    }

    /// True if z is above the ellipsoid, or an axis from the centre of the Earth.
    fn has_place_heights(&self) -> bool {
        self.definition.is_geocentric() || self.definition.vertical_crs().is_some()
    }

    /// True if x and y are degrees; None of axes from the centre of the Earth.
    pub fn is_in_degrees(&self) -> Option<bool> {
        match self.definition.is_geocentric() {
            true => None,
            false => Some(!self.definition.is_projected() && self.metres() == METRES_IN_A_DEGREE),
        }
    }

    /// Metres in a unit of x and y; on the equator for degrees.
    pub fn metres(&self) -> f64 {
        match epsg::horizontal(self.code).horizontal {
            Some(Horizontal::Metres(metres)) => metres,
            _ => METRES_IN_A_DEGREE,
        }
    }
}

/// Metres in a degree of the equator of WGS 84.
const METRES_IN_A_DEGREE: f64 = 111_319.490_793_273_57;

/// The codes of a system that means what `text` means; that of heights must have its own. Of
/// several it is the first that is known and has east before north, as a scan has.
fn by_meaning(text: &str) -> Option<(u32, Option<u32>)> {
    let meaning = SystemMeaning::said(text)?;
    let heights = match meaning.height_code() {
        None => None,
        Some(code) => Some(code?),
    };
    let all: Vec<u32> = meaning.horizontal_codes();
    let known = || all.iter().copied().filter(|code| lookup_epsg(*code).is_some());
    let is_east_first =
        |code: &u32| registry::lookup_authority_axis_order(*code) == Some(AxisOrder::EastNorth);
    let code = known().find(is_east_first).or_else(|| known().next())?;
    Some((code, heights))
}

/// What becomes of the heights of a scan.
#[derive(Debug, Clone)]
pub struct NewHeights {
    pub change: HeightChange,
    /// The EPSG code of those behind, where they have one.
    pub up: Option<u32>,
    /// What is to be told of them.
    pub told: Option<String>,
}

impl HeightChange {
    /// True if heights are those of the inputs.
    pub fn is_none(self) -> bool {
        self == HeightChange::Times(1.0)
    }

    /// What the length of a height is multiplied by; 1 where it depends on the place.
    pub fn factor(self) -> f64 {
        match self {
            HeightChange::Times(factor) => factor.abs(),
            HeightChange::WithPlace => 1.0,
        }
    }
}

/// What becomes of the heights of a scan from one system to another, whose units are `units` as far
/// as they are known.
pub fn heights(from: &PlacedSystem, to: &PlacedSystem, units: &Units) -> Result<NewHeights> {
    let refuse = |told: &str| {
        let pair = format!("from {} to {}", from.text(), to.text());
        Error::pipeline(format!("`read.reproject`: {pair}: {told}"))
    };
    let times = |factor, up| Ok(NewHeights { change: HeightChange::Times(factor), up, told: None });
    let is_coded = from.up.is_some() || to.up.is_some();
    if to.has_place_heights() || from.definition.is_geocentric() {
        return match from.has_place_heights() && !is_coded {
            true => with_place(from, to, units).map_err(|told| refuse(&told).help(NAME_HEIGHTS)),
            false if is_coded => Err(refuse(NEEDS_GEOID).help(KEEP)),
            false => Err(refuse(
                "heights above the ellipsoid are needed, and those of the inputs are not named",
            )
            .help(
                "`read.crs` may name a system with such heights, as `EPSG:4979`; or reproject to \
                 a system without",
            )),
        };
    }
    match (from.up, to.up) {
        (Some(one), Some(two)) => {
            let factor =
                if one == two { Some(1.0) } else { SystemMeaning::height_factor(one, two) };
            times(factor.ok_or_else(|| refuse(NEEDS_GEOID).help(KEEP))?, Some(two))
        }
        (None, Some(_)) if from.has_place_heights() => Err(refuse(NEEDS_GEOID).help(KEEP)),
        (None, Some(_)) => Err(refuse("the inputs do not say which heights they have")
            .help("`read.crs` says it, as `EPSG:25832+7837`; or reproject x and y alone")),
        (Some(up), None) => times(1.0, Some(up)),
        (None, None) if from.has_place_heights() => {
            with_place(from, to, units).map_err(|told| refuse(&told).help(NAME_HEIGHTS))
        }
        (None, None) if from.height_unit(units.vertical) == to.height_unit(None) => {
            times(1.0, None)
        }
        (None, None) => Err(refuse(&other_unit(from, to, units)).help(format!(
            "`read.crs` says which heights the inputs have: `EPSG:{}+6360` are heights in US \
             survey feet, `EPSG:{}+5703` in metres, both of NAVD88",
            from.code, from.code
        ))),
    }
}

/// What is wrong where heights would be taken to be in another unit than they are.
fn other_unit(from: &PlacedSystem, to: &PlacedSystem, units: &Units) -> String {
    let [own, taken] = [from.height_unit(units.vertical), to.height_unit(None)];
    format!(
        "the unit of heights is {} m, and nothing would say afterwards that it is not {} m",
        Figure(own),
        Figure(taken)
    )
}

/// Heights above an ellipsoid, of which the system behind may say nothing; what is wrong if it
/// would have them in another unit.
fn with_place(
    from: &PlacedSystem,
    to: &PlacedSystem,
    units: &Units,
) -> std::result::Result<NewHeights, String> {
    if !to.has_place_heights() && from.height_unit(units.vertical) != to.height_unit(None) {
        return Err(other_unit(from, to, units));
    }
    let change = match to.has_place_heights() {
        true => HeightChange::WithPlace,
        false if from.definition.is_geocentric() => HeightChange::WithPlace,
        false => HeightChange::Times(1.0),
    };
    let told = (!to.has_place_heights())
        .then(|| format!("heights are above the ellipsoid, which EPSG:{} does not say", to.code));
    Ok(NewHeights { change, up: None, told })
}

const NAME_HEIGHTS: &str = "reproject to a system in metres, or in degrees";
const NEEDS_GEOID: &str = "heights of the two differ by a grid that pointmill does not have";
const KEEP: &str = "name no heights for the output, which keeps those of the inputs";
