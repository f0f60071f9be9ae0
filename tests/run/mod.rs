//! Runs and what may go wrong in them.

mod edges;
mod foretold;
mod killed;
mod memory_ends;
mod spill_damage;
mod threads;
mod trouble;
