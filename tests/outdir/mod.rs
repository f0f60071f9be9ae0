//! Outputs in folders, one for each input.

#[path = "../common/mod.rs"]
mod common;
#[path = "../las_support/mod.rs"]
mod las_support;
#[path = "../outdir_support/mod.rs"]
mod outdir_support;
#[path = "../ply_support/mod.rs"]
mod ply_support;

mod io;
mod run;
