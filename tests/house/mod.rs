//! The repository itself: what imports what, what pages say, what it depends on.

mod dependencies;
mod drift;
mod imports;
mod modules;
mod readable;
mod surface;
mod synth_paper;
