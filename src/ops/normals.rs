//! Surface normals from the nearest neighbours of every position: the first step of the reduction.

mod bundle;
mod fan;
mod noise;
mod orient;

use serde::{Deserialize, Deserializer, Serialize};

use crate::geom::angle::is_known;
use crate::geom::plane::{self, Covariance};
use crate::geom::simd::Simd;
use crate::geom::star::Star;
use crate::point::names;
use crate::quantity::{Setting, Whole};
use crate::report::Tally;
use crate::stage::{Forecast, Needs, Role, ScanFacts, StageKind, StagePlace, TileOp};
use crate::tile::{Neighborhood, Tile};
use crate::{Error, Result};

use bundle::{Bundle, in_morton_order};
pub use orient::Orient;
use orient::Side;

/// Fewest neighbours that the stage takes; two make a plane, but no estimate of a surface.
pub const MIN_NEIGHBORS: usize = 3;
/// Most neighbours that the stage takes.
pub const MAX_NEIGHBORS: usize = 64;

/// The stage `normals`: a unit normal for every position, from its k nearest other positions.
///
/// Positions with fewer than two others in the whole scan, or with neighbours on one line, have
/// none.
///
/// What `orient` says decides how `cells` sees them: with `"none"` the normals of each cell are turned
/// to one side first; with any other the signs stay, and the two sides of a thin wall are two surfaces.
///
/// With `neighbors = "auto"` it looks at a sample of the scan first: `scatter_of_10` of the report is how
/// far, in radians, normals of 10 neighbours are off their linear trend where the scan is planar, which
/// is what noise does. Up to 0.01 it takes 10 neighbours, beyond 20.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Normals {
    /// How many nearest other positions the fit uses (k), besides the position itself; 3 to 64, or
    /// `"auto"`, by the noise. The paper finds 6 to 20 useful and 10 best; more smooth noise and edges.
    #[serde(deserialize_with = "checked_neighbors")]
    pub neighbors: Setting<usize>,
    /// How a normal is estimated.
    pub method: Method,
    /// To which side normals point.
    pub orient: Orient,
    /// What normals point to with `orient = "viewpoint"`, and only then: x, y, z in world units.
    pub viewpoint: Option<[f64; 3]>,
    #[serde(skip)]
    side: Option<Side>,
    /// What `"auto"` came to.
    #[serde(skip)]
    found: Option<usize>,
    /// Side of the cubes of 32 positions on average, for samples.
    #[serde(skip)]
    sample_side: i64,
}

impl Default for Normals {
    fn default() -> Self {
        Normals {
            neighbors: Setting::Given(10),
            method: Method::default(),
            orient: Orient::None,
            viewpoint: None,
            side: None,
            found: None,
            sample_side: 0,
        }
    }
}

impl Normals {
    /// Refuses a number of neighbours outside 3 to 64 (reading a pipeline file does the same), and a
    /// viewpoint that is missing, not asked for or not finite; names the key to blame.
    pub fn check(&self) -> Result<(), (&'static str, Error)> {
        let given = self.neighbors.given().unwrap_or(MIN_NEIGHBORS);
        check_neighbors(given as u64).map_err(|told| ("neighbors", Error::pipeline(told)))?;
        let (key, error) = match (self.orient, self.viewpoint) {
            (Orient::Viewpoint, None) => (
                "orient",
                Error::pipeline("`normals.orient = \"viewpoint\"` needs a `normals.viewpoint`").help(
                    "give `normals.viewpoint = [x, y, z]`, where the scanner stood, in the scan's unit",
                ),
            ),
            (Orient::Viewpoint, Some(at)) if at.iter().all(|v| v.is_finite()) => return Ok(()),
            (Orient::Viewpoint, Some(_)) => {
                ("viewpoint", Error::pipeline("a viewpoint is three finite numbers"))
            }
            (Orient::None | Orient::Up, Some(_)) => (
                "viewpoint",
                Error::pipeline("`normals.viewpoint` does nothing without `normals.orient = \"viewpoint\"`")
                    .help("give that too, or leave `normals.viewpoint` out"),
            ),
            (Orient::None | Orient::Up, None) => return Ok(()),
        };
        Err((key, error))
    }

    /// The neighbours of the fit; the most that may be chosen until they are.
    fn count(&self) -> usize {
        self.neighbors.given().or(self.found).unwrap_or(noise::MOST)
    }
}

