//! Affine maps of space: a linear part and a translation, in world units.

use nalgebra::{Matrix3, Vector3};

use super::keys::{MatrixRows, Rotation, ScaleFactors};

/// Where points go: `linear` · p + `translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AffineMap {
    pub linear: Matrix3<f64>,
    pub translation: Vector3<f64>,
}

/// A determinant is 0 if it is less than this part of the product of the lengths of the rows.
const SINGULAR: f64 = 1e-12;

impl AffineMap {
    /// That of a matrix.
    ///
    /// # Errors
    ///
    /// A matrix that is not affine, or that puts all points into a plane; as half a sentence.
    pub fn of_matrix(MatrixRows(rows): MatrixRows) -> Result<Self, String> {
        if rows[3] != [0.0, 0.0, 0.0, 1.0] {
            return Err(format!(
                "the last row of an affine matrix is [0, 0, 0, 1], not {:?}: the matrix is given \
                 by rows",
                rows[3]
            ));
        }
        let linear = Matrix3::from_fn(|row, column| rows[row][column]);
        let lengths: f64 = linear.row_iter().map(|row| row.norm()).product();
        if linear.determinant().abs() <= SINGULAR * lengths {
            return Err("the matrix puts all points into a plane".to_owned());
        }
        Ok(AffineMap { linear, translation: Vector3::from_fn(|row, _| rows[row][3]) })
    }

    /// That which scales, then rotates, both about `center`, and then translates.
    pub fn of_steps(
        scale: Option<ScaleFactors>,
        rotate: Option<Rotation>,
        center: [f64; 3],
        translate: [f64; 3],
    ) -> Self {
        let scale = scale.map_or([1.0; 3], |factors| factors.0);
        let rotation = rotate.map_or_else(Matrix3::identity, rotation);
        let linear = rotation * Matrix3::from_diagonal(&Vector3::from(scale));
        let translation = match linear == Matrix3::identity() {
            // Not by way of the centre, which would round it.
            true => Vector3::from(translate),
            false => {
                Vector3::from(center) - linear * Vector3::from(center) + Vector3::from(translate)
            }
        };
        AffineMap { linear, translation }
    }

    /// Where a point goes.
    pub fn of(&self, point: [f64; 3]) -> [f64; 3] {
        (self.linear * Vector3::from(point) + self.translation).into()
    }
}

/// The matrix of a turn about an axis (Rodrigues' formula).
fn rotation(Rotation { axis, angle }: Rotation) -> Matrix3<f64> {
    let (sine, cosine) = angle.sine_and_cosine();
    let axis = Vector3::from(axis.0).normalize();
    Matrix3::identity() * cosine
        + axis.cross_matrix() * sine
        + axis * axis.transpose() * (1.0 - cosine)
}
