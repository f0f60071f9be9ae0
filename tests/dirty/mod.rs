//! Inputs that are wrong.

mod cases;
mod headers;
mod places;
mod points;
