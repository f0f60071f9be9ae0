//! GeoTIFF keys as WKT: the systems that they name, and projections that they describe in place of
//! a code (GeoTIFF 1.1, section 7.4).

use super::{
    CITATION, GEODETIC, GeoKeys, LINEAR_UNITS, METHOD, PROJECTED, PROJECTED_CITATION, SEPARATOR,
    VERTICAL, VERTICAL_CITATION, VERTICAL_UNITS,
};
use crate::io::las::vlr::Vlr;
use crate::io::wkt::tree;
use crate::io::{epsg, wkt};

/// Keys of the numbers of projections: parallels, origins, shifts, factors (section 7.4).
const PARALLELS: [u16; 2] = [3078, 3079];
const LONGITUDES: [u16; 3] = [3080, 3084, 3088];
const LATITUDES: [u16; 3] = [3081, 3085, 3089];
const EASTINGS: [u16; 3] = [3082, 3086, 3090];
const NORTHINGS: [u16; 3] = [3083, 3087, 3091];
const FACTORS: [u16; 2] = [3092, 3093];
/// Keys of a projection with a code, and of the unit of angles, of which degrees are one.
const PROJECTION: u16 = 3074;
const ANGLES: u16 = 2054;
const DEGREES: u16 = 9102;

impl GeoKeys {
    /// WKT of the projection that the keys describe in place of a code: transverse Mercator, conic
    /// projections, zones of UTM. None of others, and where a number is missing.
    pub(super) fn own(&self, vlrs: &[Vlr]) -> Option<String> {
        if !self.is_own() || !matches!(self.value(ANGLES), None | Some(DEGREES)) {
            return None;
        }
        let base = epsg::wkt(self.code(GEODETIC)?.into(), None)?;
        let base = base.starts_with("GEOGCS").then_some(base)?;
        let unit = epsg::unit_text(self.value(LINEAR_UNITS)?.into())?;
        let cited = [PROJECTED_CITATION, CITATION].iter().find_map(|key| self.name(*key, vlrs));
        let name = quoted(cited.as_deref().unwrap_or("unnamed"));
        let mut text = format!("PROJCS[{name},{base},");
        let (method, parameters) = self.projection(vlrs)?;
        text += &format!("PROJECTION[\"{method}\"],");
        for (name, value) in parameters {
            text += &format!("PARAMETER[\"{name}\",{value}],");
        }
        Some(text + &unit + ",AXIS[\"Easting\",EAST],AXIS[\"Northing\",NORTH]]")
    }

    /// What a key among the texts calls something, on one line.
    fn name(&self, key: u16, vlrs: &[Vlr]) -> Option<String> {
        let citation = self.citation(key, vlrs)?;
        let name = citation.split(SEPARATOR).next()?.replace(char::is_control, " ");
        Some(name.trim().to_owned()).filter(|name| !name.is_empty())
    }

