//! To which side normals point.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geom::lattice::Lattice;
use crate::geom::plane::dot;
use crate::point::Position;

/// To which side normals point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Orient {
    /// No side: the sign means nothing, and the component of largest magnitude is positive. `cells`
    /// turns the normals of each cell to one side.
    #[default]
    None,
    /// Upwards: z above 0; where z is 0, y above 0; where both are, x.
    Up,
    /// Towards `viewpoint`, of a scanner for example; across the line of sight as with none.
    Viewpoint,
}

/// The rule by which signs are settled, on the lattice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::ops) enum SignRule {
    /// Any.
    Any,
    /// Upwards.
    Up,
    /// Towards a point: whole lattice steps, and what is beyond them.
    Towards([i128; 3], [f64; 3]),
}

impl SignRule {
    /// Towards `viewpoint`, in world units.
    pub(in crate::ops) fn towards(viewpoint: [f64; 3], lattice: &Lattice) -> SignRule {
        let stretched = [1.0, 1.0, lattice.z_scale()];
        let steps: [f64; 3] = std::array::from_fn(|axis| {
            (viewpoint[axis] - lattice.shift[axis]) * stretched[axis] / lattice.step
        });
        // 2^100 steps are beyond every lattice, and leave room for differences.
        let whole = steps.map(|v| v.round().clamp(-FARTHEST, FARTHEST));
        let rest = std::array::from_fn(|axis| (steps[axis] - whole[axis]).clamp(-0.5, 0.5));
        SignRule::Towards(whole.map(|v| v as i128), rest)
    }

    /// `normal`, at position `p`, turned to the side. Comes with its canonical sign, which it keeps
    /// where it lies on the border.
    pub(in crate::ops) fn settled(&self, normal: [f32; 3], p: Position) -> [f32; 3] {
        let turned = match self {
            SignRule::Any => false,
            SignRule::Up => {
                let [x, y, z] = normal;
                let first = [z, y, x].into_iter().find(|c| *c != 0.0);
                first.is_some_and(|c| c < 0.0)
            }
            SignRule::Towards(whole, rest) => {
                // Differences are exact before they are rounded, however far from world 0.
                let sight: [f64; 3] = std::array::from_fn(|axis| {
                    (whole[axis] - i128::from(p[axis])) as f64 + rest[axis]
                });
                dot(normal.map(f64::from), sight) < 0.0
            }
        };
        // −0 + 0 = 0
        if turned { normal.map(|c| -c + 0.0) } else { normal }
    }
}

/// 2^100.
const FARTHEST: f64 = (1u128 << 100) as f64;
