//! The stage `normals`.

mod orient;
mod plane;
mod seen;
mod solvers;
mod star;
mod truth;
