//! Surface normals from the nearest neighbours of every position: the first step of the reduction.

mod bundle;
pub(crate) mod estimate;
pub(crate) mod estimator;
mod fan;
mod height;
mod noise;
mod orient;
mod shape;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use super::lengths::Square;
use super::scatter::{scatter, typical};
use crate::geom::angle::is_known;
use crate::point::{NORMAL, Units, names};
use crate::quantity::{Length, Setting, Whole};
use crate::report::Tally;
use crate::stage::{Forecast, Needs, Role, RoleName, ScanFacts, StageKind, StagePlace, TileOp};
use crate::tile::Tile;
use crate::{Error, Result};

use bundle::in_morton_order;
use estimate::MIN_NEIGHBORS;
pub use estimate::{Cocircular, Method};
pub(crate) use estimate::{Estimate, EstimateOutcome, Fallback};
pub(crate) use estimator::Estimator;
pub use orient::Orient;
pub(in crate::ops) use orient::SignRule;
use shape::AskedShapes;

/// Most neighbours that the stage takes.
const MAX_NEIGHBORS: usize = 64;

/// The stage `normals`: a unit normal for every position, from its k nearest other positions.
///
/// Positions with fewer than two others in the whole scan, or with neighbours on one line, have
/// none.
///
/// What `orient` says decides how `cells` sees them: with `"none"` the normals of each cell are
/// turned to one side first; with any other the signs stay, and the two sides of a thin wall are
/// two surfaces.
///
/// With `neighbors = "auto"` it looks at a sample of the scan first: `scatter_of_10` of the report
/// is how far, in radians, normals of 10 neighbours are off their linear trend where the scan is
/// planar, which is what noise does. Up to 0.01 it takes 10 neighbours, beyond 20.
///
/// The report counts where the method asked for could not be: `no_normal`, and of those that
/// another method stood in for `fallback_no_triangle` and `fallback_perpendicular` (`"pca"`) and
/// `fallback_ill_conditioned` (`"varady"`, where neighbours are too few for a height function of
/// degree 2 or 3, or lie so that they do not determine it).
///
/// Height functions of degree 2 and 3 follow a surface that bends; of noise, too, they follow more
/// than a plane does. Both, and `curvature` and `residual`, are computed point by point, which
/// takes a multiple of the time of the other methods.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Normals {
    /// How many nearest other positions the fit uses (k), besides the position itself; 3 to 64, or
    /// `"auto"`, by the noise. The paper finds 6 to 20 useful and 10 best; more smooth noise and
    /// edges.
    #[serde(deserialize_with = "checked_neighbors")]
    #[schemars(with = "Setting<Whole<{ MIN_NEIGHBORS as u64 }, { MAX_NEIGHBORS as u64 }>>")]
    pub neighbors: Setting<usize>,
    /// Neighbours farther away than this are none: of the nearest `neighbors`, those within this
    /// length are used.
    pub within: Option<Length>,
    /// How a normal is estimated.
    pub method: Method,
    /// What becomes of a neighbour on the circle of a Delaunay triangle of the point, where the
    /// triangulation is not unique, and the paper does not say. Projected on their plane of
    /// regression points hardly ever are on one, to 2^-40: it shows where a grid is level as a
    /// whole and its heights are not. Not for `"pca"`, which has no triangles.
    pub cocircular: Cocircular,
    /// Whether the column `Curvature` is computed, the surface variation: the least eigenvalue of
    /// the covariance of the position and its neighbours, divided by the sum of all three. 0 on a
    /// plane, 1/3 at most.
    pub curvature: bool,
    /// Whether the column `Residual` is computed: the root mean square of the distances of the
    /// position and its neighbours to the fitted surface, in world units (of height functions of
    /// degree 2 and 3 along the first estimate).
    pub residual: bool,
    /// To which side normals point.
    pub orient: Orient,
    /// What normals point to with `orient = "viewpoint"`, and only then: x, y, z in world units.
    pub viewpoint: Option<[f64; 3]>,
    #[serde(skip)]
    side: Option<SignRule>,
    /// What `"auto"` came to.
    #[serde(skip)]
    found: Option<usize>,
    /// Side of the cubes of 32 positions on average, for samples.
    #[serde(skip)]
    sample_side: i64,
    /// The square of `within` in steps.
    #[serde(skip)]
    square: Option<u128>,
    /// Length of a step of the lattice.
    #[serde(skip)]
    step: f64,
}

impl Default for Normals {
    fn default() -> Self {
        Normals {
            neighbors: Setting::Given(10),
            within: None,
            method: Method::default(),
            cocircular: Cocircular::default(),
            curvature: false,
            residual: false,
            orient: Orient::None,
            viewpoint: None,
            side: None,
            found: None,
            sample_side: 0,
            square: None,
            step: 1.0,
        }
    }
}

