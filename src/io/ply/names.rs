//! Names of vertex properties and of the dimensions they stand for.

use std::collections::{BTreeMap, BTreeSet};

use crate::io::rows::RowForm;
use crate::io::rows::names::{TABLE, dimension_of, rank};
use crate::point::Layout;

/// The family of PLY records.
pub(super) const FAMILY: &str = "PLY";

/// Vertices: the file's properties in their order, binary (numbers of a text are held as
/// little-endian binary of the declared types).
pub const RECORDS: Layout = Layout::plain(FAMILY);

/// What a vertex takes.
pub(super) const FORM: RowForm = RowForm {
    layout: RECORDS,
    holds_long: false,
    packs_colors: false,
    keeps_steps: false,
    holds_nan: true,
};

/// What a comment begins with that gives a property the name of its dimension where the property's
/// own name does not tell it.
const PREFIX: &str = "dimension ";

/// Names of the dimensions of `properties` (distinct names), in their order: what a comment of ours
/// says, else the shared dimension, else the property's own name. Where two properties claim one
/// name the first has it.
pub(super) fn dimensions(properties: &[&str], comments: &[String]) -> Vec<String> {
    let mut told: BTreeMap<&str, &str> = BTreeMap::new();
    for (property, name) in comments.iter().filter_map(|c| read_comment(c)) {
        told.entry(property).or_insert(name); // the first comment counts
    }
    let mut taken = BTreeSet::new();
    let mut names: Vec<Option<String>> = properties
        .iter()
        .map(|property| {
            let name = *told.get(property)?;
            taken.insert(name.to_owned()).then(|| name.to_owned())
        })
        .collect();
    for (name, property) in names.iter_mut().zip(properties) {
        if name.is_none() {
            let shared = dimension_of(property).to_owned();
            let free = if taken.contains(&shared) {
                numbered(property, |name| taken.contains(name))
            } else {
                shared
            };
            taken.insert(free.clone());
            *name = Some(free);
        }
    }
    names.into_iter().flatten().collect()
}

/// Names of the properties that `dimensions` are written as, in their order. `kept` tells the name
/// that a property had in the input.
pub(super) fn properties(
    dimensions: &[&str],
    kept: impl Fn(&str) -> Option<String>,
) -> Vec<String> {
    let mut names: Vec<Option<String>> = dimensions
        .iter()
        .map(|&name| kept(name).or_else(|| rank(name).map(|row| TABLE[row].1.to_owned())))
        .collect();
    let mut taken: BTreeSet<String> = names.iter().flatten().cloned().collect();
    for (name, dimension) in names.iter_mut().zip(dimensions) {
        if name.is_none() {
            let word: String =
                dimension.chars().map(|c| if c.is_ascii_graphic() { c } else { '_' }).collect();
            let word = if word.is_empty() { "_".to_owned() } else { word };
            // A name that stands for another dimension will do: a comment tells which it is.
            let free = numbered(&word, |name| taken.contains(name));
            taken.insert(free.clone());
            *name = Some(free);
        }
    }
    names.into_iter().flatten().collect()
}

/// `name`, or `name_2`, `name_3` …: the first that is not `taken`.
fn numbered(name: &str, taken: impl Fn(&str) -> bool) -> String {
    let mut free = name.to_owned();
    let mut number = 2u64;
    while taken(&free) {
        free = format!("{name}_{number}");
        number += 1;
    }
    free
}

/// The comment that tells the dimension of `property`, where its name alone does not. A name that
/// no header line can hold has none.
pub(super) fn comment(property: &str, dimension: &str) -> Option<String> {
    let comment = format!("{PREFIX}{property}: {dimension}");
    (dimension_of(property) != dimension && read_comment(&comment).is_some()).then_some(comment)
}

/// Property and dimension in a comment of ours.
pub(super) fn read_comment(comment: &str) -> Option<(&str, &str)> {
    let property = property_told(comment)?;
    let (_, dimension) = comment.split_once(": ")?;
    let one_line = !dimension.is_empty()
        && dimension.trim() == dimension
        && !dimension.contains(char::is_control);
    one_line.then_some((property, dimension))
}

/// The property that a comment in the form of ours speaks of, whether or not it names a dimension.
pub(super) fn property_told(comment: &str) -> Option<&str> {
    let (property, _) = comment.strip_prefix(PREFIX)?.split_once(": ")?;
    (!property.is_empty() && !property.contains(char::is_whitespace)).then_some(property)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_spellings_of_one_dimension_stay_two() {
        let names = dimensions(&["x", "red", "r", "Red", "diffuse_red"], &[]);
        assert_eq!(names, ["X", "Red", "r", "Red_2", "diffuse_red"]);
    }

    #[test]
    fn a_scalar_field_whose_dimension_is_there_keeps_its_name() {
        let both = dimensions(&["intensity", "scalar_Intensity"], &[]);
        assert_eq!(both, ["Intensity", "scalar_Intensity"]);
    }

    #[test]
    fn a_name_gets_a_number_only_where_another_has_it() {
        let asked = ["X", "NormalX", "normal x", "normal_x", "scalar_Intensity"];
        let written = properties(&asked, |_| None);
        assert_eq!(written, ["x", "nx", "normal_x", "normal_x_2", "scalar_Intensity"]);
        let words: Vec<&str> = written.iter().map(String::as_str).collect();
        let comments: Vec<String> =
            words.iter().zip(asked).filter_map(|(w, a)| comment(w, a)).collect();
        assert_eq!(dimensions(&words, &comments), asked);
    }

    #[test]
    fn names_that_no_property_can_have_come_back() {
        let asked = ["X", "x", "Echo width", "Echo_width", "r", "", "höhe", "red: b"];
        let written = properties(&asked, |_| None);
        let words: Vec<&str> = written.iter().map(String::as_str).collect();
        let distinct: BTreeSet<&str> = words.iter().copied().collect();
        assert_eq!(distinct.len(), asked.len(), "{words:?}");
        assert!(words.iter().all(|w| !w.is_empty() && w.bytes().all(|b| b.is_ascii_graphic())));
        let comments: Vec<String> =
            words.iter().zip(asked).filter_map(|(w, a)| comment(w, a)).collect();
        let mut expected = asked.map(str::to_owned);
        expected[5] = "_".into(); // nobody can name nothing
        assert_eq!(dimensions(&words, &comments), expected);
    }
}
