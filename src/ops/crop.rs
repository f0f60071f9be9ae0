//! The stage `crop`: what is inside of a box or of polygons stays, or what is outside.

mod outline;
mod shape;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geom::polygon::Area;
use crate::point::{PointBatch, Schema, names};
use crate::report::Tally;
use crate::stage::{Needs, Role, RoleName, StageKind, StagePlace, Transform, Unread};
use crate::{Error, Result};

pub use crate::quantity::CropBox;

use outline::AreaOutline;
use shape::{AreaShape, Fitted};

/// Bytes of a file of polygons: a corner takes 20 to 40 of them, so these are millions of corners.
const MOST_BYTES: u64 = 64 << 20;

/// Cuts an area out of a scan, or cuts it away; give exactly one of `box`, `polygon` and `file`.
///
/// A box is `[x0, y0, x1, y1]`, or `[x0, y0, z0, x1, y1, z1]` where heights count, too. Polygons
/// come as text in `polygon` or from a `file`: WKT (`POLYGON` or `MULTIPOLYGON`), or GeoJSON (a
/// geometry, a feature or a collection of them). They are in x and y, whatever the height; what an
/// odd number of rings of a polygon goes around is inside of it, so holes are outside; a point in
/// one of several polygons is inside. Rings that are not closed are.
///
/// Coordinates are in the unit and the reference system of the scan: nothing is projected. By its
/// standard GeoJSON is in degrees of WGS 84, so a file of such must be brought into the system of
/// the scan first (`ogr2ogr -t_srs`).
///
/// Borders belong to the inside, exactly. Where records store coordinates as whole steps, the
/// corners are brought to these steps; one that is nearer to a step than a thousandth of it is on
/// it, since decimals are seldom exact in binary. Points whose coordinates are no numbers are not
/// inside.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Crop {
    /// Corners of a box: the smallest x and y, then the largest; or x, y and z.
    #[serde(rename = "box")]
    pub bounds: Option<CropBox>,
    /// Polygons as text: WKT or GeoJSON.
    pub polygon: Option<String>,
    /// A file of such a text.
    pub file: Option<PathBuf>,
    /// What stays.
    pub keep: CropSide,
}

/// What stays of a scan that is cropped.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum CropSide {
    /// What is inside, the border included.
    #[default]
    Inside,
    /// All else.
    Outside,
}

/// The stage with its area.
struct Cropping {
    /// The key that gives the area.
    key: &'static str,
    shape: AreaShape,
    keep: CropSide,
    /// The file that it is from.
    file: Option<PathBuf>,
    /// True if the area is of GeoJSON.
    is_geojson: bool,
    /// The area in the steps of the records, once they are known.
    fitted: OnceLock<Fitted>,
}

impl Crop {
    /// The stage with its area, or the key to blame and why.
    fn cropping(self) -> Result<Cropping, (&'static str, Error)> {
        let Crop { bounds, polygon, file, keep } = self;
        let (key, text) = match (bounds, polygon, &file) {
            (Some(bounds), None, None) => {
                let shape = AreaShape::Box(bounds);
                let fitted = OnceLock::new();
                let (key, is_geojson) = ("box", false);
                return Ok(Cropping { key, shape, keep, file, is_geojson, fitted });
            }
            (None, Some(text), None) => ("polygon", text),
            (None, None, Some(path)) => ("file", read(path).map_err(|error| ("file", error))?),
            (bounds, polygon, file) => {
                let keys = [
                    ("box", bounds.is_some()),
                    ("polygon", polygon.is_some()),
                    ("file", file.is_some()),
                ];
                let given: Vec<&str> =
                    keys.iter().filter(|(_, is_given)| *is_given).map(|(key, _)| *key).collect();
                let told = match given.len() {
                    0 => "`crop` does not say which area".to_owned(),
                    _ => format!("`crop` takes one of its areas, not {}", given.join(" and ")),
                };
                let help = "give one of `crop.box = [0, 0, 100, 100]`, `crop.polygon = \
                            \"POLYGON((0 0, 100 0, 0 100))\"` and `crop.file = \"area.geojson\"`";
                let key = given.last().copied().unwrap_or("box");
                return Err((key, Error::pipeline(told).help(help)));
            }
        };
        let outline = AreaOutline::read(&text).map_err(|told| {
            let error = match &file {
                Some(file) => Error::data(file, told),
                None => Error::pipeline(format!("`crop.{key}`: {told}")).help(EXAMPLE),
            };
            (key, error)
        })?;
        let AreaOutline { polygons, is_geojson } = outline;
        Ok(Cropping {
            key,
            shape: AreaShape::Polygons(polygons),
            keep,
            file,
            is_geojson,
            fitted: OnceLock::new(),
        })
    }
}