    /// A method and its parameters, in the words of WKT 1.
    fn projection(&self, vlrs: &[Vlr]) -> Option<(&'static str, Vec<(&'static str, f64)>)> {
        let any = |keys: &[u16]| keys.iter().find_map(|key| self.double(*key, vlrs));
        let latitude = ("latitude_of_origin", any(&LATITUDES));
        let longitude = ("central_meridian", any(&LONGITUDES));
        let factor = ("scale_factor", any(&FACTORS).or(Some(1.0)));
        let parallels = [
            ("standard_parallel_1", any(&PARALLELS[..1])),
            ("standard_parallel_2", any(&PARALLELS[1..])),
        ];
        let shifts = [
            ("false_easting", any(&EASTINGS).or(Some(0.0))),
            ("false_northing", any(&NORTHINGS).or(Some(0.0))),
        ];
        let (method, all) = match (self.value(METHOD), self.code(PROJECTION)) {
            (Some(1), _) => ("Transverse_Mercator", vec![latitude, longitude, factor]),
            (Some(8), _) => {
                ("Lambert_Conformal_Conic_2SP", [&[latitude, longitude], &parallels[..]].concat())
            }
            (Some(9), _) => ("Lambert_Conformal_Conic_1SP", vec![latitude, longitude, factor]),
            (Some(11), _) => {
                let center =
                    [("latitude_of_center", latitude.1), ("longitude_of_center", longitude.1)];
                ("Albers_Conic_Equal_Area", [&center, &parallels[..]].concat())
            }
            (None, Some(zone)) => return utm(zone),
            _ => return None,
        };
        let all = all.into_iter().chain(shifts).map(|(name, value)| Some((name, value?)));
        Some((method, all.collect::<Option<Vec<_>>>()?))
    }

    /// WKT 1 of the system that they name or describe, with its heights, whose unit may be given
    /// beside the system or alone.
    ///
    /// None if its definition is not known here, or keys of units say otherwise than it does.
    pub fn wkt(&self, vlrs: &[Vlr]) -> Option<String> {
        let across = match self.code(PROJECTED).or_else(|| self.code(GEODETIC)) {
            Some(code) if !self.is_own() => epsg::wkt(code.into(), None)?,
            _ => self.own(vlrs)?,
        };
        let text = match self.heights(vlrs)? {
            None => across,
            Some(up) => {
                let both = format!("{} + {}", name_of(&across)?, name_of(&up)?);
                format!("COMPD_CS[{},{across},{up}]", quoted(&both))
            }
        };
        wkt::units(&text).are(&self.units(vlrs)).then_some(text)
    }

    /// WKT 1 of the system of heights, `Some(None)` if there is none.
    fn heights(&self, vlrs: &[Vlr]) -> Option<Option<String>> {
        let unit = self.value(VERTICAL_UNITS).filter(|_| self.has(VERTICAL_UNITS));
        let text = match (self.code(VERTICAL), unit) {
            (None, None) => return (!self.has(VERTICAL)).then_some(None),
            (Some(code), unit) => {
                // Heights of NAVD 88 in metres by their code, and in feet by the key beside it.
                let code = match (code, unit) {
                    (5703, Some(9002)) => 8228,
                    (5703, Some(9003)) => 6360,
                    (code, _) => code,
                };
                epsg::vertical_text(code.into())?
            }
            (None, Some(unit)) => {
                let cited = self.name(VERTICAL_CITATION, vlrs);
                let name = quoted(cited.as_deref().unwrap_or("unknown"));
                let unit = epsg::unit_text(unit.into())?;
                format!(
                    "VERT_CS[{name},VERT_DATUM[{name},2005],{unit},\
                     AXIS[\"Gravity-related height\",UP]]"
                )
            }
        };
        Some(Some(text))
    }
}

/// `name` as WKT has texts.
fn quoted(name: &str) -> String {
    format!("\"{}\"", name.replace('"', "\"\""))
}

/// What the system of this WKT is called.
fn name_of(text: &str) -> Option<String> {
    tree::parse(text)?.into_iter().next()?.values.into_iter().next()
}