impl StageKind for Normals {
    const KIND: &'static str = "normals";
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
            reads: names::XYZ.map(str::to_owned).to_vec(),
            writes: vec!["Normal".into()],
            neighbors: self.count(),
            fewer_neighbors: self.neighbors.given().or(self.found).is_none(),
            ..Needs::default()
        }
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        self.check().map_err(|(_, error)| error)?;
        self.side = self.viewpoint.map(|at| Side::towards(at, scan.lattice));
        self.sample_side = 1 << scan.levels.smallest_side(noise::POSITIONS_PER_CUBE);
        Ok(())
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let side = match (self.orient, self.side) {
            (Orient::None, _) => Side::Any,
            (Orient::Up, _) => Side::Up,
            (Orient::Viewpoint, Some(side)) => side,
            (Orient::Viewpoint, None) => {
                return Err(Error::internal("normals ran before their viewpoint was settled"));
            }
        };
        let mut estimator = Estimator::with(self.method, tile.simd());
        let mut normals = std::mem::take(&mut tile.normals);
        let copies = std::mem::take(&mut tile.copies);
        let core = tile.core.clone();
        let (mut without, mut no_triangle, mut perpendicular) = (0, 0, 0);
        let mut settle = |i: usize, (estimate, fallback): Outcome| {
            let counted = u64::from(core.contains(&i) && copies[i] > 0);
            match estimate {
                Estimate::Normal(normal) => normals[i] = normal,
                Estimate::None => without += counted,
            }
            match fallback {
                Some(Fallback::NoTriangle) => no_triangle += counted,
                Some(Fallback::Perpendicular) => perpendicular += counted,
                None => {}
            }
        };
        let outcome = tile.each_neighborhood(self.count(), |i, neighborhood| {
            estimator.take(i, neighborhood, &mut settle);
        });
        estimator.finish(&mut settle);
        (tile.normals, tile.copies) = (normals, copies);
        tile.oriented = side != Side::Any;
        for i in 0..tile.positions.len() {
            if tile.oriented && is_known(tile.normals[i]) {
                tile.normals[i] = side.settled(tile.normals[i], tile.positions[i]);
            }
        }
        tally.count("no_normal", without);
        tally.count("fallback_no_triangle", no_triangle);
        tally.count("fallback_perpendicular", perpendicular);
        outcome
    }

    fn sample_side(&self) -> Option<i64> {
        self.neighbors.is_auto().then_some(self.sample_side)
    }

    fn sample(&self, tile: &mut Tile) -> Result<Vec<f64>> {
        noise::sample(self, tile)
    }

    fn forecast(&mut self, samples: &[Vec<f64>]) -> Forecast {
        noise::forecast(self, samples)
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

/// How a normal is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Least-squares height function z = ax + by + c over a first estimate: the mean normal of the
    /// Delaunay triangles around the point (the paper's Algorithm 1, after Várady).
    #[default]
    Varady,
    /// The plane of regression: the eigenvector of the smallest eigenvalue of the covariance.
    Pca,
}

/// The outcome for one position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Estimate {
    /// The unit normal, its component of largest magnitude (the first of equal ones) positive.
    Normal([f32; 3]),
    /// Fewer than 3 distinct positions, or all on one line.
    None,
}

/// Why `pca` stood in for the method asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fallback {
    /// No Delaunay triangle around the point has an area in the plane of regression.
    NoTriangle,
    /// The first estimate lies in the plane that it should be normal to.
    Perpendicular,
}

/// What came of a neighbourhood.
pub type Outcome = (Estimate, Option<Fallback>);

/// Estimates normals by one method; holds scratch memory, so keep one for each thread.
#[derive(Debug, Default)]
pub struct Estimator {
    method: Method,
    simd: Simd,
    star: Star,
    bundle: Bundle,
}

impl Estimator {
    /// An estimator by `method`, computing by the best instruction set of the processor.
    pub fn new(method: Method) -> Self {
        Estimator { method, ..Estimator::default() }
    }

    /// The same by the given instruction set; all give the same normals.
    pub fn with(method: Method, simd: Simd) -> Self {
        Estimator { method, simd, ..Estimator::default() }
    }

    /// The normal at a position whose neighbours are at `offsets` from it, in lattice steps: none of
    /// them 0, all distinct, in Morton order, each smaller than 2^63.
    ///
    /// The result is a function of `offsets` alone, the same bits on every platform.
    pub fn estimate(&mut self, offsets: &[[i64; 3]]) -> Outcome {
        alone(self.method, &mut self.star, offsets)
    }

    /// Takes the neighbourhood of `owner` to [`estimate`](Self::estimate) it with others, which is
    /// faster; calls `settle` with owners and outcomes when there are enough.
    pub fn take(
        &mut self,
        owner: usize,
        neighborhood: &Neighborhood<'_>,
        settle: &mut impl FnMut(usize, Outcome),
    ) {
        if !self.bundle.take(owner, neighborhood) {
            let offsets =
                in_morton_order(neighborhood.offsets().iter().copied(), neighborhood.ranks());
            settle(owner, self.estimate(&offsets));
        } else if self.bundle.is_full() {
            self.finish(settle);
        }
    }

    /// Calls `settle` for what was taken and is not settled yet.
    pub fn finish(&mut self, settle: &mut impl FnMut(usize, Outcome)) {
        self.bundle.estimate(self.method, self.simd, &mut self.star, settle);
    }
}

