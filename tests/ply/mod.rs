//! PLY files.

#[path = "../ply_support/mod.rs"]
mod ply_support;
#[path = "../common/real.rs"]
mod real;

mod files;
mod refused;
mod scans;
