//! The stage `mesh`: an output whose points are connected.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::connect::of_output;
use super::values::{names_once, some_offset};
use crate::error::{listed, shown};
use crate::io::facets::{ObjSink, SinglePlaces, StlSink};
use crate::io::ply;
use crate::point::{Dimension, Metadata, PointBatch, Schema, Units, names};
use crate::quantity::{Axis, Length};
use crate::stage::{
    ChunkSize, Colors, CreateSink, Format, Order, OutputEncoding, Role, RoleName, Sink, Source,
    StageKind, StagePlace, Triangulation, WriteKeys,
};
use crate::{Error, Result};

/// Writes the points that come to it as a mesh: their Delaunay triangulation in the plane across
/// `axis`, as the paper connects the points before and after a reduction into polygons.
///
/// The extension says the format. A PLY file (`.ply`) is what `write` makes of the same points,
/// with all their dimensions, and has the triangles behind them. OBJ (`.obj`) has the place of
/// every point and the triangles; STL (`.stl`) has the triangles alone, with places as 32-bit
/// floats.
///
/// Of points that lie above each other, in one place of the plane, the first in canonical order is
/// a corner; the others are in the file and in no triangle (`covered` in the report). So are
/// records that a stage set aside, such as marked outliers. Triangles run counter-clockwise as seen
/// from where the axis points to.
///
/// A triangulation over a plane is right for terrain, facades and what one scanner sees. It takes a
/// surface that lies over itself for one, and where a wall stands upright its triangles do, too.
/// Without `max_radius` triangles close every gap and bay up to the convex hull of the points, all
/// are drawn in memory at once (200 bytes a position), and a scan that is too large is refused
/// before any work, or where stages remove points, as soon as it is known how many are left. With
/// `max_radius` a scan of any size is connected piece by piece: triangles whose circles are larger
/// are left out, which leaves gaps open, and nothing shows where pieces were cut. About three
/// spacings of the points are a good radius.
///
/// Points are connected where they were read, so a stage that moves them (`smooth`) cannot stand
/// above: let a second run read what it leaves. Points that lie on one circle, as on a grid, can be
/// connected in several ways; here each such polygon is cut from its first corner on, so the same
/// points give the same triangles always.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mesh {
    /// The file; it appears under this name when it is complete.
    #[schemars(title = "a path")]
    pub path: PathBuf,
    /// The axis across the plane.
    #[serde(default)]
    pub axis: Axis,
    /// The largest radius of a circle through the corners of a triangle; none: any, in memory.
    #[serde(default)]
    pub max_radius: Option<Length>,
    /// What is taken off the places of an OBJ file, of which what is left has nine decimals, or of
    /// an STL file.
    #[serde(default, deserialize_with = "some_offset")]
    pub offset: Option<[f64; 3]>,
    /// Dimensions that a PLY file is to be without.
    #[serde(default)]
    pub drop: Vec<String>,
    /// Computed dimensions that a PLY file has besides those of the input: `NormalX`, `NormalY` and
    /// `NormalZ`, or what another stage computes.
    #[serde(default, deserialize_with = "names_once")]
    pub dimensions: Vec<String>,
    /// Encoding of a PLY file; none: the input's, or binary.
    #[serde(default)]
    pub encoding: Option<OutputEncoding>,
    /// Bits of a colour in a PLY file of LAS points; none: `"auto"`.
    #[serde(default)]
    pub colors: Option<Colors>,
}

/// What a mesh is written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum MeshFormat {
    Ply,
    Obj,
    Stl,
}

