//! Numbers as text: the shortest that reads back to the same value.

use std::io::Write;

use crate::point::{Dimension, Endian, Scalar, Value};

/// The longest text of a number of this type, a blank behind it included.
pub(crate) fn longest(scalar: Scalar) -> usize {
    match scalar {
        Scalar::U8 => 4,
        Scalar::I8 => 5,
        Scalar::U16 => 6,
        Scalar::I16 => 7,
        Scalar::U32 => 11,
        Scalar::I32 => 12,
        Scalar::U64 | Scalar::I64 => 21,
        Scalar::F32 => 20,
        Scalar::F64 => 28,
    }
}

/// Parses one number of type `scalar` into the beginning of `record`, little-endian. False if it is
/// none or beyond the type's range. A whole number may be written with a fraction or an exponent
/// for an integer type; a `float` is rounded from its text to f32 at once.
pub(crate) fn parse(token: &[u8], scalar: Scalar, record: &mut [u8]) -> bool {
    if let (Scalar::F64, Some(value)) = (scalar, short(token)) {
        return write(record, &value.to_le_bytes());
    }
    let Ok(text) = std::str::from_utf8(token) else { return false };
    macro_rules! whole {
        ($t:ty) => {
            match text.parse::<$t>() {
                Ok(value) => write(record, &value.to_le_bytes()),
                Err(_) => {
                    let Some(value) = float::<f64>(text, f64::is_finite, f64::NAN) else {
                        return false;
                    };
                    Dimension::new("", scalar, 0).put(record, Endian::Little, Value::Double(value))
                        && value.abs() < EXACT
                }
            }
        };
    }
    match scalar {
        Scalar::U8 => whole!(u8),
        Scalar::I8 => whole!(i8),
        Scalar::U16 => whole!(u16),
        Scalar::I16 => whole!(i16),
        Scalar::U32 => whole!(u32),
        Scalar::I32 => whole!(i32),
        Scalar::U64 => whole!(u64),
        Scalar::I64 => whole!(i64),
        Scalar::F32 => float::<f32>(text, f32::is_finite, f32::NAN)
            .is_some_and(|value| write(record, &value.to_le_bytes())),
        Scalar::F64 => float::<f64>(text, f64::is_finite, f64::NAN)
            .is_some_and(|value| write(record, &value.to_le_bytes())),
    }
}

/// A number of digits and perhaps a point that f64 has exactly as digits over a power of ten: the
/// quotient is rounded correctly, in a fraction of the time that texts of any form take.
pub(crate) fn short(token: &[u8]) -> Option<f64> {
    let (is_negative, digits) = match token {
        [b'-', digits @ ..] => (true, digits),
        _ => (false, token),
    };
    let (mut number, mut decimals, mut has_point) = (0u64, 0usize, false);
    if digits.len() > 19 {
        return None;
    }
    for &byte in digits {
        match byte {
            b'0'..=b'9' => {
                number = number * 10 + u64::from(byte - b'0');
                decimals += usize::from(has_point);
            }
            b'.' if !has_point => has_point = true,
            _ => return None,
        }
    }
    let is_number = digits.len() > usize::from(has_point);
    if !is_number || number >= 1 << 53 || decimals >= UNITS.len() {
        return None;
    }
    let value = number as f64 / UNITS[decimals];
    Some(if is_negative { -value } else { value })
}

