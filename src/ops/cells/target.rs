//! How many records are to stay, in words of a pipeline file.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{self, Deserializer, Unexpected, Visitor};
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::quantity::{COUNT_TEXT, has_schema, or_word, parse_count};
use crate::stage::StagePlace;

/// How many records are to stay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Keep {
    /// A share of the records that the stage decides about, in millionths of a percent.
    Share(u64),
    /// So many records.
    Records(u64),
    /// As many as an angle by the noise of the scan would leave, by samples.
    Auto,
}

/// Whole numbers below are exact as f64.
const WHOLE: f64 = 9_007_199_254_740_992.0;

/// Millionths of a percent that are all.
const ALL: u64 = 100_000_000;

impl Keep {
    /// How many of `records` are to stay: rounded to whole ones, halves upwards, at least one. All
    /// where samples decide, until they do.
    pub(in crate::ops) fn of(self, records: u64) -> u64 {
        match self {
            Keep::Auto => records,
            Keep::Records(count) => count,
            Keep::Share(share) => {
                let parts = u128::from(records) * u128::from(share);
                let all = u128::from(ALL);
                u64::try_from((2 * parts + all) / (2 * all)).unwrap_or(u64::MAX).max(1)
            }
        }
    }
}

impl Keep {
    /// The same of a trial on a share of the scan: a number is that share of it, one at least.
    pub(in crate::ops) fn for_share(&mut self, share: f64) {
        if let Keep::Records(count) = self {
            *count = ((*count as f64 * share).round() as u64).max(1);
        }
    }

    /// Refuses what leaves the number to the scan, for the stage `kind`, which does not find one.
    pub(in crate::ops) fn check_given(self, kind: &str, at: &StagePlace) -> Result<(), Error> {
        if self != Keep::Auto {
            return Ok(());
        }
        let error = Error::pipeline(format!("`{kind}.keep` is a number of points or a share"));
        Err(at.blame("keep", error.help(format!("for example `{kind}.keep = \"10%\"`"))))
    }
}

impl fmt::Display for Keep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Keep::Records(count) => write!(f, "{count}"),
            Keep::Auto => f.write_str("auto"),
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
            Keep::Share(_) | Keep::Auto => serializer.collect_str(self),
        }
    }
}

impl<'de> Deserialize<'de> for Keep {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(KeepVisitor)
    }
}

/// A share of 1 in percent, without the digits that a float does not hold: 0.07 is 7 %.
struct Percent(f64);

impl fmt::Display for Percent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = format!("{:.6}", 100.0 * self.0);
        f.write_str(digits.trim_end_matches('0').trim_end_matches('.'))
    }
}

/// What the key of a stage takes that does not find a number by itself.
pub(in crate::ops) struct KeepGiven;

has_schema!(KeepGiven, "KeepGiven", {
    "anyOf": [
        { "title": "a share such as `\"10%\"`", "type": "string", "pattern": r"^[-+.0-9eE\s]+%$" },
        {
            "title": "a number such as `\"250k\"`",
            "anyOf": [
                { "type": "integer", "minimum": 1 },
                { "type": "string", "pattern": COUNT_TEXT },
            ],
        },
    ],
});

impl JsonSchema for Keep {
    fn schema_name() -> Cow<'static, str> {
        "Keep".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        or_word(KeepGiven::json_schema(generator), "auto")
    }
}

struct KeepVisitor;

impl Visitor<'_> for KeepVisitor {
    type Value = Keep;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(
            "a share of up to 100% such as \"10%\", a number of points from 1 such as 500000, \
             \"250k\" or 1e6, or \"auto\"",
        )
    }

    fn visit_u64<E: de::Error>(self, count: u64) -> Result<Keep, E> {
        match count {
            0 => Err(E::invalid_value(Unexpected::Unsigned(0), &self)),
            _ => Ok(Keep::Records(count)),
        }
    }

    fn visit_i64<E: de::Error>(self, count: i64) -> Result<Keep, E> {
        match u64::try_from(count) {
            Ok(count) => self.visit_u64(count),
            Err(_) => Err(E::invalid_value(Unexpected::Signed(count), &self)),
        }
    }

    fn visit_f64<E: de::Error>(self, count: f64) -> Result<Keep, E> {
        if 0.0 < count && count < 1.0 {
            return Err(E::custom(format!(
                "{count} is no number of points; did you mean \"{}%\", that share of them?",
                Percent(count)
            )));
        }
        // 1e6 is a float in TOML.
        match count.fract() == 0.0 && (1.0..WHOLE).contains(&count) {
            true => Ok(Keep::Records(count as u64)),
            false => Err(E::invalid_value(Unexpected::Float(count), &self)),
        }
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Keep, E> {
        if text.trim() == "auto" {
            return Ok(Keep::Auto);
        }
        let keep = match text.strip_suffix('%') {
            Some(percent) => decimal(percent.trim(), 6)
                .filter(|share| (1..=ALL).contains(share))
                .map(Keep::Share),
            None => match text.trim().parse::<f64>() {
                Ok(number) if number.fract() != 0.0 => return self.visit_f64(number),
                _ => parse_count(text).ok().filter(|&count| count > 0).map(Keep::Records),
            },
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
            ("1e6", Keep::Records(1_000_000), "1000000"),
            ("'1e3'", Keep::Records(1_000), "1000"),
            ("'10k'", Keep::Records(10_000), "10000"),
            ("'1_500'", Keep::Records(1_500), "1500"),
        ] {
            assert_eq!((keep(text), keep(text).to_string().as_str()), (expected, said), "{text}");
        }
        for wrong in [
            "0",
            "-1",
            "1.5",
            "1e300",
            "'1.5'",
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
            "'.5M'",
        ] {
            let refusal = toml::from_str::<Cells>(&format!("keep = {wrong}")).unwrap_err();
            assert!(refusal.to_string().contains("\"10%\""), "{wrong}: {refusal}");
        }
    }

    #[test]
    fn a_share_without_its_sign_is_asked_about() {
        for (text, share) in [("0.1", "10%"), ("'0.1'", "10%"), ("0.07", "7%"), ("2.5e-3", "0.25%")]
        {
            let refusal = toml::from_str::<Cells>(&format!("keep = {text}")).unwrap_err();
            let asked = format!("did you mean \"{share}\"");
            assert!(refusal.to_string().contains(&asked), "{text}: {refusal}");
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
