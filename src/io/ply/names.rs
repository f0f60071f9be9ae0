//! Names of vertex properties and of the dimensions they stand for.

use std::collections::{BTreeMap, BTreeSet};

use crate::point::{Layout, names as n};

/// The family of PLY records.
pub(super) const FAMILY: &str = "PLY";

/// Vertices: the file's properties in their order, binary (numbers of a text are held as
/// little-endian binary of the declared types).
pub const RECORDS: Layout = Layout::plain(FAMILY);

/// Dimension, the property it is written as, and other spellings that are read as it. Known
/// dimensions are written in this order.
const TABLE: &[(&str, &str, &[&str])] = &[
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

/// What a comment begins with that gives a property the name of its dimension where the property's
/// own name does not tell it.
const PREFIX: &str = "dimension ";

/// Place of a dimension in the order in which known dimensions are written; None for the others.
pub(crate) fn rank(dimension: &str) -> Option<usize> {
    TABLE.iter().position(|row| row.0 == dimension)
}

/// The dimension that a property stands for by its name alone.
pub(super) fn dimension_of(property: &str) -> &str {
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

/// Names of the dimensions of `properties` (distinct names), in their order: what a comment of ours
/// says, else the shared dimension, else the property's own name. Where two properties claim one
/// name the first has it.
pub(super) fn dimensions(properties: &[&str], comments: &[String]) -> Vec<String> {
    let mut told: BTreeMap<&str, &str> = BTreeMap::new();
    for (property, name) in comments.iter().filter_map(|c| read_comment(c)) {
        told.entry(property).or_insert(name); // the first comment counts
    }
    let mut taken = BTreeSet::new();
    let mut names: Vec<Option<String>> = properties
        .iter()
        .map(|property| {
            let name = *told.get(property)?;
            taken.insert(name.to_owned()).then(|| name.to_owned())
        })
        .collect();
    for (name, property) in names.iter_mut().zip(properties) {
        if name.is_none() {
            let shared = dimension_of(property).to_owned();
            let free = if taken.contains(&shared) {
                numbered(property, |name| taken.contains(name))
            } else {
                shared
            };
            taken.insert(free.clone());
            *name = Some(free);
        }
    }
    names.into_iter().flatten().collect()
}

/// Names of the properties that `dimensions` are written as, in their order. `kept` tells the name
/// that a property had in the input.
pub(super) fn properties(
    dimensions: &[&str],
    kept: impl Fn(&str) -> Option<String>,
) -> Vec<String> {
    let mut names: Vec<Option<String>> = dimensions
        .iter()
        .map(|&name| kept(name).or_else(|| rank(name).map(|row| TABLE[row].1.to_owned())))
        .collect();
    let mut taken: BTreeSet<String> = names.iter().flatten().cloned().collect();
    for (name, dimension) in names.iter_mut().zip(dimensions) {
        if name.is_none() {
            let word: String =
                dimension.chars().map(|c| if c.is_ascii_graphic() { c } else { '_' }).collect();
            let word = if word.is_empty() { "_".to_owned() } else { word };
            // A name that stands for another dimension will do: a comment tells which it is.
            let free = numbered(&word, |name| taken.contains(name));
            taken.insert(free.clone());
            *name = Some(free);
        }
    }
    names.into_iter().flatten().collect()
}

/// `name`, or `name_2`, `name_3` …: the first that is not `taken`.
fn numbered(name: &str, taken: impl Fn(&str) -> bool) -> String {
    let mut free = name.to_owned();
    let mut number = 2u64;
    while taken(&free) {
        free = format!("{name}_{number}");
        number += 1;
    }
    free
}

/// The comment that tells the dimension of `property`, where its name alone does not. A name that
/// no header line can hold has none.
pub(super) fn comment(property: &str, dimension: &str) -> Option<String> {
    let comment = format!("{PREFIX}{property}: {dimension}");
    (dimension_of(property) != dimension && read_comment(&comment).is_some()).then_some(comment)
}

/// Property and dimension in a comment of ours.
pub(super) fn read_comment(comment: &str) -> Option<(&str, &str)> {
    let property = property_told(comment)?;
    let (_, dimension) = comment.split_once(": ")?;
    let one_line = !dimension.is_empty()
        && dimension.trim() == dimension
        && !dimension.contains(char::is_control);
    one_line.then_some((property, dimension))
}

/// The property that a comment in the form of ours speaks of, whether or not it names a dimension.
pub(super) fn property_told(comment: &str) -> Option<&str> {
    let (property, _) = comment.strip_prefix(PREFIX)?.split_once(": ")?;
    (!property.is_empty() && !property.contains(char::is_whitespace)).then_some(property)
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
    fn two_spellings_of_one_dimension_stay_two() {
        let names = dimensions(&["x", "red", "r", "Red", "diffuse_red"], &[]);
        assert_eq!(names, ["X", "Red", "r", "Red_2", "diffuse_red"]);
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
        let both = dimensions(&["intensity", "scalar_Intensity"], &[]);
        assert_eq!(both, ["Intensity", "scalar_Intensity"]);
    }

    #[test]
    fn a_name_gets_a_number_only_where_another_has_it() {
        let asked = ["X", "NormalX", "normal x", "normal_x", "scalar_Intensity"];
        let written = properties(&asked, |_| None);
        assert_eq!(written, ["x", "nx", "normal_x", "normal_x_2", "scalar_Intensity"]);
        let words: Vec<&str> = written.iter().map(String::as_str).collect();
        let comments: Vec<String> =
            words.iter().zip(asked).filter_map(|(w, a)| comment(w, a)).collect();
        assert_eq!(dimensions(&words, &comments), asked);
    }

    #[test]
    fn names_that_no_property_can_have_come_back() {
        let asked = ["X", "x", "Echo width", "Echo_width", "r", "", "höhe", "red: b"];
        let written = properties(&asked, |_| None);
        let words: Vec<&str> = written.iter().map(String::as_str).collect();
        let distinct: BTreeSet<&str> = words.iter().copied().collect();
        assert_eq!(distinct.len(), asked.len(), "{words:?}");
        assert!(words.iter().all(|w| !w.is_empty() && w.bytes().all(|b| b.is_ascii_graphic())));
        let comments: Vec<String> =
            words.iter().zip(asked).filter_map(|(w, a)| comment(w, a)).collect();
        let mut expected = asked.map(str::to_owned);
        expected[5] = "_".into(); // nobody can name nothing
        assert_eq!(dimensions(&words, &comments), expected);
    }
}
