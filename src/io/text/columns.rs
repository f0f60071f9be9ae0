//! What the columns of a text are: as the user says, as its heading names them, or as their number
//! and what is in them tells.

use std::path::Path;

use crate::error::{listed, shown};
use crate::io::rows::facts::{ColumnFacts, whole};
use crate::io::rows::names::heading_among;
use crate::point::Scalar;
use crate::point::names::{BLUE, GREEN, INTENSITY, NORMAL, POINT_SOURCE_ID, RED, XYZ};
use crate::{Error, Result};

/// What a column is called that is not read.
pub(super) const SKIPPED: &str = "_";

/// Names of columns, as users and headings give them, as dimensions: known ones by any spelling,
/// others as they are; None for those that are not read.
///
/// # Errors
///
/// In words, what is wrong with them: one that is named twice, and coordinates that are missing.
pub(super) fn dimensions(names: &[String]) -> Result<Vec<Option<String>>, String> {
    let mut all: Vec<Option<String>> = Vec::new();
    for (n, name) in names.iter().enumerate() {
        let dimension = match heading_among(name, names.iter().map(String::as_str)) {
            Some(known) => known.to_owned(),
            None if name.is_empty() => format!("column_{}", n + 1),
            None => name.clone(),
        };
        let dimension = (name != SKIPPED).then_some(dimension);
        if let Some(twice) = dimension.as_ref().filter(|_| all.contains(&dimension)) {
            return Err(format!("two columns are `{twice}`"));
        }
        all.push(dimension);
    }
    let lacks = |axis: &&str| !all.iter().flatten().any(|dimension| dimension == axis);
    let missing: Vec<&str> = XYZ.into_iter().filter(lacks).collect();
    match missing.is_empty() {
        true => Ok(all),
        false => Err(format!("no column is {}", listed(missing, "or"))),
    }
}

/// Refuses names of columns that no text can have.
///
/// # Errors
///
/// In words, what is wrong with them.
pub(crate) fn check_columns(names: &[String]) -> Result<(), String> {
    dimensions(names).map(|_| ())
}

/// The columns of a text whose heading says nothing, from their number and what is in them; and
/// what the user is told of it. `is_pts` for PTS, where the number alone says it.
///
/// # Errors
///
/// Columns that may be several things.
pub(super) fn guessed(
    path: &Path,
    facts: &[ColumnFacts],
    is_pts: bool,
) -> Result<(Vec<&'static str>, Option<String>)> {
    let further = facts.get(3..).unwrap_or_default();
    let colors = [RED, GREEN, BLUE];
    let (more, is_told): (Vec<&'static str>, bool) = match further {
        [] => (Vec::new(), false),
        [_] if is_pts => (vec![INTENSITY], false),
        [_, rgb @ ..] if is_pts && rgb.len() == 3 && rgb.iter().all(ColumnFacts::is_byte) => {
            ([&[INTENSITY][..], &colors].concat(), false)
        }
        rgb if rgb.len() == 3 && rgb.iter().all(ColumnFacts::is_byte) => (colors.into(), !is_pts),
        normal
            if normal.len() == 3
                && normal.iter().all(ColumnFacts::is_cosine)
                && normal.iter().any(|axis| !axis.is_whole) =>
        {
            (NORMAL.into(), true)
        }
        _ => return Err(unnamed(path, facts.len())),
    };
    let told = is_told.then(|| {
        format!(
            "{}: no heading names its columns: 4 to 6 are taken for {}, `read.columns` says \
             otherwise",
            shown(path),
            listed(&more, "and")
        )
    });
    Ok(([&XYZ[..], &more].concat(), told))
}

/// The error of a text of which nobody says what its columns are.
pub(super) fn unnamed(path: &Path, columns: usize) -> Error {
    let letters = ["x", "y", "z", "i", "r", "g", "b"];
    let known: Vec<&str> =
        letters.into_iter().chain(std::iter::repeat("_")).take(columns).collect();
    Error::data(path, format!("it has {columns} columns, and no heading says which they are"))
        .at_byte(0)
        .help(format!(
            "`read.columns = {known:?}` would say that they are these; `_` is for a column that is \
             not to be read"
        ))
}

/// The type that holds all values of a column: a float for coordinates and wherever a value is not
/// whole, else the smallest integer, but at least what LAS has for it.
pub(super) fn scalar(dimension: &str, facts: &ColumnFacts) -> Scalar {
    if XYZ.contains(&dimension) || !facts.is_whole {
        return Scalar::F64;
    }
    let is_wide = [INTENSITY, POINT_SOURCE_ID].contains(&dimension);
    match whole(facts.least, facts.most) {
        _ if facts.least > facts.most => Scalar::U8, // of no points
        Some(Scalar::U8) if is_wide => Scalar::U16,
        found => found.unwrap_or(Scalar::F64),
    }
}