fn alone(method: Method, star: &mut Star, offsets: &[[i64; 3]]) -> Outcome {
    if offsets.len() < 2 || plane::collinear(offsets) {
        return (Estimate::None, None);
    }
    let covariance = Covariance::of(offsets);
    let (_, flat) = plane::smallest(covariance.matrix());
    match method {
        Method::Pca => (settled(flat), None),
        Method::Varady => varady(&covariance.adjugate(), flat, star.normal(offsets, flat)),
    }
}

/// adj(C)·n_f, which is (−a, −b, 1) of the height function over the first estimate n_f, turned back
/// from its frame; `flat`, the normal of the plane of regression, where that fails.
fn varady(adjugate: &[f64; 6], flat: [f64; 3], first: Option<[f64; 3]>) -> Outcome {
    let Some(first) = first else { return (settled(flat), Some(Fallback::NoTriangle)) };
    match plane::unit(plane::product(adjugate, first)) {
        Some(normal) => (settled(normal), None),
        None => (settled(flat), Some(Fallback::Perpendicular)),
    }
}

fn settled(normal: [f64; 3]) -> Estimate {
    Estimate::Normal(plane::canonical(normal.map(|c| c as f32)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point::distance2;
    use proptest::prelude::*;

    /// Noisy surfaces, grids full of ties and cocircular points, lines, scan lines, edges, walls, far
    /// points; most with equally many neighbours.
    fn neighborhoods() -> impl Strategy<Value = Vec<Vec<[i64; 3]>>> {
        let count = prop::sample::select(vec![1usize, 2, 3, 8, 10, 10, 10, 16, 64, 66]);
        count.prop_flat_map(|count| prop::collection::vec(neighborhood(count), 1..40))
    }

    fn neighborhood(count: usize) -> impl Strategy<Value = Vec<[i64; 3]>> {
        let width = prop::sample::select(vec![2i64, 4, 40, 1000, 1 << 21, 1 << 23, 1 << 40]);
        let height = prop::sample::select(vec![0i64, 1, 30]);
        let step = prop::sample::select(vec![1i64, 1, 12, 1 << 13]);
        // How far neighbours are to one side and to the other.
        let sides = prop::sample::select(vec![(-1i64, 1i64), (-1, 1), (0, 1), (-1, 0)]);
        let thinner = prop::sample::select(vec![1i64, 1, 10, 100]);
        let shape = (width, height, 0usize..3, step, sides, thinner);
        shape.prop_flat_map(move |(width, height, up, step, (low, high), thinner)| {
            let across = width / thinner;
            let one = (-width..=width, low * across..=high * across, -height..=height);
            prop::collection::vec(one, count).prop_map(move |offsets| {
                let mut offsets: Vec<_> = offsets.into_iter().map(|(x, y, z)| [x, y, z]).collect();
                offsets.sort_unstable();
                offsets.dedup();
                offsets.retain(|o| *o != [0; 3]);
                offsets.iter_mut().for_each(|o| o.swap(2, up));
                offsets.iter_mut().for_each(|o| *o = o.map(|v| v * step));
                offsets
            })
        })
    }

    proptest! {
        #[test]
        fn normals_estimated_together_are_those_estimated_alone(
            neighborhoods in neighborhoods(), pca: bool,
        ) {
            let method = if pca { Method::Pca } else { Method::Varady };
            for simd in Simd::all() {
                let mut estimator = Estimator::with(method, simd);
                let mut together = vec![None; neighborhoods.len()];
                let mut settle = |i: usize, outcome| together[i] = Some(outcome);
                for (i, offsets) in neighborhoods.iter().enumerate() {
                    // Nearest first, as a search gives them.
                    let mut ranks: Vec<u32> = (0..offsets.len() as u32).collect();
                    ranks.sort_by_key(|&rank| distance2([0; 3], offsets[rank as usize]));
                    let sorted: Vec<[i64; 3]> =
                        ranks.iter().map(|&rank| offsets[rank as usize]).collect();
                    let neighborhood = Neighborhood::of_offsets(&sorted, &ranks);
                    estimator.take(i, &neighborhood, &mut settle);
                }
                estimator.finish(&mut settle);
                for (offsets, together) in neighborhoods.iter().zip(together) {
                    let alone = estimator.estimate(offsets);
                    prop_assert_eq!(Some(alone), together, "{:?} by {:?}", offsets, simd);
                }
            }
        }
    }

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
        assert!(toml::from_str::<Normals>("method = \"quadric\"").is_err());
        let (key, error) =
            Normals { neighbors: Setting::Given(2), ..Normals::default() }.check().unwrap_err();
        assert_eq!((key, &*error.to_string()), ("neighbors", "neighbors must be 3 to 64, not 2"));
    }
}
