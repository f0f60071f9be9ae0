//! The order of positions along the Morton curve.

use std::cmp::Ordering;

use crate::point::Position;

/// Morton order: interleaved bits, z above y above x on every level, anchored at the corner of the
/// lattice (the most negative i64).
pub fn morton_cmp(a: &Position, b: &Position) -> Ordering {
    let differ = |axis: usize| (a[axis] ^ b[axis]) as u64;
    // The axis whose difference has the highest bit decides; z wins equal bits, then y. Selections
    // instead of branches: which axis it is looks random.
    let (mut highest, mut deciding) = (differ(2), (a[2], b[2]));
    for axis in [1, 0] {
        let other = differ(axis);
        let higher = (highest < other) & (highest < (highest ^ other));
        highest = select(higher, other, highest);
        deciding.0 = select(higher, a[axis], deciding.0);
        deciding.1 = select(higher, b[axis], deciding.1);
    }
    // Flipping the sign bit of both keeps i64 order, so plain comparison is right on every axis.
    deciding.0.cmp(&deciding.1)
}

/// Morton order of places in a plane, the second coordinate above the first on every level.
pub fn plane_morton_cmp(a: [i64; 2], b: [i64; 2]) -> Ordering {
    let [x, y] = [0, 1].map(|axis| (a[axis] ^ b[axis]) as u64);
    let is_x = (y < x) & (y < (y ^ x));
    let (a, b) = if is_x { (a[0], b[0]) } else { (a[1], b[1]) };
    a.cmp(&b)
}

/// One of two, without a branch.
fn select<T>(condition: bool, yes: T, no: T) -> T {
    std::hint::select_unpredictable(condition, yes, no)
}
