//! The decoder of compressed points.

#[path = "../laz_support/mod.rs"]
mod laz_support;
#[path = "../common/real.rs"]
mod real;

mod damage;
mod oracle;
