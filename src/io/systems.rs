//! In which coordinate reference system the points of several inputs are: what each says, what it
//! means, and what the user says of all of them.

use std::path::Path;

use super::meaning::SystemMeaning;
use super::{epsg, wkt};
use crate::error::shown;
use crate::point::Metadata;
use crate::stage::{Assumption, ReadKeys};
use crate::{Error, Result};

/// A system as a user names it: WKT as it is, EPSG codes in one spelling.
///
/// Fails, with what would do, if it is neither, or of a code that nothing is known of.
pub fn checked(text: &str) -> std::result::Result<String, String> {
    let text = text.trim();
    if !is_code(text) {
        let is_whole = wkt::is_wkt(text) && wkt::alike(text, text);
        return match is_whole {
            true => Ok(text.to_owned()),
            false => Err("a coordinate reference system is given as `EPSG:25832`, as \
                          `EPSG:25832+7837` with that of the heights, or as WKT"
                .to_owned()),
        };
    }
    let text = format!("EPSG:{}", &text[5..]);
    let Some((across, up)) = wkt::codes(&text) else {
        return Err(format!("`{text}` has no number where its code should be"));
    };
    let is_3d = up.is_some() && epsg::horizontal(across).vertical.is_some();
    if is_3d {
        return Err(format!(
            "EPSG:{across} has heights of its own, and there is room for no other"
        ));
    }
    if epsg::horizontal(across).horizontal_unknown {
        return Err(format!(
            "EPSG:{across} is no projected, geographic or geocentric system that \
                            is known here"
        ));
    }
    match up.filter(|&up| epsg::vertical(up).is_none()) {
        Some(up) => Err(format!("EPSG:{up} is no system of heights that is known here")),
        None => Ok(up.map_or(format!("EPSG:{across}"), |up| format!("EPSG:{across}+{up}"))),
    }
}

/// The same of EPSG codes alone.
pub fn checked_code(text: &str) -> std::result::Result<String, String> {
    match is_code(text.trim()) {
        true => checked(text),
        false => {
            Err("the coordinate reference system of the output is given by its EPSG code, as \
                      `EPSG:25832`, or as `EPSG:25832+7837` with that of the heights"
                .to_owned())
        }
    }
}

fn is_code(text: &str) -> bool {
    text.get(..5).is_some_and(|begin| begin.eq_ignore_ascii_case("EPSG:"))
}

/// True if both texts mean one system: the same text, WKT of one wording or the same EPSG codes
/// with the same units, or texts that say the same of all that makes a system.
pub fn are_same(one: &str, two: &str) -> bool {
    one == two || are_alike(one, two) && wkt::units(one).are(&wkt::units(two)) || mean_one(one, two)
}

/// True if both texts are WKT of one wording, or have the same EPSG codes and no numbers that
/// contradict each other; what units they name may differ.
pub fn are_alike(one: &str, two: &str) -> bool {
    let codes = wkt::codes(one);
    if wkt::alike(one, two) {
        return true;
    }
    let contradict = || {
        let [one, two] = [one, two].map(SystemMeaning::said);
        one.is_some_and(|one| two.is_some_and(|two| one.contradicts(&two)))
    };
    codes.is_some() && codes == wkt::codes(two) && !contradict()
}

/// True if both texts say the same of datum, projection, units and heights.
pub fn mean_one(one: &str, two: &str) -> bool {
    let [one, two] = [one, two].map(SystemMeaning::of);
    one.is_some_and(|one| two.is_some_and(|two| one.is(&two)))
}

/// The system of all inputs: what `keys` say, else what those that name one agree on. Of several
/// texts that mean the same, it is WKT rather than a code, and the least by its bytes.
///
/// Fails for two inputs that are in different systems, and for one that names none beside one that
/// does, unless that is to be assumed.
pub fn of_all(keys: &ReadKeys, inputs: &[(&Path, Option<String>)]) -> Result<Option<String>> {
    if keys.crs.is_some() {
        return Ok(keys.crs.clone());
    }
    let assumes = keys.assume.contains(&Assumption::Crs);
    let mut named = inputs.iter().filter_map(|(path, crs)| Some((*path, crs.as_deref()?)));
    let Some((first, system)) = named.next() else { return Ok(None) };
    for (path, crs) in inputs {
        match crs {
            None if !assumes => return Err(differ(path, first, None, Some(system))),
            Some(crs) if !are_same(crs, system) => {
                return Err(differ(path, first, Some(crs), Some(system)));
            }
            _ => {}
        }
    }
    let texts = inputs.iter().filter_map(|(_, crs)| crs.as_ref());
    Ok(texts.min_by_key(|text| (!wkt::is_wkt(text), *text)).cloned())
}

/// What is known of inputs of formats that name no system.
pub fn said(keys: &ReadKeys) -> Metadata {
    let crs = keys.crs.clone();
    let units = crs.as_deref().map(wkt::units).unwrap_or_default();
    Metadata { crs, units, ..Metadata::default() }
}

