//! The words for values that do not fit, and for dimensions that would get lost.

use crate::error::nearest;
use crate::point::names::{BLUE, GREEN, INTENSITY, NIR, RED, XYZ};
use crate::point::{Dimension, Scalar, Schema};
use crate::report::Short;
use crate::{Error, Result};

/// What helps where the coordinate `value` of the point at `world` does not fit `to`: an offset, if
/// there is one that does, and a larger scale.
pub(super) fn placed(stage: &str, world: Option<[f64; 3]>, to: &Dimension, value: f64) -> String {
    let reach = to.scale * f64::from(1 << 30) * 2.0;
    // Whole thousands near the point: a scan around it fits, and its digits stay readable. Where
    // these are out of reach, what is in reach; no scan is so small that less than 1 would do.
    let unit = [1000.0, 100.0, 10.0, 1.0].into_iter().find(|unit| 2.0 * unit <= reach);
    let round = |at: f64| unit.map_or(at, |unit| (at / unit).round() * unit);
    match world.map(|world| world.map(round)) {
        Some(near) if near.iter().any(|at| !at.is_finite()) => {
            format!("give a larger `{stage}.scale`, or a `{stage}.offset` nearer to the points")
        }
        Some([x, y, z]) if unit.is_some() && round(value) != to.origin => format!(
            "give an offset near the points, `{stage}.offset = [{x:?}, {y:?}, {z:?}]`, or a larger \
             `{stage}.scale`"
        ),
        _ => format!(
            "give a larger `{stage}.scale`: with this one coordinates reach {} from the offset, \
             and no farther",
            Short(reach)
        ),
    }
}

/// What helps where a value of a dimension does not fit `to`; `is_fraction` for floating-point
/// numbers, `is_unit` where intensities are parts.
pub(super) fn kept_otherwise(to: &Dimension, is_fraction: bool, is_unit: bool) -> String {
    let name = &to.name;
    let dropped = format!("`write.drop = [{name:?}]` leaves the dimension out");
    match name.as_str() {
        _ if !is_fraction || to.scalar.is_float() => dropped,
        INTENSITY if is_unit => format!(
            "with `write.intensity = \"unit\"` intensities go from 0 to 1; \
             `write.map = [\"{name}=Amplitude\"]` keeps them as they are under another name, and \
             {dropped}"
        ),
        INTENSITY => format!(
            "`write.intensity = \"unit\"` takes intensities for parts of 65535, from 0 to 1, \
             `write.map = [\"{name}=Amplitude\"]` keeps them as they are under another name, and \
             {dropped}"
        ),
        RED | GREEN | BLUE | NIR => {
            format!("colours of floating-point numbers go from 0 to 1 here; {dropped}")
        }
        _ => dropped,
    }
}

/// What a field holds, for a message.
pub(super) fn room(to: &Dimension) -> String {
    let kind = match to.scalar {
        Scalar::U8 => "an unsigned 8-bit integer",
        Scalar::I8 => "a signed 8-bit integer",
        Scalar::U16 => "an unsigned 16-bit integer",
        Scalar::I16 => "a signed 16-bit integer",
        Scalar::U32 => "an unsigned 32-bit integer",
        Scalar::I32 => "a signed 32-bit integer",
        Scalar::U64 => "an unsigned 64-bit integer",
        Scalar::I64 => "a signed 64-bit integer",
        Scalar::F32 => "a 32-bit float",
        Scalar::F64 => "a 64-bit float",
    };
    match to.bits {
        Some(bits) => format!("{} bit(s)", bits.width),
        None if to.scale != 1.0 || to.origin != 0.0 => {
            format!("steps of {} from {} as {kind}", to.scale, to.origin)
        }
        None => kind.to_owned(),
    }
}

pub(in crate::io) fn quoted(names: &[impl std::fmt::Display]) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

/// What helps where `name` is none of those of `schema`, which "it has", or "there are".
pub(in crate::io) fn meant_names(name: &str, has: &str, schema: &Schema) -> String {
    let all: Vec<String> = schema.dimensions.iter().map(|d| d.name.clone()).collect();
    let near = nearest(name, &all).map(|near| format!("did you mean `{near}`? "));
    format!("{}{has} {}", near.unwrap_or_default(), quoted(&all))
}

/// Refuses names that cannot be left out of records of `from`.
pub(in crate::io) fn check_drop(from: &Schema, drop: &[String]) -> Result<()> {
    for name in drop {
        if XYZ.contains(&name.as_str()) {
            return Err(Error::pipeline(format!("`write.drop` names `{name}`: coordinates stay")));
        }
        if from.find(name).is_none() {
            let told = format!("`write.drop` names `{name}`, which the input does not have");
            return Err(Error::pipeline(told).help(meant_names(name, "it has", from)));
        }
    }
    Ok(())
}
