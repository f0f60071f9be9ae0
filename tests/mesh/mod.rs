//! Meshes: the triangles of an output are those of the whole scan, wherever it was cut.

mod file;
mod oracle;
mod refused;
mod run;
mod whole;
