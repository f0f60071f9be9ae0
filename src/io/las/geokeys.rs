//! GeoTIFF keys (GeoTIFF 1.1: OGC 19-008): the system that they name by codes, or describe, and its
//! units.

mod projection;

use super::vlr::Vlr;
use crate::io::{epsg, wkt};
use crate::point::{Horizontal, Units};

/// Who defined the records of systems.
pub const USER: &str = "LASF_Projection";
/// The directory of GeoTIFF keys, their floats, their texts.
pub const GEO_KEYS: u16 = 34735;
/// See [`GEO_KEYS`].
pub const GEO_DOUBLES: u16 = 34736;
/// See [`GEO_KEYS`].
pub const GEO_ASCII: u16 = 34737;
/// GeoTIFF keys that name a system, most specific first (GeoTIFF 1.1, section 7).
const PROJECTED: u16 = 3072;
const GEODETIC: u16 = 2048;
const VERTICAL: u16 = 4096;
/// Keys that name the system in words; what ends each text among them.
const CITATION: u16 = 1026;
const PROJECTED_CITATION: u16 = 3073;
const CITATIONS: [u16; 3] = [CITATION, PROJECTED_CITATION, 2049];
const VERTICAL_CITATION: u16 = 4097;
const SEPARATOR: char = '|';
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
/// What a projection is, where it has no code.
const METHOD: u16 = 3075;

