//! PLY files.

mod files;
mod refused;
mod scans;
