//! LAS and LAZ files.

mod copc;
mod formats;
mod holes;
mod merge;
mod metadata;
mod scans;
mod systems;
mod verify;
