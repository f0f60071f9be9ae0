//! Polygons as people write them: WKT, and GeoJSON as a geometry, a feature or a collection.

use geojson::{Feature, GeoJson, Geometry, GeometryValue};
use wkt::Wkt;

use crate::geom::polygon::{PolygonCorner, PolygonRings};

/// The polygons of a text.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct AreaOutline {
    pub polygons: Vec<PolygonRings>,
    /// True if they are of GeoJSON, whose coordinates are degrees by its standard (RFC 7946, 4).
    pub is_geojson: bool,
}

/// What an area may be, for one that is not.
const KINDS: &str = "an area is a POLYGON or a MULTIPOLYGON";
/// The kind of WKT that holds others, to any depth.
const NESTED: &str = "GEOMETRYCOLLECTION";

impl AreaOutline {
    /// Reads the polygons of a text.
    ///
    /// # Errors
    ///
    /// What is wrong with it, as half a sentence.
    pub fn read(text: &str) -> Result<AreaOutline, String> {
        let text = text.trim_start_matches('\u{feff}').trim();
        let is_geojson = text.starts_with('{');
        let polygons = if is_geojson { of_geojson(text)? } else { of_wkt(text)? };
        let polygons: Vec<PolygonRings> =
            polygons.into_iter().map(closed).collect::<Result<_, _>>()?;
        match polygons.iter().all(Vec::is_empty) {
            true => Err("it holds no polygon, so that nothing would be inside".to_owned()),
            false => Ok(AreaOutline { polygons, is_geojson }),
        }
    }
}

/// Rings without the last corner that says the first again; refused where they go around nothing.
fn closed(rings: PolygonRings) -> Result<PolygonRings, String> {
    let check = |mut ring: Vec<PolygonCorner>| {
        if let Some([x, y]) = ring.iter().find(|corner| !corner.iter().all(|v| v.is_finite())) {
            return Err(format!("the corner ({x}, {y}) is not finite"));
        }
        ring.dedup();
        if ring.len() > 1 && ring.first() == ring.last() {
            ring.pop();
        }
        match ring.len() {
            0..3 => Err(format!("a ring has {} different corners, and needs 3", ring.len())),
            _ => Ok(ring),
        }
    };
    rings.into_iter().filter(|ring| !ring.is_empty()).map(check).collect()
}

fn of_wkt(text: &str) -> Result<Vec<PolygonRings>, String> {
    // The parser calls itself for each that is in another.
    if text.to_ascii_uppercase().contains(NESTED) {
        return Err(format!("a {NESTED} is not read: {KINDS}"));
    }
    let (mut polygons, mut rest) = (Vec::new(), text);
    while !rest.is_empty() || text.is_empty() && polygons.is_empty() {
        let (one, more) = rest.split_at(end_of_geometry(rest));
        polygons.extend(of_geometry(one)?);
        // One on each line, as programs write them.
        rest = more.trim_start_matches([';', ',']).trim();
    }
    Ok(polygons)
}

/// The byte behind the first geometry of a text: behind its last parenthesis.
fn end_of_geometry(text: &str) -> usize {
    let mut open = 0u64;
    for (at, c) in text.char_indices() {
        match c {
            '(' => open += 1,
            ')' if open == 1 => return at + 1,
            ')' => open = open.saturating_sub(1),
            _ => {}
        }
    }
    text.len()
}

fn of_geometry(text: &str) -> Result<Vec<PolygonRings>, String> {
    let read: Wkt<f64> = text.parse().map_err(|why| {
        let begin: String = text.chars().take(40).collect();
        format!("this is no WKT ({why}): `{begin}`; {KINDS}")
    })?;
    let rings = |polygon: &wkt::types::Polygon<f64>| -> PolygonRings {
        let ring = |ring: &wkt::types::LineString<f64>| {
            ring.coords().iter().map(|corner| [corner.x, corner.y]).collect()
        };
        polygon.rings().iter().map(ring).collect()
    };
    let kind = match read {
        Wkt::Polygon(polygon) => return Ok(vec![rings(&polygon)]),
        Wkt::MultiPolygon(all) => return Ok(all.polygons().iter().map(rings).collect()),
        Wkt::Point(_) => "POINT",
        Wkt::LineString(_) => "LINESTRING",
        Wkt::MultiPoint(_) => "MULTIPOINT",
        Wkt::MultiLineString(_) => "MULTILINESTRING",
        Wkt::GeometryCollection(_) => NESTED,
    };
    Err(format!("it is a {kind}, and {KINDS}"))
}

fn of_geojson(text: &str) -> Result<Vec<PolygonRings>, String> {
    let read: GeoJson = text.parse().map_err(|why| format!("this is no GeoJSON ({why})"))?;
    let mut polygons = Vec::new();
    let of_feature = |feature: &Feature, polygons: &mut Vec<PolygonRings>| match &feature.geometry {
        Some(geometry) => add(geometry, polygons),
        None => Ok(()),
    };
    match &read {
        GeoJson::Geometry(geometry) => add(geometry, &mut polygons)?,
        GeoJson::Feature(feature) => of_feature(feature, &mut polygons)?,
        GeoJson::FeatureCollection(all) => {
            all.features.iter().try_for_each(|feature| of_feature(feature, &mut polygons))?;
        }
    }
    Ok(polygons)
}

