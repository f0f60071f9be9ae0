//! Coordinate reference systems by their EPSG codes: what they are, and the well-known text (WKT 1:
//! OGC 01-009, as GDAL writes it) that says so.

use std::collections::HashMap;
use std::sync::LazyLock;

use memchr::memmem;

/// What its head says. Lines of a kind stand together.
pub(super) const TABLE: &str = include_str!("systems.txt");
/// The calendar of a line's values: what stands between them.
pub(super) const BAR: char = '|';
/// The method of Web Mercator, which WKT 1 has no word for, ends with this in the table; and what
/// GDAL adds in its place.
const SPHERE: char = '*';
const SPHERE_SAID: &str = "EXTENSION[\"PROJ4\",\"+proj=merc +a=6378137 +b=6378137 +lat_ts=0 \
                           +lon_0=0 +x_0=0 +y_0=0 +k=1 +units=m +nadgrids=@null +wktext \
                           +no_defs\"],";

/// The text of the system `across`, in a compound with the system of heights `up` if there is one.
/// A code of a compound needs no other.
///
/// None if the table does not have one of them, or `across` gives heights already.
pub fn wkt(across: u32, up: Option<u32>) -> Option<String> {
    let Some(up) = up else {
        return geographic(across)
            .or_else(|| projected(across))
            .or_else(|| geocentric(across))
            .or_else(|| compound(across));
    };
    let parts = [geographic(across).or_else(|| projected(across))?, vertical_text(up)?];
    let name = format!("{} + {}", name_of(across)?, fields("vertical", up)?.first()?);
    Some(format!("COMPD_CS[\"{name}\",{},{}]", parts[0], parts[1]))
}

/// The systems of x and y and of z that the compound system `code` is made of.
pub fn parts(code: u32) -> Option<(u32, u32)> {
    let [_, across, up] = fields("compound", code)?[..] else { return None };
    Some((across.parse().ok()?, up.parse().ok()?))
}

/// The geodetic datums that are called `plain`, which is a name as [`plain`] leaves it.
pub fn datums(plain: &str) -> Vec<u32> {
    DATUMS.get(plain).cloned().unwrap_or_default()
}

/// The datums of heights of that name.
pub fn heights(plain: &str) -> Vec<u32> {
    HEIGHTS.get(plain).cloned().unwrap_or_default()
}

/// The geodetic datum of the geographic or projected system `code`.
pub fn datum_of(code: u32) -> Option<u32> {
    let base = fields("projected", code).and_then(|all| all.get(1)?.parse().ok());
    fields("geographic", base.unwrap_or(code))?.get(1)?.parse().ok()
}

/// A name without what writers change in it: case, spaces and most signs, and the letter that ESRI
/// puts before those of datums.
pub fn plain(name: &str) -> String {
    let name = name.trim();
    let name = name.strip_prefix("D_").unwrap_or(name);
    // CH1903+ is another datum than CH1903.
    let is_kept = |c: &char| c.is_ascii_alphanumeric() || *c == '+';
    name.chars().filter(is_kept).map(|c| c.to_ascii_lowercase()).collect()
}

/// The codes of the datums of a kind by all of their plain names: each of thousands of inputs may
/// ask for one.
type CodesByName = HashMap<String, Vec<u32>>;

static DATUMS: LazyLock<CodesByName> = LazyLock::new(|| codes_by_name("datum"));
static HEIGHTS: LazyLock<CodesByName> = LazyLock::new(|| codes_by_name("height"));

fn codes_by_name(kind: &str) -> CodesByName {
    let mut codes = CodesByName::new();
    let lines = TABLE.lines().filter_map(|line| line.strip_prefix(kind)?.strip_prefix(' '));
    for line in lines {
        let mut all = line.split(BAR);
        let (Some(Ok(code)), Some(name)) = (all.next().map(str::parse), all.next()) else {
            continue;
        };
        // Behind the name is its ellipsoid, then other names.
        for name in [name].into_iter().chain(all.skip(1)) {
            let of_name = codes.entry(plain(name)).or_default();
            if of_name.last() != Some(&code) {
                of_name.push(code);
            }
        }
    }
    codes
}

/// The fields behind the code of a line.
fn fields(kind: &str, code: impl std::fmt::Display) -> Option<Vec<&'static str>> {
    let begin = format!("\n{kind} {code}{BAR}");
    let at = memmem::find(TABLE.as_bytes(), begin.as_bytes())? + begin.len();
    Some(TABLE[at..].lines().next()?.split(BAR).collect())
}

