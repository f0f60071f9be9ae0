//! Angles of normals to a direction, compared by their cosines: no arc cosine decides anything,
//! because platform libraries differ in its last bits. Knows no tiles, no files.

/// True if a normal is one: positions without are marked by NaN.
pub fn is_known(normal: [f32; 3]) -> bool {
    normal.iter().all(|component| component.is_finite())
}

/// cos θ of the angle θ between the unit vector `reference` and `normal` (turned around first if
/// `turned`), in [−1, 1]. A normal and its turned opposite have exactly the same cosine.
pub fn cosine(reference: [f64; 3], normal: [f32; 3], turned: bool) -> f64 {
    let [x, y, z] = normal.map(f64::from);
    let dot = (reference[0] * x + reference[1] * y + reference[2] * z).clamp(-1.0, 1.0);
    // Adding 0 makes −0 a 0, so that total order and equality agree.
    (if turned { -dot } else { dot }) + 0.0
}

/// cos(θ_max − θ_min), given cos θ_min ≥ cos θ_max, as
/// cos θ_max · cos θ_min + sin θ_max · sin θ_min; infinite where both are equal. Smaller values are
/// wider ranges; ranges below about 1e-8 rad cannot be told from none.
pub fn range(cos_theta_min: f64, cos_theta_max: f64) -> f64 {
    if cos_theta_min > cos_theta_max {
        cos_theta_min * cos_theta_max + sine(cos_theta_min) * sine(cos_theta_max)
    } else {
        f64::INFINITY
    }
}

/// sin² θ of the angle θ between the line along `axis` (of any length) and `normal`, in [0, 1]:
/// exact to a few roundings for small θ too, where the cosine of a normal that was rounded tells
/// little. Signs do not matter.
pub fn sine2(axis: [f64; 3], normal: [f32; 3]) -> f64 {
    let [x, y, z] = normal.map(f64::from);
    let [ax, ay, az] = axis;
    let squared = |x: f64, y: f64, z: f64| x * x + y * y + z * z;
    let lengths2 = squared(ax, ay, az) * squared(x, y, z);
    if lengths2 > 0.0 {
        (squared(ay * z - az * y, az * x - ax * z, ax * y - ay * x) / lengths2).min(1.0)
    } else {
        0.0
    }
}

/// cos 2θ of a θ in [0, π/2] from sin² θ: what [`range`] is for a cone of half angle θ.
pub fn cone(sine2: f64) -> f64 {
    1.0 - 2.0 * sine2
}

/// `v` at length 1; none if it is 0 or not finite. Whatever the size of its components.
pub fn direction(v: [f64; 3]) -> Option<[f64; 3]> {
    let size = v[largest(v)].abs();
    let scaled = v.map(|c| c / size);
    let length = scaled.iter().map(|c| c * c).sum::<f64>().sqrt();
    // NaN where a component is NaN or infinite, or all are 0. Adding 0 makes −0 a 0.
    length.is_finite().then(|| scaled.map(|c| c / length + 0.0))
}

/// The widest range of angles that counts as agreement, prepared for comparing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaxAngle {
    cosine: f64,
}

impl MaxAngle {
    /// The range 0: everything that can be told from it exceeds it.
    pub const NONE: MaxAngle = MaxAngle { cosine: 1.0 };

    /// The range `radians`, in [0, π].
    pub fn new(radians: f64) -> Self {
        MaxAngle { cosine: libm::cos(radians) }
    }

    /// The range whose cosine is `cosine`.
    pub fn of_cosine(cosine: f64) -> Self {
        MaxAngle { cosine }
    }

    /// Its cosine.
    pub fn cosine(self) -> f64 {
        self.cosine
    }

    /// It in radians, for [`new`](MaxAngle::new): rounded up, so that it exceeds no less than this.
    pub fn radians(self) -> f64 {
        let mut radians = libm::acos(self.cosine.clamp(-1.0, 1.0));
        // An arc cosine errs by a rounding or two.
        for _ in 0..8 {
            if libm::cos(radians) <= self.cosine {
                break;
            }
            radians = radians.next_up();
        }
        radians
    }

