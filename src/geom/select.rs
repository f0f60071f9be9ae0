//! The n-th largest of more numbers than memory holds, by digits.

use crate::Result;

/// Bits of a digit: its counts are half a mebibyte.
const DIGIT: u32 = 16;

/// The `want`-th largest of the numbers that `each` visits, always the same ones, and how many that
/// are equal to it are among the first `want`; 0 and all that are 0 where there are fewer.
///
/// # Errors
///
/// Those of `each`.
pub fn nth_largest(
    want: u64,
    mut each: impl FnMut(&mut dyn FnMut(u64)) -> Result<()>,
) -> Result<(u64, u64)> {
    let (mut least, mut left) = (0u64, want);
    let mut counts = vec![0u64; 1 << DIGIT];
    for shift in (0..u64::BITS).step_by(DIGIT as usize).rev() {
        counts.fill(0);
        let above = |number: u64| number.checked_shr(shift + DIGIT).unwrap_or(0);
        each(&mut |number| {
            if above(number) == above(least) {
                counts[(number >> shift) as usize & ((1 << DIGIT) - 1)] += 1;
            }
        })?;
        let mut digit = counts.len() - 1;
        while digit > 0 && counts[digit] < left {
            left -= counts[digit];
            digit -= 1;
        }
        least |= (digit as u64) << shift;
    }
    Ok((least, left))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_that_of_a_sorted_list() {
        let mut numbers: Vec<u64> = (0..500u64).map(|i| i.wrapping_mul(i) << (i % 50)).collect();
        numbers.extend([u64::MAX, u64::MAX, 0, 0, 0, 1, 1]);
        let mut sorted = numbers.clone();
        sorted.sort_unstable_by(|a, b| b.cmp(a));
        for want in 1..=numbers.len() {
            let each = |visit: &mut dyn FnMut(u64)| {
                numbers.iter().for_each(|n| visit(*n));
                Ok(())
            };
            let (least, ties) = nth_largest(want as u64, each).unwrap();
            assert_eq!(least, sorted[want - 1], "{want}");
            let before = sorted[..want].iter().filter(|n| **n == least).count();
            assert_eq!(ties, before as u64, "{want}");
        }
        let (least, ties) = nth_largest(9, |visit| {
            [5, 6].into_iter().for_each(visit);
            Ok(())
        })
        .unwrap();
        assert!(least == 0 && ties >= 7, "{least} {ties}");
    }
}