impl Normals {
    /// Refuses a number of neighbours outside 3 to 64 (reading a pipeline file does the same), and
    /// a viewpoint that is missing, not asked for or not finite; names the key to blame.
    pub(crate) fn check(&self) -> Result<(), (&'static str, Error)> {
        let given = self.neighbors.given().unwrap_or(MIN_NEIGHBORS);
        check_neighbors(given as u64).map_err(|told| ("neighbors", Error::pipeline(told)))?;
        let (fewest, method) = (self.method.fewest(), self.method.name());
        if self.neighbors.given().is_some_and(|given| given < fewest) {
            let told = format!(
                "`normals.method = \"{method}\"` needs {fewest} neighbours or more, not {given}"
            );
            return Err(("neighbors", Error::pipeline(told)));
        }
        if self.method == Method::Pca && self.cocircular == Cocircular::In {
            let told = "`normals.cocircular` is about triangles, and `normals.method = \"pca\"` \
                        has none";
            return Err(("cocircular", Error::pipeline(told)));
        }
        let (key, error) = match (self.orient, self.viewpoint) {
            (Orient::Viewpoint, None) => (
                "orient",
                Error::pipeline("`normals.orient = \"viewpoint\"` needs a `normals.viewpoint`")
.help(
                    "give `normals.viewpoint = [x, y, z]`, where the scanner stood, in the scan's \
                     unit",
                ),
            ),
            (Orient::Viewpoint, Some(at)) if at.iter().all(|v| v.is_finite()) => return Ok(()),
            (Orient::Viewpoint, Some(_)) => {
                ("viewpoint", Error::pipeline("a viewpoint is three finite numbers"))
            }
            (Orient::None | Orient::Up, Some(_)) => (
                "viewpoint",
                Error::pipeline(
                    "`normals.viewpoint` does nothing without `normals.orient = \"viewpoint\"`",
                )
                .help("give that too, or leave `normals.viewpoint` out"),
            ),
            (Orient::None | Orient::Up, None) => return Ok(()),
        };
        Err((key, error))
    }

    /// The columns that are computed besides normals.
    fn shapes(&self) -> AskedShapes {
        AskedShapes { curvature: self.curvature, residual: self.residual }
    }

    /// To which side normals are turned.
    fn sign_rule(&self) -> Result<SignRule> {
        match (self.orient, self.side) {
            (Orient::None, _) => Ok(SignRule::Any),
            (Orient::Up, _) => Ok(SignRule::Up),
            (Orient::Viewpoint, Some(side)) => Ok(side),
            (Orient::Viewpoint, None) => {
                Err(Error::internal("normals ran before their viewpoint was settled"))
            }
        }
    }

    /// The neighbours of the fit; the most that may be chosen until they are.
    fn count(&self) -> usize {
        self.neighbors.given().or(self.found).unwrap_or(noise::MOST)
    }
}

impl StageKind for Normals {
    const KIND: &'static str = "normals";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str =
        "Computes a surface normal at every point from its nearest neighbours.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        self.check().map_err(|(key, error)| at.blame(key, error))?;
        Ok(Role::TileOp(Box::new(self)))
    }
}

impl TileOp for Normals {
    fn needs(&self) -> Needs {
        Needs {
            fewer_neighbors: self.neighbors.given().or(self.found).is_none(),
            ..self.shapes().needs(Needs::none().looks_at(names::XYZ).writes(&NORMAL))
        }
        .neighbors(self.count())
    }

    fn convert(&mut self, units: &Units) -> Result<()> {
        let within = self.within.map(|length| length.in_scan(units, "normals.within"));
        self.within = within.transpose()?;
        Ok(())
    }

