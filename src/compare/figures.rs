//! The figures that rules of a comparison are on, by their names, and what bounds them.

use std::ops::Range;

use super::clouds::{CloudDistances, CloudFigures, NormalAngles};
use super::depth::DepthErrors;
use super::same::RecordsComparison;
use crate::expression::ExpressionFault;
use crate::quantity::Length;
use crate::report::{angle, length};

/// What a figure is of.
#[derive(Debug, Clone, Copy)]
pub(super) enum FigureWord {
    Distance(CloudWord),
    Normals(CloudWord),
    Depth(DepthWord),
}

/// What bounds a figure.
#[derive(Debug, Clone, Copy)]
pub(super) enum RuleBound {
    Length(Length),
    /// In degrees.
    Angle(f64),
    /// In the square of the scan's unit.
    Squares(f64),
}

/// What there is to judge.
pub(super) struct Judged<'a> {
    pub records: &'a RecordsComparison,
    pub distances: Option<&'a CloudDistances>,
    pub normals: Option<&'a NormalAngles>,
    pub depth: Option<&'a DepthErrors>,
}

/// A figure of distances or of angles.
type CloudWord = fn(&CloudFigures) -> f64;
/// A figure of depth images.
type DepthWord = fn(&DepthErrors) -> f64;

const CLOUDS: [(&str, CloudWord); 6] = [
    ("max", |figures| figures.max),
    ("mean", |figures| figures.mean),
    ("rms", |figures| figures.rms),
    ("p50", |figures| figures.p50),
    ("p95", |figures| figures.p95),
    ("p99", |figures| figures.p99),
];

/// What stands before figures of normals and of depth images.
const NORMALS: &str = "normals.";
const DEPTH: &str = "depth.";

const DEPTHS: [(&str, DepthWord); 4] = [
    ("rms", |errors| errors.rms),
    ("mean", |errors| errors.mean),
    ("max", |errors| errors.max),
    (SSD, |errors| errors.ssd),
];
/// The one that is no length but a sum of squares.
const SSD: &str = "ssd";

impl FigureWord {
    /// The figure of this name.
    pub fn named(name: &str) -> Option<FigureWord> {
        let (of_normals, of_depth) = (name.strip_prefix(NORMALS), name.strip_prefix(DEPTH));
        let cloud = |name: &str| CLOUDS.iter().find(|(known, _)| *known == name);
        match (of_normals, of_depth) {
            (Some(name), _) => Some(FigureWord::Normals(cloud(name)?.1)),
            (_, Some(name)) => {
                let (_, figure) = DEPTHS.iter().find(|(known, _)| *known == name)?;
                Some(FigureWord::Depth(*figure))
            }
            (None, None) => Some(FigureWord::Distance(cloud(name)?.1)),
        }
    }

    /// All names.
    pub fn names() -> impl Iterator<Item = String> {
        let clouds = CLOUDS.iter().map(|(name, _)| (*name).to_owned());
        let normals = CLOUDS.iter().map(|(name, _)| format!("{NORMALS}{name}"));
        clouds.chain(normals).chain(DEPTHS.iter().map(|(name, _)| format!("{DEPTH}{name}")))
    }

    /// What it comes to.
    pub fn of(self, all: &Judged<'_>) -> Option<f64> {
        match self {
            FigureWord::Distance(figure) => all.distances?.larger(figure),
            FigureWord::Normals(figure) => all.normals?.larger(figure),
            FigureWord::Depth(figure) => all.depth.map(figure),
        }
    }

    /// Of how many points it is, and how many of these it leaves out as they have no angle, where
    /// there are such.
    pub fn left_out(self, all: &Judged<'_>) -> Option<[u64; 2]> {
        let FigureWord::Normals(_) = self else { return None };
        all.normals.map(NormalAngles::without).filter(|[_, without]| *without > 0)
    }

    /// The bound that stands behind it.
    pub fn bound(
        self,
        name: &str,
        text: &str,
        place: Range<usize>,
    ) -> Result<RuleBound, ExpressionFault> {
        match self {
            FigureWord::Normals(_) => {
                angle(name, text, place).map(|angle| RuleBound::Angle(angle.in_degrees()))
            }
            FigureWord::Depth(_) if name.ends_with(SSD) => {
                let number = text.parse().ok().filter(|v: &f64| v.is_finite() && *v > 0.0);
                number.map(RuleBound::Squares).ok_or_else(|| {
                    let told = format!("`{name}` is bounded by a number above 0");
                    let help = "write it in the square of the scan's unit";
                    ExpressionFault::new(place, told).help(help)
                })
            }
            _ => length(name, text, place).map(RuleBound::Length),
        }
    }
}

impl RuleBound {
    /// In the unit that figures are in.
    pub fn value(self) -> f64 {
        match self {
            RuleBound::Length(length) => length.value(),
            RuleBound::Angle(value) | RuleBound::Squares(value) => value,
        }
    }

    /// The sign of its unit.
    pub fn unit(self, all: &Judged<'_>) -> Option<&'static str> {
        match self {
            RuleBound::Length(_) => all.distances.and_then(|distances| distances.unit),
            RuleBound::Angle(_) => Some("deg"),
            RuleBound::Squares(_) => None,
        }
    }
}

/// A bound as an example, for the figure of this name.
pub(super) fn example(name: &str) -> &'static str {
    match name {
        _ if name.starts_with(NORMALS) => "5deg",
        _ if name.ends_with(SSD) => "0.5",
        _ => "5mm",
    }
}
