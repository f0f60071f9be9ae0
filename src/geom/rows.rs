//! Sorting lists side by side: row i has the i-th number of each list, so that what is done to a
//! row is done to all of them. Knows no tiles, no stages.

/// Numbers of several lists side by side.
pub trait Ordered: Copy {
    /// The smaller and the larger of two numbers, in every list.
    fn ordered(self, other: Self) -> (Self, Self);
}

impl Ordered for [f64; 2] {
    #[inline(always)]
    fn ordered(self, other: Self) -> (Self, Self) {
        // In this form compilers know minimum and maximum.
        let smaller = |i: usize| if self[i] < other[i] { self[i] } else { other[i] };
        let larger = |i: usize| if self[i] > other[i] { self[i] } else { other[i] };
        ([smaller(0), smaller(1)], [larger(0), larger(1)])
    }
}

/// Orders pairs of rows, one after the other, without a loop: rows that are vectors stay in
/// registers.
macro_rules! order {
    ($rows:ident: $($a:literal $b:literal),* $(,)?) => {
        $(($rows[$a], $rows[$b]) = $rows[$a].ordered($rows[$b]);)*
    };
}

/// Sorts lists of 16, smallest first, by comparisons that do not depend on the numbers: the 60 of
/// Green's network (Knuth, The Art of Computer Programming 3, 5.3.4). A list with a NaN is left in
/// no order.
#[inline(always)]
pub fn sort<T: Ordered>(rows: &mut [T; 16]) {
    order!(rows: 0 1, 2 3, 4 5, 6 7, 8 9, 10 11, 12 13, 14 15);
    order!(rows: 0 2, 1 3, 4 6, 5 7, 8 10, 9 11, 12 14, 13 15);
    order!(rows: 0 4, 1 5, 2 6, 3 7, 8 12, 9 13, 10 14, 11 15);
    order!(rows: 0 8, 1 9, 2 10, 3 11, 4 12, 5 13, 6 14, 7 15);
    order!(rows: 5 10, 6 9, 3 12, 13 14, 4 8, 7 11, 1 2);
    order!(rows: 1 4, 7 13, 2 8, 11 14);
    order!(rows: 2 4, 5 6, 9 10, 11 13, 3 8, 7 12);
    order!(rows: 6 8, 10 12, 3 5, 7 9);
    order!(rows: 3 4, 5 6, 7 8, 9 10, 11 12);
    order!(rows: 6 7, 8 9);
}

/// Puts the 16 smallest of two sorted lists into `best`, sorted: the smallest of one and the
/// largest of the other, and so on, are such a list up and down, which Batcher's merge brings in
/// order (Knuth, 5.3.4).
#[inline(always)]
pub fn merge<T: Ordered>(best: &mut [T; 16], sorted: &[T; 16]) {
    let mut rows = *best;
    for i in 0..16 {
        rows[i] = best[i].ordered(sorted[15 - i]).0;
    }
    order!(rows: 0 8, 1 9, 2 10, 3 11, 4 12, 5 13, 6 14, 7 15);
    order!(rows: 0 4, 1 5, 2 6, 3 7, 8 12, 9 13, 10 14, 11 15);
    order!(rows: 0 2, 1 3, 4 6, 5 7, 8 10, 9 11, 12 14, 13 15);
    order!(rows: 0 1, 2 3, 4 5, 6 7, 8 9, 10 11, 12 13, 14 15);
    *best = rows;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As for sorting, lists of zeros and ones are enough.
    #[test]
    fn the_smallest_of_two_lists_are_merged() {
        let list = |zeros: usize| std::array::from_fn(|i| [f64::from(i >= zeros); 2]);
        for (one, other) in (0..=16).flat_map(|one| (0..=16).map(move |other| (one, other))) {
            let mut best: [[f64; 2]; 16] = list(one);
            merge(&mut best, &list(other));
            assert_eq!(best, list((one + other).min(16)), "{one} {other}");
        }
    }

    /// A network that sorts all lists of zeros and ones sorts all lists.
    #[test]
    fn every_list_is_sorted() {
        for bits in (0..1u32 << 16).step_by(2) {
            let lists: [u32; 2] = [bits, bits + 1];
            let mut rows: [[f64; 2]; 16] =
                std::array::from_fn(|i| lists.map(|bits| f64::from(bits >> i & 1)));
            sort(&mut rows);
            for (list, bits) in lists.into_iter().enumerate() {
                let zeros = 16 - bits.count_ones() as usize;
                let sorted =
                    rows.iter().enumerate().all(|(i, row)| (row[list] == 1.0) == (i >= zeros));
                assert!(sorted, "{bits:016b}");
            }
        }
    }
}
