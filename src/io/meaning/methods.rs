//! Projections and their parameters by the names that they have in WKT 1, in WKT 2 (those of EPSG),
//! and in WKT of ESRI, each brought to one.

use std::collections::BTreeMap;

/// What a parameter is measured in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterUnit {
    /// Angles.
    Angle,
    /// Lengths.
    Length,
    /// Factors.
    Factor,
}

/// Names of one method each, plain (see [`plain`](crate::io::epsg::plain)); the first is that which
/// stands for all. Names that mean several are settled by [`method`].
const METHODS: [&[&str]; 13] = [
    &["transversemercator", "gausskruger"],
    &["transversemercatorsouthorientated", "transversemercatorsouthoriented"],
    &["lambertconicconformal2sp", "lambertconformalconic2sp"],
    &["lambertconicconformal1sp", "lambertconformalconic1sp"],
    &["albersequalarea", "albersconicequalarea", "albers"],
    &["lambertazimuthalequalarea"],
    &["obliquestereographic", "doublestereographic"],
    &[
        "hotineobliquemercatorvarianta",
        "hotineobliquemercator",
        "hotineobliquemercatorazimuthnaturalorigin",
        "rectifiedskeworthomorphicnaturalorigin",
    ],
    &[
        "hotineobliquemercatorvariantb",
        "hotineobliquemercatorazimuthcenter",
        "rectifiedskeworthomorphiccenter",
    ],
    &["mercatorvarianta", "mercator1sp"],
    &["mercatorvariantb", "mercator2sp", "mercator"],
    &["cassinisoldner", "cassini"],
    &["americanpolyconic", "polyconic"],
];

/// The method of Web Mercator, and the name that ESRI gives it.
pub const SPHERE: [&str; 2] = ["popularvisualisationpseudomercator", "mercatorauxiliarysphere"];

/// Names of one parameter each, plain; the first stands for all.
const PARAMETERS: [(ParameterUnit, &[&str]); 10] = [
    (
        ParameterUnit::Angle,
        &[
            "latitudeoforigin",
            "latitudeofcenter",
            "latitudeofnaturalorigin",
            "latitudeoffalseorigin",
            "latitudeofprojectioncentre",
            "centralparallel",
        ],
    ),
    (
        ParameterUnit::Angle,
        &[
            "centralmeridian",
            "longitudeoforigin",
            "longitudeofcenter",
            "longitudeofnaturalorigin",
            "longitudeoffalseorigin",
            "longitudeofprojectioncentre",
        ],
    ),
    (
        ParameterUnit::Angle,
        &["standardparallel1", "latitudeof1ststandardparallel", "latitudeofstandardparallel"],
    ),
    (ParameterUnit::Angle, &["standardparallel2", "latitudeof2ndstandardparallel"]),
    (
        ParameterUnit::Angle,
        &["azimuth", "azimuthofinitialline", "azimuthatprojectioncentre", "colatitudeofconeaxis"],
    ),
    (
        ParameterUnit::Angle,
        &["rectifiedgridangle", "anglefromrectifiedtoskewgrid", "xyplanerotation"],
    ),
    (ParameterUnit::Angle, &["pseudostandardparallel1", "latitudeofpseudostandardparallel"]),
    (
        ParameterUnit::Factor,
        &[
            "scalefactor",
            "scalefactoratnaturalorigin",
            "scalefactoratprojectioncentre",
            "scalefactoroninitialline",
            "scalefactoronpseudostandardparallel",
        ],
    ),
    (ParameterUnit::Length, &["falseeasting", "eastingatfalseorigin", "eastingatprojectioncentre"]),
    (
        ParameterUnit::Length,
        &["falsenorthing", "northingatfalseorigin", "northingatprojectioncentre"],
    ),
];

const LATITUDE: &str = PARAMETERS[0].1[0];
const LONGITUDE: &str = PARAMETERS[1].1[0];
const PARALLEL: &str = PARAMETERS[2].1[0];
const SECOND: &str = PARAMETERS[3].1[0];
const AZIMUTH: &str = PARAMETERS[4].1[0];
const GRID_ANGLE: &str = PARAMETERS[5].1[0];
const FACTOR: &str = PARAMETERS[7].1[0];

