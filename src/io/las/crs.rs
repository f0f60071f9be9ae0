//! The coordinate reference system of a file: WKT where it has one, else what its GeoTIFF keys name.

use super::vlr::{Evlr, Vlr};
use crate::point::{Horizontal, Units};
use crate::{Result, io};

const USER: &str = "LASF_Projection";
const WKT: u16 = 2112;
const GEO_KEYS: u16 = 34735;
const GEO_DOUBLES: u16 = 34736;
const GEO_ASCII: u16 = 34737;
/// No WKT is longer; a record that claims to be is not read for it.
const WKT_LIMIT: usize = 1 << 20;

/// GeoTIFF keys that name a system, most specific first (GeoTIFF 1.1, section 7).
const PROJECTED: u16 = 3072;
const GEODETIC: u16 = 2048;
const VERTICAL: u16 = 4096;
const CITATIONS: [u16; 3] = [1026, 3073, 2049];
/// Keys that name units (sections 7.5 to 7.7), and the model type that means longitude and latitude.
const MODEL_TYPE: u16 = 1024;
const GEOGRAPHIC: u16 = 2;
const LINEAR_UNITS: u16 = 3076;
const LINEAR_UNIT_SIZE: u16 = 3077;
const VERTICAL_UNITS: u16 = 4099;
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
    Ok(wkt(vlrs, evlrs)?.or_else(|| geotiff(vlrs)))
}

/// The units of the coordinates: as the WKT says, and where that is silent as the GeoTIFF keys do.
pub fn units(vlrs: &[Vlr], evlrs: &[Evlr]) -> Result<Units> {
    let told = wkt(vlrs, evlrs)?.map(|text| io::wkt::units(&text)).unwrap_or_default();
    Ok(told.or(GeoKeys::of(vlrs).map(|keys| keys.units(vlrs)).unwrap_or_default()))
}

fn wkt(vlrs: &[Vlr], evlrs: &[Evlr]) -> Result<Option<String>> {
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
    Ok(None)
}

