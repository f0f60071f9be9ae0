//! The coordinate reference system of a file: WKT where it has one, else what its GeoTIFF keys
//! name.

use super::header::Header;
use super::vlr::{Evlr, Vlr};
use crate::Result;
use crate::io::{epsg, wkt};
use crate::point::{Horizontal, Units};

/// Who defined the records of systems.
pub const USER: &str = "LASF_Projection";
/// Their numbers: WKT 1.
pub const WKT: u16 = 2112;
/// WKT 2 in LAS 1.4, as some writers have it beside or in place of WKT 1.
const WKT2: u16 = 4224;
/// Where libLAS put its WKT before the specification had a place for it.
const LIBLAS: (&str, u16) = ("liblas", 2112);
/// The directory of GeoTIFF keys, their floats, their texts.
pub const GEO_KEYS: u16 = 34735;
/// See [`GEO_KEYS`].
pub const GEO_DOUBLES: u16 = 34736;
/// See [`GEO_KEYS`].
pub const GEO_ASCII: u16 = 34737;
/// No WKT is longer; a record that claims to be is not read for it.
pub const WKT_LIMIT: usize = 1 << 20;

/// GeoTIFF keys that name a system, most specific first (GeoTIFF 1.1, section 7).
const PROJECTED: u16 = 3072;
const GEODETIC: u16 = 2048;
const VERTICAL: u16 = 4096;
const CITATIONS: [u16; 3] = [1026, 3073, 2049];
/// Keys that name units (sections 7.5 to 7.7), and the model type that means longitude and
/// latitude.
const MODEL_TYPE: u16 = 1024;
const GEOGRAPHIC: u16 = 2;
const GEOCENTRIC: u16 = 3;
const LINEAR_UNITS: u16 = 3076;
const LINEAR_UNIT_SIZE: u16 = 3077;
const VERTICAL_UNITS: u16 = 4099;
/// Key values above this are "user-defined" or private.
const USER_DEFINED: u16 = 32767;

/// A new record that names the system `text`, and why there is none.
pub fn record(text: &str) -> std::result::Result<Vlr, String> {
    if !wkt::is_wkt(text) {
        return keys_record(text);
    }
    let mut payload = text.as_bytes().to_vec();
    payload.push(0);
    match u16::try_from(payload.len()) {
        Ok(_) => Ok(Vlr::new(USER, WKT, "OGC coordinate system WKT", payload)),
        Err(_) => Err("WKT of 64 KiB or more fits no record".to_owned()),
    }
}

