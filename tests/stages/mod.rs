//! Stages against brute force and at their limits.

mod bad_luck;
mod classes;
mod crop;
mod exact;
mod extremes;
mod graded;
mod graded_beside;
mod graded_choices;
mod grid;
mod moved;
mod orders;
mod outliers;
mod reduce_auto;
mod run;
mod same_bytes;
mod sample;
mod shapes;
mod stats;
mod tiles;
mod transform;
mod unread;
