//! References within texts: `${name}` to a parameter, `${ENV:NAME}` and `${ENV:NAME:-default}` to
//! the environment; `$${` is a literal `${`. Knows no parameter.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::ops::Range;

use super::mistake::Mistake;
use super::node::{Node, NodeValue};

/// The variables of an environment, by their names.
pub(super) type Environment<'a> = &'a dyn Fn(&str) -> Option<OsString>;

/// A part of a text.
#[derive(Debug, PartialEq)]
pub(super) enum Piece<'a> {
    /// As it is.
    Plain(&'a str),
    /// The value of the parameter of this name.
    Parameter(&'a str),
    /// The value of this variable of the environment, or else this default.
    Variable(&'a str, Option<&'a str>),
}

/// A part of a text and where it stands in it.
pub(super) type PlacedPiece<'a> = (Piece<'a>, Range<usize>);

/// What is wrong with a reference, what helps, and where it stands in its text.
type WrongPiece = (String, &'static str, Range<usize>);

/// The parts of a text in their order.
pub(super) fn pieces(text: &str) -> Result<Vec<PlacedPiece<'_>>, WrongPiece> {
    let mut pieces = Vec::new();
    let mut at = 0;
    while at < text.len() {
        let rest = &text[at..];
        let (piece, length) = if rest.starts_with("$${") {
            (Piece::Plain("${"), 3)
        } else if let Some(inside) = rest.strip_prefix("${") {
            let Some(end) = inside.find('}') else {
                let told = "`${` is not closed by `}`".to_owned();
                return Err((told, "a literal `${` is written `$${`", at..text.len()));
            };
            (
                reference(&inside[..end]).map_err(|(told, help)| (told, help, at..at + end + 3))?,
                end + 3,
            )
        } else {
            // A lone `$` is none of ours.
            let next = rest.char_indices().skip(1).find(|(_, c)| *c == '$');
            let length = next.map_or(rest.len(), |(next, _)| next);
            (Piece::Plain(&rest[..length]), length)
        };
        pieces.push((piece, at..at + length));
        at += length;
    }
    Ok(pieces)
}

/// What stands between `${` and `}`.
fn reference(inside: &str) -> Result<Piece<'_>, (String, &'static str)> {
    if let Some(variable) = inside.strip_prefix("ENV:") {
        let (name, default) = match variable.split_once(":-") {
            Some((name, default)) => (name, Some(default)),
            None => (variable, None),
        };
        return match is_name(name) {
            true => Ok(Piece::Variable(name, default)),
            false => Err((
                format!("`${{{inside}}}` names no variable"),
                "write `${ENV:NAME}` or `${ENV:NAME:-default}`",
            )),
        };
    }
    match is_name(inside) {
        true => Ok(Piece::Parameter(inside)),
        false => Err((
            format!("`${{{inside}}}` names no parameter"),
            "write `${name}`, or `$${` for a literal `${`",
        )),
    }
}

/// True for what names parameters and variables.
pub(super) fn is_name(word: &str) -> bool {
    !word.is_empty() && word.chars().all(is_part_of_name)
}

fn is_part_of_name(c: char) -> bool {
    c.is_alphanumeric() || c == '-' || c == '_'
}

/// Enters the parameters that the texts of `node` refer to.
pub(super) fn enter_names(node: &Node, names: &mut BTreeSet<String>) {
    match &node.value {
        NodeValue::Text(text) => enter_text(text, names),
        NodeValue::List(list) => list.iter().for_each(|item| enter_names(item, names)),
        NodeValue::Table(entries) => entries.iter().for_each(|e| enter_names(&e.node, names)),
        _ => {}
    }
}

/// The names of the parameters that a text refers to; where a reference is wrong, what all of them
/// begin with: that is told, and not that a parameter is of no use.
pub(super) fn enter_text(text: &str, names: &mut BTreeSet<String>) {
    let Ok(pieces) = pieces(text) else {
        let begun = text.split("${").skip(1);
        let name = |begun: &str| begun.chars().take_while(|c| is_part_of_name(*c)).collect();
        return names.extend(begun.map(name));
    };
    for (piece, _) in pieces {
        if let Piece::Parameter(name) = piece {
            names.insert(name.to_owned());
        }
    }
}

/// The value of a variable of the environment, or what is wrong with it and what helps. As in a
/// shell, the default also stands for an empty one.
pub(super) fn variable(
    name: &str,
    default: Option<&str>,
    environment: Environment<'_>,
) -> Result<String, (String, String)> {
    match (environment(name), default) {
        (None, None) => Err((
            format!("the environment has no `{name}`"),
            format!("`${{ENV:{name}:-default}}` does without"),
        )),
        (None, Some(default)) => Ok(default.to_owned()),
        (Some(value), Some(default)) if value.is_empty() => Ok(default.to_owned()),
        (Some(value), _) => value
            .into_string()
            .map_err(|_| (format!("`{name}` of the environment is not UTF-8 text"), String::new())),
    }
}

/// What is wrong with the part `span` of the text `node`.
pub(super) fn wrong(
    node: &Node,
    text: &str,
    span: &Range<usize>,
    told: String,
    help: impl Into<String>,
) -> Mistake {
    Mistake::new(node.place.within(text, span), told).note(help)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_fall_into_pieces() {
        use Piece::{Parameter, Plain, Variable};
        let parts = |text| -> Vec<Piece<'_>> {
            pieces(text).unwrap().into_iter().map(|(piece, _)| piece).collect()
        };
        assert_eq!(parts(""), []);
        assert_eq!(parts("5 $ ö$"), [Plain("5 "), Plain("$ ö"), Plain("$")]);
        assert_eq!(parts("${a-b_1}"), [Parameter("a-b_1")]);
        let all = parts("x$${a}${a}$${ENV:A}${ENV:A}${ENV:A:-b:-c}");
        let expected = [
            Plain("x"),
            Plain("${"),
            Plain("a}"),
            Parameter("a"),
            Plain("${"),
            Plain("ENV:A}"),
            Variable("A", None),
            Variable("A", Some("b:-c")),
        ];
        assert_eq!(all, expected);
        for text in ["${", "a${b", "${}", "${a b}", "${ENV:}", "${ENV:a b}", "${env:A}"] {
            assert!(pieces(text).is_err(), "{text}");
        }
    }
}
