//! The stage `cells`.

mod keep;
mod median;
mod noise;
mod partition;
mod scene;
mod tiles;