/// True for a number that a `float` moves by more than half a unit of the text's last digit that is
/// not 0.
pub(crate) fn loses_digits(token: &[u8]) -> bool {
    // So many digits a float keeps always.
    if token.len() <= SURE_DIGITS {
        return false;
    }
    let Some(text) = std::str::from_utf8(token).ok() else { return false };
    let Some(value) = text.parse::<f64>().ok().filter(|v| v.is_finite()) else { return false };
    let (digits, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
    let decimals = digits.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let zeros = digits.bytes().rev().filter(|b| *b != b'.').take_while(|b| *b == b'0').count();
    let place = zeros as i64 - decimals as i64 + exponent.parse::<i64>().unwrap_or(0);
    let unit = 10f64.powi(place.clamp(-400, 400) as i32);
    // The text itself is off by what a double rounds.
    (f64::from(value as f32) - value).abs() > unit / 2.0 + 2.0 * f64::EPSILON * value.abs()
}

/// Decimal digits of which a float keeps every one.
const SURE_DIGITS: usize = 6;

/// Beyond it a decimal text may stand for an integer that f64 rounds.
pub(crate) const EXACT: f64 = (1u64 << 53) as f64;

fn write(record: &mut [u8], bytes: &[u8]) -> bool {
    record[..bytes.len()].copy_from_slice(bytes);
    true
}

/// A floating-point number, correctly rounded; None if it is none, or if only rounding makes it
/// infinite. Also knows what old C libraries write for what is no number.
fn float<T: std::str::FromStr + Copy>(text: &str, finite: impl Fn(T) -> bool, nan: T) -> Option<T> {
    match text.parse::<T>() {
        Ok(value) => {
            let digits = text.bytes().any(|b| b.is_ascii_digit());
            (finite(value) || !digits).then_some(value)
        }
        Err(_) => {
            let text = text.trim_start_matches(['-', '+']).to_ascii_lowercase();
            let none = ["nan(ind)", "nan(snan)", "1.#ind", "1.#qnan", "1.#snan"];
            none.iter().any(|start| text.starts_with(start)).then_some(nan)
        }
    }
}

/// Appends a number as text: the shortest that [`parse`] reads back to the same value (`nan`, `inf`
/// and `-inf` for what is no finite number; the bits of a NaN are not kept).
pub(crate) fn print(value: Value, out: &mut Vec<u8>) {
    let written = match value {
        Value::Unsigned(v) => write!(out, "{v}"),
        Value::Signed(v) => write!(out, "{v}"),
        Value::Single(v) if v.is_nan() => write!(out, "nan"),
        Value::Double(v) if v.is_nan() => write!(out, "nan"),
        Value::Double(v) if print_short(v, out) => Ok(()),
        Value::Single(v) if plain(v.into()) => write!(out, "{v}"),
        Value::Double(v) if plain(v) => write!(out, "{v}"),
        Value::Single(v) => write!(out, "{v:e}"),
        Value::Double(v) => write!(out, "{v:e}"),
    };
    debug_assert!(written.is_ok(), "memory takes every text");
}

/// Prints a number that has few decimals, as most coordinates have, if it is one: the text is the
/// same as [`print`]'s, in a fraction of the time.
fn print_short(v: f64, out: &mut Vec<u8>) -> bool {
    if v == 0.0 || !plain(v) {
        return false;
    }
    let size = v.abs();
    for (decimals, unit) in UNITS.iter().enumerate() {
        let units = size * unit;
        if units >= SHORT {
            return false;
        }
        // The nearest whole number, by a conversion that costs less than rounding does.
        let units = (units + 0.5) as u64;
        // Two such numbers of neighbouring units are more than a step of f64 apart, and division
        // rounds correctly: only one reads back as `v`, and with fewer decimals none does.
        if units as f64 / unit == size {
            if v < 0.0 {
                out.push(b'-');
            }
            print_units(units, decimals, out);
            return true;
        }
    }
    false
}

/// Powers of ten that f64 has exactly.
const UNITS: [f64; 10] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9];

/// Numbers below it have their neighbours a third of a unit away at most.
const SHORT: f64 = 1e15;

/// Appends `units` of the last of so many decimals as a decimal number.
pub(crate) fn print_decimal(units: i128, decimals: u32, out: &mut Vec<u8>) {
    if units < 0 {
        out.push(b'-');
    }
    if let Ok(units) = u64::try_from(units.unsigned_abs()) {
        return print_units(units, decimals as usize, out);
    }
    // Of more digits than there are decimals.
    let text = units.unsigned_abs().to_string();
    let (whole, part) = text.split_at(text.len() - decimals as usize);
    out.extend_from_slice(whole.as_bytes());
    if decimals > 0 {
        out.push(b'.');
        out.extend_from_slice(part.as_bytes());
    }
}

/// As [`print_decimal`], of what 64 bits hold: arithmetic of 128 is slow, and rarely needed.
fn print_units(mut left: u64, decimals: usize, out: &mut Vec<u8>) {
    let mut digits = [b'0'; 24];
    let (mut start, point) = (digits.len(), digits.len() - decimals);
    // Two digits a division.
    while left >= 100 {
        let pair = (left % 100) as u8;
        left /= 100;
        start -= 2;
        (digits[start], digits[start + 1]) = (b'0' + pair / 10, b'0' + pair % 10);
    }
    while left > 0 {
        start -= 1;
        digits[start] = b'0' + (left % 10) as u8;
        left /= 10;
    }
    let start = start.min(point - 1);
    out.extend_from_slice(&digits[start..point]);
    if decimals > 0 {
        out.push(b'.');
        out.extend_from_slice(&digits[point..]);
    }
}

/// Appends a number with so many decimals; returns by how much that rounds it.
pub(crate) fn print_rounded(v: f64, decimals: usize, out: &mut Vec<u8>) -> f64 {
    let start = out.len();
    let written = write!(out, "{v:.decimals$}");
    debug_assert!(written.is_ok(), "memory takes every text");
    let text = std::str::from_utf8(&out[start..]).ok();
    let back = text.and_then(|text| text.parse::<f64>().ok()).unwrap_or(v);
    if back.is_finite() && v.is_finite() { (back - v).abs() } else { 0.0 }
}