    fn lengths(&self) -> Vec<(&'static str, Length)> {
        self.within.map(|within| ("normals.within", within)).into_iter().collect()
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        self.check().map_err(|(_, error)| error)?;
        self.side = self.viewpoint.map(|at| SignRule::towards(at, scan.lattice));
        self.step = scan.lattice.step;
        self.square = self.within.map(|length| Square::of(length.value() / self.step).at_most());
        self.sample_side = 1 << scan.levels.smallest_side(noise::POSITIONS_PER_CUBE);
        Ok(())
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let side = self.sign_rule()?;
        let estimator = Estimator::with(self.method, tile.simd());
        let mut estimator = estimator.taking(self.cocircular);
        let mut normals = tile.columns.take(&NORMAL)?;
        let copies = std::mem::take(&mut tile.copies);
        let core = tile.core.clone();
        let (mut without, mut no_triangle, mut perpendicular, mut ill) = (0, 0, 0, 0);
        let mut settle = |i: usize, (estimate, fallback): EstimateOutcome| {
            let counted = u64::from(core.contains(&i) && copies[i] > 0);
            match estimate {
                Estimate::Normal(normal) => normals[i] = normal,
                Estimate::None => without += counted,
            }
            match fallback {
                Some(Fallback::NoTriangle) => no_triangle += counted,
                Some(Fallback::Perpendicular) => perpendicular += counted,
                Some(Fallback::IllConditioned) => ill += counted,
                None => {}
            }
        };
        let mut shapes = self.shapes().take(tile)?;
        let outcome = tile.each_neighborhood(self.count(), |i, neighborhood| {
            let neighborhood = match self.square {
                Some(square) => &neighborhood.within(square),
                None => neighborhood,
            };
            match &mut shapes {
                Some(shapes) => {
                    let offsets = in_morton_order(
                        neighborhood.offsets().iter().copied(),
                        neighborhood.ranks(),
                    );
                    let (outcome, shape) = estimator.estimate_with_shape(&offsets);
                    settle(i, outcome);
                    shapes.enter(i, shape, self.step);
                }
                None => estimator.take(i, neighborhood, &mut settle),
            }
        });
        estimator.finish(&mut settle);
        if let Some(shapes) = shapes {
            shapes.put(tile);
        }
        tile.oriented = side != SignRule::Any;
        for (normal, position) in normals.iter_mut().zip(&tile.positions) {
            if tile.oriented && is_known(*normal) {
                *normal = side.settled(*normal, *position);
            }
        }
        tile.columns.put(normals);
        tile.copies = copies;
        tally.count("no_normal", without);
        tally.count("fallback_no_triangle", no_triangle);
        tally.count("fallback_perpendicular", perpendicular);
        tally.count("fallback_ill_conditioned", ill);
        outcome
    }

    fn sample_side(&self) -> Option<i64> {
        self.neighbors.is_auto().then_some(self.sample_side)
    }

    fn sample(&self, tile: &mut Tile) -> Result<Vec<f64>> {
        let first = Normals { neighbors: Setting::Given(noise::FIRST), ..*self };
        first.run(tile, &mut Tally::default())?;
        Ok(vec![scatter(tile).unwrap_or(f64::NAN)])
    }

    fn forecast(&mut self, samples: &[Vec<f64>]) -> Forecast {
        let scatter = typical(samples.iter().flatten().copied());
        let found = noise::neighbors(scatter);
        self.found = Some(found);
        let told = scatter.map(|scatter| ("scatter_of_10".into(), scatter.into()));
        Forecast {
            decisions: told.into_iter().collect(),
            chosen: vec![("neighbors".into(), found.into())],
            warning: None,
        }
    }
}

fn check_neighbors(neighbors: u64) -> Result<(), String> {
    if (MIN_NEIGHBORS as u64..=MAX_NEIGHBORS as u64).contains(&neighbors) {
        return Ok(());
    }
    Err(format!("neighbors must be {MIN_NEIGHBORS} to {MAX_NEIGHBORS}, not {neighbors}"))
}

fn checked_neighbors<'de, D: Deserializer<'de>>(from: D) -> Result<Setting<usize>, D::Error> {
    type Count = Whole<{ MIN_NEIGHBORS as u64 }, { MAX_NEIGHBORS as u64 }>;
    let given = Setting::<Count>::deserialize(from)?.given();
    Ok(given.map_or(Setting::Auto, |count| Setting::Given(count.get() as usize)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_ten_neighbors_and_varady() {
        let stage: Normals = toml::from_str("").unwrap();
        assert_eq!(stage, Normals::default());
        assert_eq!(
            (stage.neighbors, stage.method, stage.orient),
            (Setting::Given(10), Method::Varady, Orient::None)
        );
        let stage: Normals = toml::from_str("neighbors = 64\nmethod = \"pca\"").unwrap();
        assert_eq!((stage.neighbors, stage.method), (Setting::Given(64), Method::Pca));
        let stage: Normals = toml::from_str("neighbors = \"auto\"").unwrap();
        assert_eq!((stage.neighbors, stage.needs().neighbors), (Setting::Auto, noise::MOST));
    }

    #[test]
    fn neighbors_outside_the_range_are_refused_with_the_range() {
        for wrong in ["2", "65", "0"] {
            let error = toml::from_str::<Normals>(&format!("neighbors = {wrong}")).unwrap_err();
            assert!(error.message().contains("3 to 64"), "{error}");
            assert!(error.span().is_some());
        }
        assert!(toml::from_str::<Normals>("neighbors = -1").is_err());
        assert!(toml::from_str::<Normals>("neighbours = 10").is_err());
        assert!(toml::from_str::<Normals>("method = \"quartic\"").is_err());
        let (key, error) =
            Normals { neighbors: Setting::Given(2), ..Normals::default() }.check().unwrap_err();
        assert_eq!((key, &*error.to_string()), ("neighbors", "neighbors must be 3 to 64, not 2"));
    }
}
