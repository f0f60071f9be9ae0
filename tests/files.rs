//! Files in and out: LAS, LAZ, PLY and others, conversion between them, outputs in folders, and that
//! nothing is lost.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic and tell why")]

mod convert;
mod formats;
mod las;
mod laz;
mod lossless;
mod mesh;
mod outdir;
mod ply;
mod support;