fn name_of(code: u32) -> Option<&'static str> {
    fields("projected", code).or_else(|| fields("geographic", code))?.first().copied()
}

/// `WORD["name",…,AUTHORITY["EPSG","code"]]`, as texts name what has a code.
fn node(word: &str, name: &str, inner: &str, code: impl std::fmt::Display) -> String {
    format!("{word}[\"{name}\",{inner}AUTHORITY[\"EPSG\",\"{code}\"]]")
}

fn geographic(code: u32) -> Option<String> {
    let [name, datum, meridian, unit] = fields("geographic", code)?[..] else { return None };
    let inner = [
        datum_text(datum)?,
        named_value("meridian", "PRIMEM", meridian)?,
        unit_text(unit.parse().ok()?)?,
    ];
    Some(node("GEOGCS", name, &(inner.join(",") + ","), code))
}

fn geocentric(code: u32) -> Option<String> {
    const AXES: &str = "AXIS[\"Geocentric X\",OTHER],AXIS[\"Geocentric Y\",OTHER],\
                        AXIS[\"Geocentric Z\",NORTH]";
    let [name, datum] = fields("geocentric", code)?[..] else { return None };
    let greenwich = named_value("meridian", "PRIMEM", "8901")?;
    let inner = format!("{},{greenwich},{},{AXES},", datum_text(datum)?, unit_text(9001)?);
    Some(node("GEOCCS", name, &inner, code))
}

fn projected(code: u32) -> Option<String> {
    let all = fields("projected", code)?;
    let [name, base, method, unit, ref values @ ..] = all[..] else { return None };
    let (method, has_axes) = match method.strip_suffix('-') {
        Some(method) => (method, false),
        None => (method, true),
    };
    let shape = fields("method", method)?;
    let (method, parameters) = shape.split_first()?;
    let mut inner = geographic(base.parse().ok()?)?;
    inner += &format!(",PROJECTION[\"{}\"],", method.trim_end_matches(SPHERE));
    for (parameter, value) in parameters.iter().zip(values) {
        inner += &format!("PARAMETER[\"{parameter}\",{value}],");
    }
    inner += &(unit_text(unit.parse().ok()?)? + ",");
    inner += if has_axes { "AXIS[\"Easting\",EAST],AXIS[\"Northing\",NORTH]," } else { "" };
    inner += if method.ends_with(SPHERE) { SPHERE_SAID } else { "" };
    Some(node("PROJCS", name, &inner, code))
}

/// The text of the system of heights `code`.
pub fn vertical_text(code: u32) -> Option<String> {
    let [name, height, unit, axis] = fields("vertical", code)?[..] else { return None };
    let datum = node("VERT_DATUM", fields("height", height)?.first()?, "2005,", height);
    let way = if axis.to_ascii_lowercase().ends_with("depth") { "DOWN" } else { "UP" };
    let inner = format!("{datum},{},AXIS[\"{axis}\",{way}],", unit_text(unit.parse().ok()?)?);
    Some(node("VERT_CS", name, &inner, code))
}

fn compound(code: u32) -> Option<String> {
    let (across, up) = parts(code)?;
    let inner = [geographic(across).or_else(|| projected(across))?, vertical_text(up)?];
    let name = *fields("compound", code)?.first()?;
    Some(node("COMPD_CS", name, &(inner.join(",") + ","), code))
}

fn datum_text(code: &str) -> Option<String> {
    let all = fields("datum", code)?;
    let [name, ball, ..] = all[..] else { return None };
    let [ball_name, half_axis, flattening] = fields("ellipsoid", ball)?[..] else { return None };
    let ball = node("SPHEROID", ball_name, &format!("{half_axis},{flattening},"), ball);
    Some(node("DATUM", name, &(ball + ","), code))
}

/// The text of the unit `code`, of a length or an angle.
pub fn unit_text(code: u32) -> Option<String> {
    named_value("unit", "UNIT", &code.to_string())
}

fn named_value(kind: &str, word: &str, code: &str) -> Option<String> {
    let [name, value] = fields(kind, code)?[..] else { return None };
    Some(node(word, name, &format!("{value},"), code))
}

#[cfg(test)]
mod tests {
    use super::*;

