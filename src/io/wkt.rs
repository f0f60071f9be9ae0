//! The units that a coordinate reference system names, in well-known text (WKT 1: OGC 01-009; WKT
//! 2: OGC 18-010) or by its EPSG code. Knows no files.

pub mod tree;

use super::epsg;
use crate::point::{Horizontal, Units};
use tree::{
    BOUND, COMPOUND, GEODETIC, LENGTH, LOCAL, PROJECTED, SYSTEMS, VERTICAL, WktNode, factor,
    length_unit, parse, parts,
};

/// The units of the system that `text` is: WKT, or `EPSG:code` with a vertical code behind `+`. Of
/// another text, nothing is known.
pub fn units(text: &str) -> Units {
    let unknown = Units { horizontal_unknown: true, ..Units::default() };
    match codes_of(text) {
        Some((across, up)) => {
            let across = across.map_or(unknown, epsg::horizontal);
            up.map_or(across, |up| across.or(of_vertical(up.and_then(epsg::vertical))))
        }
        None => parse(text).map_or(unknown, |trees| of_parts(parts(&trees))),
    }
}

/// The codes in `EPSG:code+code`, none for one that is no number; the second may be absent.
fn codes_of(text: &str) -> Option<(Option<u32>, Option<Option<u32>>)> {
    let codes = text.trim().strip_prefix("EPSG:")?;
    let number = |code: &str| code.trim().parse::<u32>().ok();
    Some(match codes.split_once('+') {
        Some((across, up)) => (number(across), Some(number(up))),
        None => match number(codes).and_then(epsg::parts) {
            Some((across, up)) => (Some(across), Some(Some(up))),
            None => (number(codes), None),
        },
    })
}

/// The system that `text` is by its EPSG codes: that of x and y, and that of z where there is one.
/// None where one of them has no code.
pub fn codes(text: &str) -> Option<(u32, Option<u32>)> {
    match codes_of(text) {
        Some((across, None)) => Some((across?, None)),
        Some((across, Some(up))) => Some((across?, Some(up?))),
        None => codes_of_parts(&parse(text)?),
    }
}

/// The code of the system of x and y in WKT, whatever is said of heights.
#[cfg(feature = "proj")]
pub fn horizontal_code(text: &str) -> Option<u32> {
    let trees = parse(text)?;
    let mut across = parts(&trees).into_iter().filter(|part| !part.is(&VERTICAL));
    let code = across.next()?.epsg()?;
    across.next().is_none().then_some(code)
}

fn codes_of_parts(trees: &[WktNode]) -> Option<(u32, Option<u32>)> {
    let (mut across, mut up) = (None, None);
    for part in parts(trees) {
        let code = part.epsg()?;
        let place = if part.is(&VERTICAL) { &mut up } else { &mut across };
        if place.replace(code).is_some() {
            return None;
        }
    }
    Some((across?, up))
}

/// True if both texts are WKT of one wording: spaces, the case of keywords, and how numbers are
/// written aside.
pub fn alike(one: &str, two: &str) -> bool {
    let (Some(one), Some(two)) = (parse(one), parse(two)) else { return false };
    one.len() == two.len() && one.iter().zip(&two).all(|(one, two)| one.is_like(two))
}

/// True if `text` begins like WKT 1 or 2.
pub fn is_wkt(text: &str) -> bool {
    let word = text.trim_start().split(['[', '(']).next().unwrap_or_default();
    let named = WktNode { word: word.trim_end().to_owned(), ..WktNode::default() };
    let is_system = named.is(&COMPOUND) || SYSTEMS.iter().any(|words| named.is(words));
    is_system && word.len() < text.trim_start().len()
}

/// True if all brackets of `text` are closed, and there is nothing outside of them.
pub fn is_closed(text: &str) -> bool {
    parse(text).is_some()
}

/// True if `text` begins with a keyword that WKT 2 has, and WKT 1 has not.
pub fn is_second(text: &str) -> bool {
    let word = text.trim_start().split(['[', '(']).next().unwrap_or_default();
    word.trim_end().to_ascii_uppercase().ends_with("CRS")
}

/// The units of a system that is given in parts: what the first says that says something.
fn of_parts<'a>(parts: impl IntoIterator<Item = &'a WktNode>) -> Units {
    parts.into_iter().map(of_system).fold(Units::default(), Units::or)
}

fn of_vertical(metres: Option<f64>) -> Units {
    Units { vertical: metres, vertical_unknown: metres.is_none(), ..Units::default() }
}

/// The units of the system that `node` is.
fn of_system(node: &WktNode) -> Units {
    if node.is(&BOUND) {
        let source = node.find(&["SOURCECRS"]).map_or(&[][..], |source| &source.inner);
        return of_parts(parts(source));
    }
    if node.is(&VERTICAL) {
        return of_vertical(match length_unit(node) {
            Some(unit) => factor(unit),
            None => node.epsg().and_then(epsg::vertical),
        });
    }
    let system = of_horizontal(node);
    // Some writers put the vertical system inside the projected one.
    let inside = node.find(&VERTICAL).map(of_system).unwrap_or_default();
    let third = Units { vertical: third_axis(node), ..Units::default() };
    inside.or(third).or(system)
}

