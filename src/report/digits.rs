//! Counts, lengths, shares and coordinates in as many digits as mean something to a reader.

use std::fmt;

/// How many of all, in brackets; nothing where there are none.
pub(super) struct Share(pub u64, pub u64);

impl fmt::Display for Share {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.1 {
            0 => Ok(()),
            all => write!(f, " ({:.1} %)", self.0 as f64 / all as f64 * 100.0),
        }
    }
}

/// A coordinate in the digits that tell it from its neighbours on a grid of this step: those of the
/// single precision number that it is, if it is one.
pub struct Coordinate {
    /// The coordinate.
    pub at: f64,
    /// Step of the lattice, or scale of the file; 0 where there is none.
    pub step: f64,
}

impl Coordinate {
    /// The fewest decimals that are the coordinate but for what sums and products in f64 add to it;
    /// None where all its digits are needed.
    fn decimals(&self) -> Option<usize> {
        let rounding = 4.0 * f64::EPSILON * self.at.abs();
        let slack = (self.step * 1e-3).max(rounding).min(self.step / 2.0);
        let is_it = |text: String| text.parse().is_ok_and(|v: f64| (v - self.at).abs() <= slack);
        (0..=12).find(|&decimals| is_it(format!("{:.decimals$}", self.at)))
    }
}

impl fmt::Display for Coordinate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let single = self.at as f32;
        if (f64::from(single) - self.at).abs() <= self.step / 2.0 {
            return write!(f, "{single}");
        }
        match self.decimals() {
            Some(decimals) => write!(f, "{:.decimals$}", self.at),
            None => write!(f, "{}", self.at),
        }
    }
}

/// A count with a comma between thousands.
pub struct Grouped(pub u64);

impl fmt::Display for Grouped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = self.0.to_string();
        for (i, digit) in digits.char_indices() {
            if i > 0 && (digits.len() - i).is_multiple_of(3) {
                f.write_str(",")?;
            }
            write!(f, "{digit}")?;
        }
        Ok(())
    }
}

/// A length with three digits that mean something.
pub struct Short(pub f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            v if v == 0.0 || !v.is_finite() => write!(f, "{v}"),
            v if v.abs() >= 100.0 => write!(f, "{v:.0}"),
            v if v.abs() < 1e-4 => write!(f, "{v:.2e}"),
            v => {
                let decimals = (1..=6).find(|&d| v.abs() * 10f64.powi(d) >= 100.0).unwrap_or(6);
                write!(f, "{v:.*}", decimals as usize)
            }
        }
    }
}

/// A length in short, with its unit where that is known.
pub struct Long<'a>(pub f64, pub Option<&'a str>);

impl fmt::Display for Long<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Short(self.0).fmt(f)?;
        self.1.map_or(Ok(()), |unit| write!(f, " {unit}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_grouped_in_thousands() {
        let text = [0, 999, 1000, 12345, 1234567].map(|n| Grouped(n).to_string());
        assert_eq!(text, ["0", "999", "1,000", "12,345", "1,234,567"]);
    }

    #[test]
    fn coordinates_show_the_digits_that_the_lattice_tells_apart() {
        let shown = |at: f64, step: f64| Coordinate { at, step }.to_string();
        let binary = 1.0 / f64::from(1 << 30);
        assert_eq!(shown(f64::from(12.346_f32), binary), "12.346");
        assert_eq!(shown(12.346, 0.001), "12.346");
        assert_eq!(shown(5_600_018.349, 0.001), "5600018.349");
        assert_eq!(shown(12.123456789, binary), "12.123456789");
        assert_eq!(shown(-0.1, 0.0), "-0.1");
        assert_eq!(shown(6_277_535.589_999_999, 0.01), "6277535.59");
        assert_eq!(shown(77_051_903.0 * 0.01, 0.01), "770519.03");
        assert_eq!(shown(0.1 + 0.2, 0.1), "0.3");
        assert_eq!(
            shown(6_277_535.125_499_999, 0.25),
            "6277535.1255",
            "an offset beside the steps"
        );
    }

    #[test]
    fn lengths_show_three_digits() {
        let text = [0.0, 1234.56, 12.345, 1.0, 0.0123456, 0.000123456, 1.5e-7]
            .map(|v| Short(v).to_string());
        assert_eq!(text, ["0", "1235", "12.3", "1.00", "0.0123", "0.000123", "1.50e-7"]);
    }
}
