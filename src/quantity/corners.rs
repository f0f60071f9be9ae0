//! The corners of a box as people write them: four numbers, or six.

use serde::{Deserialize, Serialize};

use super::has_schema;

/// A box in world units, both of whose corners belong to it: `[x0, y0, x1, y1]`, or
/// `[x0, y0, z0, x1, y1, z1]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<f64>", into = "Vec<f64>")]
pub struct CropBox {
    lo: Vec<f64>,
    hi: Vec<f64>,
}

impl CropBox {
    /// The smallest coordinates, of two or three axes.
    pub fn lo(&self) -> &[f64] {
        &self.lo
    }

    /// The largest coordinates, of as many.
    pub fn hi(&self) -> &[f64] {
        &self.hi
    }
}

impl TryFrom<Vec<f64>> for CropBox {
    type Error = String;

    fn try_from(numbers: Vec<f64>) -> Result<Self, String> {
        const FORMS: &str = "[x0, y0, x1, y1] or [x0, y0, z0, x1, y1, z1]";
        if !matches!(numbers.len(), 4 | 6) {
            return Err(format!("a box has 4 or 6 numbers, not {}: {FORMS}", numbers.len()));
        }
        if let Some(wrong) = numbers.iter().find(|number| !number.is_finite()) {
            return Err(format!("a corner of a box is finite, and {wrong} is not"));
        }
        let (lo, hi) = numbers.split_at(numbers.len() / 2);
        for (axis, (lo, hi)) in ["x", "y", "z"].iter().zip(lo.iter().zip(hi)) {
            if lo > hi {
                return Err(format!(
                    "the box ends at {axis} = {hi}, before it begins at {lo}: it is {FORMS}"
                ));
            }
        }
        Ok(CropBox { lo: lo.to_vec(), hi: hi.to_vec() })
    }
}

impl From<CropBox> for Vec<f64> {
    fn from(of: CropBox) -> Vec<f64> {
        [of.lo, of.hi].concat()
    }
}

has_schema!(CropBox, "CropBox", {
    "title": "4 numbers, or 6",
    "anyOf": [
        { "type": "array", "items": { "type": "number" }, "minItems": 4, "maxItems": 4 },
        { "type": "array", "items": { "type": "number" }, "minItems": 6, "maxItems": 6 },
    ],
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_has_two_corners_in_their_order() {
        let read = |numbers: &[f64]| CropBox::try_from(numbers.to_vec());
        assert_eq!(read(&[1.0, 2.0, 1.0, 5.0]).unwrap().hi(), [1.0, 5.0]);
        assert_eq!(read(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap().lo(), [1.0, 2.0, 3.0]);
        for (wrong, told) in [
            (&[][..], "4 or 6 numbers, not 0"),
            (&[0.0; 5], "4 or 6 numbers, not 5"),
            (&[0.0, 3.0, 1.0, 2.0], "the box ends at y = 2, before it begins at 3"),
            (&[0.0, 0.0, 1.0, 9.0, 9.0, 0.5], "the box ends at z = 0.5, before it begins at 1"),
            (&[0.0, f64::NAN, 1.0, 2.0], "NaN is not"),
            (&[0.0, 0.0, f64::INFINITY, 2.0], "inf is not"),
        ] {
            let error = read(wrong).unwrap_err();
            assert!(error.contains(told), "{error}");
        }
    }
}