/// GeoTIFF keys for `EPSG:code` or `EPSG:code+code`.
fn keys_record(text: &str) -> std::result::Result<Vlr, String> {
    let Some((across, up)) = text.starts_with("EPSG:").then(|| wkt::codes(text)).flatten() else {
        return Err("LAS names a system by WKT or EPSG codes, and this is neither".to_owned());
    };
    let kind = match epsg::horizontal(across) {
        units if units.horizontal_unknown => {
            return Err(format!("what EPSG:{across} is is not known here"));
        }
        Units { horizontal: Some(Horizontal::Degrees), .. } => GEOGRAPHIC,
        Units { vertical: Some(_), .. } => GEOCENTRIC,
        _ => 1,
    };
    let word = |code: u32| match u16::try_from(code) {
        Ok(code) if code > 0 && code < USER_DEFINED => Ok(code),
        _ => Err(format!("a GeoTIFF key cannot hold EPSG:{code}")),
    };
    let system = if kind == 1 { PROJECTED } else { GEODETIC };
    let mut keys = vec![(MODEL_TYPE, kind), (system, word(across)?)];
    if let Some(up) = up {
        keys.push((VERTICAL, word(up)?));
    }
    // The directory's head: versions of the directory and of the keys, and how many there are.
    let head = [1, 1, 0, keys.len() as u16];
    let entries = keys.into_iter().flat_map(|(key, value)| [key, 0, 1, value]);
    let payload = head.into_iter().chain(entries).flat_map(u16::to_le_bytes).collect();
    Ok(Vlr::new(USER, GEO_KEYS, "GeoTIFF keys", payload))
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
    match wkt(vlrs, evlrs)?.or_else(|| geotiff(vlrs)) {
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

    /// True if a key stands there with a value that means something.
    fn has(&self, key: u16) -> bool {
        self.0.iter().any(|entry| entry[0] == key && (entry[1] != 0 || entry[3] != 0))
    }

    /// The units of the coordinates (GeoTIFF 1.1, sections 7.5 to 7.7): as keys of units say, else
    /// as the codes of the systems do.
    fn units(&self, vlrs: &[Vlr]) -> Units {
        let by_system = || epsg::vertical(self.code(VERTICAL)?.into());
        let vertical = self.value(VERTICAL_UNITS).and_then(epsg::unit).or_else(by_system);
        let named = self.has(VERTICAL) || self.has(VERTICAL_UNITS);
        let up =
            Units { vertical, vertical_unknown: named && vertical.is_none(), ..Units::default() };
        up.or(self.across(vlrs))
    }

    /// Those of x and y, and of z where their system gives that too.
    fn across(&self, vlrs: &[Vlr]) -> Units {
        let of = |horizontal| Units { horizontal: Some(horizontal), ..Units::default() };
        let kind = self.value(MODEL_TYPE).unwrap_or(match self.value(PROJECTED) {
            None if self.value(GEODETIC).is_some() => GEOGRAPHIC,
            _ => 0,
        });
        let geodetic = self.code(GEODETIC).map(|code| epsg::horizontal(code.into()));
        if kind == GEOGRAPHIC {
            return of(Horizontal::Degrees).or(geodetic.unwrap_or_default());
        }
        let named = self.value(LINEAR_UNITS).and_then(epsg::unit);
        if let Some(metres) = named.or_else(|| self.double(LINEAR_UNIT_SIZE, vlrs)) {
            return of(Horizontal::Metres(metres));
        }
        match (self.code(PROJECTED), geodetic) {
            (Some(code), _) => epsg::horizontal(code.into()),
            (None, Some(units)) if kind == GEOCENTRIC => units,
            _ => {
                let named = [MODEL_TYPE, PROJECTED, LINEAR_UNITS].iter().any(|&key| self.has(key));
                Units { horizontal_unknown: named, ..Units::default() }
            }
        }
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
        let citation = super::text::text(bytes).trim_end_matches('|').to_owned();
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
        assert_eq!((feet.horizontal, feet.vertical), (metres(1200.0 / 3937.0), Some(1.0)));
        for by_code in [&[1024, 1, 3076, 9001, 4096, 6360][..], &[1024, 1, 3072, 2277, 4096, 5703]]
        {
            assert!(units(by_code).mismatch().is_some(), "{by_code:?}");
        }
        let geocentric = units(&[1024, 3, 2048, 4978]);
        assert_eq!((geocentric.horizontal, geocentric.vertical), (metres(1.0), Some(1.0)));
        assert_eq!(
            units(&[1024, 2, 2048, 4979]).vertical,
            Some(1.0),
            "a height above the ellipsoid"
        );
        for degrees in [&[1024, 2, 2048, 4326][..], &[2048, 4326], &[1024, 2, 4099, 9001]] {
            assert_eq!(units(degrees).horizontal, Some(Horizontal::Degrees), "{degrees:?}");
        }
        assert_eq!(units(&[]), Units::default());
        let projected = units(&[2048, 4326, 3072, 2154, 4096, 0]);
        assert_eq!(projected, Units { horizontal: metres(1.0), ..Units::default() });
        for unknown in [&[1024, 1, 3076, 32767][..], &[3072, 32767], &[3072, 30999]] {
            let nothing = Units { horizontal_unknown: true, ..Units::default() };
            assert_eq!(units(unknown), nothing, "{unknown:?}");
        }
        for height in [&[3072, 2154, 4096, 5103][..], &[3072, 2154, 4099, 32767]] {
            assert!(
                units(height).vertical_unknown && units(height).doubt().is_some(),
                "{height:?}"
            );
        }
    }

    #[test]
    fn epsg_codes_become_keys_and_come_back() {
        for code in ["EPSG:25832", "EPSG:25832+7837", "EPSG:4326", "EPSG:4979", "EPSG:4978"] {
            let record = [keys_record(code).unwrap()];
            assert_eq!(geotiff(&record).as_deref(), Some(code));
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
}