const EXAMPLE: &str = "for example `crop.polygon = \"POLYGON((0 0, 100 0, 0 100))\"`";

fn read(path: &Path) -> Result<String> {
    let failed = |cause| Error::io(path, "read it", cause);
    let bytes = fs::metadata(path).map_err(failed)?.len();
    if bytes > MOST_BYTES {
        let told = format!("an area of {bytes} bytes is more than is read, {MOST_BYTES}");
        return Err(Error::data(path, told).help("simplify its polygons first"));
    }
    let bytes = fs::read(path).map_err(failed)?;
    String::from_utf8(bytes)
        .map_err(|_| Error::data(path, "it is no text").help("a file of an area is WKT or GeoJSON"))
}

impl StageKind for Crop {
    const KIND: &'static str = "crop";
    const ABOUT: &'static str = "Keeps what is inside of a box or of polygons, or what is outside.";
    const ROLE: RoleName = RoleName::Transform;
    const EITHER: &'static [&'static str] = &["box", "polygon", "file"];
    const MAIN: Option<&'static str> = Some("file");
    const PLACES: &'static [&'static str] = &["file"];

    fn build(self, at: &StagePlace) -> Result<Role> {
        // An area in a file that is not there yet.
        if at.is_unread() && self.file.as_ref().is_some_and(|file| !file.exists()) {
            return Ok(Role::Transform(Box::new(Unread::default())));
        }
        let cropping = self.cropping().map_err(|(key, error)| at.blame(key, error))?;
        Ok(Role::Transform(Box::new(cropping)))
    }
}

impl Cropping {
    /// The area in words.
    fn extent(&self) -> String {
        let [lo, hi] = self.shape.bounds();
        format!("x from {} to {}, y from {} to {}", lo[0], hi[0], lo[1], hi[1])
    }

    /// What to say of GeoJSON where an area may be in another system than the scan.
    fn doubt(&self) -> &'static str {
        match self.is_geojson {
            true => {
                "; by its standard GeoJSON is in degrees of WGS 84: bring it into the system \
                     of the scan"
            }
            false => "",
        }
    }
}

impl Transform for Cropping {
    fn needs(&self) -> Needs {
        let axes = if self.shape.has_heights() { &names::XYZ[..] } else { &names::XYZ[..2] };
        Needs::none().looks_at(axes.iter().copied()).removes(None)
    }

    fn check(&self, schema: &Schema) -> Result<()> {
        // Asked once, and of no other records later.
        let _ = self.fitted.set(self.shape.fit(schema)?);
        Ok(())
    }

    fn warnings(&self, _: &Schema) -> Vec<String> {
        let AreaShape::Polygons(polygons) = &self.shape else { return Vec::new() };
        let crossing = Area::of(polygons).crossing();
        let told = crossing.map(|[x, y]| {
            format!(
                "a polygon of `crop.{}` crosses itself near ({x}, {y}): what an even number of its \
                 rings goes around is outside",
                self.key
            )
        });
        told.into_iter().collect()
    }

