//! Quantities as people write them: counts, angles, lengths with units, and values that are found
//! instead of given. Reads, checks and shows them; knows no stage and no file.

mod angle;
mod axis;
mod corners;
mod count;
mod figure;
mod fraction;
mod length;
mod schema;
mod setting;
mod size;
mod turn;
mod whole;

pub use angle::Angle;
pub use axis::Axis;
pub use corners::CropBox;
pub use count::parse_count;
pub(crate) use figure::Figure;
pub use fraction::Fraction;
pub use length::Length;
pub(crate) use schema::{COUNT_TEXT, OrNone, has_schema, or_word};
pub use setting::Setting;
pub use size::parse_bytes;
pub(crate) use size::{SizeText, some_bytes};
pub use turn::Turn;
pub(crate) use whole::Whole;
