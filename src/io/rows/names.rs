//! The names that formats of rows have for dimensions.

use crate::point::names as n;

/// Dimension, the property it is written as, and other spellings that are read as it. Known
/// dimensions are written in this order.
pub(crate) const TABLE: &[(&str, &str, &[&str])] = &[
    (n::XYZ[0], "x", &[]),
    (n::XYZ[1], "y", &[]),
    (n::XYZ[2], "z", &[]),
    (n::NORMAL[0], "nx", &["normal_x", "normalx"]),
    (n::NORMAL[1], "ny", &["normal_y", "normaly"]),
    (n::NORMAL[2], "nz", &["normal_z", "normalz"]),
    (n::INTENSITY, "intensity", &[]),
    (n::RED, "red", &["r", "diffuse_red"]),
    (n::GREEN, "green", &["g", "diffuse_green"]),
    (n::BLUE, "blue", &["b", "diffuse_blue"]),
    (n::NIR, "nir", &[]),
    (n::CLASSIFICATION, "classification", &[]),
    (n::GPS_TIME, "gps_time", &["gpstime"]),
    (n::RETURN_NUMBER, "return_number", &["returnnumber"]),
    (n::NUMBER_OF_RETURNS, "number_of_returns", &["numberofreturns"]),
    (n::SCAN_ANGLE, "scan_angle", &["scan_angle_rank", "scananglerank"]),
    (n::USER_DATA, "user_data", &["userdata"]),
    (n::POINT_SOURCE_ID, "point_source_id", &["pointsourceid"]),
    (n::SYNTHETIC, "synthetic", &[]),
    (n::KEY_POINT, "key_point", &["keypoint"]),
    (n::WITHHELD, "withheld", &[]),
    (n::OVERLAP, "overlap", &[]),
    (n::SCAN_DIRECTION_FLAG, "scan_direction_flag", &["scandirectionflag"]),
    (n::EDGE_OF_FLIGHT_LINE, "edge_of_flight_line", &["edgeofflightline"]),
    (n::SCANNER_CHANNEL, "scanner_channel", &["scanchannel"]),
    (n::ROW, "row", &["row_index", "rowindex"]),
    (n::COLUMN, "column", &["column_index", "columnindex"]),
    (n::WAVE_DESCRIPTOR, "wave_packet_descriptor_index", &[]),
    (n::WAVE_OFFSET, "wave_packet_byte_offset", &[]),
    (n::WAVE_SIZE, "wave_packet_size", &[]),
    (n::WAVE_RETURN, "wave_return_point", &[]),
    (n::WAVE_DIRECTION[0], "wave_xt", &[]),
    (n::WAVE_DIRECTION[1], "wave_yt", &[]),
    (n::WAVE_DIRECTION[2], "wave_zt", &[]),
];

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

    #[test]
    fn every_known_dimension_reads_back_from_its_property() {
        for (dimension, property, spellings) in TABLE {
            assert_eq!(dimension_of(property), *dimension);
            assert!(spellings.iter().all(|s| dimension_of(s) == *dimension));
        }
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
