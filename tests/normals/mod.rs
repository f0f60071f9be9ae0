//! The stage `normals`.

#[path = "../normals_support/mod.rs"]
mod normals_support;
#[path = "../stages_support/mod.rs"]
mod stages_support;

mod orient;
mod plane;
mod star;
mod truth;
