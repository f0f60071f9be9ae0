//! What a coordinate reference system is, in whatever words a text says it: datum, ellipsoid,
//! projection and its parameters, units, heights. Two texts mean one system if all of it is the
//! same; of a text that leaves something open, nothing is known.
//!
//! In what order a text names its axes plays no part: x of a scan is east, whatever it says.

#[cfg(feature = "proj")]
mod codes;
mod methods;

use std::collections::BTreeMap;
use std::f64::consts::PI;

use super::wkt::tree::{
    GEODETIC, LENGTH, PROJECTED, VERTICAL, WktNode, factor, length_unit, parse, parts,
};
use super::{epsg, wkt};
use methods::{MapProjection, ParameterUnit, SPHERE};

/// Numbers that differ by less than this part of them are one.
const NEAR: f64 = 1e-9;
/// Parameters that differ by more contradict each other, whatever code the texts have.
const FAR: f64 = 1e-6;
/// Radians in a degree.
const DEGREE: f64 = PI / 180.0;

/// What a system is.
#[derive(Debug, Clone, PartialEq)]
pub struct SystemMeaning {
    datum: DatumName,
    /// Half axis in metres, inverse flattening (0 for a sphere), the first meridian in degrees.
    globe: [f64; 3],
    across: Across,
    up: Option<HeightSystem>,
}

/// Something that has a name: its EPSG code where it has one, else what it is called.
#[derive(Debug, Clone, PartialEq, Eq)]
enum DatumName {
    Code(u32),
    Plain(String),
}

/// What x and y are.
#[derive(Debug, Clone, PartialEq)]
enum Across {
    /// Angles, with the radians in their unit.
    Angles(f64),
    /// Three axes from the centre of the Earth, with the metres in their unit.
    Axes(f64),
    /// A plane, with the metres in its unit.
    Plane(MapProjection, f64),
}

/// What z is.
#[derive(Debug, Clone, PartialEq)]
struct HeightSystem {
    /// None: heights above the ellipsoid.
    datum: Option<DatumName>,
    metres: f64,
    is_depth: bool,
}

impl SystemMeaning {
    /// What `text` means: WKT, or `EPSG:code`. None where it leaves something open, is of a kind
    /// that is not known here, or has a code that is another system.
    pub fn of(text: &str) -> Option<SystemMeaning> {
        let said = SystemMeaning::said(text)?;
        let by_code = wkt::is_wkt(text).then(|| SystemMeaning::by_code(text)).flatten();
        by_code.is_none_or(|by_code| !by_code.contradicts(&said)).then_some(said)
    }

    /// The same, whatever code the text has.
    pub fn said(text: &str) -> Option<SystemMeaning> {
        match wkt::is_wkt(text) {
            true => of_trees(&parse(text)?),
            false => SystemMeaning::by_code(text),
        }
    }

    fn by_code(text: &str) -> Option<SystemMeaning> {
        let (across, up) = wkt::codes(text)?;
        of_trees(&parse(&epsg::wkt(across, up)?)?)
    }

    /// True if both are one system.
    pub fn is(&self, other: &SystemMeaning) -> bool {
        self.datum == other.datum && self.up_is(other) && self.is_near(other, NEAR)
    }

    /// True if numbers of both do not agree, whatever they are called.
    pub fn contradicts(&self, other: &SystemMeaning) -> bool {
        let are_of_a_kind = match (&self.across, &other.across) {
            (Across::Plane(one, _), Across::Plane(two, _)) => one.name == two.name,
            (Across::Angles(_), Across::Angles(_)) | (Across::Axes(_), Across::Axes(_)) => true,
            _ => return true,
        };
        are_of_a_kind && !self.is_near(other, FAR)
    }

    fn up_is(&self, other: &SystemMeaning) -> bool {
        match (&self.up, &other.up) {
            (Some(one), Some(two)) => {
                (&one.datum, one.is_depth) == (&two.datum, two.is_depth)
                    && near(one.metres, two.metres, NEAR)
            }
            (one, two) => one.is_none() && two.is_none(),
        }
    }

