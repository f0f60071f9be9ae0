//! The built-in stages that compute: one file each.

pub mod normals;
