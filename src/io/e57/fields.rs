//! What the values of E57 are: which dimension, of which type.

use e57::{PointCloud, Record, RecordDataType, RecordName, RecordValue};

use crate::io::rows::facts::{holding, whole};
use crate::io::rows::names::heading;
use crate::point::Scalar;
use crate::point::names as n;

/// What a value is taken for.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Meaning {
    /// One of the three coordinates, along axes or as range, azimuth and elevation.
    Cartesian(usize),
    Spherical(usize),
    /// Not 0 where coordinates are none.
    CartesianState,
    SphericalState,
    /// A colour, and what makes it one of 16 bits: less the first, times the second.
    Color(&'static str, Option<[f64; 2]>),
    /// Not 0 where these dimensions have no value.
    NoValue(&'static [&'static str]),
    /// A number that E57 counts from 0 and others from 1.
    FromZero(&'static str),
    /// A dimension as it is.
    Of(String),
}

/// What a field is taken for.
pub(super) fn meaning(record: &Record, cloud: &PointCloud) -> Meaning {
    match &record.name {
        RecordName::CartesianX => Meaning::Cartesian(0),
        RecordName::CartesianY => Meaning::Cartesian(1),
        RecordName::CartesianZ => Meaning::Cartesian(2),
        RecordName::SphericalRange => Meaning::Spherical(0),
        RecordName::SphericalAzimuth => Meaning::Spherical(1),
        RecordName::SphericalElevation => Meaning::Spherical(2),
        RecordName::CartesianInvalidState => Meaning::CartesianState,
        RecordName::SphericalInvalidState => Meaning::SphericalState,
        RecordName::Intensity => Meaning::Of(n::INTENSITY.to_owned()),
        RecordName::IsIntensityInvalid => Meaning::NoValue(&[n::INTENSITY]),
        RecordName::ColorRed => color(n::RED, record, cloud),
        RecordName::ColorGreen => color(n::GREEN, record, cloud),
        RecordName::ColorBlue => color(n::BLUE, record, cloud),
        RecordName::IsColorInvalid => Meaning::NoValue(&[n::RED, n::GREEN, n::BLUE]),
        RecordName::RowIndex => Meaning::Of(n::ROW.to_owned()),
        RecordName::ColumnIndex => Meaning::Of(n::COLUMN.to_owned()),
        RecordName::ReturnCount => Meaning::Of(n::NUMBER_OF_RETURNS.to_owned()),
        RecordName::ReturnIndex => Meaning::FromZero(n::RETURN_NUMBER),
        RecordName::TimeStamp => Meaning::Of(TIME_STAMP.to_owned()),
        RecordName::IsTimeStampInvalid => Meaning::NoValue(&[]),
        // Names of outputs of ours are those of dimensions.
        RecordName::Unknown { name, namespace } if namespace == OWN => Meaning::Of(name.clone()),
        RecordName::Unknown { name, .. } => {
            Meaning::Of(heading(name).map_or_else(|| name.clone(), str::to_owned))
        }
    }
}

/// The prefix of what outputs of ours have and the standard has no name for.
pub(super) const OWN: &str = "pm";

/// Seconds since the scan began: no time that other formats have.
pub(super) const TIME_STAMP: &str = "TimeStamp";