    fn misses(&self, [lo, hi]: [[f64; 3]; 2]) -> Option<String> {
        let [area_lo, area_hi] = self.shape.bounds();
        let is_apart = (0..2).any(|axis| area_lo[axis] > hi[axis] || area_hi[axis] < lo[axis]);
        (is_apart && self.keep == CropSide::Inside).then(|| {
            format!(
                "no point will be left: the area of `crop.{}`, {}, is outside of the scan, which \
                 by its header has x from {} to {}, y from {} to {}{}",
                self.key,
                self.extent(),
                lo[0],
                hi[0],
                lo[1],
                hi[1],
                self.doubt()
            )
        })
    }

    fn idle(&self, _: &Schema) -> Vec<String> {
        let side = match self.keep {
            CropSide::Inside => "inside",
            CropSide::Outside => "outside",
        };
        let (extent, key, doubt) = (self.extent(), self.key, self.doubt());
        vec![format!(
            "every point is {side} of the area of `crop.{key}`, {extent}: no point is left \
             out{doubt}"
        )]
    }

    fn removes_by(&self) -> Vec<&'static str> {
        vec![match self.key {
            "box" => "crop.box",
            "polygon" => "crop.polygon",
            _ => "crop.file",
        }]
    }

    fn emptied(&self) -> Option<String> {
        let (extent, key, doubt) = (self.extent(), self.key, self.doubt());
        Some(format!("the area of `crop.{key}` is {extent}{doubt}"))
    }

    fn files(&self) -> Vec<(&'static str, PathBuf)> {
        self.file.iter().map(|file| ("file", file.clone())).collect()
    }

    fn apply(&self, batch: &mut PointBatch, _tally: &mut Tally) -> Result<()> {
        let fitted = self.fitted.get();
        let fitted = fitted.ok_or_else(|| Error::internal("a crop was not told of its records"))?;
        let endian = batch.schema().endian;
        let inside = self.keep == CropSide::Inside;
        batch.retain(|_, record| fitted.contains(record, endian) == inside);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(text: &str) -> Option<(&'static str, String)> {
        let crop = toml::from_str::<Crop>(text).unwrap();
        crop.cropping().err().map(|(key, error)| (key, error.to_string()))
    }

    #[test]
    fn exactly_one_area_is_given_and_what_is_wrong_with_it_is_told() {
        for (text, key) in [
            ("box = [0, 0, 1, 1]", None),
            ("box = [0, 0, -5, 1, 1, 5]\nkeep = 'outside'", None),
            ("polygon = 'POLYGON((0 0, 1 0, 0 1))'", None),
            ("", Some("box")),
            ("keep = 'inside'", Some("box")),
            ("box = [0, 0, 1, 1]\npolygon = 'x'", Some("polygon")),
            ("polygon = 'x'\nfile = 'x'", Some("file")),
            ("polygon = 'area.wkt'", Some("polygon")),
            ("file = 'there/is/no/such.wkt'", Some("file")),
        ] {
            assert_eq!(told(text).map(|(key, _)| key), key, "{text}");
        }
        let (_, message) = told("polygon = 'POINT(1 2)'").unwrap();
        assert_eq!(
            message,
            "`crop.polygon`: it is a POINT, and an area is a POLYGON or a MULTIPOLYGON"
        );
    }

    #[test]
    fn files_that_are_no_areas_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("area.wkt");
        for (bytes, wrong) in
            [(&b"POLYGON((0 0, 1 1))"[..], "a ring has 2"), (b"\xff\xfe", "it is no text")]
        {
            fs::write(&path, bytes).unwrap();
            let crop = Crop { file: Some(path.clone()), ..Crop::default() };
            let (key, error) = crop.cropping().err().unwrap();
            let message = error.to_string();
            assert!(key == "file" && message.contains("area.wkt") && message.contains(wrong));
        }
        fs::File::create(&path).unwrap().set_len(MOST_BYTES + 1).unwrap();
        let crop = Crop { file: Some(path), ..Crop::default() };
        assert!(crop.cropping().err().unwrap().1.to_string().contains("more than is read"));
    }
}
