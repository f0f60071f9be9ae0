//! What is lost of a damaged file: points are counted where they are lost, and told with the byte
//! from which on. Knows no formats.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;

use crate::error::shown;
use crate::host::lock;
use crate::report::{Grouped, LostPoints};
use crate::stage::OnError;
use crate::{Error, ErrorKind, Result};

/// Losses of one file that are told one by one.
const TOLD: usize = 3;
/// Losses of one part that are held one by one: a text may have more lines that are wrong than
/// right.
const HELD: usize = 100;

/// What is done about damage in a file whose parts are read one after the other, each from begin to
/// end, and what is lost of it.
#[derive(Debug, Default)]
pub struct Losses {
    on_error: OnError,
    /// What was found when the file was opened.
    at_open: Vec<LostPoints>,
    /// What was found while each of its parts was read, which may be read more than once.
    by_part: Mutex<BTreeMap<usize, PartLosses>>,
}

/// What is lost of one part.
#[derive(Debug, Clone, Default)]
pub struct PartLosses {
    on_error: OnError,
    /// The first of them one by one, the last of these with all that are behind it.
    list: Vec<LostPoints>,
    points: u64,
    /// Places where some are lost: as many as the list has, or more.
    places: u64,
}

impl Losses {
    /// Nothing yet.
    pub fn new(on_error: OnError) -> Self {
        Losses { on_error, ..Losses::default() }
    }

    /// True if damage does not end the run.
    pub fn mends(&self) -> bool {
        self.on_error != OnError::Fail
    }

    /// Goes on without `points` points of the file at `path` from `byte` on, which it does not have
    /// as it is opened.
    ///
    /// # Errors
    ///
    /// With `error`, which says why they are lost, if that is not wanted.
    pub fn lose(&mut self, path: &Path, byte: u64, points: u64, error: Error) -> Result<()> {
        let mut losses = self.part();
        losses.lose(path, byte, points, error)?;
        self.at_open.extend(losses.list);
        Ok(())
    }

    /// What a part that begins to be read counts its losses in.
    pub fn part(&self) -> PartLosses {
        PartLosses::new(self.on_error)
    }

    /// Takes down what was lost of a part so far.
    pub fn enter(&self, part: usize, losses: &PartLosses) {
        if losses.points == 0 {
            return;
        }
        let by_part = &mut *lock(&self.by_part);
        let known = by_part.entry(part).or_default();
        // It may have been read farther before.
        if losses.points > known.points {
            known.clone_from(losses);
        }
    }

    /// Points that are lost of those that the parts were to have.
    pub fn while_read(&self) -> u64 {
        lock(&self.by_part).values().fold(0, |sum, part| sum.saturating_add(part.points))
    }

    /// What is told of all that is lost.
    pub fn told(&self) -> Vec<String> {
        let places: u64 = lock(&self.by_part).values().map(|part| part.places).sum();
        told(&self.all(), places + self.at_open.len() as u64)
    }

    /// All that is lost, in the order of the file.
    pub fn all(&self) -> Vec<LostPoints> {
        let by_part = lock(&self.by_part);
        let mut all: Vec<LostPoints> =
            by_part.values().flat_map(|part| part.list.iter().cloned()).collect();
        all.extend(self.at_open.iter().cloned());
        all.sort_by_key(|lost| lost.byte);
        all
    }
}

impl PartLosses {
    /// Nothing yet.
    pub fn new(on_error: OnError) -> Self {
        PartLosses { on_error, ..PartLosses::default() }
    }

    /// What is told of it.
    pub fn told(&self) -> Vec<String> {
        told(&self.list, self.places)
    }

    /// What is lost, in the order of the file.
    pub fn list(&self) -> &[LostPoints] {
        &self.list
    }

    /// Points that are lost.
    pub fn points(&self) -> u64 {
        self.points
    }

    /// True if damage does not end the run.
    pub fn mends(&self) -> bool {
        self.on_error != OnError::Fail
    }

    /// Goes on without `points` points from `byte` on.
    ///
    /// # Errors
    ///
    /// With `error`, which says why they are lost, if that is not wanted, or if it is no damage.
    pub fn lose(&mut self, path: &Path, byte: u64, points: u64, error: Error) -> Result<()> {
        if !self.mends() || error.kind() != ErrorKind::Data {
            return Err(advised(error));
        }
        if points == 0 {
            return Ok(());
        }
        // What a header claims may be any number.
        self.points = self.points.saturating_add(points);
        let held = self.list.len();
        match self.list.last_mut() {
            // The same place again.
            Some(last) if last.byte >= byte => {
                last.points = last.points.saturating_add(points);
                return Ok(());
            }
            Some(last) if held >= HELD => {
                last.points = last.points.saturating_add(points);
                if !last.why.ends_with(BEHIND) {
                    last.why += BEHIND;
                }
            }
            _ => self.list.push(lost(path, byte, points, error.message())),
        }
        self.places += 1;
        Ok(())
    }
}

/// What is said of a loss that stands for those behind it, too.
const BEHIND: &str = ", and more behind it";

/// What helps besides another copy.
const ADVICE: &str = "`read.on_error = \"salvage\"` reads what can be read, and says what is lost";

/// `error`, with what helps besides.
pub fn advised(error: Error) -> Error {
    if error.kind() != ErrorKind::Data {
        return error;
    }
    let help = match error.remedy() {
        Some(help) if help.ends_with(ADVICE) => return error,
        Some(help) => format!("{help}; {ADVICE}"),
        None => ADVICE.to_owned(),
    };
    error.help(help)
}

/// Points that are lost in a file.
pub fn lost(path: &Path, byte: u64, points: u64, why: &str) -> LostPoints {
    let path = path.to_string_lossy().into_owned();
    LostPoints { path, byte, points, why: why.to_owned() }
}

/// What is told of the losses of one file, which are in so many places: those of the list, or more.
pub fn told(lost: &[LostPoints], places: u64) -> Vec<String> {
    let Some(first) = lost.first() else { return Vec::new() };
    let path = shown(Path::new(&first.path)).to_string();
    let one = |lost: &LostPoints| {
        let LostPoints { byte, points, why, .. } = lost;
        format!("{path}: at byte {byte}: {} points are lost: {why}", Grouped(*points))
    };
    let mut all: Vec<String> = lost.iter().take(TOLD).map(one).collect();
    if lost.len() > 1 {
        let points = lost.iter().fold(0u64, |sum, lost| sum.saturating_add(lost.points));
        let (points, listed) = (Grouped(points), lost.len() as u64);
        let report = match places > listed {
            true => format!("the report has the first {} one by one", Grouped(listed)),
            false => "the report has all".to_owned(),
        };
        let places = Grouped(places);
        all.push(format!("{path}: {points} points are lost in {places} places; {report}"));
    }
    all
}