/// A colour: whole numbers of 8 or 16 bits as they are, others by the limits that the scan gives.
fn color(name: &'static str, record: &Record, cloud: &PointCloud) -> Meaning {
    let limits = cloud.color_limits.as_ref().and_then(|limits| {
        let (least, most) = match name {
            n::RED => (&limits.red_min, &limits.red_max),
            n::GREEN => (&limits.green_min, &limits.green_max),
            _ => (&limits.blue_min, &limits.blue_max),
        };
        let number = |value: &Option<RecordValue>| Some(plain(value.as_ref()?, &record.data_type));
        Some([number(least)?, number(most)?])
    });
    let [least, most] = match (&record.data_type, limits) {
        (RecordDataType::Integer { min: 0, max }, _) if [255, 65_535].contains(max) => {
            return Meaning::Color(name, None);
        }
        (_, Some([least, most])) if most > least => [least, most],
        (RecordDataType::Integer { min: 0.., max: ..=255 }, _) => {
            return Meaning::Color(name, None);
        }
        (RecordDataType::Integer { min, max }, _) if max > min => [*min as f64, *max as f64],
        _ => [0.0, 1.0],
    };
    // Whole numbers of 8 bits in a wider field.
    match (&record.data_type, [least, most] == [0.0, 255.0]) {
        (RecordDataType::Integer { .. }, true) => Meaning::Color(name, Some([0.0, 257.0])),
        _ => Meaning::Color(name, Some([least, 65_535.0 / (most - least)])),
    }
}

/// A value as a number, by the type of its field.
pub(super) fn plain(value: &RecordValue, kind: &RecordDataType) -> f64 {
    match (value, kind) {
        (RecordValue::Single(v), _) => f64::from(*v),
        (RecordValue::Double(v), _) => *v,
        (RecordValue::ScaledInteger(v), RecordDataType::ScaledInteger { scale, offset, .. }) => {
            *v as f64 * scale + offset
        }
        (RecordValue::ScaledInteger(v) | RecordValue::Integer(v), _) => *v as f64,
    }
}

/// The type that holds a field's values.
pub(super) fn scalar(kind: &RecordDataType) -> Scalar {
    match kind {
        RecordDataType::Single { .. } => Scalar::F32,
        RecordDataType::Double { .. } | RecordDataType::ScaledInteger { .. } => Scalar::F64,
        RecordDataType::Integer { min, max } => {
            whole(i128::from(*min), i128::from(*max)).unwrap_or(Scalar::I64)
        }
    }
}

/// A type that holds the values of both, or nearly: of 64-bit integers the first 53 bits.
pub(super) fn both(one: Scalar, two: Scalar) -> Scalar {
    holding(one, two).unwrap_or(Scalar::F64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_hold_the_values_of_both() {
        assert_eq!(both(Scalar::U8, Scalar::U8), Scalar::U8);
        assert_eq!(both(Scalar::U8, Scalar::I8), Scalar::I16);
        assert_eq!(both(Scalar::U32, Scalar::I32), Scalar::I64);
        assert_eq!(both(Scalar::F32, Scalar::U8), Scalar::F32);
        assert_eq!(both(Scalar::F32, Scalar::U64), Scalar::F64);
    }

    #[test]
    fn colours_are_scaled_by_the_limits_of_their_scan() {
        let of = |data_type, limits: Option<[f64; 2]>| {
            let mut cloud = PointCloud::default();
            if let Some([least, most]) = limits {
                cloud.color_limits = Some(e57::ColorLimits {
                    red_min: Some(RecordValue::Double(least)),
                    red_max: Some(RecordValue::Double(most)),
                    green_min: None,
                    green_max: None,
                    blue_min: None,
                    blue_max: None,
                });
            }
            match meaning(&Record { name: RecordName::ColorRed, data_type }, &cloud) {
                Meaning::Color(n::RED, scale) => scale,
                other => panic!("{other:?}"),
            }
        };
        let integer = |min, max| RecordDataType::Integer { min, max };
        let single = RecordDataType::Single { min: None, max: None };
        assert_eq!(of(integer(0, 255), Some([0.0, 255.0])), None);
        assert_eq!(of(integer(0, 65_535), None), None);
        assert_eq!(of(integer(0, 200), None), None);
        assert_eq!(of(integer(0, 1023), None), Some([0.0, 65_535.0 / 1023.0]));
        assert_eq!(of(integer(0, 1023), Some([0.0, 255.0])), Some([0.0, 257.0]));
        assert_eq!(of(single.clone(), None), Some([0.0, 65_535.0]));
        assert_eq!(of(single, Some([0.0, 255.0])), Some([0.0, 257.0]));
    }
}
