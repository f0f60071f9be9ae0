//! The stage `normals`.

mod orient;
mod plane;
mod solvers;
mod star;
mod truth;
