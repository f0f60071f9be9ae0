//! Numbers that were computed, in the digits that say something.

use std::fmt;

/// A number in at most ten digits: 5 cm are 0.05 m, not 0.05000000000000001, and a metre is
/// 3.280833333 US survey feet.
pub struct Figure(pub f64);

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let short: f64 = format!("{:.9e}", self.0).parse().unwrap_or(self.0);
        // As many zeros as 1e308 has say nothing.
        match short.abs() {
            size if size >= 1e16 || size < 1e-9 && size > 0.0 => write!(f, "{short:e}"),
            _ => write!(f, "{short}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Figure;

    #[test]
    fn computed_numbers_have_ten_digits_at_most() {
        for (number, told) in [
            (3937.0 / 1200.0, "3.280833333"),
            (1200.0 / 3937.0, "0.3048006096"),
            (5.0 * 0.01, "0.05"),
            (0.3048, "0.3048"),
            (1.0, "1"),
            (0.0, "0"),
            (1e308, "1e308"),
            (-1e-12, "-1e-12"),
            (3.0 * 0.1, "0.3"),
        ] {
            assert_eq!(Figure(number).to_string(), told);
        }
    }
}
