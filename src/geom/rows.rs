//! Lists side by side: row i has the i-th number of each of 16 lists, so that a plain loop over a row
//! works on all of them. Knows no tiles, no stages.

use super::simd::LANES;

/// One number of each list.
pub type Row = [f64; LANES];

/// Sorts every list, smallest first: Batcher's merge exchange, as in Knuth's Algorithm 5.2.2 M. The
/// comparisons do not depend on the numbers. A list with a NaN is left in no order.
#[inline(always)]
pub fn sort(rows: &mut [Row]) {
    let count = rows.len();
    let top = count.next_power_of_two() / 2;
    let mut p = top;
    while p > 0 {
        let (mut q, mut r, mut d) = (top, 0, p);
        loop {
            for i in (0..count - d).filter(|i| i & p == r) {
                let (low, high) = rows.split_at_mut(i + d);
                exchange(&mut low[i], &mut high[0]);
            }
            if q == p {
                break;
            }
            (d, q, r) = (q - p, q / 2, p);
        }
        p /= 2;
    }
}

/// Puts the smaller of two numbers first, in every lane.
#[inline(always)]
fn exchange(low: &mut Row, high: &mut Row) {
    for i in 0..LANES {
        // In this form compilers know minimum and maximum.
        let (a, b) = (low[i], high[i]);
        low[i] = if a < b { a } else { b };
        high[i] = if a > b { a } else { b };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    proptest::proptest! {
        #[test]
        fn every_list_is_sorted(
            mut rows in proptest::collection::vec(
                proptest::array::uniform16((-9i32..9).prop_map(f64::from)), 0..40,
            ),
        ) {
            let mut lists: Vec<Vec<f64>> = (0..LANES).map(|i| rows.iter().map(|r| r[i]).collect()).collect();
            sort(&mut rows);
            for (i, list) in lists.iter_mut().enumerate() {
                list.sort_by(f64::total_cmp);
                let sorted: Vec<f64> = rows.iter().map(|r| r[i]).collect();
                proptest::prop_assert_eq!(&sorted, list);
            }
        }
    }

    use proptest::strategy::Strategy;
}
