//! Fuzzing on stable Rust: targets that take any bytes, a mutator that knows their formats, and a
//! judge of what came of it. There is no instrumentation: an input is worth keeping if its outcome
//! (the shape of an error, or what was accepted) has not been seen.
#![allow(dead_code, reason = "the tests and the long runner use a part each")]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a harness may panic: not on inputs")]

pub mod campaign;
pub mod formats;
pub mod harness;
pub mod judge;
pub mod las;
pub mod las_seeds;
pub mod laz;
pub mod mutate;
pub mod pipeline;
pub mod ply;
pub mod text;
pub mod vocabulary;

use std::path::Path;

use crate::support::random::Random;

/// Something that takes bytes from outside.
#[derive(Clone, Copy)]
pub struct Target {
    /// Its name: a folder of `tests/corpus`.
    pub name: &'static str,
    /// Takes one input, which is also the file at the path: what came of it, or the promise that it
    /// broke.
    pub judge: fn(&Path, &[u8]) -> judge::Judgement,
    /// Inputs to begin with.
    pub seeds: fn(&Path) -> Vec<Vec<u8>>,
    /// Changes an input a little; the last input is another one to take parts from.
    pub mutate: fn(&mut Random, &mut Vec<u8>, &[u8]),
    /// True if the folder of the input has to be the working directory.
    pub at_home: bool,
}

/// Every target.
pub const TARGETS: [Target; 12] = [
    las::TARGET,
    laz::TARGET,
    ply::TARGET,
    pipeline::TARGET,
    text::TARGET,
    formats::XYZ,
    formats::PTX,
    formats::PCD,
    formats::OBJ,
    formats::OFF,
    formats::STL,
    formats::E57,
];