/// A zone of UTM by the code of its projection: 160 and its number north, 161 and its number south.
fn utm(code: u16) -> Option<(&'static str, Vec<(&'static str, f64)>)> {
    let (zone, is_south) = (code % 100, code / 100 == 161);
    if !(16001..=16060).contains(&code) && !(16101..=16160).contains(&code) {
        return None;
    }
    let parameters = [
        ("latitude_of_origin", 0.0),
        ("central_meridian", f64::from(zone) * 6.0 - 183.0),
        ("scale_factor", 0.9996),
        ("false_easting", 500_000.0),
        ("false_northing", if is_south { 10_000_000.0 } else { 0.0 }),
    ];
    Some(("Transverse_Mercator", parameters.to_vec()))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, of};
    use super::super::{GEO_ASCII, GEO_DOUBLES, GEO_KEYS, USER, text as named};
    use super::*;

    /// Keys, of which those above 3076 but for units have their numbers among the doubles.
    fn described(words: &[u16], numbers: &[(u16, f64)]) -> [Vlr; 2] {
        let mut all = vec![1, 1, 0, (words.len() / 2 + numbers.len()) as u16];
        all.extend(words.chunks_exact(2).flat_map(|w| [w[0], 0, 1, w[1]]));
        let places = numbers.iter().zip(0..);
        all.extend(places.flat_map(|((key, _), at)| [*key, GEO_DOUBLES, 1, at]));
        let doubles = numbers.iter().flat_map(|(_, value)| value.to_le_bytes()).collect();
        [keys(&all), Vlr::new(USER, GEO_DOUBLES, "", doubles)]
    }

    fn wkt_of(vlrs: &[Vlr]) -> Option<String> {
        GeoKeys::of(vlrs).unwrap().wkt(vlrs)
    }

    #[test]
    fn codes_become_wkt_with_the_units_that_the_keys_say() {
        let made = |words: &[u16]| wkt_of(&described(words, &[]));
        let utm = made(&[1024, 1, 3072, 25832, 4096, 7837]).unwrap();
        assert_eq!(Some(utm), epsg::wkt(25832, Some(7837)));
        assert_eq!(made(&[1024, 1, 3072, 25832]), epsg::wkt(25832, None));
        assert_eq!(made(&[1024, 2, 2048, 4326]), epsg::wkt(4326, None));
        // Heights of a system in metres that are in feet are of the system in feet.
        let feet = made(&[1024, 1, 3072, 2277, 3076, 9003, 4096, 5703, 4099, 9003]).unwrap();
        assert_eq!(wkt::codes(&feet), Some((2277, Some(6360))));
        let alone = made(&[1024, 1, 3072, 25832, 4099, 9001]).unwrap();
        assert_eq!((wkt::units(&alone).vertical, wkt::codes(&alone)), (Some(1.0), None));
        for none in [
            &[1024, 1, 3072, 25832, 3076, 9003][..],
            &[1024, 1, 3072, 25832, 4096, 5103],
            &[1024, 1, 3072, 25832, 4096, 32767],
            &[1024, 1, 3072, 25832, 4096, 7837, 4099, 9002],
            &[1024, 2, 2048, 4979],
            &[1024, 1, 3072, 31000],
            &[],
        ] {
            assert_eq!(made(none), None, "{none:?}");
        }
    }

    /// Keys that describe a projection, but for its method and unit.
    const OWN: [u16; 10] = [1024, 1, 2048, 4269, 2054, 9102, 3072, 32767, 3074, 32767];
    const NUMBERS: [(u16, f64); 5] =
        [(3080, -100.5), (3081, 29.5), (3092, 0.9999), (3082, 700.0), (3083, 3000.0)];

    /// Keys with citations: the directory and what stands in its texts.
    fn cited(words: &[u16], numbers: &[(u16, f64)], citations: &[(u16, &str)]) -> Vec<Vlr> {
        let [directory, doubles] = described(words, numbers);
        let mut all = directory.payload().to_vec();
        let mut ascii = String::new();
        for (key, citation) in citations {
            let (start, length) = (ascii.len() as u16, citation.len() as u16 + 1);
            all.extend([*key, GEO_ASCII, length, start].iter().flat_map(|w| w.to_le_bytes()));
            ascii += &format!("{citation}|");
        }
        let directory = Vlr::new(USER, GEO_KEYS, "", all);
        vec![directory, doubles, Vlr::new(USER, GEO_ASCII, "", ascii.into_bytes())]
    }

    #[test]
    fn systems_are_called_what_citations_call_them() {
        let heights = [1024, 1, 3072, 2277, 4099, 9003];
        let named = |text: &str| wkt_of(&cited(&heights, &[], &[(4097, text)])).unwrap();
        let text = named("NAVD88 \"ft\", Geoid12B");
        let height = "\"NAVD88 \"\"ft\"\", Geoid12B\"";
        assert!(text.contains(&format!("VERT_CS[{height},VERT_DATUM[{height},2005]")), "{text}");
        let both = "NAD83 / Texas Central (ftUS) + NAVD88 \"\"ft\"\", Geoid12B";
        assert!(text.starts_with(&format!("COMPD_CS[\"{both}\",PROJCS[")), "{text}");
        assert!(wkt::is_closed(&text) && wkt::units(&text).are(&wkt::units("EPSG:2277+6360")));
        assert!(named(" \n|ft").contains("VERT_DATUM[\"unknown\",2005]"), "nothing is no name");
        assert!(named("a\nb|c").contains("VERT_DATUM[\"a b\",2005]"), "one line, one text");

        let mercator = [&OWN[..], &[3075, 1, 3076, 9001]].concat();
        for (citations, name) in [
            (&[(1026, "All"), (3073, "Texas TMX")][..], "Texas TMX"),
            (&[(1026, "All")], "All"),
            (&[(2049, "NAD83")], "unnamed"),
        ] {
            let text = wkt_of(&cited(&mercator, &NUMBERS, citations)).unwrap();
            assert!(text.starts_with(&format!("PROJCS[\"{name}\",GEOGCS[")), "{text}");
        }
    }

    #[test]
    fn heights_of_a_described_projection_are_in_the_text() {
        let text = |heights: &[u16]| {
            let keys = described(&[&OWN[..], &[3075, 1, 3076, 9001], heights].concat(), &NUMBERS);
            named(&keys).unwrap()
        };
        let feet = text(&[4096, 6360]);
        assert!(feet.starts_with("COMPD_CS[\"unnamed + NAVD88 height (ftUS)\",PROJCS["), "{feet}");
        assert!(feet.contains("AUTHORITY[\"EPSG\",\"6360\"]]"), "{feet}");
        let metres = text(&[4099, 9001]);
        assert_eq!(wkt::units(&metres).vertical, Some(1.0), "{metres}");
        assert!(text(&[]).starts_with("PROJCS["));
    }

    #[test]
    fn projections_that_keys_describe_become_wkt() {
        let (own, numbers) = (OWN, NUMBERS);
        let mercator = described(&[&own[..], &[3075, 1, 3076, 9003]].concat(), &numbers);
        let text = wkt_of(&mercator).unwrap();
        assert!(text.starts_with("PROJCS[\"unnamed\",GEOGCS[\"NAD83\""), "{text}");
        assert!(text.contains("PARAMETER[\"central_meridian\",-100.5]"), "{text}");
        assert!(wkt::units(&text).are(&of(&mercator)), "{text}");
        assert_eq!(named(&mercator), Some(text), "it is what other formats get");
        let cone = [(3078, 30.1), (3079, 31.9), (3084, -100.5), (3085, 29.5), (3086, 7e5)];
        let text = wkt_of(&described(&[&own[..], &[3075, 8, 3076, 9001]].concat(), &cone)).unwrap();
        assert!(text.contains("Lambert_Conformal_Conic_2SP") && text.contains("_2\",31.9]"));
        let zone = described(&[1024, 1, 2048, 4269, 3072, 32767, 3074, 16015, 3076, 9001], &[]);
        let text = wkt_of(&zone).unwrap();
        assert!(text.contains("central_meridian\",-93]") && text.contains("0.9996"), "{text}");
        // A number or the unit that is missing, another method, another unit of angles or datum.
        for (words, numbers) in [
            (&[&own[..], &[3075, 1, 3076, 9001]].concat(), &numbers[..1]),
            (&[&own[..], &[3075, 15, 3076, 9001]].concat(), &numbers[..]),
            (&[&own[..], &[3075, 1]].concat(), &numbers[..]),
            (
                &vec![1024, 1, 2048, 4269, 2054, 9105, 3072, 32767, 3075, 1, 3076, 9001],
                &numbers[..],
            ),
            (&vec![1024, 1, 2048, 32767, 3072, 32767, 3075, 1, 3076, 9001], &numbers[..]),
        ] {
            let vlrs = described(words, numbers);
            assert_eq!((wkt_of(&vlrs), named(&vlrs)), (None, None), "{words:?}");
        }
    }
}