/// The one name of a parameter, and what it is measured in; None for one that is not known.
pub fn parameter(plain: &str) -> Option<(&'static str, ParameterUnit)> {
    let found = PARAMETERS.iter().find(|(_, names)| names.contains(&plain));
    found.map(|(measure, names)| (names[0], *measure))
}

/// The one name of a method, with its parameters by their names, in radians and metres: those that
/// change nothing (a factor of 1, a shift of 0) are left out.
///
/// None if the parameters do not say where the projection is.
pub fn method(plain: &str, mut values: BTreeMap<&'static str, f64>) -> Option<MapProjection> {
    let is_esri_cone = plain == "lambertconformalconic";
    let plain = match plain {
        // ESRI has one word for both.
        "lambertconformalconic" if values.contains_key(SECOND) => "lambertconformalconic2sp",
        "lambertconformalconic" => "lambertconformalconic1sp",
        // One word for a pole with a factor and for a parallel of true scale.
        "polarstereographic" | "stereographicnorthpole" | "stereographicsouthpole" => {
            return polar(values);
        }
        "polarstereographicvarianta" | "polarstereographicvariantb" => return polar(values),
        // One name for axes to the south and west, and to the east and north.
        krovak if krovak.starts_with("krovak") => return None,
        other => other,
    };
    let name = METHODS.iter().find(|names| names.contains(&plain)).map(|names| names[0]);
    if name == Some("lambertconicconformal1sp") && is_esri_cone {
        let parallel = values.remove(PARALLEL);
        if parallel.is_none() || parallel != values.get(LATITUDE).copied() {
            return None;
        }
    }
    if SPHERE.contains(&plain) {
        values.retain(|_, value| *value != 0.0);
        values.remove(FACTOR);
        return Some(MapProjection { name: SPHERE[0].to_owned(), values });
    }
    if !values.contains_key(LONGITUDE) {
        return None;
    }
    if name.is_some_and(|name| name.starts_with("hotine")) {
        // ESRI leaves out the second angle where it is the first, and has both from -180 degrees.
        let azimuth = around(*values.get(AZIMUTH)?);
        let grid = values.get(GRID_ANGLE).map_or(azimuth, |angle| around(*angle));
        values.extend([(AZIMUTH, azimuth), (GRID_ANGLE, grid)]);
    }
    settle(&mut values);
    Some(MapProjection { name: name.unwrap_or(plain).to_owned(), values })
}

/// An angle as one from 0 up to a whole turn.
fn around(angle: f64) -> f64 {
    angle.rem_euclid(std::f64::consts::TAU)
}

/// A stereographic projection of a pole: by the parallel of true scale, or the factor at the pole.
fn polar(mut values: BTreeMap<&'static str, f64>) -> Option<MapProjection> {
    let pole = std::f64::consts::FRAC_PI_2;
    let at_pole = |angle: &f64| (angle.abs() - pole).abs() < 1e-9;
    let latitude = values.remove(PARALLEL).or_else(|| values.remove(LATITUDE))?;
    values.remove(LATITUDE);
    values.get(LONGITUDE)?;
    settle(&mut values);
    values.insert(PARALLEL, latitude);
    let is_true_elsewhere = !at_pole(&latitude);
    // A factor beside a parallel where the scale is true: nobody knows which holds.
    if is_true_elsewhere && values.contains_key(FACTOR) {
        return None;
    }
    Some(MapProjection { name: "polarstereographic".to_owned(), values })
}

fn settle(values: &mut BTreeMap<&'static str, f64>) {
    values.retain(|name, value| *value != if *name == FACTOR { 1.0 } else { 0.0 });
}

/// A projection with its parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct MapProjection {
    /// The one name of it.
    pub name: String,
    /// Parameters by their one name, in radians, metres and as factors.
    pub values: BTreeMap<&'static str, f64>,
}
