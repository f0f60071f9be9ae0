//! The units that a coordinate reference system names, in well-known text (WKT 1: OGC 01-009; WKT 2:
//! OGC 18-010) or by its EPSG code. Knows no files.

use crate::point::{Horizontal, Units};

/// A text with brackets nested deeper is none of a coordinate reference system.
const DEEPEST: usize = 64;
/// Brackets that are looked into; a system has some hundreds.
const MOST_NODES: usize = 20_000;

/// The units of the system that `text` is: WKT, or `EPSG:code` with a vertical code behind `+`.
/// Nothing is said for a text that is neither.
pub fn units(text: &str) -> Units {
    let text = text.trim();
    match text.strip_prefix("EPSG:") {
        Some(codes) => {
            let mut codes = codes.splitn(2, '+').map(|code| code.trim().parse::<u32>().ok());
            let horizontal = codes.next().flatten().and_then(epsg_horizontal);
            let vertical = codes.next().flatten().and_then(epsg_vertical);
            Units { horizontal, vertical }
        }
        None => parse(text).map_or(Units::default(), |node| of_system(&node)),
    }
}

/// Degrees for the geographic systems that scans come in. Codes of projected systems say nothing
/// here: their files give the unit.
fn epsg_horizontal(code: u32) -> Option<Horizontal> {
    const GEOGRAPHIC: [u32; 30] = [
        4148, 4152, 4167, 4171, 4230, 4258, 4267, 4269, 4277, 4283, 4289, 4312, 4313, 4314, 4326,
        4490, 4612, 4617, 4674, 4759, 4937, 4965, 4979, 6318, 6319, 6668, 6706, 7844, 9057, 9755,
    ];
    GEOGRAPHIC.contains(&code).then_some(Horizontal::Degrees)
}

/// Metres in a unit of the vertical systems that scans come in.
pub fn epsg_vertical(code: u32) -> Option<f64> {
    match code {
        // EGM2008, ODN, AHD, NAVD88, NAP, EGM96, IGN69, EGM84, Baltic 1977, LN02, DHHN92, CGVD28, EVRF2007,
        // CGVD2013, JGD2011, NZVD2016, DHHN2016, CGVD2013a, EVRF2019
        3855 | 5701 | 5703 | 5705 | 5709 | 5711 | 5713 | 5720 | 5728 | 5773 | 5783 | 5798
        | 5621 | 6647 | 6695 | 7837 | 7839 | 9245 | 9389 => Some(1.0),
        // NGVD29 and NAVD88 in US survey feet.
        5702 | 6360 => Some(SURVEY_FOOT),
        // NAVD88 in feet.
        8228 => Some(FOOT),
        _ => None,
    }
}

/// Metres in an international foot.
const FOOT: f64 = 0.3048;
/// Metres in a US survey foot.
const SURVEY_FOOT: f64 = 1200.0 / 3937.0;

/// Metres in the EPSG unit of length `code`, for those of surveys.
pub fn epsg_unit(code: u16) -> Option<f64> {
    match code {
        9001 => Some(1.0),
        9002 => Some(FOOT),
        9003 => Some(SURVEY_FOOT),
        9005 => Some(0.304_797_265_4), // Clarke's foot
        9036 => Some(1000.0),
        _ => None,
    }
}

/// `WORD["text", number, WORD[…], …]`.
#[derive(Debug, Default)]
struct Node {
    word: String,
    /// Texts and numbers inside, as written, quotes off.
    values: Vec<String>,
    inner: Vec<Node>,
}

impl Node {
    fn is(&self, words: &[&str]) -> bool {
        words.iter().any(|word| self.word.eq_ignore_ascii_case(word))
    }

    fn find(&self, words: &[&str]) -> Option<&Node> {
        self.inner.iter().find(|node| node.is(words))
    }
}