    /// True if `range`, as [`range`] and [`cone`] give it, is larger.
    pub fn is_exceeded_by(self, range: f64) -> bool {
        range < self.cosine
    }

    /// True if θ_max − θ_min is larger, given cos θ_min ≥ cos θ_max.
    pub fn is_exceeded(self, cos_theta_min: f64, cos_theta_max: f64) -> bool {
        self.is_exceeded_by(range(cos_theta_min, cos_theta_max))
    }
}

/// sin θ of a θ in [0, π] from its cosine.
fn sine(cosine: f64) -> f64 {
    (1.0 - cosine * cosine).max(0.0).sqrt()
}

/// Σ nnᵀ of normals, whatever their signs: xx, xy, xz, yy, yz, zz. Summed in the order given.
pub fn outer_sum(normals: impl Iterator<Item = [f32; 3]>) -> [f64; 6] {
    normals.fold([0.0; 6], |mut sum, normal| {
        let [x, y, z] = normal.map(f64::from);
        for (entry, product) in sum.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
            *entry += product;
        }
        sum
    })
}

/// Squarings after which [`dominant_axis`] stops: eigenvalues that agree to 1e-8 count as equal.
const SQUARINGS: usize = 32;
/// Trace of the square over the square of the trace at which nothing but the largest eigenvalue is
/// left in the square: the others are at most 1e-16 of it.
const CONVERGED: f64 = 1.0 - 1e-8;

/// Direction (of no particular length) of an eigenvector of the largest eigenvalue of a positive
/// semidefinite symmetric matrix (xx, xy, xz, yy, yz, zz), its largest component positive (of equal
/// ones the first). Where the largest eigenvalue is multiple, one of its eigenvectors; zero for the
/// zero matrix.
///
/// The matrix is squared until one eigenvalue is left: every column is then an eigenvector, also
/// where two eigenvalues are equal, and the cells of agreeing normals need three or four squarings.
pub fn dominant_axis(matrix: [f64; 6]) -> [f64; 3] {
    let trace = matrix[0] + matrix[3] + matrix[5];
    if trace <= 0.0 {
        return [0.0; 3];
    }
    let mut m = matrix.map(|entry| entry / trace);
    let mut trace = 1.0;
    for _ in 0..SQUARINGS {
        let [xx, xy, xz, yy, yz, zz] = m;
        let square = [
            xx * xx + xy * xy + xz * xz,
            xx * xy + xy * yy + xz * yz,
            xx * xz + xy * yz + xz * zz,
            xy * xy + yy * yy + yz * yz,
            xy * xz + yy * yz + yz * zz,
            xz * xz + yz * yz + zz * zz,
        ];
        let before = trace;
        (m, trace) = (square, square[0] + square[3] + square[5]);
        if trace >= CONVERGED * (before * before) {
            break;
        }
        // A square's trace is a third of the trace's square or more: rare, and far from underflow.
        if trace < 1e-60 {
            m = m.map(|entry| entry / trace);
            trace = 1.0;
        }
    }
    let [xx, xy, xz, yy, yz, zz] = m;
    let columns = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let axis = columns[largest([xx, yy, zz])];
    if axis[largest(axis)] < 0.0 { axis.map(|v| -v) } else { axis }
}

/// The component of largest magnitude, of equal ones the first.
fn largest(v: [f64; 3]) -> usize {
    let [x, y, z] = v.map(f64::abs);
    if x >= y && x >= z {
        0
    } else if y >= z {
        1
    } else {
        2
    }
}

