//! The coordinate reference system of a file: WKT where it has one, else what its GeoTIFF keys
//! name.

use super::geokeys::{self, GeoKeys};
use super::header::Header;
use super::vlr::{Evlr, Vlr};
use crate::Result;
use crate::io::wkt;
use crate::point::Units;

pub use super::geokeys::{GEO_ASCII, GEO_DOUBLES, GEO_KEYS, USER};

/// The record of WKT 1.
pub const WKT: u16 = 2112;
/// WKT 2 in LAS 1.4, as some writers have it beside or in place of WKT 1.
const WKT2: u16 = 4224;
/// Where libLAS put its WKT before the specification had a place for it.
const LIBLAS: (&str, u16) = ("liblas", 2112);
/// No WKT is longer; a record that claims to be is not read for it.
pub const WKT_LIMIT: usize = 1 << 20;

/// A new record that names the system `text`, and why there is none.
pub fn record(text: &str) -> std::result::Result<Vlr, String> {
    if !wkt::is_wkt(text) {
        return geokeys::record(text);
    }
    let mut payload = text.as_bytes().to_vec();
    payload.push(0);
    match u16::try_from(payload.len()) {
        Ok(_) => Ok(Vlr::new(USER, WKT, "OGC coordinate system WKT", payload)),
        Err(_) => Err("WKT of 64 KiB or more fits no record".to_owned()),
    }
}

/// True for the records that say in which system the points are.
pub fn is_record(user: &str, record: u16) -> bool {
    const RECORDS: [u16; 6] = [2111, WKT, WKT2, GEO_KEYS, GEO_DOUBLES, GEO_ASCII];
    (user == USER && RECORDS.contains(&record)) || (user, record) == LIBLAS
}

/// True if the records name the system by WKT, as the bit of the header says it.
pub fn has_wkt(vlrs: &[Vlr], evlrs: &[Evlr]) -> Result<bool> {
    Ok(wkt(vlrs, evlrs)?.is_some())
}

/// True if the header of an output is to say that its system is WKT (LAS 1.4 R15, section 2.4):
/// where it is, unless there are GeoTIFF keys too and a point format that may have them; and always
/// in point formats 6 to 10, unless there are GeoTIFF keys alone, which it would belie.
pub fn wants_bit(header: &Header, vlrs: &[Vlr], evlrs: &[Evlr]) -> Result<bool> {
    let keys = vlrs.iter().any(|v| v.is(USER, GEO_KEYS));
    let wkt = has_wkt(vlrs, evlrs)?;
    Ok(header.minor() >= 4 && if header.format() >= 6 { wkt || !keys } else { wkt && !keys })
}

/// The system as text, if the file names one.
pub fn text(vlrs: &[Vlr], evlrs: &[Evlr]) -> Result<Option<String>> {
    match wkt(vlrs, evlrs)?.or_else(|| geokeys::text(vlrs)) {
        None => first_text(vlrs, evlrs, LIBLAS.0, LIBLAS.1),
        some => Ok(some),
    }
}

/// The units of the coordinates: as the WKT says, where that is silent as the GeoTIFF keys do, and
/// where those are as the WKT of libLAS does.
pub fn units(vlrs: &[Vlr], evlrs: &[Evlr]) -> Result<Units> {
    let of = |text: Option<String>| text.map(|text| wkt::units(&text)).unwrap_or_default();
    let keys = GeoKeys::of(vlrs).map(|keys| keys.units(vlrs)).unwrap_or_default();
    let liblas = of(first_text(vlrs, evlrs, LIBLAS.0, LIBLAS.1)?);
    Ok(of(wkt(vlrs, evlrs)?).or(keys).or(liblas))
}

fn wkt(vlrs: &[Vlr], evlrs: &[Evlr]) -> Result<Option<String>> {
    match first_text(vlrs, evlrs, USER, WKT)? {
        None => first_text(vlrs, evlrs, USER, WKT2),
        some => Ok(some),
    }
}

/// The first text in records of this kind that is not empty.
fn first_text(vlrs: &[Vlr], evlrs: &[Evlr], user: &str, record: u16) -> Result<Option<String>> {
    let filled = |payload: &[u8]| Some(super::text::text(payload)).filter(|text| !text.is_empty());
    let mut plain = vlrs.iter().filter(|v| v.is(user, record));
    if let Some(text) = plain.find_map(|v| filled(v.payload())) {
        return Ok(Some(text));
    }
    for evlr in evlrs.iter().filter(|v| v.is(user, record)) {
        if let Some(text) = evlr.payload(WKT_LIMIT)?.as_deref().and_then(filled) {
            return Ok(Some(text));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::las::geokeys;
    use crate::io::las::geokeys::tests::keys;

    #[test]
    fn epsg_codes_become_keys_and_come_back() {
        for code in ["EPSG:25832", "EPSG:25832+7837", "EPSG:4326", "EPSG:4979", "EPSG:4978"] {
            let record = [geokeys::record(code).unwrap()];
            assert_eq!(geokeys::text(&record).as_deref(), Some(code));
            let read = units(&record, &[]).unwrap();
            assert_eq!(read, wkt::units(code), "{code}");
        }
        for (text, why) in [
            ("EPSG:1", "not known"),
            ("EPSG:900913", "cannot hold"),
            ("EPSG:x", "neither"),
            ("here", "neither"),
            (&format!("PROJCS[\"{}\"]", "a".repeat(70_000)), "64 KiB"),
        ] {
            assert!(super::record(text).unwrap_err().contains(why), "{text}");
        }
    }

    #[test]
    fn wkt_of_other_records_is_found() {
        let record =
            |user: &str, number, text: &str| Vlr::new(user, number, "", text.as_bytes().to_vec());
        let (two, liblas) = (record(USER, WKT2, "PROJCRS[2]"), record("liblas", 2112, "PROJCS[1]"));
        let found = |vlrs: &[Vlr]| text(vlrs, &[]).unwrap();
        assert_eq!(found(&[liblas.clone(), two]).as_deref(), Some("PROJCRS[2]"));
        assert_eq!(found(std::slice::from_ref(&liblas)).as_deref(), Some("PROJCS[1]"));
        let keys = keys(&[1, 1, 0, 1, 3072, 0, 1, 2154]);
        assert_eq!(found(&[liblas, keys]).as_deref(), Some("EPSG:2154"));
    }
}
