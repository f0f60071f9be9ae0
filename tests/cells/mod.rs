//! The stage `cells`.

#[path = "../cells_scene/mod.rs"]
mod cells_scene;

mod keep;
mod median;
mod noise;
mod partition;
mod tiles;
