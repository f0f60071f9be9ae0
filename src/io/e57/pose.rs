//! Where a scan is: a turn, as a quaternion, then a shift (ASTM E2807, 8.4.14).

use e57::Transform;

/// The pose of a scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pose {
    /// Rows of the matrix that turns.
    turn: [[f64; 3]; 3],
    shift: [f64; 3],
}

impl Pose {
    /// None where it changes nothing, or is no pose; the quaternion need not be of length 1.
    pub fn of(transform: &Transform) -> Option<Pose> {
        let q = &transform.rotation;
        let (w, x, y, z) = (q.w, q.x, q.y, q.z);
        let square = w * w + x * x + y * y + z * z;
        let t = &transform.translation;
        let shift = [t.x, t.y, t.z];
        let is_one = (x, y, z) == (0.0, 0.0, 0.0) && w != 0.0;
        if is_one && shift == [0.0; 3] {
            return None;
        }
        let s = 2.0 / square;
        let turn = [
            [1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y)],
        ];
        Some(Pose { turn, shift })
    }

    /// True if it has numbers alone.
    pub fn is_finite(&self) -> bool {
        self.turn.as_flattened().iter().chain(&self.shift).all(|v| v.is_finite())
    }

    /// Where a point of the scan is in the coordinates of all.
    pub fn placed(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let row = |i: usize| {
            let [a, b, c] = self.turn[i];
            a * x + b * y + c * z + self.shift[i]
        };
        [row(0), row(1), row(2)]
    }

    /// As [`placed`](Self::placed), for a direction.
    pub fn turned(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        self.turn.map(|[a, b, c]| a * x + b * y + c * z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use e57::{Quaternion, Translation};

    fn pose(w: f64, z: f64, x: f64) -> Option<Pose> {
        let rotation = Quaternion { w, x: 0.0, y: 0.0, z };
        Pose::of(&Transform { rotation, translation: Translation { x, y: 0.0, z: 0.0 } })
    }

    #[test]
    fn a_quarter_turn_and_a_shift_move_points_and_turn_directions() {
        // A quaternion that is twice as long as it should be.
        let quarter = pose(2.0, 2.0, 10.0).unwrap();
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-15);
        assert!(near(quarter.placed([1.0, 2.0, 3.0]), [8.0, 1.0, 3.0]));
        assert!(near(quarter.turned([1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]));
        assert_eq!(pose(1.0, 0.0, 0.0), None);
        assert!(!pose(0.0, 0.0, 1.0).unwrap().is_finite());
    }
}