/// What two files must share to be in one system: the payloads of their CRS records.
pub fn identity(vlrs: &[Vlr], evlrs: &[Evlr]) -> Result<Vec<(u16, Vec<u8>)>> {
    const RECORDS: [u16; 5] = [2111, WKT, GEO_KEYS, GEO_DOUBLES, GEO_ASCII];
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

/// The directory of GeoTIFF keys: number, place, count and value of each.
struct GeoKeys(Vec<[u16; 4]>);

impl GeoKeys {
    fn of(vlrs: &[Vlr]) -> Option<Self> {
        let keys = vlrs.iter().find(|v| v.is(USER, GEO_KEYS))?.payload();
        let words: Vec<u16> = keys.as_chunks().0.iter().map(|b| u16::from_le_bytes(*b)).collect();
        let entries = words.as_chunks::<4>().0;
        Some(GeoKeys(entries.get(1..)?.to_vec())) // the first four words are the directory's head
    }

    /// The value of a key that stands in the directory itself.
    fn value(&self, key: u16) -> Option<u16> {
        Some(self.0.iter().find(|e| e[0] == key && e[1] == 0)?[3])
    }

    /// The value of a key if it is a code of EPSG.
    fn code(&self, key: u16) -> Option<u16> {
        self.value(key).filter(|&code| code > 0 && code < USER_DEFINED)
    }

    /// The units of the coordinates (GeoTIFF 1.1, sections 7.5 to 7.7).
    fn units(&self, vlrs: &[Vlr]) -> Units {
        let geographic = match self.value(MODEL_TYPE) {
            Some(kind) => kind == GEOGRAPHIC,
            None => self.value(PROJECTED).is_none() && self.value(GEODETIC).is_some(),
        };
        let own = || self.double(LINEAR_UNIT_SIZE, vlrs);
        let horizontal = if geographic {
            Some(Horizontal::Degrees)
        } else {
            let named = self.value(LINEAR_UNITS).and_then(io::wkt::epsg_unit);
            named.or_else(own).map(Horizontal::Metres)
        };
        let by_system = || io::wkt::epsg_vertical(self.code(VERTICAL)?.into());
        let vertical = self.value(VERTICAL_UNITS).and_then(io::wkt::epsg_unit);
        Units { horizontal, vertical: vertical.or_else(by_system) }
    }

    /// The value of a key that stands among the doubles, above 0.
    fn double(&self, key: u16, vlrs: &[Vlr]) -> Option<f64> {
        let entry = self.0.iter().find(|e| e[0] == key && e[1] == GEO_DOUBLES)?;
        let doubles = vlrs.iter().find(|v| v.is(USER, GEO_DOUBLES))?.payload();
        let bytes = doubles.as_chunks().0.get(usize::from(entry[3]))?;
        Some(f64::from_le_bytes(*bytes)).filter(|v| v.is_finite() && *v > 0.0)
    }
}

/// EPSG codes of the GeoTIFF keys, else their citation.
fn geotiff(vlrs: &[Vlr]) -> Option<String> {
    let keys = GeoKeys::of(vlrs)?;
    let code = |key: u16| keys.code(key);
    if let Some(epsg) = code(PROJECTED).or_else(|| code(GEODETIC)) {
        return Some(match code(VERTICAL) {
            Some(vertical) => format!("EPSG:{epsg}+{vertical}"),
            None => format!("EPSG:{epsg}"),
        });
    }
    let ascii = vlrs.iter().find(|v| v.is(USER, GEO_ASCII))?.payload();
    CITATIONS.iter().find_map(|key| {
        let entry = keys.0.iter().find(|e| e[0] == *key && e[1] == GEO_ASCII)?;
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
    fn geotiff_keys_name_units() {
        let units = |words: &[u16]| {
            let mut all = vec![1, 1, 0, 0];
            all.extend(words.chunks_exact(2).flat_map(|w| [w[0], 0, 1, w[1]]));
            units(&[keys(&all)], &[]).unwrap()
        };
        let metres = |m| Some(Horizontal::Metres(m));
        let feet = units(&[1024, 1, 3072, 2264, 3076, 9003, 4099, 9001]);
        assert_eq!(feet, Units { horizontal: metres(1200.0 / 3937.0), vertical: Some(1.0) });
        let by_code = units(&[1024, 1, 3076, 9001, 4096, 6360]);
        assert!(by_code.mismatch().is_some());
        for degrees in [&[1024, 2, 2048, 4326][..], &[2048, 4326], &[1024, 2, 4099, 9001]] {
            assert_eq!(units(degrees).horizontal, Some(Horizontal::Degrees), "{degrees:?}");
        }
        for unknown in [&[][..], &[3072, 2154], &[1024, 1, 3076, 32767], &[2048, 4326, 3072, 2154]]
        {
            assert_eq!(units(unknown), Units::default(), "{unknown:?}");
        }
    }

    #[test]
    fn a_unit_of_ones_own_is_as_long_as_it_says() {
        let doubles = |v: f64| {
            let bytes = [7.0, v].iter().flat_map(|v: &f64| v.to_le_bytes()).collect();
            Vlr::new(USER, GEO_DOUBLES, "", bytes)
        };
        let own = keys(&[1, 1, 0, 2, 3076, 0, 1, 32767, 3077, GEO_DOUBLES, 1, 1]);
        let horizontal = |v| units(&[own.clone(), doubles(v)], &[]).unwrap().horizontal;
        assert_eq!(horizontal(0.9144), Some(Horizontal::Metres(0.9144)));
        assert_eq!((horizontal(f64::NAN), horizontal(-1.0)), (None, None));
    }

    #[test]
    fn wkt_is_told_from_other_text() {
        assert!(is_wkt("PROJCS[\"x\"]") && is_wkt(" compoundcrs [\"x\"]"));
        assert!(!is_wkt("EPSG:2154") && !is_wkt("PROJCS"));
    }
}
