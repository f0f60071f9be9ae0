//! The names that formats of rows have for dimensions.

use crate::point::Schema;
use crate::point::names as n;

/// Dimension, the property it is written as, other spellings that are read as it, and what it is.
/// Known dimensions are written in this order.
pub(crate) const TABLE: &[NamedDimension] = &[
    (n::XYZ[0], "x", &[], "coordinate, in the unit of the reference system"),
    (n::XYZ[1], "y", &[], "coordinate, in the unit of the reference system"),
    (n::XYZ[2], "z", &[], "height or third coordinate, in its unit"),
    (n::NORMAL[0], "nx", &["normal_x", "normalx"], "component of the unit normal, -1 to 1"),
    (n::NORMAL[1], "ny", &["normal_y", "normaly"], "component of the unit normal, -1 to 1"),
    (n::NORMAL[2], "nz", &["normal_z", "normalz"], "component of the unit normal, -1 to 1"),
    (
        n::INTENSITY,
        "intensity",
        &[],
        "strength of the return, in no unit; of floats see `write.intensity`",
    ),
    (
        n::RED,
        "red",
        &["r", "diffuse_red"],
        "colour; the most is 65535 of 16 bits, 255 of 8, 1 of floats",
    ),
    (n::GREEN, "green", &["g", "diffuse_green"], "likewise"),
    (n::BLUE, "blue", &["b", "diffuse_blue"], "likewise"),
    (n::NIR, "nir", &[], "near infrared, as a colour"),
    (n::CLASSIFICATION, "classification", &[], "class, 0 to 255 (LAS 1.4 R15, table 17)"),
    (
        n::GPS_TIME,
        "gps_time",
        &["gpstime"],
        "seconds; the header says of the GPS week or of GPS time minus 1e9",
    ),
    (
        n::RETURN_NUMBER,
        "return_number",
        &["returnnumber"],
        "number of the return of its pulse, from 1",
    ),
    (n::NUMBER_OF_RETURNS, "number_of_returns", &["numberofreturns"], "returns of the pulse"),
    (
        n::SCAN_ANGLE,
        "scan_angle",
        &["scan_angle_rank", "scananglerank"],
        "degrees from straight down",
    ),
    (n::USER_DATA, "user_data", &["userdata"], "free"),
    (
        n::POINT_SOURCE_ID,
        "point_source_id",
        &["pointsourceid"],
        "flight line, or scan of several, 0 to 65535",
    ),
    (n::SYNTHETIC, "synthetic", &[], "1 for a point that was not measured"),
    (n::KEY_POINT, "key_point", &["keypoint"], "1 for a point that is to stay"),
    (n::WITHHELD, "withheld", &[], "1 for a point that counts as deleted"),
    (n::OVERLAP, "overlap", &[], "1 where flight lines overlap"),
    (
        n::SCAN_DIRECTION_FLAG,
        "scan_direction_flag",
        &["scandirectionflag"],
        "1 where the mirror moved from left to right",
    ),
    (
        n::EDGE_OF_FLIGHT_LINE,
        "edge_of_flight_line",
        &["edgeofflightline"],
        "1 for the last point of a scan line",
    ),
    (n::SCANNER_CHANNEL, "scanner_channel", &["scanchannel"], "head of the scanner, 0 to 3"),
    (n::ROW, "row", &["row_index", "rowindex"], "row of an organised scan, from 0"),
    (n::COLUMN, "column", &["column_index", "columnindex"], "column of an organised scan, from 0"),
    (n::WAVE_DESCRIPTOR, "wave_packet_descriptor_index", &[], "record that describes the waveform"),
    (n::WAVE_OFFSET, "wave_packet_byte_offset", &[], "byte where the waveform begins"),
    (n::WAVE_SIZE, "wave_packet_size", &[], "bytes of the waveform"),
    (n::WAVE_RETURN, "wave_return_point", &[], "picoseconds from the first sample to the return"),
    (n::WAVE_DIRECTION[0], "wave_xt", &[], "direction of the waveform, per picosecond"),
    (n::WAVE_DIRECTION[1], "wave_yt", &[], "likewise"),
    (n::WAVE_DIRECTION[2], "wave_zt", &[], "likewise"),
];

