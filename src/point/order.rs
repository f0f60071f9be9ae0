//! Numbers as keys of a sort.

/// A number that orders as `time` does in the total order of IEEE 754.
pub fn ascending(time: f64) -> u64 {
    let bits = time.to_bits();
    if bits >> 63 == 0 { bits | 1 << 63 } else { !bits }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_ascend_as_numbers_do() {
        let times = [f64::NEG_INFINITY, -1.5, -0.0, 0.0, 1e-300, 2.0, 1e9, f64::INFINITY];
        assert!(times.map(ascending).is_sorted());
    }
}
