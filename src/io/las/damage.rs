//! What is done about damage in a file, and what it cost: points that are lost are counted where
//! they are lost, and told with the byte from which on.

use super::file::InputFile;
use crate::error::shown;
use crate::report::{Grouped, LostPoints};
use crate::stage::OnError;
use crate::{Error, ErrorKind, Result};

/// Losses of one file that are told one by one.
const TOLD: usize = 3;

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

    /// Goes on behind `error`, which is told, if that is wanted; else fails with it.
    pub fn tell(&mut self, error: Error) -> Result<()> {
        if !self.mends(&error) {
            return Err(advised(error));
        }
        self.warnings.push(error.to_string());
        Ok(())
    }

    /// Goes on without `points` points from `byte` on, if that is wanted; else fails with `error`,
    /// which says why they are lost.
    pub fn lose(&mut self, file: &InputFile, byte: u64, points: u64, error: Error) -> Result<()> {
        if !self.mends(&error) {
            return Err(advised(error));
        }
        self.lost.push(lost(file, byte, points, error.message()));
        Ok(())
    }
}

/// What helps besides another copy.
const ADVICE: &str = "`read.on_error = \"salvage\"` reads what can be read, and says what is lost";

/// `error`, with what helps besides.
pub fn advised(error: Error) -> Error {
    if error.kind() != ErrorKind::Data {
        return error;
    }
    let help = match error.remedy() {
        Some(help) => format!("{help}; {ADVICE}"),
        None => ADVICE.to_owned(),
    };
    error.help(help)
}

/// Points that are lost in a file.
pub fn lost(file: &InputFile, byte: u64, points: u64, why: &str) -> LostPoints {
    let path = file.path().to_string_lossy().into_owned();
    LostPoints { path, byte, points, why: why.to_owned() }
}

/// What is told of the losses of one file.
pub fn told(lost: &[LostPoints]) -> Vec<String> {
    let Some(first) = lost.first() else { return Vec::new() };
    let path = shown(std::path::Path::new(&first.path)).to_string();
    let one = |lost: &LostPoints| {
        let LostPoints { byte, points, why, .. } = lost;
        format!("{path}: at byte {byte}: {} points are lost: {why}", Grouped(*points))
    };
    let mut all: Vec<String> = lost.iter().take(TOLD).map(one).collect();
    if lost.len() > 1 {
        let points = lost.iter().map(|lost| lost.points).sum();
        let (points, places) = (Grouped(points), lost.len());
        all.push(format!(
            "{path}: {points} points are lost in {places} places; the report has all"
        ));
    }
    all
}
