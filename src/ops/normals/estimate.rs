//! The normal of one neighbourhood, by either method.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geom::plane::{self, Covariance};
use crate::geom::star::Star;

/// How a normal is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
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
pub type EstimateOutcome = (Estimate, Option<Fallback>);

/// The normal at a position whose neighbours are at `offsets` from it.
pub(super) fn alone(method: Method, star: &mut Star, offsets: &[[i64; 3]]) -> EstimateOutcome {
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
pub(super) fn varady(
    adjugate: &[f64; 6],
    flat: [f64; 3],
    first: Option<[f64; 3]>,
) -> EstimateOutcome {
    let Some(first) = first else { return (settled(flat), Some(Fallback::NoTriangle)) };
    match plane::unit(plane::product(adjugate, first)) {
        Some(normal) => (settled(normal), None),
        None => (settled(flat), Some(Fallback::Perpendicular)),
    }
}

pub(super) fn settled(normal: [f64; 3]) -> Estimate {
    Estimate::Normal(plane::canonical(normal.map(|c| c as f32)))
}