impl MeshFormat {
    const ALL: [(&'static str, MeshFormat); 3] =
        [("ply", MeshFormat::Ply), ("obj", MeshFormat::Obj), ("stl", MeshFormat::Stl)];

    fn of(path: &Path) -> Option<(&'static str, MeshFormat)> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        MeshFormat::ALL.into_iter().find(|(name, _)| *name == extension)
    }
}

impl StageKind for Mesh {
    const KIND: &'static str = "mesh";
    const ROLE: RoleName = RoleName::Sink;
    const ABOUT: &'static str = "Writes points as the triangles of a PLY, OBJ or STL file.";
    const MAIN: Option<&'static str> = Some("path");
    const PLACES: &'static [&'static str] = &["path"];

    fn build(self, at: &StagePlace) -> Result<Role> {
        let path = shown(&self.path).to_string();
        if self.path.is_dir() {
            let told = format!("`{path}` is a folder, not a file to write");
            let help =
                format!("name a file in it, such as `{}`", shown(&self.path.join("mesh.ply")));
            return Err(at.blame("path", Error::pipeline(told).help(help)));
        }
        let Some((name, format)) = MeshFormat::of(&self.path) else {
            let dotted = listed(MeshFormat::ALL.map(|(name, _)| format!(".{name}")), "or");
            let told = format!("the extension of `{path}` names no format of meshes");
            return Err(at.blame("path", Error::pipeline(told).help(format!("name it {dotted}"))));
        };
        const PLY: &[&str] = &["ply"];
        const OTHERS: &[&str] = &["obj", "stl"];
        let given = [
            ("offset", self.offset.is_some(), OTHERS),
            ("drop", !self.drop.is_empty(), PLY),
            ("dimensions", !self.dimensions.is_empty(), PLY),
            ("encoding", self.encoding.is_some(), PLY),
            ("colors", self.colors.is_some(), PLY),
        ];
        let mut wrong = given.into_iter().filter(|(_, given, of)| *given && !of.contains(&name));
        if let Some((key, _, having)) = wrong.next() {
            let having = listed(having, "and");
            let told = format!("`mesh.{key}` is for {having}, the output is {name}");
            return Err(at.blame(key, Error::pipeline(told)));
        }
        Ok(Role::Sink(Box::new(MeshFile { keys: self, format })))
    }
}

/// The sink of a mesh.
struct MeshFile {
    keys: Mesh,
    format: MeshFormat,
}

impl MeshFile {
    fn ply(&self, metadata: &Metadata) -> ply::sink::PlyOptions {
        let Mesh { path, drop, dimensions, encoding, colors, .. } = self.keys.clone();
        let (scale, offset, computed) = (None, None, dimensions);
        let keys = WriteKeys {
            path,
            computed,
            drop,
            scale,
            offset,
            encoding,
            colors,
            ..WriteKeys::default()
        };
        let options = ply::registered::options(&keys, metadata, false);
        ply::sink::PlyOptions { triangles: true, ..options }
    }

    fn offset(&self) -> [f64; 3] {
        self.keys.offset.unwrap_or_default()
    }

    /// Places of an STL file: a step of the records is the most that they may move, a thousandth
    /// where coordinates have no steps.
    fn places(&self, schema: &Schema) -> SinglePlaces {
        let step = |axis: &Dimension| if axis.scalar.is_float() { 1e-3 } else { axis.scale.abs() };
        let steps = schema.coordinates().map(|axes| axes.map(step));
        let most = steps.unwrap_or([1e-3; 3]).into_iter().fold(0.0, f64::max);
        SinglePlaces { offset: self.offset(), most }
    }
}

impl CreateSink for MeshFile {
    fn path(&self) -> &Path {
        &self.keys.path
    }

    fn triangulation(&self, units: &Units) -> Result<Option<Triangulation>> {
        let radius = self.keys.max_radius.map(|radius| radius.in_scan(units, "mesh.max_radius"));
        let max_radius = radius.transpose()?.map(Length::value);
        Ok(Some(Triangulation { axis: self.keys.axis as usize, max_radius }))
    }

    fn order(&self) -> Order {
        Order::Canonical
    }

    fn computed(&self) -> &[String] {
        &self.keys.dimensions
    }

    fn unread(&self) -> &[String] {
        &self.keys.drop
    }

