//! The rules of the records that say in which coordinate reference system the points are.

use super::raw::RawHeader;
use super::records::FoundRecord;
use super::rules as r;
use crate::io::las::crs::{GEO_ASCII, GEO_DOUBLES, GEO_KEYS, USER, WKT};
use crate::io::las::fields::encoding;
use crate::io::wkt;
use crate::stage::Findings;

/// Numbers of a GeoTIFF directory's head, and of each key.
const ENTRY: usize = 4;

/// Enters what the records break.
pub fn check(raw: &RawHeader, records: &[FoundRecord], findings: &mut Findings) {
    let is_filled = |record: &&FoundRecord| record.payload.iter().any(|&b| b != 0 && b != b' ');
    let text = records.iter().filter(|record| record.is(USER, WKT)).find(is_filled);
    let keys = records.iter().find(|record| record.is(USER, GEO_KEYS));
    bit(raw, text, keys, findings);
    if text.is_none() && keys.is_none() {
        findings.whole(&r::NO_SYSTEM, "none");
    }
    if let Some(text) = text {
        of_text(text, findings);
    }
    if let Some(keys) = keys {
        of_keys(keys, records, findings);
    }
}

/// The bit of the header against the records that there are.
fn bit(
    raw: &RawHeader,
    text: Option<&FoundRecord>,
    keys: Option<&FoundRecord>,
    findings: &mut Findings,
) {
    let (format, is_set) = (raw.format(), raw.encoding() & encoding::WKT != 0);
    if raw.minor() < 4 {
        return;
    }
    if let (true, None, Some(keys)) = (format >= 6, text, keys) {
        let told = format!("GeoTIFF keys alone in point format {format}");
        findings.at(&r::SYSTEM_KIND, keys.at, told);
    }
    let told = match (is_set, text, keys) {
        (false, _, _) if format >= 6 => Some(format!("not set in point format {format}")),
        (false, Some(_), None) => Some("not set, and the reference system is WKT".to_owned()),
        (true, None, Some(_)) if format < 6 => {
            Some("set, and the reference system is GeoTIFF keys".to_owned())
        }
        _ => None,
    };
    if let Some(told) = told {
        findings.at(&r::WKT_BIT, 6, told);
    }
}

fn of_text(record: &FoundRecord, findings: &mut Findings) {
    let bytes = &record.payload;
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    let at = |byte: usize| record.payload_at + byte as u64;
    if end == bytes.len() {
        findings.at(&r::WKT_END, at(end), "no zero");
    } else if let Some(odd) = bytes[end..].iter().position(|&b| b != 0) {
        findings.at(&r::WKT_END, at(end + odd), "other bytes behind the zero");
    }
    let Ok(text) = std::str::from_utf8(&bytes[..end]) else {
        findings.at(&r::WKT_TEXT, at(0), "bytes that are no text");
        return;
    };
    if !wkt::is_wkt(text) || !wkt::is_closed(text) {
        let begin: String = text.chars().take(40).collect();
        findings.at(&r::WKT_TEXT, at(0), format!("other text, which begins with `{begin}`"));
    } else if wkt::is_second(text) {
        findings.at(&r::WKT_SECOND, at(0), "well-known text of version 2");
    }
}

/// The directory of GeoTIFF keys: its head, then number, place, count and value of each.
fn of_keys(record: &FoundRecord, records: &[FoundRecord], findings: &mut Findings) {
    let words: Vec<u16> =
        record.payload.as_chunks().0.iter().map(|b| u16::from_le_bytes(*b)).collect();
    let (entries, _) = words.as_chunks::<ENTRY>();
    let at = |entry: usize| record.payload_at + (2 * ENTRY * entry) as u64;
    let Some((head, keys)) = entries.split_first() else {
        findings.at(&r::GEO_KEYS, at(0), format!("{} bytes, no directory", record.length));
        return;
    };
    if head[0] != 1 {
        findings.at(&r::GEO_KEYS, at(0), format!("a directory of version {}", head[0]));
    }
    let count = usize::from(head[3]);
    if count > keys.len() {
        let told = format!("{count} keys are counted, and there is room for {}", keys.len());
        findings.at(&r::GEO_KEYS, at(0) + 6, told);
    }
    let length = |number: u16| {
        let other = records.iter().find(|other| other.is(USER, number));
        other.map_or(0, |other| other.payload.len())
    };
    let (doubles, texts) = (length(GEO_DOUBLES) / 8, length(GEO_ASCII));
    for (n, [key, place, values, value]) in keys.iter().take(count).enumerate() {
        let end = usize::from(*value) + usize::from(*values);
        let told = match *place {
            0 | GEO_KEYS => None,
            GEO_DOUBLES if end <= doubles => None,
            GEO_ASCII if end <= texts => None,
            GEO_DOUBLES => Some(format!("key {key} is number {end} of {doubles} numbers")),
            GEO_ASCII => Some(format!("key {key} ends at byte {end} of a text of {texts} bytes")),
            other => Some(format!("key {key} is in record {other}, which holds no values of keys")),
        };
        if let Some(told) = told {
            findings.at(&r::GEO_KEYS, at(n + 1), told);
        }
        if n > 0 && keys[n - 1][0] >= *key {
            let told = format!("key {key} behind key {}", keys[n - 1][0]);
            findings.at(&r::GEO_KEYS, at(n + 1), told);
        }
    }
}
