//! What is done about damage in a LAS file, and what it cost.

use super::file::InputFile;
use crate::io::damage::{advised, lost};
use crate::report::LostPoints;
use crate::stage::OnError;
use crate::{Error, ErrorKind, Result};

/// What is done about the damage of one file, and what it came to so far.
#[derive(Debug, Clone, Default)]
pub struct Mending {
    /// What is to be done.
    pub on_error: OnError,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// What is lost.
    pub lost: Vec<LostPoints>,
}

impl Mending {
    /// Of a file of which nothing is known yet.
    pub fn new(on_error: OnError) -> Self {
        Mending { on_error, ..Mending::default() }
    }

    /// True if this does not end the run: damage, and not that a file cannot be read.
    pub fn mends(&self, error: &Error) -> bool {
        self.on_error != OnError::Fail && error.kind() == ErrorKind::Data
    }

    /// `error`, with the advice to salvage what can be read where that is not done already.
    pub fn advised(&self, error: Error) -> Error {
        match self.on_error {
            OnError::Salvage => error,
            OnError::Fail | OnError::Skip => advised(error),
        }
    }

    /// Goes on behind `error`, which is told, if that is wanted; else fails with it.
    pub fn tell(&mut self, error: Error) -> Result<()> {
        if !self.mends(&error) {
            return Err(self.advised(error));
        }
        self.warnings.push(error.to_string());
        Ok(())
    }

    /// Goes on without `points` points from `byte` on, if that is wanted; else fails with `error`,
    /// which says why they are lost.
    pub fn lose(&mut self, file: &InputFile, byte: u64, points: u64, error: Error) -> Result<()> {
        if !self.mends(&error) {
            return Err(self.advised(error));
        }
        self.lost.push(lost(file.path(), byte, points, error.message()));
        Ok(())
    }
}
