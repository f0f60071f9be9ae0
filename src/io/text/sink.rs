//! Writes points as lines of text.

use std::path::Path;
use std::sync::Arc;

use super::names::RECORDS;
use super::source::TextKind;
use crate::io::convert::quoted;
use crate::io::rows::file::{Heading, RowFile};
use crate::io::rows::plan::{RowOptions, RowPlan};
use crate::io::rows::schema::RowShape;
use crate::io::rows::{Encoding, RowForm};
use crate::point::names::{BLUE, GREEN, INTENSITY, RED, XYZ};
use crate::point::{Dimension, Metadata, Schema};
use crate::stage::{Separator, Sink, WriteKeys};
use crate::{Error, Result};

/// What a line takes.
const FORM: RowForm = RowForm {
    layout: RECORDS,
    holds_long: true,
    packs_colors: false,
    keeps_steps: true,
    holds_nan: true,
};

/// How a text of one format is written where the user does not say it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Habit {
    pub kind: TextKind,
    pub separator: Separator,
    /// What begins a line that names the columns.
    pub mark: &'static str,
    /// True if there is such a line even above coordinates alone.
    pub always_names: bool,
}

fn byte(separator: Separator) -> u8 {
    match separator {
        Separator::Blank => b' ',
        Separator::Comma => b',',
        Separator::Semicolon => b';',
        Separator::Tab => b'\t',
    }
}

/// How the records of an output are written.
///
/// # Errors
///
/// What PTS does not hold of records of `schema`.
pub(super) fn plan(
    habit: Habit,
    keys: &WriteKeys,
    schema: &Schema,
    metadata: &Metadata,
) -> Result<RowPlan> {
    let mut options = RowOptions::of(keys, Encoding::Ascii, &metadata.computed);
    options.style.separator = byte(keys.separator.unwrap_or(habit.separator));
    options.style.decimals = keys.decimals;
    let plan = RowPlan::new(&options, FORM, schema)?;
    if habit.kind == TextKind::Pts {
        check_pts(&plan.full.shape.columns)?;
    }
    Ok(plan)
}

/// Refuses columns that PTS does not have, where each has its place.
fn check_pts(columns: &[Dimension]) -> Result<()> {
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let colors = [RED, GREEN, BLUE];
    let all = [&XYZ[..], &[INTENSITY], &colors].concat();
    let lost: Vec<&&str> = names.iter().filter(|name| !all.contains(name)).collect();
    if !lost.is_empty() {
        let told = format!("PTS cannot hold {}", quoted(&lost));
        return Err(Error::pipeline(told).help(format!("`write.drop = {lost:?}` leaves them out")));
    }
    let place = |name: &&str| all.iter().position(|known| known == name);
    if !names.is_sorted_by_key(place) {
        let told = format!("PTS has its numbers in another order than {}", names.join(", "));
        return Err(Error::pipeline(told).help("name it .csv or .txt, which say what they are"));
    }
    match names.iter().filter(|name| colors.contains(name)).count() {
        0 | 3 => Ok(()),
        _ => Err(Error::pipeline("PTS has all three colours or none")
            .help("`write.drop` with the others leaves them out")),
    }
}

/// What stands above the points.
struct Titles {
    /// The line that names the columns; empty if there is none.
    names: String,
    /// True if a line has how many points there are.
    has_count: bool,
}

impl Titles {
    fn of(habit: Habit, keys: &WriteKeys, columns: &[Dimension], separator: u8) -> Titles {
        let plain = columns.iter().map(|column| column.name.as_str()).eq(XYZ);
        let by_habit = habit.always_names || (!plain && habit.kind != TextKind::Pts);
        let has_count = habit.kind == TextKind::Pts;
        if !keys.header.unwrap_or(by_habit) {
            return Titles { names: String::new(), has_count };
        }
        // A name that has what separates names would be two.
        let is_odd = |c: char| c.is_control() || "\"'".contains(c) || c == char::from(separator);
        let word = |column: &Dimension| -> String {
            column.name.chars().map(|c| if is_odd(c) { '_' } else { c }).collect()
        };
        let words: Vec<String> = columns.iter().map(word).collect();
        let separator = char::from(separator).to_string();
        Titles { names: format!("{}{}\n", habit.mark, words.join(&separator)), has_count }
    }
}

impl Heading for Titles {
    fn text(&self, rows: u64) -> Vec<u8> {
        let count = if self.has_count { format!("{rows:<20}\n") } else { String::new() };
        format!("{count}{}", self.names).into_bytes()
    }
}

/// Creates a text at `staged` for records of `schema`.
///
/// # Errors
///
/// As [`plan`], and a file that cannot be created.
pub(super) fn create(
    staged: &Path,
    habit: Habit,
    keys: &WriteKeys,
    schema: &Arc<Schema>,
    metadata: &Metadata,
) -> Result<Box<dyn Sink>> {
    let plan = plan(habit, keys, schema, metadata)?;
    let separator = plan.style.separator;
    let titles = |shape: &RowShape| Titles::of(habit, keys, &shape.columns, separator);
    Ok(Box::new(RowFile::create(staged, plan, titles)?))
}
