//! Decimal steps: powers of ten, and whole numbers of them within the rounding of decimals.

/// The largest power of ten that is at most `length`, which is above 0; 1e-300 at least.
pub(super) fn decimal_step(length: f64) -> f64 {
    let power = |exponent: i32| format!("1e{exponent}").parse::<f64>().unwrap_or(f64::MAX);
    // The logarithm may be off by a little, so the first of the larger ones that fits is taken.
    let above = if length > 1e-300 { libm::ceil(libm::log10(length)) as i32 } else { -300 };
    (0..3).map(|less| power(above - less)).find(|&step| step <= length).unwrap_or(1e-300)
}

/// How many steps a scale is, if it is a whole number of them within the rounding of decimals.
pub(super) fn multiple(scale: f64, step: f64) -> Option<i64> {
    let ratio = scale / step;
    let whole = ratio.round();
    let whole_number = (1.0..1e15).contains(&whole) && (ratio - whole).abs() <= 1e-12 * whole;
    whole_number.then_some(whole as i64)
}

#[cfg(test)]
mod tests {
    use super::decimal_step;

    #[test]
    fn decimal_steps_are_the_powers_of_ten_below() {
        for (length, step) in
            [(1.0, 1.0), (0.99, 0.1), (1e-12, 1e-12), (9.9e-12, 1e-12), (1e22, 1e22), (0.0, 1e-300)]
        {
            assert_eq!(decimal_step(length), step, "{length}");
        }
    }
}