fn add(geometry: &Geometry, polygons: &mut Vec<PolygonRings>) -> Result<(), String> {
    let rings = |rings: &Vec<Vec<geojson::Position>>| -> Result<PolygonRings, String> {
        let corner = |position: &geojson::Position| match position.as_slice() {
            [x, y, ..] => Ok([*x, *y]),
            _ => Err("a position has fewer than 2 coordinates".to_owned()),
        };
        rings.iter().map(|ring| ring.iter().map(corner).collect()).collect()
    };
    match &geometry.value {
        GeometryValue::Polygon { coordinates } => polygons.push(rings(coordinates)?),
        GeometryValue::MultiPolygon { coordinates } => {
            for polygon in coordinates {
                polygons.push(rings(polygon)?);
            }
        }
        GeometryValue::GeometryCollection { geometries } => {
            geometries.iter().try_for_each(|geometry| add(geometry, polygons))?;
        }
        other => {
            let kind = other.type_name();
            return Err(format!("it has a {kind}, and an area is a Polygon or a MultiPolygon"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: &str = "[[[0, 0], [4, 0, 7.5], [0, 4], [0, 0]]]";

    #[test]
    fn one_area_is_read_from_all_that_hold_it() {
        let expected = vec![vec![vec![[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]]]];
        let polygon = format!("{{\"type\": \"Polygon\", \"coordinates\": {TRIANGLE}}}");
        let feature =
            format!("{{\"type\": \"Feature\", \"properties\": null, \"geometry\": {polygon}}}");
        for text in [
            "POLYGON((0 0, 4 0, 0 4, 0 0))".to_owned(),
            "  polygon ((0 0, 4 0, 0 4))\n".to_owned(),
            "POLYGON Z ((0 0 1, 4 0 2, 4 0 2, 0 4 3, 0 0 1))".to_owned(),
            "MULTIPOLYGON(((0 0, 4 0, 0 4, 0 0)))".to_owned(),
            format!("{{\"type\": \"MultiPolygon\", \"coordinates\": [{TRIANGLE}]}}"),
            format!("{{\"type\": \"GeometryCollection\", \"geometries\": [{polygon}]}}"),
            format!("{{\"type\": \"FeatureCollection\", \"features\": [{feature}]}}"),
            feature,
            polygon,
        ] {
            let read = AreaOutline::read(&text).unwrap_or_else(|told| panic!("{text}: {told}"));
            assert_eq!(read.polygons, expected, "{text}");
            assert_eq!(read.is_geojson, text.starts_with('{'));
        }
        // Several, as programs write one on each line.
        let two = "POLYGON((0 0, 4 0, 0 4))\nPOLYGON((9 9, 8 9, 9 8));\n";
        assert_eq!(AreaOutline::read(two).unwrap().polygons.len(), 2);
        let holed = AreaOutline::read("POLYGON((0 0,9 0,9 9,0 9),(1 1,2 1,2 2))").unwrap();
        assert_eq!(holed.polygons[0].iter().map(Vec::len).collect::<Vec<_>>(), [4, 3]);
    }

    #[test]
    fn what_is_no_area_is_told() {
        let deep = NESTED.to_owned() + &"(GEOMETRYCOLLECTION".repeat(100_000);
        let nested = "{\"type\":\"GeometryCollection\",\"geometries\":[".repeat(10_000);
        for (text, told) in [
            ("", "this is no WKT"),
            ("POLYGON((0 0, 4 0", "this is no WKT"),
            ("POLYGON((0 0, 4 0, 0 4)) this is nonsense", "no WKT (Invalid type"),
            ("POLYGON((0 0, 4 0, 0 4))/EPSG:4326", "`/EPSG:4326`"),
            ("POLYGON((0 0, 4 0, 0 4)))", "this is no WKT"),
            ("POLYGON EMPTY", "it holds no polygon"),
            ("MULTIPOLYGON EMPTY", "it holds no polygon"),
            ("POINT(1 2)", "it is a POINT"),
            ("LINESTRING(1 2, 3 4)", "it is a LINESTRING"),
            ("POLYGON((0 0, 4 0, 0 0))", "a ring has 2 different corners"),
            ("POLYGON((0 0, 4 0, 1e999 4))", "is not finite"),
            ("POLYGON((0 0, 4 0, nan 4))", ""),
            (&deep, "GEOMETRYCOLLECTION is not read"),
            (&nested, "this is no GeoJSON"),
            ("{}", "this is no GeoJSON"),
            ("{\"type\": \"Point\", \"coordinates\": [1, 2]}", "it has a Point"),
            ("{\"type\": \"Polygon\", \"coordinates\": [[[1], [2], [3]]]}", ""),
            ("{\"type\": \"FeatureCollection\", \"features\": []}", "it holds no polygon"),
        ] {
            let error = AreaOutline::read(text).unwrap_err();
            assert!(error.contains(told), "{text:.60}: {error}");
        }
    }
}
