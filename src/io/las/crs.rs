//! The coordinate reference system of a file: WKT where it has one, else what its GeoTIFF keys name.

use super::vlr::{Evlr, Vlr};
use crate::Result;

const USER: &str = "LASF_Projection";
const WKT: u16 = 2112;
const GEO_KEYS: u16 = 34735;
const GEO_ASCII: u16 = 34737;
/// No WKT is longer; a record that claims to be is not read for it.
const WKT_LIMIT: usize = 1 << 20;

/// GeoTIFF keys that name a system, most specific first (GeoTIFF 1.1, section 7).
const PROJECTED: u16 = 3072;
const GEODETIC: u16 = 2048;
const VERTICAL: u16 = 4096;
const CITATIONS: [u16; 3] = [1026, 3073, 2049];
/// Key values above this are "user-defined" or private.
const USER_DEFINED: u16 = 32767;

/// A new record that holds `wkt`; None if it is too long for one.
pub fn wkt_record(wkt: &str) -> Option<Vlr> {
    let mut payload = wkt.as_bytes().to_vec();
    payload.push(0);
    (payload.len() <= usize::from(u16::MAX))
        .then(|| Vlr::new(USER, WKT, "OGC coordinate system WKT", payload))
}

/// True if `text` begins like WKT 1 or 2.
pub fn is_wkt(text: &str) -> bool {
    let word = text.trim_start().split(['[', '(']).next().unwrap_or_default().trim_end();
    const WORDS: [&str; 14] = [
        "PROJCS",
        "GEOGCS",
        "GEOCCS",
        "COMPD_CS",
        "VERT_CS",
        "LOCAL_CS",
        "PROJCRS",
        "GEOGCRS",
        "GEODCRS",
        "COMPOUNDCRS",
        "VERTCRS",
        "ENGCRS",
        "BOUNDCRS",
        "PROJECTEDCRS",
    ];
    word.len() < text.len() && WORDS.contains(&word.to_ascii_uppercase().as_str())
}

/// The system as text, if the file names one.
pub fn text(vlrs: &[Vlr], evlrs: &[Evlr]) -> Result<Option<String>> {
    if let Some(vlr) = vlrs.iter().find(|v| v.is(USER, WKT)) {
        let wkt = super::vlr::text(vlr.payload());
        if !wkt.is_empty() {
            return Ok(Some(wkt));
        }
    }
    for evlr in evlrs.iter().filter(|v| v.is(USER, WKT)) {
        if let Some(payload) = evlr.payload(WKT_LIMIT)? {
            let wkt = super::vlr::text(&payload);
            if !wkt.is_empty() {
                return Ok(Some(wkt));
            }
        }
    }
    Ok(geotiff(vlrs))
}

/// What two files must share to be in one system: the payloads of their CRS records.
pub fn identity(vlrs: &[Vlr], evlrs: &[Evlr]) -> Result<Vec<(u16, Vec<u8>)>> {
    const RECORDS: [u16; 5] = [2111, WKT, GEO_KEYS, 34736, GEO_ASCII];
    let mut all: Vec<(u16, Vec<u8>)> = vlrs
        .iter()
        .filter(|v| RECORDS.contains(&v.record()) && v.user() == USER)
        .map(|v| (v.record(), v.payload().to_vec()))
        .collect();
    for evlr in evlrs.iter().filter(|v| RECORDS.contains(&v.record()) && v.user() == USER) {
        all.extend(evlr.payload(WKT_LIMIT)?.map(|payload| (evlr.record(), payload)));
    }
    all.sort();
    all.dedup();
    Ok(all)
}

/// EPSG codes of the GeoTIFF keys, else their citation.
fn geotiff(vlrs: &[Vlr]) -> Option<String> {
    let keys = vlrs.iter().find(|v| v.is(USER, GEO_KEYS))?.payload();
    let words: Vec<u16> = keys.as_chunks().0.iter().map(|b| u16::from_le_bytes(*b)).collect();
    let entries = words.as_chunks::<4>().0;
    let entries = entries.get(1..)?; // the first four words are the directory's head
    let code = |key: u16| {
        let found = entries.iter().find(|e| e[0] == key && e[1] == 0)?[3];
        (found > 0 && found < USER_DEFINED).then_some(found)
    };
    if let Some(epsg) = code(PROJECTED).or_else(|| code(GEODETIC)) {
        return Some(match code(VERTICAL) {
            Some(vertical) => format!("EPSG:{epsg}+{vertical}"),
            None => format!("EPSG:{epsg}"),
        });
    }
    let ascii = vlrs.iter().find(|v| v.is(USER, GEO_ASCII))?.payload();
    CITATIONS.iter().find_map(|key| {
        let entry = entries.iter().find(|e| e[0] == *key && e[1] == GEO_ASCII)?;
        let start = usize::from(entry[3]);
        let bytes = ascii.get(start..start.checked_add(usize::from(entry[2]))?)?;
        let citation = super::vlr::text(bytes).trim_end_matches('|').to_owned();
        (!citation.is_empty()).then_some(citation)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(words: &[u16]) -> Vlr {
        Vlr::new(USER, GEO_KEYS, "", words.iter().flat_map(|w| w.to_le_bytes()).collect())
    }

    #[test]
    fn geotiff_codes_become_epsg_text() {
        let vlr = keys(&[1, 1, 0, 2, 3072, 0, 1, 26915, 4096, 0, 1, 5703]);
        assert_eq!(geotiff(&[vlr]).as_deref(), Some("EPSG:26915+5703"));
        assert_eq!(geotiff(&[keys(&[1, 1])]), None, "a directory cut short names nothing");
    }

    #[test]
    fn a_citation_beyond_its_text_is_ignored() {
        let ascii = Vlr::new(USER, GEO_ASCII, "", b"Here|".to_vec());
        let good = keys(&[1, 1, 0, 1, 1026, GEO_ASCII, 5, 0]);
        let bad = keys(&[1, 1, 0, 1, 1026, GEO_ASCII, 500, 65535]);
        assert_eq!(geotiff(&[good, ascii.clone()]).as_deref(), Some("Here"));
        assert_eq!(geotiff(&[bad, ascii]), None);
    }

    #[test]
    fn wkt_is_told_from_other_text() {
        assert!(is_wkt("PROJCS[\"x\"]") && is_wkt(" compoundcrs [\"x\"]"));
        assert!(!is_wkt("EPSG:2154") && !is_wkt("PROJCS"));
    }
}
