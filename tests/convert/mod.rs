//! The command `convert`, and what becomes of fields, colours and units.

mod boxed;
mod bulk;
mod colors;
mod damage;
mod damaged_counts;
mod damaged_rows;
mod damaged_scans;
mod fields;
mod found;
mod inputs;
mod point_formats;
mod reproject;
mod reshaped;
mod runs;
mod units;
mod unlike;
