//! What the tests of normals share: solvers written another way.
#![allow(clippy::needless_range_loop, reason = "matrices read best by index")]

pub type Vec3 = [f64; 3];

pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn normalised(v: Vec3) -> Vec3 {
    let length = dot(v, v).sqrt();
    v.map(|c| c / length)
}

/// Angle between two lines, 0 to π/2.
pub fn angle(a: Vec3, b: Vec3) -> f64 {
    let c = cross(a, b);
    dot(c, c).sqrt().atan2(dot(a, b).abs())
}

/// A right-handed frame whose third axis is `axis`.
pub fn frame(axis: Vec3) -> [Vec3; 3] {
    let helper = if axis[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let u = normalised(cross(helper, axis));
    [u, cross(axis, u), axis]
}

/// Eigenvalues (ascending) and unit eigenvectors of a symmetric matrix, by cyclic Jacobi rotations.
pub fn jacobi(mut a: [[f64; 3]; 3]) -> [(f64, Vec3); 3] {
    let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..40 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            for row in &mut a {
                (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
            }
            for i in 0..3 {
                (a[p][i], a[q][i]) = (c * a[p][i] - s * a[q][i], s * a[p][i] + c * a[q][i]);
            }
            for row in &mut v {
                (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
            }
        }
    }
    let mut pairs: [(f64, Vec3); 3] =
        std::array::from_fn(|i| (a[i][i], [v[0][i], v[1][i], v[2][i]]));
    pairs.sort_by(|x, y| x.0.total_cmp(&y.0));
    pairs
}

/// Covariance about the mean of `offsets` and 0, computed in the textbook order.
pub fn covariance(offsets: &[[i64; 3]]) -> [[f64; 3]; 3] {
    let mut points: Vec<Vec3> = offsets.iter().map(|o| o.map(|c| c as f64)).collect();
    points.push([0.0; 3]);
    let n = points.len() as f64;
    let mean: Vec3 = std::array::from_fn(|i| points.iter().map(|p| p[i]).sum::<f64>() / n);
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            points.iter().map(|p| (p[i] - mean[i]) * (p[j] - mean[j])).sum::<f64>() / n
        })
    })
}

/// Least squares z = ax + by + c by the normal equations and Cramer's rule, in the frame of `axis`;
/// the normal (−a, −b, 1) turned back.
pub fn rotated_fit(offsets: &[[i64; 3]], axis: Vec3) -> Vec3 {
    let [u, v, w] = frame(axis);
    let mut points: Vec<Vec3> = offsets
        .iter()
        .map(|o| o.map(|c| c as f64))
        .map(|o| [dot(o, u), dot(o, v), dot(o, w)])
        .collect();
    points.push([0.0; 3]);
    let n = points.len() as f64;
    let mean: Vec3 = std::array::from_fn(|i| points.iter().map(|p| p[i]).sum::<f64>() / n);
    let sum = |i: usize, j: usize| -> f64 {
        points.iter().map(|p| (p[i] - mean[i]) * (p[j] - mean[j])).sum()
    };
    let (xx, xy, yy, xz, yz) = (sum(0, 0), sum(0, 1), sum(1, 1), sum(0, 2), sum(1, 2));
    let determinant = xx * yy - xy * xy;
    let a = (xz * yy - yz * xy) / determinant;
    let b = (yz * xx - xz * xy) / determinant;
    normalised(std::array::from_fn(|i| w[i] - a * u[i] - b * v[i]))
}

/// `k` points around p on a surface z = height(x, y) of the frame, with x and y within `size`,
/// distinct, none of them 0.
pub fn around(
    k: usize,
    size: f64,
    axes: [Vec3; 3],
    mut place: impl FnMut() -> (f64, f64),
    height: impl Fn(f64, f64) -> f64,
) -> Vec<[i64; 3]> {
    let mut offsets: Vec<[i64; 3]> = Vec::new();
    while offsets.len() < k {
        let (x, y) = place();
        let (x, y) = (x * size, y * size);
        let z = height(x, y) - height(0.0, 0.0);
        let offset = std::array::from_fn(|i| {
            (x * axes[0][i] + y * axes[1][i] + z * axes[2][i]).round() as i64
        });
        if offset != [0; 3] && !offsets.contains(&offset) {
            offsets.push(offset);
        }
    }
    offsets
}
