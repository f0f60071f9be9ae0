//! Points side by side: what a record holds and how its fields are read. Knows no tiles, no files.

mod batch;
mod bounds;
mod column;
mod columns;
mod mark;
mod metadata;
pub mod names;
mod note;
mod order;
mod schema;
mod selection;
mod spare;
mod units;

pub use batch::PointBatch;
pub(crate) use bounds::center_distance2;
pub use bounds::{Bounds, Position, distance2};
pub use column::{Column, ColumnKind, ColumnValue, ComputedDimension, NORMAL, SHIFT};
pub(crate) use columns::COLUMN_ENDIAN;
pub use columns::{Columns, TakenColumn};
pub use mark::{Edit, Mark};
pub use metadata::{GpsTime, Metadata};
pub use note::RunNote;
pub(crate) use note::Settle;
pub(crate) use order::ascending;
pub use schema::{Bits, Dimension, Endian, Layout, Scalar, Schema, Value};
pub use selection::Flag;
pub(crate) use selection::{Chooser, Selection};
pub(crate) use spare::Spare;
pub use units::{Horizontal, Mismatch, Units};
