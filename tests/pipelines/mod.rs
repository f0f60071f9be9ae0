//! Pipeline files: their text, values, and the files that they name.

mod builder;
mod drawn;
mod explain;
mod formats;
mod inputs;
mod jobs;
mod json;
mod lines;
mod params;
mod text;
mod trees;
mod user_files;
mod values;
mod words;