    fn is_near(&self, other: &SystemMeaning, by: f64) -> bool {
        let is_plane = match (&self.across, &other.across) {
            (Across::Angles(one), Across::Angles(two)) | (Across::Axes(one), Across::Axes(two)) => {
                near(*one, *two, by)
            }
            (Across::Plane(one, metres), Across::Plane(two, other)) => {
                let (mut these, mut those) = (one.values.iter(), two.values.iter());
                let pairs = these.by_ref().zip(those.by_ref());
                one.name == two.name
                    && one.values.len() == two.values.len()
                    && near(*metres, *other, by)
                    && pairs.into_iter().all(|(a, b)| a.0 == b.0 && near(*a.1, *b.1, by))
            }
            _ => false,
        };
        is_plane && self.globe.iter().zip(other.globe).all(|(one, two)| near(*one, two, by))
    }
}

fn near(one: f64, two: f64, by: f64) -> bool {
    (one - two).abs() <= by * one.abs().max(two.abs())
}

fn of_trees(trees: &[WktNode]) -> Option<SystemMeaning> {
    let mut all = parts(trees);
    if let [bound] = all[..]
        && bound.is(&["BOUNDCRS"])
    {
        all = parts(&bound.find(&["SOURCECRS"])?.inner);
    }
    let (ups, acrosses): (Vec<&WktNode>, Vec<&WktNode>) =
        all.into_iter().partition(|node| node.is(&VERTICAL));
    let [across] = acrosses[..] else { return None };
    // Some writers put the vertical system inside the projected one.
    let inside = across.inner.iter().filter(|node| node.is(&VERTICAL));
    let ups: Vec<&WktNode> = ups.into_iter().chain(inside).collect();
    let mut meaning = of_across(across)?;
    match (&ups[..], &meaning.up) {
        ([], _) => {}
        ([up], None) => meaning.up = Some(of_vertical(up, &meaning.datum)?),
        _ => return None,
    }
    Some(meaning)
}

fn of_across(node: &WktNode) -> Option<SystemMeaning> {
    let base = match node.is(&PROJECTED) {
        true => node.find(&["GEOGCS", "BASEGEOGCRS", "BASEGEODCRS"])?,
        false => node,
    };
    let datum = base.find(&["DATUM", "GEODETICDATUM", "TRF", "ENSEMBLE"])?;
    let globe = globe(base, datum)?;
    let datum = datum_name(base, datum)?;
    let angle = angle_unit(base);
    let axes = node.inner.iter().filter(|inner| inner.is(&["AXIS"])).collect::<Vec<_>>();
    let metres = || length_unit(node).and_then(factor);
    let cartesian = node.find(&["CS"]).and_then(|cs| cs.values.first());
    let cartesian = cartesian.is_some_and(|kind| kind.eq_ignore_ascii_case("Cartesian"));
    let across = match () {
        () if node.is(&PROJECTED) => Across::Plane(projection(node, angle?)?, metres()?),
        () if node.is(&["GEOCCS"]) || node.is(&GEODETIC) && cartesian => Across::Axes(metres()?),
        () if node.is(&GEODETIC) => Across::Angles(angle?),
        () => return None,
    };
    let up = match (&across, axes.len()) {
        (Across::Angles(_) | Across::Plane(..), 3) => {
            let unit = axes[2].find(&LENGTH).or_else(|| node.find(&["LENGTHUNIT"]))?;
            Some(HeightSystem { datum: None, metres: factor(unit)?, is_depth: false })
        }
        _ => None,
    };
    Some(SystemMeaning { datum, globe, across, up })
}

/// Ellipsoid and first meridian.
fn globe(base: &WktNode, datum: &WktNode) -> Option<[f64; 3]> {
    let ball = datum.find(&["SPHEROID", "ELLIPSOID"])?;
    let metres = ball.find(&LENGTH).map_or(Some(1.0), factor)?;
    let meridian = match base.find(&["PRIMEM", "PRIMEMERIDIAN"]) {
        None => 0.0,
        Some(meridian) => {
            let unit = meridian.find(&["ANGLEUNIT"]).map_or(Some(DEGREE), |unit| number(unit, 1));
            number(meridian, 1)? * unit? / DEGREE
        }
    };
    Some([number(ball, 1)? * metres, number(ball, 2)?, meridian])
}

fn number(node: &WktNode, at: usize) -> Option<f64> {
    node.values.get(at)?.parse().ok().filter(|value: &f64| value.is_finite())
}

/// Which datum it is: by its name, by its code, by the code of its system. None if these do not
/// agree, and for one without a name.
fn datum_name(base: &WktNode, datum: &WktNode) -> Option<DatumName> {
    let of_base = || epsg::datum_of(base.epsg()?);
    named(datum, epsg::datums, of_base)
}