/// A row of [`TABLE`].
type NamedDimension = (&'static str, &'static str, &'static [&'static str], &'static str);

/// Place of a dimension in the order in which known dimensions are written; None for the others.
pub(crate) fn rank(dimension: &str) -> Option<usize> {
    TABLE.iter().position(|row| row.0 == dimension)
}

/// The dimension that a property stands for by its name alone.
pub(crate) fn dimension_of(property: &str) -> &str {
    TABLE
        .iter()
        .find(|row| row.1 == property || row.2.contains(&property))
        .map(|row| row.0)
        .or_else(|| field_of(property))
        .unwrap_or(property)
}

/// The dimension that CloudCompare means by a scalar field: `scalar_Return_Number`, or
/// `scalar_ReturnNumber`. It writes coordinates, normals and colours otherwise.
fn field_of(property: &str) -> Option<&'static str> {
    let field = property.strip_prefix("scalar_")?;
    let plain = |name: &str| name.replace('_', "").to_ascii_lowercase();
    let field = plain(field);
    let otherwise = [&n::XYZ[..], &n::NORMAL, &[n::RED, n::GREEN, n::BLUE]].concat();
    let fields = TABLE.iter().filter(|row| !otherwise.contains(&row.0));
    let mut named = fields.filter(|row| {
        plain(row.0) == field || plain(row.1) == field || row.2.iter().any(|s| plain(s) == field)
    });
    named.next().map(|row| row.0)
}

/// The dimension that a word of a heading means, if it is one that formats share: its name or one
/// of its spellings, whatever their case, blanks, underscores and hyphens aside.
pub(crate) fn heading(word: &str) -> Option<&'static str> {
    let plain = |name: &str| -> String {
        let kept = name.chars().filter(|c| !" _-".contains(*c));
        kept.flat_map(char::to_lowercase).collect()
    };
    let word = plain(word);
    let mut rows = TABLE.iter();
    let found = rows.find(|row| {
        plain(row.0) == word || plain(row.1) == word || row.2.iter().any(|s| plain(s) == word)
    });
    let found = found.map(|row| row.0);
    let other = || SHORT.iter().find(|(short, _)| *short == word).map(|(_, dimension)| *dimension);
    found.or_else(other).or_else(|| field_of(&format!("scalar_{}", word.strip_prefix("scalar")?)))
}

/// The dimension that a word of a heading means among `all` words of it: one that only a spelling
/// tells is left to a word that is its name.
pub(crate) fn heading_among<'a>(
    word: &str,
    mut all: impl Iterator<Item = &'a str>,
) -> Option<&'static str> {
    let known = heading(word)?;
    let is_name = |word: &str| shared(word) == Some(known);
    (is_name(word) || !all.any(is_name)).then_some(known)
}

/// The dimension that formats share of which `word` is the name, here or in PLY, whatever its case.
pub(crate) fn shared(word: &str) -> Option<&'static str> {
    let is_its = |name: &str| name.eq_ignore_ascii_case(word);
    TABLE.iter().find(|row| is_its(row.0) || is_its(row.1)).map(|row| row.0)
}

/// The dimension of `schema` that a user means by `word`: of that name, else of one that differs in
/// its case, or in the words of PLY, if that is one; else `word`.
pub(crate) fn meant<'a>(word: &'a str, schema: &'a Schema) -> &'a str {
    if schema.find(word).is_some() {
        return word;
    }
    if let Some(shared) = shared(word).filter(|shared| schema.find(shared).is_some()) {
        return shared;
    }
    let mut alike = schema.dimensions.iter().filter(|d| d.name.eq_ignore_ascii_case(word));
    match (alike.next(), alike.next()) {
        (Some(one), None) => &one.name,
        _ => word,
    }
}

