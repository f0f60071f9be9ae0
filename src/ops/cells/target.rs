//! How many records are to stay, in words of a pipeline file.

use std::fmt;

use serde::de::{Deserializer, Error, Unexpected, Visitor};
use serde::{Deserialize, Serialize};

/// How many records are to stay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Keep {
    /// A share of the records that the stage decides about, in millionths of a percent.
    Share(u64),
    /// So many records.
    Records(u64),
}

/// Millionths of a percent that are all.
const ALL: u64 = 100_000_000;

impl Keep {
    /// How many of `records` are to stay: rounded to whole ones, halves upwards, at least one.
    pub(super) fn of(self, records: u64) -> u64 {
        match self {
            Keep::Records(count) => count,
            Keep::Share(share) => {
                let parts = u128::from(records) * u128::from(share);
                let all = u128::from(ALL);
                u64::try_from((2 * parts + all) / (2 * all)).unwrap_or(u64::MAX).max(1)
            }
        }
    }
}

impl fmt::Display for Keep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Keep::Records(count) => write!(f, "{count}"),
            Keep::Share(share) => {
                let digits = format!("{}.{:06}", share / 1_000_000, share % 1_000_000);
                write!(f, "{}%", digits.trim_end_matches('0').trim_end_matches('.'))
            }
        }
    }
}

impl Serialize for Keep {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Keep::Records(count) => serializer.serialize_u64(*count),
            Keep::Share(_) => serializer.collect_str(self),
        }
    }
}

impl<'de> Deserialize<'de> for Keep {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(KeepVisitor)
    }
}

struct KeepVisitor;

impl Visitor<'_> for KeepVisitor {
    type Value = Keep;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(
            "a share such as \"10%\", or a number of points such as 500000, \"250k\" or \"5M\"",
        )
    }

    fn visit_u64<E: Error>(self, count: u64) -> Result<Keep, E> {
        match count {
            0 => Err(E::invalid_value(Unexpected::Unsigned(0), &self)),
            _ => Ok(Keep::Records(count)),
        }
    }

    fn visit_i64<E: Error>(self, count: i64) -> Result<Keep, E> {
        match u64::try_from(count) {
            Ok(count) => self.visit_u64(count),
            Err(_) => Err(E::invalid_value(Unexpected::Signed(count), &self)),
        }
    }

    fn visit_f64<E: Error>(self, count: f64) -> Result<Keep, E> {
        Err(E::invalid_value(Unexpected::Float(count), &self))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Keep, E> {
        let keep = match text.strip_suffix('%') {
            Some(percent) => decimal(percent.trim(), 6)
                .filter(|share| (1..=ALL).contains(share))
                .map(Keep::Share),
            None => {
                let units = [('k', 3), ('K', 3), ('M', 6), ('G', 9)];
                let unit = |(unit, digits)| Some((text.strip_suffix(unit)?.trim(), digits));
                let (number, digits) = units.into_iter().find_map(unit).unwrap_or((text, 0));
                decimal(number, digits).filter(|&count| count > 0).map(Keep::Records)
            }
        };
        keep.ok_or_else(|| E::invalid_value(Unexpected::Str(text), &self))
    }
}

/// The decimal number `text` times 10^`digits`; none if that is not a whole number of 64 bits.
fn decimal(text: &str, digits: usize) -> Option<u64> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let fraction = fraction.trim_end_matches('0');
    let all_digits = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
    if whole.is_empty() || !all_digits(whole) || !all_digits(fraction) || fraction.len() > digits {
        return None;
    }
    format!("{whole}{fraction:0<digits$}").parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ops::Cells;

    fn keep(text: &str) -> Keep {
        toml::from_str::<Cells>(&format!("keep = {text}")).unwrap().keep.unwrap()
    }

    #[test]
    fn targets_are_shares_or_numbers_of_points() {
        for (text, expected, said) in [
            ("'10%'", Keep::Share(10_000_000), "10%"),
            ("'0.1 %'", Keep::Share(100_000), "0.1%"),
            ("'12.500001%'", Keep::Share(12_500_001), "12.500001%"),
            ("'100%'", Keep::Share(ALL), "100%"),
            ("500000", Keep::Records(500_000), "500000"),
            ("'500000'", Keep::Records(500_000), "500000"),
            ("'5M'", Keep::Records(5_000_000), "5000000"),
            ("'2.5 M'", Keep::Records(2_500_000), "2500000"),
            ("'250k'", Keep::Records(250_000), "250000"),
            ("'1.25G'", Keep::Records(1_250_000_000), "1250000000"),
        ] {
            assert_eq!((keep(text), keep(text).to_string().as_str()), (expected, said), "{text}");
        }
        for wrong in [
            "0",
            "-1",
            "0.1",
            "'0%'",
            "'101%'",
            "'1.2345678%'",
            "'-5%'",
            "'5m'",
            "'%'",
            "'k'",
            "''",
            "'1.0005k'",
            "'99999999999G'",
            "true",
            "'1e3'",
            "'.5M'",
        ] {
            let refusal = toml::from_str::<Cells>(&format!("keep = {wrong}")).unwrap_err();
            assert!(refusal.to_string().contains("\"10%\""), "{wrong}: {refusal}");
        }
    }

    #[test]
    fn shares_are_rounded_half_up_to_one_at_least() {
        let tenth = Keep::Share(10_000_000);
        assert_eq!([4, 5, 14, 15, 24, 25].map(|n| tenth.of(n)), [1, 1, 1, 2, 2, 3]);
        assert_eq!(Keep::Share(ALL).of(u64::MAX), u64::MAX);
        assert_eq!(Keep::Share(1).of(0), 1);
        assert_eq!(Keep::Records(7).of(3), 7);
    }
}