    const UTM: &str = "PROJCS[\"ETRS89 / UTM zone 32N\",GEOGCS[\"ETRS89\",\
        DATUM[\"European_Terrestrial_Reference_System_1989\",\
        SPHEROID[\"GRS 1980\",6378137,298.257222101,AUTHORITY[\"EPSG\",\"7019\"]],\
        AUTHORITY[\"EPSG\",\"6258\"]],PRIMEM[\"Greenwich\",0,AUTHORITY[\"EPSG\",\"8901\"]],\
        UNIT[\"degree\",0.0174532925199433,AUTHORITY[\"EPSG\",\"9122\"]],\
        AUTHORITY[\"EPSG\",\"4258\"]],PROJECTION[\"Transverse_Mercator\"],\
        PARAMETER[\"latitude_of_origin\",0],PARAMETER[\"central_meridian\",9],\
        PARAMETER[\"scale_factor\",0.9996],PARAMETER[\"false_easting\",500000],\
        PARAMETER[\"false_northing\",0],UNIT[\"metre\",1,AUTHORITY[\"EPSG\",\"9001\"]],\
        AXIS[\"Easting\",EAST],AXIS[\"Northing\",NORTH],AUTHORITY[\"EPSG\",\"25832\"]]";
    const DHHN: &str = "VERT_CS[\"DHHN2016 height\",VERT_DATUM[\"Deutsches Haupthoehennetz 2016\",\
        2005,AUTHORITY[\"EPSG\",\"1170\"]],UNIT[\"metre\",1,AUTHORITY[\"EPSG\",\"9001\"]],\
        AXIS[\"Gravity-related height\",UP],AUTHORITY[\"EPSG\",\"7837\"]]";

    #[test]
    fn a_code_becomes_the_text_that_gdal_writes() {
        assert_eq!(wkt(25832, None).as_deref(), Some(UTM));
        let both = format!("COMPD_CS[\"ETRS89 / UTM zone 32N + DHHN2016 height\",{UTM},{DHHN}]");
        assert_eq!(wkt(25832, Some(7837)), Some(both));
        let geographic = wkt(4326, None).unwrap();
        assert!(geographic.starts_with("GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\""), "{geographic}");
        assert!(wkt(3857, None).unwrap().contains("+nadgrids=@null"));
        assert!(wkt(4978, None).unwrap().starts_with("GEOCCS[\"WGS 84\""));
        let compound = wkt(5555, None).unwrap();
        assert!(compound.contains("\"5783\"]],AUTHORITY[\"EPSG\",\"5555\"]]"), "{compound}");
        assert_eq!(parts(5555), Some((25832, 5783)));
        // Three axes: WKT 1 has no word for them. And what has heights gets no other.
        for none in [(4979, None), (0, None), (25832, Some(25832)), (4978, Some(5703))] {
            assert_eq!(wkt(none.0, none.1), None, "{none:?}");
        }
    }

    #[test]
    fn every_system_of_the_table_has_a_text_with_all_that_it_names() {
        let mut systems = 0;
        for line in TABLE.lines().filter(|line| !line.starts_with('#')) {
            let (kind, rest) = line.split_once(' ').unwrap();
            let (code, _) = rest.split_once(BAR).unwrap();
            let code: u32 = code.parse().unwrap();
            match kind {
                "vertical" => assert!(vertical_text(code).is_some(), "{line}"),
                "geographic" | "geocentric" | "projected" | "compound" => {
                    let text = wkt(code, None).unwrap_or_else(|| panic!("{line}"));
                    assert!(text.ends_with(&format!("AUTHORITY[\"EPSG\",\"{code}\"]]")), "{text}");
                }
                _ => continue,
            }
            systems += 1;
        }
        assert_eq!(systems, 662 + 247 + 5586 + 291 + 449);
    }

    #[test]
    fn datums_are_found_by_all_of_their_names() {
        for name in [
            "European_Terrestrial_Reference_System_1989",
            "D_ETRS_1989",
            "European Terrestrial Reference System 1989 ensemble",
        ] {
            assert_eq!(datums(&plain(name)), [6258], "{name}");
        }
        assert_eq!(datums("wgs1984"), [6326]);
        assert_eq!(datums("nad83"), [6152, 6269], "a name of two");
        assert_eq!(heights(&plain("North_American_Vertical_Datum_1988")), [5103]);
        assert_eq!((datum_of(25832), datum_of(4269), datum_of(1)), (Some(6258), Some(6269), None));
    }
}