fn differ(path: &Path, other: &Path, crs: Option<&str>, of_other: Option<&str>) -> Error {
    let told = format!(
        "its coordinate reference system is not that of {}: {}",
        shown(other),
        told_apart(crs, of_other)
    );
    Error::data(path, told).help(remedy(crs.is_none() || of_other.is_none()))
}

/// What helps where systems of inputs differ, of which one may name none.
pub fn remedy(is_missing: bool) -> String {
    let all = "`read.crs = \"EPSG:25832\"` says which system all inputs are in, if they are in one";
    match is_missing {
        true => format!("if both are in one system, give `read.assume = [\"crs\"]`; {all}"),
        false => format!(
            "{all}; if they are in several, bring each to one by itself: `read.reproject` does it"
        ),
    }
}

/// Two texts of systems in the words of a message: from the beginning if that tells them apart,
/// else from shortly before they differ.
pub fn told_apart(one: Option<&str>, two: Option<&str>) -> String {
    let (Some(one), Some(two)) = (one, two) else {
        let told = |text: Option<&str>| text.map_or("none".to_owned(), short);
        return format!("{} and {}", told(one), told(two));
    };
    if one == two {
        return format!("{} and the same with other parameters", short(one));
    }
    if short(one) != short(two) {
        return format!("{} and {}", short(one), short(two));
    }
    let alike = one.chars().zip(two.chars()).take_while(|(a, b)| a == b).count();
    let end = |text: &str| {
        format!("…{}", short(&text.chars().skip(alike.saturating_sub(20)).collect::<String>()))
    };
    format!("{} and {}", end(one), end(two))
}

/// Characters of a system that are shown.
const SHOWN: usize = 60;

fn short(text: &str) -> String {
    let text: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    match text.char_indices().nth(SHOWN) {
        None => text,
        Some((end, _)) => format!("{}…", &text[..end]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UTM: &str = "PROJCS[\"a\",UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"25832\"]]";

    fn of(texts: &[Option<&str>], keys: &ReadKeys) -> Result<Option<String>> {
        let all: Vec<(&Path, Option<String>)> =
            texts.iter().map(|text| (Path::new("in.ply"), text.map(str::to_owned))).collect();
        of_all(keys, &all)
    }

    #[test]
    fn a_user_names_systems_by_code_or_wkt() {
        assert_eq!(checked(" epsg:25832 ").as_deref(), Ok("EPSG:25832"));
        assert_eq!(checked("EPSG:25832+7837").as_deref(), Ok("EPSG:25832+7837"));
        assert_eq!(checked(UTM).as_deref(), Ok(UTM));
        for (text, why) in [
            ("EPSG:1", "is known here"),
            ("EPSG:25832+25832", "no system of heights"),
            ("EPSG:UTM", "no number"),
            ("UTM32", "is given as"),
            ("", "is given as"),
            ("é", "is given as"),
            ("PROJCS[\"a\"", "is given as"),
        ] {
            assert!(checked(text).unwrap_err().contains(why), "{text}");
        }
    }

    #[test]
    fn inputs_of_one_system_in_other_words_are_of_one() {
        let keys = ReadKeys::default();
        let code = Some("EPSG:25832");
        assert_eq!(of(&[code, Some(UTM)], &keys).unwrap().as_deref(), Some(UTM));
        assert_eq!(of(&[Some(UTM), code], &keys).unwrap().as_deref(), Some(UTM));
        assert_eq!(of(&[None, None], &keys).unwrap(), None);
        let other = of(&[code, Some("EPSG:25833")], &keys).unwrap_err();
        assert!(other.to_string().contains("EPSG:25833 and EPSG:25832"), "{other}");
        assert!(other.remedy().unwrap().contains("read.crs") && of(&[None, code], &keys).is_err());
    }

    #[test]
    fn a_system_is_assumed_or_given() {
        let mut keys = ReadKeys { assume: vec![Assumption::Crs], ..ReadKeys::default() };
        let code = Some("EPSG:25832");
        assert_eq!(of(&[None, code, None], &keys).unwrap().as_deref(), code);
        assert!(of(&[None, code, Some("EPSG:25833")], &keys).is_err());
        keys.crs = Some("EPSG:2154".to_owned());
        assert_eq!(of(&[None, code], &keys).unwrap().as_deref(), Some("EPSG:2154"));
    }

    #[test]
    fn two_texts_are_shown_where_they_differ() {
        let long = |end: &str| format!("PROJCS[\"{}\",{end}]", "name ".repeat(30));
        let told = told_apart(Some(&long("UNIT[1]")), Some(&long("UNIT[2]")));
        assert!(told.starts_with('…') && told.contains("UNIT[1]") && told.contains("UNIT[2]"));
        assert_eq!(told_apart(None, Some("a")), "none and a");
        assert!(told_apart(Some("Here"), Some("Here")).contains("other parameters"));
    }
}