/// The outermost node of `text`; None if its brackets do not match.
fn parse(text: &str) -> Option<Node> {
    let mut open: Vec<Node> = Vec::new();
    let mut word = String::new();
    let mut nodes = 0;
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '[' | '(' => {
                nodes += 1;
                if open.len() == DEEPEST || nodes > MOST_NODES {
                    return None;
                }
                let word = std::mem::take(&mut word);
                open.push(Node { word: word.trim().to_owned(), ..Node::default() });
            }
            ']' | ')' | ',' => {
                let node = open.last_mut()?;
                let value = std::mem::take(&mut word);
                if !value.trim().is_empty() {
                    node.values.push(value.trim().to_owned());
                }
                if letter != ',' {
                    let done = open.pop()?;
                    match open.last_mut() {
                        Some(outer) => outer.inner.push(done),
                        None => return Some(done),
                    }
                }
            }
            '"' => {
                // A doubled quote is one inside the text.
                while let Some(letter) = letters.next() {
                    if letter == '"' && letters.next_if_eq(&'"').is_none() {
                        break;
                    }
                    word.push(letter);
                }
            }
            _ => word.push(letter),
        }
    }
    None
}

const VERTICAL: [&str; 4] = ["VERT_CS", "VERTCS", "VERTCRS", "VERTICALCRS"];
const PROJECTED: [&str; 3] = ["PROJCS", "PROJCRS", "PROJECTEDCRS"];
const GEODETIC: [&str; 5] = ["GEOGCS", "GEOGCRS", "GEOGRAPHICCRS", "GEODCRS", "GEODETICCRS"];
const LOCAL: [&str; 4] = ["GEOCCS", "LOCAL_CS", "ENGCRS", "ENGINEERINGCRS"];
const LENGTH: [&str; 2] = ["LENGTHUNIT", "UNIT"];

/// The units of the system that `node` is.
fn of_system(node: &Node) -> Units {
    if node.is(&["BOUNDCRS"]) {
        let source = node.find(&["SOURCECRS"]).and_then(|source| source.inner.first());
        return source.map_or(Units::default(), of_system);
    }
    if node.is(&["COMPD_CS", "COMPOUNDCRS"]) {
        let parts = node.inner.iter().map(of_system);
        return parts.fold(Units::default(), |all, part| Units {
            horizontal: all.horizontal.or(part.horizontal),
            vertical: all.vertical.or(part.vertical),
        });
    }
    if node.is(&VERTICAL) {
        return Units { horizontal: None, vertical: metres(node) };
    }
    // Some writers put the vertical system inside the projected one.
    let vertical = node.find(&VERTICAL).and_then(metres).or_else(|| third_axis(node));
    let geocentric = node
        .find(&["CS"])
        .and_then(|cs| cs.values.first())
        .is_some_and(|kind| kind.eq_ignore_ascii_case("Cartesian"));
    let horizontal = if node.is(&GEODETIC) && !geocentric {
        Some(Horizontal::Degrees)
    } else if node.is(&PROJECTED) || node.is(&GEODETIC) || node.is(&LOCAL) {
        metres(node).map(Horizontal::Metres)
    } else {
        None
    };
    Units { horizontal, vertical }
}

/// Metres in the unit of length of `node`, or of its first axis.
fn metres(node: &Node) -> Option<f64> {
    let unit = node.find(&LENGTH).or_else(|| node.find(&["AXIS"]).and_then(|a| a.find(&LENGTH)))?;
    factor(unit)
}

/// Metres in the unit of the third of three axes, where each has its own.
fn third_axis(node: &Node) -> Option<f64> {
    let axis = node.inner.iter().filter(|inner| inner.is(&["AXIS"])).nth(2)?;
    factor(axis.find(&LENGTH)?)
}