    fn chunk(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<ChunkSize> {
        match self.format {
            MeshFormat::Ply => {
                ply::sink::chunk(&self.ply(metadata), schema, metadata).map_err(of_mesh)
            }
            MeshFormat::Obj => Ok(ObjSink::CHUNK),
            MeshFormat::Stl => Ok(StlSink::CHUNK),
        }
    }

    fn carries(&self, schema: &Schema) -> bool {
        let is_asked = self.keys.encoding.is_some() || !self.keys.drop.is_empty();
        self.format == MeshFormat::Ply && schema.layout.family == ply::PLY.family() && !is_asked
    }

    fn warnings(&self, schema: &Schema, _metadata: &Metadata) -> Vec<String> {
        if self.format == MeshFormat::Ply {
            return Vec::new();
        }
        let others = schema
            .dimensions
            .iter()
            .filter(|dimension| !names::XYZ.contains(&dimension.name.as_str()));
        let path = shown(self.path());
        match others.count() {
            0 => Vec::new(),
            _ => vec![format!(
                "{path}: this format holds places, and no other dimensions; PLY holds them all"
            )],
        }
    }

    fn checks(&self, _schema: &Schema) -> bool {
        self.format == MeshFormat::Stl
    }

    fn check(&self, _metadata: &Metadata, records: &PointBatch) -> Result<()> {
        let schema = records.schema();
        let Some(axes) = schema.coordinates().filter(|_| self.format == MeshFormat::Stl) else {
            return Ok(());
        };
        let places = self.places(schema);
        for record in records.iter() {
            let place = axes.map(|axis| axis.world(record, schema.endian));
            places.rounding(place).map_err(|error| error.at(self.path()))?;
        }
        Ok(())
    }

    fn reopen(&self, staged: &[PathBuf]) -> Result<Option<Box<dyn Source>>> {
        match self.format {
            MeshFormat::Ply => ply::open(staged).map(Some),
            MeshFormat::Obj | MeshFormat::Stl => Ok(None),
        }
    }

    fn create(
        &self,
        staged: &Path,
        schema: &Arc<Schema>,
        metadata: &Metadata,
        _whole: bool,
    ) -> Result<Box<dyn Sink>> {
        let created: Result<Box<dyn Sink>> = match self.format {
            MeshFormat::Ply => ply::sink::create(staged, &self.ply(metadata), schema, metadata),
            MeshFormat::Obj => {
                let crs = metadata.crs.iter().map(|crs| format!("crs: {crs}"));
                let comments: Vec<String> = crs.collect();
                Ok(Box::new(ObjSink::create(staged, self.offset(), &comments)?))
            }
            MeshFormat::Stl => Ok(Box::new(StlSink::create(staged, self.places(schema))?)),
        };
        created.map_err(|error| of_output(error, staged, self.path()))
    }
}

/// An error of `write`'s keys, which are those of a mesh.
fn of_mesh(error: Error) -> Error {
    let named = |text: &str| text.replace("`write.", "`mesh.");
    let told = Error::new(error.kind(), named(&error.to_string()));
    match error.remedy() {
        None => told,
        Some(help) => told.help(named(help)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_extension_says_the_format_and_which_keys_it_has() {
        let at = StagePlace::new("test", 1);
        let built = |text: &str| toml::from_str::<Mesh>(text).unwrap().build(&at);
        assert!(built("path = 'a.PLY'\ncolors = '8bit'\ndimensions = ['NormalX']").is_ok());
        assert!(built("path = 'a.stl'\noffset = [1, 2, 3]").is_ok());
        assert!(built("path = 'a.obj'\naxis = 'x'\nmax_radius = '2 m'").is_ok());
        for wrong in ["path = 'a.laz'", "path = 'a'", "path = 'a.ply'\noffset = [1, 2, 3]"] {
            assert!(built(wrong).is_err(), "{wrong}");
        }
        let told = built("path = 'a.obj'\nencoding = 'ascii'").err().unwrap().to_string();
        assert_eq!(told, "`mesh.encoding` is for ply, the output is obj");
    }
}