/// The units of a system of x and y as it says them; where it says none, as its code does.
fn of_horizontal(node: &WktNode) -> Units {
    let unknown = Units { horizontal_unknown: true, ..Units::default() };
    let of = |horizontal| Units { horizontal: Some(horizontal), ..Units::default() };
    let cartesian = node.find(&["CS"]).and_then(|cs| cs.values.first());
    let cartesian = cartesian.is_some_and(|kind| kind.eq_ignore_ascii_case("Cartesian"));
    if node.is(&GEODETIC) && !cartesian {
        return of(Horizontal::Degrees);
    }
    if ![&PROJECTED[..], &GEODETIC, &LOCAL].iter().any(|words| node.is(words)) {
        return unknown;
    }
    let across = match length_unit(node) {
        Some(unit) => factor(unit).map_or(unknown, |metres| of(Horizontal::Metres(metres))),
        None => epsg::horizontal(node.epsg().unwrap_or(0)),
    };
    match across.horizontal {
        // Three axes in one unit.
        Some(Horizontal::Metres(metres)) if node.is(&GEODETIC) || node.is(&["GEOCCS"]) => {
            Units { vertical: Some(metres), ..across }
        }
        _ => across,
    }
}

/// Metres in the unit of the third of three axes, where each has its own.
fn third_axis(node: &WktNode) -> Option<f64> {
    let axis = node.inner.iter().filter(|inner| inner.is(&["AXIS"])).nth(2)?;
    factor(axis.find(&LENGTH)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    const UTM: &str = "PROJCS[\"UTM \"\"10\"\" N\",GEOGCS[\"WGS84\",PRIMEM[\"Greenwich\",0],\
                       UNIT[\"degree\",0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],\
                       UNIT[\"metre\",1,AUTHORITY[\"EPSG\",\"9001\"]],AXIS[\"Easting\",EAST]]";

    fn of(horizontal: Option<Horizontal>, vertical: Option<f64>) -> Units {
        Units { horizontal, vertical, ..Units::default() }
    }

    /// Nothing known of a system that is there.
    fn unknown() -> Units {
        Units { horizontal_unknown: true, ..Units::default() }
    }

    #[test]
    fn a_projected_system_has_its_own_unit_and_not_that_of_its_angles() {
        assert_eq!(units(UTM), of(Some(Horizontal::Metres(1.0)), None));
        let wkt2 = "PROJCRS[\"a\",BASEGEOGCRS[\"b\",ANGLEUNIT[\"degree\",0.017]],\
                    CS[Cartesian,2],AXIS[\"e\",east],AXIS[\"n\",north],LENGTHUNIT[\"metre\",1]]";
        assert_eq!(units(wkt2), of(Some(Horizontal::Metres(1.0)), None));
        let by_axis = "PROJCRS[\"a\",CS[Cartesian,2],AXIS[\"e\",east,LENGTHUNIT[\"foot\",0.3048]],\
                       AXIS[\"n\",north,LENGTHUNIT[\"foot\",0.3048]]]";
        assert_eq!(units(by_axis), of(Some(Horizontal::Metres(0.3048)), None));
    }

    #[test]
    fn a_compound_has_the_units_of_its_parts() {
        for words in [["COMPD_CS", "VERT_CS", "UNIT"], ["CompoundCRS", "VERTCRS", "LENGTHUNIT"]] {
            let [compound, vertical, unit] = words;
            let text = format!(
                "{compound}[\"m and ft\", {UTM} , {vertical} [ \"NAVD88\",VDATUM[\"x\"], \
                 {unit} [ \"US survey foot\", 0.304800609601219 ] ] ]"
            );
            let vertical = Some(0.304_800_609_601_219);
            assert_eq!(units(&text), of(Some(Horizontal::Metres(1.0)), vertical));
            assert!(units(&text).mismatch().is_some());
        }
    }

    #[test]
    fn geographic_systems_are_degrees_and_geocentric_ones_are_not() {
        let degrees = Some(Horizontal::Degrees);
        assert_eq!(units("GEOGCS[\"WGS 84\",UNIT[\"degree\",0.017]]"), of(degrees, None));
        let three = "GEOGCRS[\"WGS 84\",CS[ellipsoidal,3],\
                     AXIS[\"lat\",north,ANGLEUNIT[\"degree\",0.017]],\
                     AXIS[\"lon\",east,ANGLEUNIT[\"degree\",0.017]],\
                     AXIS[\"h\",up,LENGTHUNIT[\"metre\",1]]]";
        assert_eq!(units(three), of(degrees, Some(1.0)));
        for text in [
            "GEOCCS[\"x\",UNIT[\"metre\",1]]",
            "GEODCRS[\"x\",CS[Cartesian,3],AXIS[\"X\",geocentricX],LENGTHUNIT[\"metre\",1]]",
        ] {
            assert_eq!(units(text), of(Some(Horizontal::Metres(1.0)), Some(1.0)), "{text}");
        }
        let bound = format!("BOUNDCRS[SOURCECRS[{UTM}],TARGETCRS[GEOGCRS[\"x\"]]]");
        assert_eq!(units(&bound), of(Some(Horizontal::Metres(1.0)), None));
    }

    #[test]
    fn a_foot_of_one_metre_is_no_known_unit() {
        let text = UTM
            .replace("AXIS[\"Easting\",EAST]", "VERTCS[\"NAVD88\",UNIT[\"US survey foot\",1.0]]");
        let metres = of(Some(Horizontal::Metres(1.0)), None);
        assert_eq!(units(&text), Units { vertical_unknown: true, ..metres });
    }

    #[test]
    fn a_vertical_system_behind_the_projected_one_counts() {
        for between in [",", "", "\n, "] {
            let text =
                format!("{UTM}{between}VERTCS[\"NAVD_1988\",UNIT[\"Foot_US\",0.3048006096]]");
            assert_eq!(units(&text), of(Some(Horizontal::Metres(1.0)), Some(0.3048006096)));
        }
        assert_eq!(units(&format!("{UTM},VERTCS[")), unknown(), "cut short");
        let early = format!("COMPD_CS[\"x\",{UTM}],VERT_CS[\"NAVD88\",UNIT[\"metres\",1.0]]]");
        assert_eq!(units(&early), of(Some(Horizontal::Metres(1.0)), Some(1.0)));
    }

    #[test]
    fn what_gives_no_unit_has_that_of_its_code() {
        let text = "COMPD_CS[\"x\",PROJCS[\"Texas\",AUTHORITY[\"EPSG\",\"2277\"]],\
                    VERT_CS[\"NAVD88\",AUTHORITY[\"EPSG\",\"5703\"]],AUTHORITY[\"EPSG\",\"9999\"]]";
        assert_eq!(units(text), of(Some(Horizontal::Metres(1200.0 / 3937.0)), Some(1.0)));
        assert_eq!(codes(text), Some((2277, Some(5703))));
        let other = text.replace("5703", "5103");
        assert!(units(&other).vertical_unknown);
        let nonsense = text.replace("NAVD88\",", "NAVD88\",UNIT[\"US survey foot\",1.0],");
        assert!(units(&nonsense).vertical_unknown, "which of the two is wrong, nobody knows");
    }

    #[test]
    fn codes_say_what_is_known_of_them() {
        let metres = Some(Horizontal::Metres(1.0));
        assert_eq!(units("EPSG:4326"), of(Some(Horizontal::Degrees), None));
        assert_eq!(units("EPSG:26910+6360"), of(metres, Some(1200.0 / 3937.0)));
        assert_eq!(units("EPSG:25832"), of(metres, None));
        let height = Units { vertical_unknown: true, ..of(metres, None) };
        assert_eq!((units("EPSG:25832+5103"), units("EPSG:25832+x")), (height, height));
        assert_eq!(units("EPSG:none"), unknown());
        assert_eq!(
            (codes("EPSG:1+2"), codes("EPSG:x"), codes(UTM)),
            (Some((1, Some(2))), None, None)
        );
    }

    #[test]
    fn wording_is_more_than_spaces_and_case() {
        let other = UTM.replace("UNIT[\"metre\",1,", "Unit [ \"metre\" , 1.0,\n ");
        assert!(alike(UTM, &other) && !alike(UTM, &UTM.replace("metre", "meter")));
        assert!(!alike(UTM, &format!("{UTM},VERTCS[\"x\"]")) && !alike("", ""));
    }

    #[test]
    fn wkt_is_told_from_other_text() {
        assert!(is_wkt("PROJCS[\"x\"]") && is_wkt(" compoundcrs [\"x\"]"));
        assert!(!is_wkt("EPSG:2154") && !is_wkt("PROJCS") && !is_wkt(" PROJCS "));
    }

    #[test]
    fn of_nonsense_nothing_is_known() {
        let deep = "A[".repeat(1_000_000);
        let wide = format!("A[{}]", "B[1],".repeat(1_000_000));
        for text in
            ["", "PROJCS", "PROJCS[", "]]]]", "PROJCS[\"", "a,b", "UNIT[\"m\",1]", &deep, &wide]
        {
            assert_eq!(units(text), unknown());
        }
        let negative = UTM.replace("\"metre\",1", "\"metre\",-1");
        assert_eq!(units(&negative), unknown());
        assert_eq!(units(&UTM.replace("\"metre\",1", "\"metre\",nan")), unknown());
    }
}
