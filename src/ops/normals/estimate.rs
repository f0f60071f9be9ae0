//! The normal of one neighbourhood, by each method.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::height;
use crate::geom::plane::{self, Covariance};
use crate::geom::star::Star;

/// Fewest neighbours that the stage takes; two make a plane, but no estimate of a surface.
pub(super) const MIN_NEIGHBORS: usize = 3;

/// How a normal is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Method {
    /// Least-squares height function z = ax + by + c over a first estimate: the mean normal of the
    /// Delaunay triangles around the point (the paper's Algorithm 1, after Várady).
    #[default]
    Varady,
    /// That first estimate alone (Vančo's second method).
    Delaunay,
    /// The plane of regression: the eigenvector of the smallest eigenvalue of the covariance
    /// (Vančo's first method).
    Pca,
    /// A height function of degree 2 over the first estimate of `varady`, and its normal at the
    /// point (Vančo's third method): for 5 neighbours or more.
    Quadric,
    /// The same of degree 3: for 9 neighbours or more.
    Cubic,
}

/// What a neighbour is that lies on the circle through the point and the two others of a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Cocircular {
    /// No corner: of a square the point has one triangle, with its two nearer corners.
    #[default]
    Out,
    /// A corner: of a square the point has two triangles.
    In,
}

impl Method {
    /// Fewest neighbours that it makes sense with.
    pub(super) fn fewest(self) -> usize {
        match self {
            Method::Varady | Method::Delaunay | Method::Pca => MIN_NEIGHBORS,
            Method::Quadric => 5,
            Method::Cubic => 9,
        }
    }

    /// True if it is a height function of degree 2 or 3, which is fitted point by point.
    pub(super) fn is_height(self) -> bool {
        matches!(self, Method::Quadric | Method::Cubic)
    }

    /// As in `normals.method`.
    pub(super) fn name(self) -> &'static str {
        match self {
            Method::Varady => "varady",
            Method::Delaunay => "delaunay",
            Method::Pca => "pca",
            Method::Quadric => "quadric",
            Method::Cubic => "cubic",
        }
    }
}

/// The outcome for one position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Estimate {
    /// The unit normal, its component of largest magnitude (the first of equal ones) positive.
    Normal([f32; 3]),
    /// Fewer than 3 distinct positions, or all on one line.
    None,
}

/// Why another method stood in for the one asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fallback {
    /// No Delaunay triangle around the point has an area in the plane of regression: `pca`.
    NoTriangle,
    /// The first estimate lies in the plane that it should be normal to: `pca`.
    Perpendicular,
    /// The positions do not determine the height function, or hardly: `varady`.
    IllConditioned,
}

/// What came of a neighbourhood.
pub type EstimateOutcome = (Estimate, Option<Fallback>);

/// How a neighbourhood lies about its surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SurfaceShape {
    /// The least eigenvalue of the covariance, as a part of their sum: 0 to 1/3.
    pub curvature: f64,
    /// Root mean square of the distances to the fitted surface, in steps.
    pub residual: f64,
}

impl SurfaceShape {
    /// Nothing is known.
    const NONE: SurfaceShape = SurfaceShape { curvature: f64::NAN, residual: f64::NAN };
}

/// The normal at a position whose neighbours are at `offsets` from it.
pub(super) fn alone(
    method: Method,
    star: &mut Star,
    offsets: &[[i64; 3]],
) -> (EstimateOutcome, SurfaceShape) {
    if offsets.len() < 2 || plane::collinear(offsets) {
        return ((Estimate::None, None), SurfaceShape::NONE);
    }
    let covariance = Covariance::of(offsets);
    let matrix = covariance.matrix();
    let (least, flat) = plane::smallest(matrix);
    let first = (method != Method::Pca).then(|| star.normal(offsets, flat)).flatten();
    let height = first.and_then(|first| match method {
        Method::Quadric => height::fitted(height::quadric, offsets, first),
        Method::Cubic => height::fitted(height::cubic, offsets, first),
        Method::Varady | Method::Delaunay | Method::Pca => None,
    });
    let (normal, fallback) = match (method, height) {
        (Method::Pca, _) => (flat, None),
        (_, Some(height)) => (height.normal, None),
        (_, None) => over_first(method, &covariance.adjugate(), flat, first),
    };
    let trace = matrix[0] + matrix[3] + matrix[5];
    // Distances to the plane through the centre of mass.
    let off = || plane::dot(normal, plane::product(&matrix, normal)).max(0.0).sqrt();
    let shape = SurfaceShape {
        curvature: (least / trace).clamp(0.0, 1.0 / 3.0),
        residual: height.map_or_else(off, |height| height.residual),
    };
    ((settled(normal), fallback), shape)
}

/// The normal over the first estimate n_f, where no height function of degree 2 or 3 is asked for
/// or determined: n_f itself by `delaunay`, else adj(C)·n_f, which is (−a, −b, 1) of the height
/// function over it, turned back from its frame; `flat`, the normal of the plane of regression,
/// where that fails.
pub(super) fn over_first(
    method: Method,
    adjugate: &[f64; 6],
    flat: [f64; 3],
    first: Option<[f64; 3]>,
) -> ([f64; 3], Option<Fallback>) {
    let Some(first) = first else { return (flat, Some(Fallback::NoTriangle)) };
    if method == Method::Delaunay {
        return (first, None);
    }
    match plane::unit(plane::product(adjugate, first)) {
        Some(normal) => (normal, method.is_height().then_some(Fallback::IllConditioned)),
        None => (flat, Some(Fallback::Perpendicular)),
    }
}

pub(super) fn settled(normal: [f64; 3]) -> Estimate {
    Estimate::Normal(plane::canonical(normal.map(|c| c as f32)))
}
