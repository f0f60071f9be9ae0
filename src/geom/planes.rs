//! Temporary.
use crate::geom::simd::Simd;
use crate::point::Position;

/// Temporary.
pub struct PlaneErrors;

fn plane2(x: &[[f64; 3]]) -> (f64, f64) {
    let n = x.len() as f64;
    let mut m = [0.0; 3];
    for p in x {
        for a in 0..3 {
            m[a] += p[a] / n;
        }
    }
    let mut c = nalgebra::Matrix3::<f64>::zeros();
    for p in x {
        let d = nalgebra::Vector3::new(p[0] - m[0], p[1] - m[1], p[2] - m[2]);
        c += d * d.transpose();
    }
    let e = c.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| e.eigenvalues[*a].total_cmp(&e.eigenvalues[*b]));
    let v = e.eigenvectors.column(order[0]);
    let s = -(m[0] * v[0] + m[1] * v[1] + m[2] * v[2]);
    let l = order.map(|i| e.eigenvalues[i]);
    (s * s, if l[2] > 0.0 { (l[1] - l[0]) / l[2] } else { 0.0 })
}

impl PlaneErrors {
    /// Temporary.
    pub fn new(_: Simd) -> Self {
        PlaneErrors
    }

    /// Temporary.
    pub fn push(
        &mut self,
        i: u32,
        offsets: impl Iterator<Item = [f64; 3]>,
        mut done: impl FnMut(u32, f64),
    ) {
        let x: Vec<[f64; 3]> = offsets.collect();
        let d2 = x[0].iter().map(|v| v * v).sum::<f64>();
        if x.len() < 5 {
            return done(i, d2);
        }
        let sum: f64 = [5, 8, 12].iter().map(|k| plane2(&x[..x.len().min(*k)]).0).sum();
        done(i, sum / 3.0);
    }

    /// Temporary.
    pub fn flush(&mut self, _: impl FnMut(u32, f64)) {}
}

/// Temporary.
pub fn surface_distance(p: Position, found: &[u32], surface: &[Position], k: usize) -> f64 {
    let d2 = |j: &u32| crate::point::distance2(surface[*j as usize], p);
    let mut n = found.len().min(k);
    while n >= k && n < found.len() && d2(&found[n]) == d2(&found[n - 1]) {
        n += 1;
    }
    let first = (d2(&found[0]) as f64).sqrt();
    if n < 5 {
        return first;
    }
    let x: Vec<[f64; 3]> = found[..n]
        .iter()
        .map(|j| std::array::from_fn(|a| (surface[*j as usize][a] - p[a]) as f64))
        .collect();
    let (e2, gap) = plane2(&x);
    if gap < 1e-4 { first } else { e2.sqrt() }
}
