//! Numbers of bytes as people write them.

use serde::{Deserializer, de};

use super::has_schema;

/// Bytes in a unit; the first of each is the one that messages use.
const UNITS: [(&str, u64); 9] = [
    ("B", 1),
    ("KiB", 1 << 10),
    ("MiB", 1 << 20),
    ("GiB", 1 << 30),
    ("TiB", 1 << 40),
    ("kB", 1_000),
    ("MB", 1_000_000),
    ("GB", 1_000_000_000),
    ("TB", 1_000_000_000_000),
];

/// Reads a size: `512MiB`, `1.5 GiB`, `2GB`, or bytes without a unit. A fraction of a byte is cut
/// off.
///
/// ```
/// assert_eq!(pointmill::quantity::parse_bytes("1.5GiB"), Ok(1_610_612_736));
/// assert!(pointmill::quantity::parse_bytes("2G").is_err());
/// ```
///
/// # Errors
///
/// What is no size, or none of at least one byte; the text says what a size looks like.
pub fn parse_bytes(text: &str) -> Result<u64, String> {
    let refused = || {
        let units: Vec<&str> = UNITS.iter().map(|(unit, _)| *unit).collect();
        let short: String = text.chars().take(40).collect();
        let meant = meant(text).map_or(String::new(), |meant| format!(": write {meant}"));
        let units = units.join(", ");
        format!("`{short}` is no size such as 512MiB or 2GiB{meant} (units: {units})")
    };
    let text = text.trim();
    let split = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = (&text[..split], text[split..].trim_start());
    let scale = match unit {
        "" => 1,
        _ => UNITS.iter().find(|(name, _)| *name == unit).ok_or_else(refused)?.1,
    };
    let (whole, fraction) = number.split_once('.').unwrap_or((number, "0"));
    let fraction = &fraction[..fraction.len().min(9)];
    let parse = |digits: &str| digits.parse::<u64>().map_err(|_| refused());
    let part = u128::from(parse(fraction)?) * u128::from(scale) / 10u128.pow(fraction.len() as u32);
    let bytes = u128::from(parse(whole)?) * u128::from(scale) + part;
    match u64::try_from(bytes) {
        Ok(0) => Err(format!("{}: a size is at least one byte", refused())),
        Ok(bytes) => Ok(bytes),
        Err(_) => Err(format!("{}: too large", refused())),
    }
}

/// The size that was meant by a unit of other letters: `2GiB` for `2G` and `2gb`.
fn meant(text: &str) -> Option<String> {
    let text = text.trim();
    let (number, unit) = text.split_at(text.find(|c: char| c.is_ascii_alphabetic())?);
    let of = |unit: &str| UNITS.iter().find(|(known, _)| known.eq_ignore_ascii_case(unit));
    let (unit, _) = of(unit).or_else(|| of(&format!("{unit}iB")))?;
    // What is written as it was typed is wrong for another reason.
    Some(format!("{}{unit}", number.trim_end()))
        .filter(|size| size != text && parse_bytes(size).is_ok())
}

/// A size, as a key takes it.
pub(crate) struct SizeText;

has_schema!(SizeText, "SizeText", {
    "title": "a size (such as `\"2GiB\"`, or a number of bytes)",
    "anyOf": [
        { "type": "integer", "minimum": 1 },
        {
            "type": "string",
            "pattern": r"^\s*[0-9]+(\.[0-9]+)?\s*(B|KiB|MiB|GiB|TiB|kB|MB|GB|TB)?\s*$",
        },
    ],
});

/// Reads a size, as a text or as a number of bytes.
pub(crate) fn some_bytes<'de, D: Deserializer<'de>>(from: D) -> Result<Option<u64>, D::Error> {
    struct Size;
    impl de::Visitor<'_> for Size {
        type Value = u64;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("a size such as \"2GiB\", or bytes")
        }

        fn visit_str<E: de::Error>(self, text: &str) -> Result<u64, E> {
            parse_bytes(text).map_err(E::custom)
        }

        fn visit_u64<E: de::Error>(self, bytes: u64) -> Result<u64, E> {
            match bytes {
                0 => Err(E::invalid_value(de::Unexpected::Unsigned(0), &self)),
                _ => Ok(bytes),
            }
        }

        fn visit_i64<E: de::Error>(self, bytes: i64) -> Result<u64, E> {
            match u64::try_from(bytes) {
                Ok(bytes) => self.visit_u64(bytes),
                Err(_) => Err(E::invalid_value(de::Unexpected::Signed(bytes), &self)),
            }
        }
    }
    from.deserialize_any(Size).map(Some)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_binary_and_decimal_units() {
        for (text, bytes) in [
            ("1", 1),
            ("1024", 1024),
            ("1B", 1),
            ("1KiB", 1 << 10),
            ("512MiB", 512 << 20),
            ("2GiB", 2 << 30),
            (" 2 GiB ", 2 << 30),
            ("1.5GiB", 3 << 29),
            ("3TiB", 3 << 40),
            ("1kB", 1000),
            ("1MB", 1_000_000),
            ("0.25GB", 250_000_000),
            ("1TB", 1_000_000_000_000),
            ("18446744073709551615", u64::MAX),
        ] {
            assert_eq!(parse_bytes(text), Ok(bytes), "{text}");
        }
    }

    #[test]
    fn what_is_no_size_is_refused() {
        let wrong = ["", "GiB", "2G", "2gib", "-1", "1e3", "1.2.3GiB", "1,5GiB", "0", "0.1B", "１"];
        for text in wrong {
            assert!(parse_bytes(text).is_err(), "{text}");
        }
        assert!(parse_bytes("99999999TiB").unwrap_err().ends_with("too large"));
        assert!(parse_bytes("18446744073709551616").is_err());
    }
}
