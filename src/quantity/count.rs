//! Counts of points as people write them.

/// Reads a count: `1500`, `1_500`, `10k`, `2.5M`, `1e6`, `3G`; a unit is a power of 1,000.
///
/// ```
/// use pointmill::quantity::parse_count;
///
/// assert_eq!(parse_count("2.5M"), Ok(2_500_000));
/// assert_eq!(parse_count("1e5"), Ok(100_000));
/// assert!(parse_count("0.5").is_err());
/// ```
///
/// # Errors
///
/// What is no whole count below 2^64; the text says what a count looks like.
pub fn parse_count(text: &str) -> Result<u64, String> {
    let shown: String = text.chars().take(40).collect();
    let refused = || format!("`{shown}` is no count such as 1500, 10k, 5M or 1e6");
    let digits: String = text.trim().chars().filter(|&c| c != '_').collect();
    let (number, thousands) = match digits.chars().last() {
        Some('k' | 'K') => (&digits[..digits.len() - 1], 3),
        Some('M') => (&digits[..digits.len() - 1], 6),
        Some('G') => (&digits[..digits.len() - 1], 9),
        _ => (&digits[..], 0),
    };
    let number = number.trim_end();
    let (number, power) = match number.split_once(['e', 'E']) {
        Some((number, power)) if thousands == 0 => (number, power.parse().map_err(|_| refused())?),
        Some(_) => return Err(refused()),
        None => (number, thousands),
    };
    let (whole, fraction) = number.split_once('.').unwrap_or((number, ""));
    let fraction = fraction.trim_end_matches('0');
    let plain = |part: &str| part.chars().all(|c| c.is_ascii_digit());
    if whole.is_empty() || !plain(whole) || !plain(fraction) {
        return Err(refused());
    }
    let zeros =
        usize::try_from(power).ok().and_then(|power: usize| power.checked_sub(fraction.len()));
    let Some(zeros) = zeros else {
        return Err(format!("{}: it is not whole", refused()));
    };
    if zeros > 20 {
        return Err(format!("{}: too large", refused()));
    }
    let all = format!("{whole}{fraction}{}", "0".repeat(zeros));
    all.parse().map_err(|_| format!("{}: too large", refused()))
}

#[cfg(test)]
mod tests {
    use super::parse_count;

    #[test]
    fn counts_may_have_units_powers_and_groups() {
        for (text, count) in [
            ("0", 0),
            ("1500", 1_500),
            ("1_500", 1_500),
            (" 10k ", 10_000),
            ("2.5 M", 2_500_000),
            ("10K", 10_000),
            ("5M", 5_000_000),
            ("2.5M", 2_500_000),
            ("1.50M", 1_500_000),
            ("3G", 3_000_000_000),
            ("1e5", 100_000),
            ("1E5", 100_000),
            ("1.5e3", 1_500),
            ("7.0", 7),
            ("18446744073709551615", u64::MAX),
        ] {
            assert_eq!(parse_count(text), Ok(count), "{text}");
        }
    }

    #[test]
    fn what_is_no_count_is_refused() {
        for text in
            ["", "k", "-5", "+5", "5MB", "5m", "1e", "1e-3", "1e5k", ".5M", "5,000", "1 k k", "é"]
        {
            assert!(parse_count(text).is_err(), "{text}");
        }
        assert!(parse_count("1.5").unwrap_err().ends_with("it is not whole"));
        assert!(parse_count("1e99").unwrap_err().ends_with("too large"));
        assert!(parse_count("18446744073709551616").unwrap_err().ends_with("too large"));
    }
}
