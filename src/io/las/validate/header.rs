//! The rules of the public header block that it is held to by itself.

use super::raw::RawHeader;
use super::rules as r;
use crate::io::las::fields::{at, encoding};
use crate::io::las::format::{has_gps_time, has_waveforms, record_size};
use crate::stage::Findings;

/// Years in which files can have been made.
const YEARS: std::ops::RangeInclusive<u16> = 1990..=2200;
/// The names of the axes.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Enters what the header breaks.
pub fn check(raw: &RawHeader, findings: &mut Findings) {
    sizes(raw, findings);
    identity(raw, findings);
    date(raw, findings);
    bits(raw, findings);
    format(raw, findings);
    counts(raw, findings);
    places(raw, findings);
    bounds(raw, findings);
}

fn sizes(raw: &RawHeader, findings: &mut Findings) {
    let (major, minor, size) = (raw.byte(24), raw.minor(), raw.size());
    let Some((needed, ..)) = raw.version() else {
        findings.at(&r::VERSION, at::VERSION as u64, format!("LAS {major}.{minor}"));
        return;
    };
    if size < needed {
        let told = format!("{size} bytes, and LAS 1.{minor} needs {needed}");
        findings.at(&r::HEADER_SIZE, at::HEADER_SIZE as u64, told);
    } else if u64::from(size) > raw.length {
        let told = format!("{size} bytes, and the file has {}", raw.length);
        findings.at(&r::HEADER_SIZE, at::HEADER_SIZE as u64, told);
    } else if size > needed {
        let told = format!("{} bytes behind the {needed} of LAS 1.{minor}", size - needed);
        findings.at(&r::HEADER_BYTES, needed.into(), told);
    }
    let start = raw.points_start();
    if start < u64::from(size) || start > raw.length {
        let told =
            format!("byte {start}, and the header has {size} bytes and the file {}", raw.length);
        findings.at(&r::POINTS_START, at::POINTS_START as u64, told);
    }
}

fn identity(raw: &RawHeader, findings: &mut Findings) {
    let minor = raw.minor();
    if minor == 0 && raw.word(4) != 0 {
        findings.at(&r::RESERVED, 4, format!("{}", raw.word(4)));
    } else if minor == 1 && raw.short(6) != 0 {
        findings.at(&r::RESERVED, 6, format!("{}", raw.short(6)));
    }
    if minor > 0 && raw.short(4) == 0 {
        findings.at(&r::SOURCE_ID, 4, "0");
    }
    for (at, name) in [(26, "system identifier"), (58, "generating software")] {
        let text = raw.bytes(at, 32);
        let end = text.iter().position(|&b| b == 0).unwrap_or(32);
        if end == 0 {
            findings.at(&r::IDENTIFIER, at as u64, format!("the {name} is empty"));
        }
        if let Some(odd) = text[end..].iter().position(|&b| b != 0) {
            let told = format!("other bytes behind the zero that ends the {name}");
            findings.at(&r::PADDING, (at + end + odd) as u64, told);
        }
    }
}

fn date(raw: &RawHeader, findings: &mut Findings) {
    let (day, year) = (raw.short(90), raw.short(92));
    let is_leap = year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    if day == 0 || year == 0 {
        findings.at(&r::NO_DATE, 90, format!("day {day} of year {year}"));
    }
    if day > 365 + u16::from(is_leap || year == 0) {
        findings.at(&r::DATE, 90, format!("day {day} of year {year}"));
    } else if year != 0 && !YEARS.contains(&year) {
        findings.at(&r::DATE, 92, format!("the year {year}"));
    }
}

fn bits(raw: &RawHeader, findings: &mut Findings) {
    let Some((.., known)) = raw.version() else { return };
    let (bits, minor, format) = (raw.encoding(), raw.minor(), raw.format());
    if bits & !known != 0 {
        let told = format!("{bits:#06x}, and LAS 1.{minor} defines {known:#06x}");
        findings.at(&r::ENCODING, 6, told);
    }
    let inside = bits & encoding::WAVEFORM_INTERNAL != 0;
    let beside = bits & encoding::WAVEFORM_EXTERNAL != 0;
    if minor >= 3 {
        let told = match (has_waveforms(format), inside, beside) {
            (_, true, true) => Some("both bits are set".to_owned()),
            (true, false, false) => {
                findings.at(&r::NO_WAVEFORMS, 6, format!("neither in point format {format}"));
                None
            }
            (false, true, _) | (false, _, true) => {
                Some(format!("a bit is set, and point format {format} has no waveforms"))
            }
            _ => None,
        };
        if let Some(told) = told {
            findings.at(&r::WAVEFORM_BITS, 6, told);
        }
        let start = raw.long(at::WAVEFORM_START);
        let told = match (inside, start) {
            (false, 0) => None,
            (false, _) => Some(format!("byte {start}, and no packets are said to be in the file")),
            (true, 0) => Some("0, and the packets are said to be in the file".to_owned()),
            (true, _) if start >= raw.length => Some(format!("byte {start}, behind the file")),
            _ => None,
        };
        if let Some(told) = told {
            findings.at(&r::WAVEFORM_START, at::WAVEFORM_START as u64, told);
        }
    }
    if bits & encoding::GPS_STANDARD != 0 && !has_gps_time(format) {
        let told = format!("the bit of GPS times is set, and point format {format} has none");
        findings.at(&r::ENCODING, 6, told);
    }
}

