//! Outputs in folders, one for each input.

mod io;
mod run;
mod split;
mod squares;
