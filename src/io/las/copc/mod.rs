//! COPC 1.0 (copc.io): LAZ whose chunks are the nodes of an octree, so that a viewer fetches what
//! it draws. It is read as the LAZ that it is.

mod hierarchy;
mod names;
mod nodes;
mod octree;
mod overflow;
mod packing;
pub mod rules;
pub mod selected;
pub mod sink;
pub mod validate;

pub use names::{EXTENSION, POINT_FORMATS, USER};

use crate::point::{Schema, names as n};
use crate::{Error, Result};

/// The point format of COPC that holds records of `schema`, or the one that is `asked` for.
///
/// # Errors
///
/// A point format that COPC does not have.
pub fn point_format(asked: Option<u8>, schema: &Schema, drop: &[String]) -> Result<u8> {
    if let Some(asked) = asked {
        return match POINT_FORMATS.contains(&asked) {
            true => Ok(asked),
            false => {
                let told = format!("COPC has no point format {asked}");
                Err(Error::pipeline(told).help("it has 6, 7 (with colours) and 8 (and infrared)"))
            }
        };
    }
    let has = |name: &str| schema.find(name).is_some() && !drop.iter().any(|d| d == name);
    Ok(match () {
        () if has(n::NIR) => 8,
        () if [n::RED, n::GREEN, n::BLUE].iter().any(|name| has(name)) => 7,
        () => 6,
    })
}