/// True if `normal` is to be turned around to lie on the side of `axis`; one that is exactly
/// perpendicular to it is turned so that its largest component is positive.
pub fn is_turned(axis: [f64; 3], normal: [f32; 3]) -> bool {
    let n = normal.map(f64::from);
    let dot = axis[0] * n[0] + axis[1] * n[1] + axis[2] * n[2];
    if dot == 0.0 { n[largest(n)] < 0.0 } else { dot < 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unit() -> impl Strategy<Value = [f32; 3]> {
        proptest::array::uniform3(-1.0f64..1.0).prop_filter_map("length", |v| {
            let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
            (length > 0.1).then(|| v.map(|c| (c / length) as f32))
        })
    }

    fn column(m: [f64; 6], v: [f64; 3]) -> [f64; 3] {
        [
            m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
            m[1] * v[0] + m[3] * v[1] + m[4] * v[2],
            m[2] * v[0] + m[4] * v[1] + m[5] * v[2],
        ]
    }

    proptest! {
        #[test]
        fn the_range_test_is_that_of_arc_cosines(
            a in unit(), b in unit(), n in unit(), delta in 0.0f64..3.2,
        ) {
            let delta = delta.min(std::f64::consts::PI);
            let n = n.map(f64::from);
            let (a, b) = (cosine(n, a, false), cosine(n, b, false));
            let range = (a.acos() - b.acos()).abs();
            prop_assume!((range - delta).abs() > 1e-6);
            prop_assert_eq!(MaxAngle::new(delta).is_exceeded(a.max(b), a.min(b)), range > delta);
        }

        #[test]
        fn a_turned_normal_has_the_cosine_of_its_opposite(n in unit(), reference in unit()) {
            let reference = reference.map(f64::from);
            let opposite = n.map(|v| -v);
            let [turned, plain] = [cosine(reference, n, true), cosine(reference, opposite, false)];
            prop_assert_eq!(turned.to_bits(), plain.to_bits());
        }

        #[test]
        fn the_axis_is_an_eigenvector_of_the_largest_eigenvalue(
            normals in prop::collection::vec(unit(), 1..9),
        ) {
            let m = outer_sum(normals.iter().copied());
            let axis = dominant_axis(m);
            let length2: f64 = axis.iter().map(|v| v * v).sum();
            let image = column(m, axis);
            let value = (0..3).map(|i| image[i] * axis[i]).sum::<f64>() / length2;
            for i in 0..3 {
                prop_assert!((image[i] - value * axis[i]).abs() < 1e-7 * value * length2.sqrt());
            }
            for n in normals {
                let product = column(m, n.map(f64::from));
                let quotient = (0..3).map(|i| product[i] * f64::from(n[i])).sum::<f64>();
                prop_assert!(quotient <= value * (1.0 + 1e-6));
            }
            prop_assert!(axis[largest(axis)] > 0.0);
        }
    }

    #[test]
    fn equal_angles_have_no_range_even_for_zero() {
        for c in [-1.0, -0.7, 0.0, 0.1, 0.999_999_9, 1.0] {
            assert!(!MaxAngle::new(0.0).is_exceeded(c, c));
        }
        assert!(MaxAngle::new(0.0).is_exceeded(0.5, 0.499_999_9));
        assert!(!MaxAngle::new(std::f64::consts::PI).is_exceeded(1.0, -1.0));
    }

    #[test]
    fn an_axis_of_equal_eigenvalues_is_in_their_plane() {
        let axis = dominant_axis(outer_sum([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]].into_iter()));
        assert_eq!((axis[0], axis[1], axis[2]), (0.5, 0.0, 0.0));
        assert_eq!(dominant_axis([0.0; 6]), [0.0; 3]);
    }

    #[test]
    fn a_perpendicular_normal_keeps_its_largest_component_positive() {
        let x = [1.0, 0.0, 0.0];
        assert!(is_turned(x, [0.0, -0.8, 0.6]));
        assert!(!is_turned(x, [0.0, 0.8, -0.6]));
        assert!(is_turned(x, [-0.1, 0.9, 0.0]));
    }
}