/// What headings of texts call dimensions besides.
const SHORT: &[(&str, &str)] = &[
    ("i", n::INTENSITY),
    ("class", n::CLASSIFICATION),
    ("time", n::GPS_TIME),
    ("easting", n::XYZ[0]),
    ("northing", n::XYZ[1]),
    ("elevation", n::XYZ[2]),
];

/// The name that a dimension has where names have no blanks and begin with small letters.
pub(crate) fn property(dimension: &str) -> Option<&'static str> {
    rank(dimension).map(|row| TABLE[row].1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point::{Dimension, Endian, Layout, Scalar};

    #[test]
    fn every_known_dimension_reads_back_from_its_property() {
        for (dimension, property, spellings, _) in TABLE {
            assert_eq!(dimension_of(property), *dimension);
            assert!(spellings.iter().all(|s| dimension_of(s) == *dimension));
        }
    }

    #[test]
    fn users_mean_dimensions_whatever_the_case() {
        let named = ["X", "Intensity", "GpsTime", "Amplitude", "twice", "Twice"];
        let fields = named.iter().enumerate().map(|(n, name)| Dimension::new(*name, Scalar::U8, n));
        let layout = Layout::plain("TOY");
        let dimensions = fields.collect();
        let schema = Schema { layout, endian: Endian::Little, stride: 6, dimensions };
        for (word, dimension) in [
            ("x", "X"),
            ("INTENSITY", "Intensity"),
            ("gps_time", "GpsTime"),
            ("gpstime", "GpsTime"),
            ("amplitude", "Amplitude"),
            ("twice", "twice"),
            ("TWICE", "TWICE"),
            ("red", "red"),
        ] {
            assert_eq!(meant(word, &schema), dimension, "{word}");
        }
        assert_eq!((shared("intensity"), shared("time")), (Some("Intensity"), None));
        let among = |all: &[&'static str]| heading_among("Time", all.iter().copied());
        assert_eq!(among(&["X", "Time"]), Some("GpsTime"));
        assert_eq!(among(&["Time", "GpsTime"]), None);
        assert_eq!(among(&["gps_time", "Time"]), None);
    }

    #[test]
    fn headings_are_read_in_any_spelling() {
        let words = [
            ("X", "X"),
            ("x", "X"),
            ("Normal X", "NormalX"),
            ("gps_time", "GpsTime"),
            ("GPS Time", "GpsTime"),
            ("R", "Red"),
            ("Number-Of-Returns", "NumberOfReturns"),
            ("i", "Intensity"),
            ("Scalar field", "-"),
            ("scalar_Intensity", "Intensity"),
            ("Reflectance", "-"),
        ];
        for (word, dimension) in words {
            assert_eq!(heading(word).unwrap_or("-"), dimension, "{word}");
        }
    }

    #[test]
    fn scalar_fields_are_the_dimensions_that_they_are_named_after() {
        let fields = [
            ("scalar_Intensity", "Intensity"),
            ("scalar_Classification", "Classification"),
            ("scalar_GpsTime", "GpsTime"),
            ("scalar_Gps_Time", "GpsTime"),
            ("scalar_Return_Number", "ReturnNumber"),
            ("scalar_Number_Of_Returns", "NumberOfReturns"),
            ("scalar_Scan_Angle_Rank", "ScanAngle"),
            ("scalar_Point_Source_ID", "PointSourceId"),
            ("scalar_X", "scalar_X"),
            ("scalar_Nx", "scalar_Nx"),
            ("scalar_R", "scalar_R"),
            ("scalar_Reflectance", "scalar_Reflectance"),
        ];
        for (property, dimension) in fields {
            assert_eq!(dimension_of(property), dimension);
        }
    }
}
