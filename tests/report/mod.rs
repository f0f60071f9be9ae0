//! The report.

mod document;
mod survey;
