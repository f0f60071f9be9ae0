//! Inputs that are wrong.

mod headers;
mod places;
mod points;
