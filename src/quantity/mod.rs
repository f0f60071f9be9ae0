//! Quantities as people write them: counts, angles, lengths with units, and values that are found
//! instead of given. Reads, checks and shows them; knows no stage and no file.

mod angle;
mod count;
mod figure;
mod length;
mod schema;
mod setting;
mod whole;

pub use angle::Angle;
pub use count::parse_count;
pub(crate) use figure::Figure;
pub use length::Length;
pub(crate) use schema::{COUNT_TEXT, OrNone, has_schema};
pub use setting::Setting;
pub(crate) use whole::Whole;