/// True for what reads better without an exponent.
fn plain(v: f64) -> bool {
    v == 0.0 || v.is_infinite() || (1e-5..1e16).contains(&v.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, scalar: Scalar) -> Option<Value> {
        let mut record = [0; 8];
        parse(text.as_bytes(), scalar, &mut record)
            .then(|| Dimension::new("", scalar, 0).get(&record, Endian::Little))
    }

    #[test]
    fn short_ways_lead_to_the_same_numbers_and_texts() {
        let texts =
            ["0", "-0", "007.50", "-.5", "5.", "637012.24", "9007199254740993", "-", ".", ""];
        for text in texts {
            let value = short(text.as_bytes());
            let slow = text.parse::<f64>().ok().map(f64::to_bits);
            assert!(value.is_none() || value.map(f64::to_bits) == slow, "{text}");
        }
        assert_eq!(short(b"-637012.24"), Some(-637_012.24));
        assert!(short(b"1e3").is_none() && short(b"1.2.3").is_none() && short(b"-").is_none());
        let mut seed = 1u64;
        for n in 0..200_000 {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let v = match n % 4 {
                0 => f64::from_bits(seed),
                1 => (seed >> 30) as f64 / UNITS[n % 10],
                2 => ((seed >> 12) as f64 / UNITS[n % 10]).next_up(),
                _ => -((seed >> 40) as f64 / 1000.0),
            };
            let (mut fast, slow) = (Vec::new(), format!("{v}"));
            if print_short(v, &mut fast) {
                assert_eq!(String::from_utf8(fast).unwrap(), slow);
            }
            if let Some(read) = short(slow.as_bytes()) {
                assert_eq!(read.to_bits(), v.to_bits(), "{slow}");
            }
        }
    }

    #[test]
    fn a_float_is_rounded_once() {
        // Halfway between two f32 once rounded to f64, above it as written.
        let text = "1.00000005960464477540";
        assert_eq!(read(text, Scalar::F32), Some(Value::Single(1.0 + f32::EPSILON)));
        assert_eq!(text.parse::<f64>().unwrap() as f32, 1.0);
    }

    #[test]
    fn digits_that_a_float_rounds_are_told() {
        for lost in ["5600000.37", "16777217", "0.123456789", "1.23456789e-5", "1.00000001"] {
            assert!(loses_digits(lost.as_bytes()), "{lost}");
        }
        // What programs print of floats: six decimals, or nine digits.
        for v in [12.3456f32, 0.1, -7.25e-9, 5_600_000.5, 1.0 / 3.0, 9.800_001e9, 3e38, 1e-45] {
            let mut own = Vec::new();
            print(Value::Single(v), &mut own);
            let own = String::from_utf8(own).unwrap();
            for text in [own, format!("{v:.6}"), format!("{v:.8e}")] {
                assert!(!loses_digits(text.as_bytes()), "{text}");
            }
        }
        assert!(["nan", "-infinity", "1e9999", ""].iter().all(|t| !loses_digits(t.as_bytes())));
    }

    #[test]
    fn values_beyond_a_type_are_refused() {
        let beyond = [
            ("256", Scalar::U8),
            ("-1", Scalar::U8),
            ("128", Scalar::I8),
            ("65536.0", Scalar::U16),
            ("1e39", Scalar::F32),
            ("-1e309", Scalar::F64),
            ("1.5", Scalar::I32),
            ("18446744073709551616", Scalar::U64),
            ("1e17", Scalar::U64),
            ("nan", Scalar::I32),
            ("", Scalar::F64),
            ("0x10", Scalar::U8),
            ("1,5", Scalar::F64),
        ];
        for (text, scalar) in beyond {
            assert_eq!(read(text, scalar), None, "{text} {scalar:?}");
        }
    }

    #[test]
    fn odd_but_clear_texts_are_read() {
        assert_eq!(read("+7", Scalar::U8), Some(Value::Unsigned(7)));
        assert_eq!(read("-797.000", Scalar::I32), Some(Value::Signed(-797)));
        assert_eq!(read("5e2", Scalar::U16), Some(Value::Unsigned(500)));
        assert_eq!(read("-INF", Scalar::F32), Some(Value::Single(f32::NEG_INFINITY)));
        for nan in ["nan", "-nan", "-nan(ind)", "1.#QNAN", "-1.#IND00"] {
            let Some(Value::Double(v)) = read(nan, Scalar::F64) else { panic!("{nan}") };
            assert!(v.is_nan());
        }
    }

    #[test]
    fn the_longest_texts_fit_their_room() {
        let doubles = [
            f64::MIN,
            -f64::from_bits(1),
            -1.2345678901234567e-5,
            -9999999999999998.0,
            -1.2345678901234567e-300,
            -0.000012345678901234567,
            f64::NEG_INFINITY,
        ];
        for v in doubles {
            let mut text = Vec::new();
            print(Value::Double(v), &mut text);
            assert!(text.len() < longest(Scalar::F64), "{v}");
            assert_eq!(
                read(std::str::from_utf8(&text).unwrap(), Scalar::F64),
                Some(Value::Double(v))
            );
        }
        for bits in (0..=u32::MAX).step_by(65_521) {
            let v = f32::from_bits(bits);
            let mut text = Vec::new();
            print(Value::Single(v), &mut text);
            assert!(text.len() < longest(Scalar::F32), "{v}");
            let Some(Value::Single(back)) = read(std::str::from_utf8(&text).unwrap(), Scalar::F32)
            else {
                panic!("{v}")
            };
            assert!(back.to_bits() == bits || (back.is_nan() && v.is_nan()), "{v}");
        }
    }
}
