//! LAS and LAZ files.

mod copc;
mod copc_files;
mod formats;
mod holes;
mod merge;
mod metadata;
mod scans;
mod systems;
mod verify;
