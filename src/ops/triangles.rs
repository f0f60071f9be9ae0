//! The stage `triangles`: triangles of a mesh go, one after the other, where they tell least.

mod mesh;
mod weights;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Axis;
use super::cells::{Keep, KeepGiven};
use super::whole::Rows;
use crate::point::{Bounds, names};
use crate::report::{Grouped, Tally};
use crate::stage::{
    Gathered, Needs, Role, RoleName, ScanFacts, ScanOp, StageKind, StagePlace, TileOp,
};
use crate::tile::Tile;
use crate::{Error, Result};

use mesh::ThinnedMesh;

/// Bytes of a position while the mesh is thinned: what was gathered of it, its corner with edges
/// and faces, two triangles and those that come in their place, and what becomes of it.
const HELD_BYTES: usize = Rows::<()>::BYTES + ThinnedMesh::BYTES + size_of::<f32>();

/// Iterative triangle removal (Hamann), with which the paper compares: triangles are weighted by
/// the curvature at their corners and by their interior angles, and removed in order of their
/// weight.
///
/// The positions are triangulated (Delaunay) in the plane across `axis`; of those in one place of
/// it the first in canonical order is a corner. A corner's curvature is the root mean square of its
/// normal curvatures 2 n·(q − p) / |q − p|² towards its neighbours q, n being the mean normal of
/// its triangles; it stays what it was at the beginning. A triangle's weight is the sum of the
/// three curvatures, times its smallest angle, times its perimeter, so that what is flat thins out
/// evenly (of the sum a thousandth of its mean counts where nothing bends). Of the triangle of the
/// smallest weight the corner of the largest curvature stays, the others go, the hole is
/// triangulated anew, and so on until `keep` points are left. Corners on the border of the mesh
/// stay, and so does one with more than 512 corners around it.
///
/// The report tells as deviation how far along the axis a point that went is from the mesh that is
/// left. No point is moved: of Hamann's method, which puts a new point in the place of a triangle,
/// this keeps one of the three.
///
/// A mesh over a plane takes a surface that lies over itself for one. All positions are in memory
/// at once, with 400 bytes each; a scan that is too large for the run's memory is refused before
/// any work.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Triangles {
    /// How many points stay: a number, or a share of those there are, such as "10%".
    #[schemars(with = "KeepGiven")]
    pub keep: Keep,
    /// The axis across which the points are triangulated.
    #[serde(default)]
    pub axis: Axis,
    #[serde(skip)]
    bounds: Option<Bounds>,
    #[serde(skip)]
    found: Option<ThinnedScan>,
}

/// What came of the mesh.
#[derive(Debug, Clone, PartialEq)]
struct ThinnedScan {
    /// How far each position is from the mesh that is left, in steps; NaN for one that stays.
    rows: Rows<f32>,
    /// Corners of the whole mesh, and those on its border.
    corners: u64,
    border: u64,
}

impl StageKind for Triangles {
    const KIND: &'static str = "triangles";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str =
        "Removes triangles of a mesh of the points, those that tell least first.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        self.keep.check_given(Self::KIND, at)?;
        Ok(Role::ScanOp(Box::new(self)))
    }
}

impl TileOp for Triangles {
    fn needs(&self) -> Needs {
        Needs::none().looks_at(names::XYZ).removes(None).measures()
    }

    fn for_share(&mut self, share: f64) {
        self.keep.for_share(share);
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        self.bounds = Some(scan.bounds);
        Ok(())
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let unfound = || Error::internal("the stage triangles ran before its mesh was thinned");
        let rows = &self.found.as_ref().ok_or_else(unfound)?.rows;
        rows.thin(tile, Self::KIND, tally)
    }

    fn decisions(&self) -> Vec<(String, Value)> {
        self.found.as_ref().map_or(Vec::new(), |found| {
            vec![("corners".into(), found.corners.into()), ("border".into(), found.border.into())]
        })
    }
}

impl ScanOp for Triangles {
    type Summary = Rows<()>;

    fn gather_needs(&self) -> Needs {
        let needs = Needs::none().looks_at(names::XYZ).bytes_per_point(2 * Rows::<()>::BYTES);
        needs.holds(HELD_BYTES)
    }

    fn gather(&self, tile: &mut Tile, _: &mut Tally) -> Result<Rows<()>> {
        Ok(Rows::of_core(tile, |_| ()))
    }

    fn conclude(&mut self, gathered: &dyn Gathered<Rows<()>>) -> Result<Option<String>> {
        let unsettled = || Error::internal("the stage triangles gathered before it was settled");
        let bounds = self.bounds.ok_or_else(unsettled)?;
        let most = self.keep.of(gathered.records()).max(1);
        let rows = Rows::of_scan(gathered)?;
        let mut mesh = {
            let axis = self.axis as usize;
            ThinnedMesh::of(&rows.positions, bounds.lo, axis, || gathered.go_on())?
        };
        let positions = rows.positions.len() as u64;
        let (corners, border) = (mesh.corners(), mesh.border());
        mesh.thin(most, || gathered.go_on())?;
        let left = mesh.corners();
        let distances = mesh.distances(&rows.positions);
        self.found = Some(ThinnedScan { rows: rows.with(distances), corners, border });
        let most = most.min(positions);
        Ok((left != most).then(|| {
            let (left, most) = (Grouped(left), Grouped(most));
            let (border, covered) = (Grouped(border), Grouped(positions - corners));
            format!(
                "`triangles` keeps {left} points, and not {most}: {border} corners are on the \
                 border of its mesh and stay, as do those with hundreds around them, and {covered} \
                 positions lie above or below a corner"
            )
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_must_be_given() {
        let at = StagePlace::new("test", 1);
        let read = toml::from_str::<Triangles>;
        assert!(read("keep = '10%'\naxis = 'x'").unwrap().build(&at).is_ok());
        assert!(read("keep = 'auto'").unwrap().build(&at).is_err());
        for wrong in ["", "keep = 0", "keep = 5\naxis = 'w'"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
