//! The stage `transform`: points are moved, turned and scaled.

mod affine;
mod keys;
mod stored;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::point::{PointBatch, Schema, names};
use crate::quantity::Figure;
use crate::report::Tally;
use crate::stage::{Needs, Role, RoleName, StageKind, StagePlace, Transform};
use crate::{Error, Result};

pub use keys::{MatrixRows, Rotation, RotationAxis, ScaleFactors};

use affine::AffineMap;
use stored::StoredMap;

/// Moves, turns and scales a scan.
///
/// Give `matrix`, or any of `scale`, `rotate` and `translate`, which are done in this order, the
/// first two about `center`. All other bytes of the records stay as they are: normals that the
/// input has are not turned. The output keeps the coordinate reference system of the input, which
/// may not hold any more; the run says so.
///
/// LAS coordinates are whole steps of a scale from an offset. Where an axis comes from one other
/// alone (moved, scaled, turned by a quarter), the stored numbers stay, up to a sign, and scale and
/// offset change instead: nothing is rounded. Else steps are as fine as the finest of the input
/// times how much that axis grows, the offset is the image of the old one in whole thousands of
/// steps, and a coordinate is rounded to the nearest step, which the run says. A point that is out
/// of reach of such numbers ends the run. Floating-point coordinates are computed in double
/// precision and rounded once.
///
/// Points move before anything looks at where they are, so this stands above stages that work on
/// tiles and above branches. Stages below it, such as `crop`, see points where they have gone.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Transformation {
    /// An affine matrix by its rows: 16 numbers, or 4 lists of 4; the last row is [0, 0, 0, 1].
    pub matrix: Option<MatrixRows>,
    /// By what x, y and z are multiplied: a number, or one for each.
    pub scale: Option<ScaleFactors>,
    /// A turn: its `axis` ("x", "y", "z" or a direction) and its `angle` ("30 deg", or radians).
    pub rotate: Option<Rotation>,
    /// The point that `scale` and `rotate` leave where it is; none: the origin.
    pub center: Option<[f64; 3]>,
    /// By how much points are moved along x, y and z.
    pub translate: Option<[f64; 3]>,
}

/// The stage with its map.
struct Moving(AffineMap);

impl Transformation {
    /// Where points go, or the key to blame and why.
    fn map(self) -> Result<AffineMap, (&'static str, Error)> {
        let Transformation { matrix, scale, rotate, center, translate } = self;
        let wrong = |key, told: &str, help: &str| Err((key, Error::pipeline(told).help(help)));
        for (key, point) in [("center", center), ("translate", translate)] {
            if point.is_some_and(|point| !point.iter().all(|v| v.is_finite())) {
                let told = format!("`transform.{key}` has a number that is not finite");
                return Err((key, Error::pipeline(told)));
            }
        }
        let is_turned = scale.is_some() || rotate.is_some();
        match matrix {
            Some(_) if is_turned || center.is_some() || translate.is_some() => wrong(
                "matrix",
                "`transform.matrix` says all of where points go",
                "leave `scale`, `rotate`, `center` and `translate` out, or `matrix`",
            ),
            Some(matrix) => AffineMap::of_matrix(matrix)
                .map_err(|told| ("matrix", Error::pipeline(format!("`transform.matrix`: {told}")))),
            None if center.is_some() && !is_turned => wrong(
                "center",
                "`transform.center` is what `scale` and `rotate` leave in its place, and neither \
                 is given",
                "leave `center` out",
            ),
            None if !is_turned && translate.is_none() => wrong(
                "matrix",
                "`transform` does not say where points go",
                "for example `transform.translate = [0, 0, -100]`",
            ),
            None => {
                let [center, translate] = [center, translate].map(Option::unwrap_or_default);
                Ok(AffineMap::of_steps(scale, rotate, center, translate))
            }
        }
    }
}

impl StageKind for Transformation {
    const KIND: &'static str = "transform";
    const ABOUT: &'static str = "Moves, turns and scales the points.";
    const ROLE: RoleName = RoleName::Transform;
    const IS_LIMITED: bool = false;

    fn build(self, at: &StagePlace) -> Result<Role> {
        let map = self.map().map_err(|(key, error)| at.blame(key, error))?;
        Ok(Role::Transform(Box::new(Moving(map))))
    }
}

impl Transform for Moving {
    fn needs(&self) -> Needs {
        Needs::none().looks_at(names::XYZ).changes(names::XYZ)
    }

    fn leaves(&self, schema: &Schema) -> Result<Option<Schema>> {
        Ok(StoredMap::of(&self.0, schema)?.schema(schema))
    }

    fn warnings(&self, schema: &Schema) -> Vec<String> {
        let Ok(map) = StoredMap::of(&self.0, schema) else { return Vec::new() };
        let each = map.rounding().into_iter().zip(names::XYZ);
        let told: Vec<String> = each
            .filter_map(|(most, axis)| Some((most.filter(|most| *most > 0.0)?, axis)))
            .map(|(most, axis)| format!("{axis} by {} at most", Figure(most)))
            .collect();
        match told.is_empty() {
            true => Vec::new(),
            false => vec![format!("`transform` rounds coordinates: {}", told.join(", "))],
        }
    }

    fn apply(&self, batch: &mut PointBatch, _tally: &mut Tally) -> Result<()> {
        let schema = batch.schema().clone();
        let map = StoredMap::of(&self.0, &schema)?;
        let mut records = batch.records_mut().chunks_exact_mut(schema.stride);
        records.try_for_each(|record| map.apply(record, &schema))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(text: &str) -> Option<(&'static str, String)> {
        let read = toml::from_str::<Transformation>(text).unwrap();
        read.map().err().map(|(key, error)| (key, error.to_string()))
    }

    #[test]
    fn what_says_nothing_or_too_much_is_refused_with_the_key() {
        let rows = "matrix = [[1,0,0,5],[0,1,0,6],[0,0,1,7],[0,0,0,1]]\n";
        for (text, key) in [
            (rows, None),
            ("translate = [1, 2, 3]", None),
            ("rotate = {axis = 'z', angle = '30 deg'}\ncenter = [1, 2, 3]", None),
            ("scale = 2\ntranslate = [1, 2, 3]", None),
            ("", Some("matrix")),
            ("center = [1, 2, 3]", Some("center")),
            ("center = [1, 2, 3]\ntranslate = [1, 2, 3]", Some("center")),
            ("translate = [1, nan, 3]", Some("translate")),
            (&(rows.to_owned() + "scale = 2"), Some("matrix")),
            ("matrix = [[1,0,0,5],[0,1,0,6],[0,0,1,7],[0,0,1,1]]", Some("matrix")),
            ("matrix = [[1,0,0,0],[0,1,0,0],[1,1,0,0],[0,0,0,1]]", Some("matrix")),
        ] {
            assert_eq!(told(text).map(|(key, _)| key), key, "{text}");
        }
        let by_columns = "matrix = [1,0,0,0, 0,1,0,0, 0,0,1,0, 5,6,7,1]";
        let (_, message) = told(by_columns).unwrap();
        assert!(message.contains("is [0, 0, 0, 1], not [5.0, 6.0, 7.0, 1.0]"), "{message}");
    }
}
