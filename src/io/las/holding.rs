//! The LAS point format that holds what a record of another format holds.

use crate::io::convert::{check_drop, quoted};
use crate::point::names::{self as n, XYZ};
use crate::point::{Scalar, Schema};
use crate::{Error, Result};

/// Dimensions beside X, Y and Z that all LAS point formats hold.
const CORE: [&str; 12] = [
    n::INTENSITY,
    n::RETURN_NUMBER,
    n::NUMBER_OF_RETURNS,
    n::SCAN_DIRECTION_FLAG,
    n::EDGE_OF_FLIGHT_LINE,
    n::CLASSIFICATION,
    n::SYNTHETIC,
    n::KEY_POINT,
    n::WITHHELD,
    n::SCAN_ANGLE,
    n::USER_DATA,
    n::POINT_SOURCE_ID,
];
const COLOR: [&str; 3] = [n::RED, n::GREEN, n::BLUE];
const WAVE: [&str; 7] = [
    n::WAVE_DESCRIPTOR,
    n::WAVE_OFFSET,
    n::WAVE_SIZE,
    n::WAVE_RETURN,
    n::WAVE_DIRECTION[0],
    n::WAVE_DIRECTION[1],
    n::WAVE_DIRECTION[2],
];

/// The LAS point format that holds the dimensions of `from`, without those of `drop`, and its extra
/// bytes: name and type of every dimension that LAS does not know.
///
/// It is the smallest of formats 6 to 10 (LAS 1.4 R15 §2.6), but one of formats 0 to 5 where the
/// scan angle is an integer: whole degrees, which the 0.006° steps of the others would round.
///
/// # Errors
///
/// Names that an extra-bytes descriptor cannot hold (32 bytes), and names in `drop` that `from`
/// lacks.
pub fn las_schema(from: &Schema, drop: &[String]) -> Result<(u8, Vec<(String, Scalar)>)> {
    check_drop(from, drop)?;
    let has = |name: &str| from.find(name).is_some() && !drop.iter().any(|d| d == name);
    let any = |names: &[&str]| names.iter().any(|name| has(name));
    let (color, wave) = (any(&COLOR), any(&WAVE));
    let whole_degrees = has(n::SCAN_ANGLE)
        && from
            .find(n::SCAN_ANGLE)
            .is_some_and(|angle| !angle.scalar.is_float() && angle.scale == 1.0)
        && !any(&[n::NIR, n::OVERLAP, n::SCANNER_CHANNEL]);
    let format = match (whole_degrees, wave, color, has(n::GPS_TIME)) {
        (true, true, true, _) => 5,
        (true, true, false, _) => 4,
        (true, false, true, true) => 3,
        (true, false, true, false) => 2,
        (true, false, false, gps) => u8::from(gps),
        (false, true, color, _) => {
            if color || has(n::NIR) {
                10
            } else {
                9
            }
        }
        (false, false, _, _) if has(n::NIR) => 8,
        (false, false, color, _) => {
            if color {
                7
            } else {
                6
            }
        }
    };
    let known = |name: &str| {
        let sets: [&[&str]; 5] =
            [&XYZ, &CORE, &COLOR, &WAVE, &[n::GPS_TIME, n::NIR, n::OVERLAP, n::SCANNER_CHANNEL]];
        sets.iter().any(|set| set.contains(&name))
    };
    let extra: Vec<(String, Scalar)> = from
        .dimensions
        .iter()
        .filter(|d| has(&d.name) && !known(&d.name))
        .map(|d| (d.name.clone(), d.scalar))
        .collect();
    let long: Vec<&str> =
        extra.iter().map(|(name, _)| name.as_str()).filter(|name| name.len() > 32).collect();
    if !long.is_empty() {
        return Err(Error::pipeline(format!(
            "LAS cannot name extra bytes {}: a name has at most 32 bytes",
            quoted(&long)
        ))
        .help(format!("`write.drop = {long:?}` leaves them out")));
    }
    Ok((format, extra))
}