/// GeoTIFF keys for `EPSG:code` or `EPSG:code+code`.
pub fn record(text: &str) -> std::result::Result<Vlr, String> {
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

/// The directory of GeoTIFF keys: number, place, count and value of each.
pub struct GeoKeys(Vec<[u16; 4]>);

impl GeoKeys {
    /// Those of a file, if it has any.
    pub fn of(vlrs: &[Vlr]) -> Option<Self> {
        let keys = vlrs.iter().find(|v| v.is(USER, GEO_KEYS))?.payload();
        let words: Vec<u16> = keys.as_chunks().0.iter().map(|b| u16::from_le_bytes(*b)).collect();
        let entries = words.as_chunks::<4>().0;
        Some(GeoKeys(entries.get(1..)?.to_vec())) // the first four words are the directory's head
    }

    /// The value of a key that stands in the directory itself.
    pub fn value(&self, key: u16) -> Option<u16> {
        Some(self.0.iter().find(|e| e[0] == key && e[1] == 0)?[3])
    }

    /// The value of a key if it is a code of EPSG.
    pub fn code(&self, key: u16) -> Option<u16> {
        self.value(key).filter(|&code| code > 0 && code < USER_DEFINED)
    }

    /// True if a key stands there with a value that means something.
    fn has(&self, key: u16) -> bool {
        self.0.iter().any(|entry| entry[0] == key && (entry[1] != 0 || entry[3] != 0))
    }

    /// True if they describe a projection in place of a code.
    fn is_own(&self) -> bool {
        self.code(PROJECTED).is_none() && (self.has(PROJECTED) || self.has(METHOD))
    }

    /// The units of the coordinates (GeoTIFF 1.1, sections 7.5 to 7.7): as keys of units say, else
    /// as the codes of the systems do.
    pub fn units(&self, vlrs: &[Vlr]) -> Units {
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
        if let Some(metres) =
            named.or_else(|| self.double(LINEAR_UNIT_SIZE, vlrs).filter(|v| *v > 0.0))
        {
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

    /// The value of a key that stands among the doubles.
    pub fn double(&self, key: u16, vlrs: &[Vlr]) -> Option<f64> {
        let entry = self.0.iter().find(|e| e[0] == key && e[1] == GEO_DOUBLES)?;
        let doubles = vlrs.iter().find(|v| v.is(USER, GEO_DOUBLES))?.payload();
        let bytes = doubles.as_chunks().0.get(usize::from(entry[3]))?;
        Some(f64::from_le_bytes(*bytes)).filter(|v| v.is_finite())
    }

    /// The value of a key that stands among the texts, if it is not empty.
    fn citation(&self, key: u16, vlrs: &[Vlr]) -> Option<String> {
        let entry = self.0.iter().find(|e| e[0] == key && e[1] == GEO_ASCII)?;
        let ascii = vlrs.iter().find(|v| v.is(USER, GEO_ASCII))?.payload();
        let start = usize::from(entry[3]);
        let bytes = ascii.get(start..start.checked_add(usize::from(entry[2]))?)?;
        let citation = super::text::text(bytes).trim_end_matches(SEPARATOR).to_owned();
        (!citation.is_empty()).then_some(citation)
    }
}

/// EPSG codes of the GeoTIFF keys; WKT where keys describe a projection, or say units that the
/// codes do not; else their citation.
pub fn text(vlrs: &[Vlr]) -> Option<String> {
    let keys = GeoKeys::of(vlrs)?;
    let code = |key: u16| keys.code(key);
    // The geodetic system of a projected one without a code is not that of the points.
    let geodetic = || code(GEODETIC).filter(|_| !keys.is_own());
    let named = code(PROJECTED).or_else(geodetic).map(|epsg| match code(VERTICAL) {
        Some(vertical) => format!("EPSG:{epsg}+{vertical}"),
        None => format!("EPSG:{epsg}"),
    });
    let says_all = |text: &String| wkt::units(text).are(&keys.units(vlrs));
    let whole = if named.as_ref().is_some_and(says_all) { None } else { keys.wkt(vlrs) };
    let citation = || CITATIONS.iter().find_map(|key| keys.citation(*key, vlrs));
    whole.or(named).or_else(|| keys.own(vlrs)).or_else(citation)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// The units that the keys among these say.
    pub fn of(vlrs: &[Vlr]) -> Units {
        GeoKeys::of(vlrs).map(|keys| keys.units(vlrs)).unwrap_or_default()
    }

    /// A directory of these words.
    pub fn keys(words: &[u16]) -> Vlr {
        Vlr::new(USER, GEO_KEYS, "", words.iter().flat_map(|w| w.to_le_bytes()).collect())
    }

    #[test]
    fn geotiff_codes_become_epsg_text() {
        let vlr = keys(&[1, 1, 0, 2, 3072, 0, 1, 26915, 4096, 0, 1, 5703]);
        assert_eq!(text(&[vlr]).as_deref(), Some("EPSG:26915+5703"));
        assert_eq!(text(&[keys(&[1, 1])]), None, "a directory cut short names nothing");
    }

    #[test]
    fn units_that_the_codes_do_not_say_are_in_the_text() {
        let named = |words: &[u16]| {
            let mut all = vec![1, 1, 0, (words.len() / 2) as u16];
            all.extend(words.chunks_exact(2).flat_map(|w| [w[0], 0, 1, w[1]]));
            let record = [keys(&all)];
            (text(&record).unwrap(), of(&record))
        };
        for words in [
            &[1024, 1, 3072, 2277, 4099, 9003][..],
            &[1024, 1, 3072, 2277, 4099, 9001],
            &[1024, 1, 3072, 2277, 4096, 5703, 4099, 9003],
            &[1024, 1, 3072, 2277, 4096, 32767, 4099, 9003],
        ] {
            let (text, units) = named(words);
            assert!(text.starts_with("COMPD_CS[\""), "{words:?}: {text}");
            assert!(wkt::units(&text).are(&units), "{words:?}: {text}");
        }
        // The codes say it, or there is no WKT of what contradicts them.
        for (words, codes) in [
            (&[1024, 1, 3072, 2277, 3076, 9003, 4096, 6360, 4099, 9003][..], "EPSG:2277+6360"),
            (&[1024, 1, 3072, 2277, 3076, 9001], "EPSG:2277"),
            (&[1024, 1, 3072, 2277, 4096, 5103, 4099, 9003], "EPSG:2277+5103"),
        ] {
            assert_eq!(named(words).0, codes, "{words:?}");
        }
    }

    #[test]
    fn a_citation_beyond_its_text_is_ignored() {
        let ascii = Vlr::new(USER, GEO_ASCII, "", b"Here|".to_vec());
        let good = keys(&[1, 1, 0, 1, 1026, GEO_ASCII, 5, 0]);
        let bad = keys(&[1, 1, 0, 1, 1026, GEO_ASCII, 500, 65535]);
        assert_eq!(text(&[good, ascii.clone()]).as_deref(), Some("Here"));
        assert_eq!(text(&[bad, ascii]), None);
    }

    #[test]
    fn geotiff_keys_name_units() {
        let units = |words: &[u16]| {
            let mut all = vec![1, 1, 0, 0];
            all.extend(words.chunks_exact(2).flat_map(|w| [w[0], 0, 1, w[1]]));
            of(&[keys(&all)])
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
    fn a_unit_of_ones_own_is_as_long_as_it_says() {
        let doubles = |v: f64| {
            let bytes = [7.0, v].iter().flat_map(|v: &f64| v.to_le_bytes()).collect();
            Vlr::new(USER, GEO_DOUBLES, "", bytes)
        };
        let own = keys(&[1, 1, 0, 2, 3076, 0, 1, 32767, 3077, GEO_DOUBLES, 1, 1]);
        let horizontal = |v| of(&[own.clone(), doubles(v)]).horizontal;
        assert_eq!(horizontal(0.9144), Some(Horizontal::Metres(0.9144)));
        assert_eq!((horizontal(f64::NAN), horizontal(-1.0)), (None, None));
    }
}