fn named(
    datum: &WktNode,
    find: impl Fn(&str) -> Vec<u32>,
    beside: impl Fn() -> Option<u32>,
) -> Option<DatumName> {
    let plain = epsg::plain(datum.values.first()?);
    match (&find(&plain)[..], datum.epsg().or_else(beside)) {
        // Some datums share a name.
        (all, Some(code)) if all.is_empty() || all.contains(&code) => Some(DatumName::Code(code)),
        (_, Some(_)) => None,
        ([code], None) => Some(DatumName::Code(*code)),
        // "unknown" and "unnamed", "not specified".
        _ if plain.is_empty() || plain.starts_with("un") || plain.starts_with("not") => None,
        _ => Some(DatumName::Plain(plain)),
    }
}

/// Radians in the unit of angles.
fn angle_unit(base: &WktNode) -> Option<f64> {
    let words = ["UNIT", "ANGLEUNIT"];
    let of_axis = || base.find(&["AXIS"]).and_then(|axis| axis.find(&words));
    let cs = base.find(&words).filter(|_| !base.is(&["GEOCCS"])).or_else(of_axis);
    cs.map_or(Some(DEGREE), |unit| number(unit, 1))
}

/// The projection; `angle` are the radians in a unit of its angles, where they have none.
fn projection(node: &WktNode, angle: f64) -> Option<MapProjection> {
    let conversion = node.find(&["CONVERSION"]);
    let name = match conversion {
        Some(conversion) => conversion.find(&["METHOD", "PROJECTION"])?,
        None => node.find(&["PROJECTION"])?,
    };
    let mut plain = epsg::plain(name.values.first()?);
    match node.find(&["EXTENSION"]).map(|said| said.values.get(1)) {
        None => {}
        Some(Some(text)) if text.contains("+a=6378137 +b=6378137 ") => plain = SPHERE[0].to_owned(),
        Some(_) => return None,
    }
    let metres = length_unit(node).and_then(factor)?;
    let mut values = BTreeMap::new();
    for inner in &conversion.unwrap_or(node).inner {
        if !inner.is(&["PARAMETER"]) {
            continue;
        }
        let called = epsg::plain(inner.values.first()?);
        // ESRI says of Web Mercator that it is on a sphere.
        if called == "auxiliaryspheretype" {
            continue;
        }
        let (known, measure) = methods::parameter(&called)?;
        let own = |words: &[&str], or: f64| inner.find(words).map_or(Some(or), |u| number(u, 1));
        let unit = match measure {
            ParameterUnit::Angle => own(&["ANGLEUNIT", "UNIT"], angle)?,
            ParameterUnit::Length => own(&LENGTH, metres)?,
            ParameterUnit::Factor => own(&["SCALEUNIT", "UNIT"], 1.0)?,
        };
        if values.insert(known, number(inner, 1)? * unit).is_some() {
            return None;
        }
    }
    methods::method(&plain, values)
}

fn of_vertical(node: &WktNode, across: &DatumName) -> Option<HeightSystem> {
    let metres = factor(length_unit(node)?)?;
    let parameter = |wanted: &str| {
        let mut all = node.inner.iter().filter(|inner| inner.is(&["PARAMETER"]));
        let found = all.find(|p| p.values.first().is_some_and(|name| epsg::plain(name) == wanted));
        found.map(|found| number(found, 1))
    };
    // What ESRI says of an axis.
    if !matches!(parameter("verticalshift"), None | Some(Some(0.0))) {
        return None;
    }
    let way = node.find(&["AXIS"]).and_then(|axis| axis.values.get(1));
    let is_depth = match parameter("direction") {
        Some(Some(direction)) => direction < 0.0,
        Some(None) => return None,
        None => way.is_some_and(|way| way.eq_ignore_ascii_case("down")),
    };
    let datum = match node.find(&["VERT_DATUM", "VDATUM", "VERTICALDATUM", "VRF", "ENSEMBLE"]) {
        Some(datum) => Some(named(datum, epsg::heights, || None)?),
        // ESRI says so of heights above an ellipsoid, which must be that of x and y.
        None => {
            let own = named(node.find(&["DATUM"])?, epsg::datums, || None)?;
            (own == *across).then_some(None)?
        }
    };
    Some(HeightSystem { datum, metres, is_depth })
}

#[cfg(test)]
mod tests;