fn format(raw: &RawHeader, findings: &mut Findings) {
    let (format, minor) = (raw.format(), raw.minor());
    if let Some((_, highest, _)) = raw.version().filter(|(_, highest, _)| format > *highest) {
        let told = format!("{format}, and LAS 1.{minor} has 0 to {highest}");
        findings.at(&r::FORMAT, at::FORMAT as u64, told);
    }
    let length = raw.short(at::RECORD_LENGTH);
    if let Some(least) = record_size(format).filter(|least| length < *least) {
        let told = format!("{length} bytes, and point format {format} has {least}");
        findings.at(&r::RECORD_LENGTH, at::RECORD_LENGTH as u64, told);
    }
}

fn counts(raw: &RawHeader, findings: &mut Findings) {
    let points = raw.points();
    let legacy = u64::from(raw.word(at::LEGACY_POINTS));
    if points == 0 && legacy == 0 {
        let field = if raw.minor() >= 4 { 247 } else { at::LEGACY_POINTS };
        findings.at(&r::NO_POINTS, field as u64, "none");
    }
    if raw.minor() < 4 {
        return;
    }
    let is_new = raw.format() >= 6;
    let right = if is_new || u32::try_from(points).is_err() { 0 } else { points };
    if legacy != 0 && legacy != right {
        let told = match is_new {
            true => format!("{legacy} in point format {}", raw.format()),
            false => format!("{legacy}, and the number of points is {points}"),
        };
        findings.at(&r::LEGACY_COUNT, at::LEGACY_POINTS as u64, told);
    }
    for number in 0..5 {
        let at = at::LEGACY_RETURNS + 4 * number;
        let (legacy, counted) = (u64::from(raw.word(at)), raw.long(at::RETURNS + 8 * number));
        let right = if is_new || right == 0 { 0 } else { counted };
        if legacy != 0 && legacy != right {
            let told = format!("{legacy} of return {}, where {right} is right", number + 1);
            findings.at(&r::LEGACY_RETURNS, at as u64, told);
        }
    }
}

fn places(raw: &RawHeader, findings: &mut Findings) {
    let (scales, offsets) = (raw.axes(at::SCALE, 8), raw.axes(at::SCALE + 24, 8));
    for (axis, (scale, offset)) in scales.into_iter().zip(offsets).enumerate() {
        let (name, byte) = (AXES[axis], (at::SCALE + 8 * axis) as u64);
        if !(scale > 0.0 && scale.is_finite()) {
            findings.at(&r::SCALE, byte, format!("the scale of {name} is {scale}"));
        } else if !is_round(scale) {
            findings.at(&r::ODD_SCALE, byte, format!("the scale of {name} is {scale}"));
        }
        if !offset.is_finite() {
            findings.at(&r::OFFSET, byte + 24, format!("the offset of {name} is {offset}"));
        }
    }
}

/// True for 1, 0.5, 0.25 and these divided by a power of ten, as decimals write them.
fn is_round(scale: f64) -> bool {
    let digits = format!("{scale:e}");
    let (mantissa, exponent) = digits.split_once('e').unwrap_or((&digits, ""));
    let is_below = exponent.parse().is_ok_and(|exponent: i32| exponent <= 0);
    is_below && ["1", "5", "2.5"].contains(&mantissa)
}

fn bounds(raw: &RawHeader, findings: &mut Findings) {
    let (highest, lowest) = (raw.axes(at::BOX, 16), raw.axes(at::BOX + 8, 16));
    let is_empty = raw.points() == 0 && raw.word(at::LEGACY_POINTS) == 0;
    for axis in (0..3).filter(|_| !is_empty) {
        let (low, high) = (lowest[axis], highest[axis]);
        if !(low <= high && low.is_finite() && high.is_finite()) {
            let told = format!("{} from {low} to {high}", AXES[axis]);
            findings.at(&r::BOX_ORDER, (at::BOX + 16 * axis) as u64, told);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::is_round;

    #[test]
    fn scales_of_one_digit_or_a_quarter_are_round() {
        let round = [1.0, 0.1, 0.01, 0.001, 1e-7, 0.5, 0.05, 0.25, 0.025, 1e-9];
        assert!(round.iter().all(|scale| is_round(*scale)));
        let odd = [0.3, 0.0100001, 10.0, 3.0, 0.0003047851264858275, f64::NAN, 5e-324];
        assert!(!odd[..6].iter().any(|scale| is_round(*scale)));
    }
}