/// Metres in a unit; None for what cannot be, such as a foot of one metre, which some writers name.
fn factor(unit: &Node) -> Option<f64> {
    let factor: f64 = unit.values.get(1)?.parse().ok()?;
    let name = unit.values.first()?.to_ascii_lowercase();
    let foot = ["foot", "feet", "ft"].iter().any(|word| name.contains(word));
    let possible = factor.is_finite() && factor > 0.0 && (!foot || (0.29..0.32).contains(&factor));
    possible.then_some(factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    const UTM: &str = "PROJCS[\"UTM \"\"10\"\" N\",GEOGCS[\"WGS84\",PRIMEM[\"Greenwich\",0],\
                       UNIT[\"degree\",0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],\
                       UNIT[\"metre\",1,AUTHORITY[\"EPSG\",\"9001\"]],AXIS[\"Easting\",EAST]]";

    fn of(horizontal: Option<Horizontal>, vertical: Option<f64>) -> Units {
        Units { horizontal, vertical }
    }

    #[test]
    fn a_projected_system_has_its_own_unit_and_not_that_of_its_angles() {
        assert_eq!(units(UTM), of(Some(Horizontal::Metres(1.0)), None));
        let wkt2 = "PROJCRS[\"a\",BASEGEOGCRS[\"b\",ANGLEUNIT[\"degree\",0.017]],\
                    CS[Cartesian,2],AXIS[\"e\",east],AXIS[\"n\",north],LENGTHUNIT[\"metre\",1]]";
        assert_eq!(units(wkt2), of(Some(Horizontal::Metres(1.0)), None));
        let by_axis = "PROJCRS[\"a\",CS[Cartesian,2],AXIS[\"e\",east,LENGTHUNIT[\"foot\",0.3048]],\
                       AXIS[\"n\",north,LENGTHUNIT[\"foot\",0.3048]]]";
        assert_eq!(units(by_axis), of(Some(Horizontal::Metres(FOOT)), None));
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
        let three = "GEOGCRS[\"WGS 84\",CS[ellipsoidal,3],AXIS[\"lat\",north,ANGLEUNIT[\"degree\",0.017]],\
                     AXIS[\"lon\",east,ANGLEUNIT[\"degree\",0.017]],AXIS[\"h\",up,LENGTHUNIT[\"metre\",1]]]";
        assert_eq!(units(three), of(degrees, Some(1.0)));
        for text in [
            "GEOCCS[\"x\",UNIT[\"metre\",1]]",
            "GEODCRS[\"x\",CS[Cartesian,3],AXIS[\"X\",geocentricX],LENGTHUNIT[\"metre\",1]]",
        ] {
            assert_eq!(units(text), of(Some(Horizontal::Metres(1.0)), None), "{text}");
        }
        let bound = format!("BOUNDCRS[SOURCECRS[{UTM}],TARGETCRS[GEOGCRS[\"x\"]]]");
        assert_eq!(units(&bound), of(Some(Horizontal::Metres(1.0)), None));
    }

    #[test]
    fn a_foot_of_one_metre_says_nothing() {
        let text = UTM
            .replace("AXIS[\"Easting\",EAST]", "VERTCS[\"NAVD88\",UNIT[\"US survey foot\",1.0]]");
        assert_eq!(units(&text), of(Some(Horizontal::Metres(1.0)), None));
    }

    #[test]
    fn codes_say_what_is_known_of_them() {
        assert_eq!(units("EPSG:4326"), of(Some(Horizontal::Degrees), None));
        assert_eq!(units("EPSG:26910+6360"), of(None, Some(SURVEY_FOOT)));
        assert_eq!(units("EPSG:none"), Units::default());
    }

    #[test]
    fn nonsense_says_nothing() {
        let deep = "A[".repeat(1_000_000);
        let wide = format!("A[{}]", "B[1],".repeat(1_000_000));
        for text in
            ["", "PROJCS", "PROJCS[", "]]]]", "PROJCS[\"", "a,b", "UNIT[\"m\",1]", &deep, &wide]
        {
            assert_eq!(units(text), Units::default());
        }
        let negative = UTM.replace("\"metre\",1", "\"metre\",-1");
        assert_eq!(units(&negative), Units::default());
        assert_eq!(units(&UTM.replace("\"metre\",1", "\"metre\",nan")), Units::default());
    }
}
