//! The words and signs of an expression.

use std::ops::Range;

use super::fault::ExpressionFault;
use crate::error::is_control;

/// A word or sign and where it stands.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Token {
    pub kind: TokenKind,
    pub span: Range<usize>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum TokenKind {
    Number(f64),
    /// A name or one of the words of the language.
    Word(String),
    /// A name in backticks, which is none of the words of the language.
    Name(String),
    Sign(&'static str),
    End,
}

/// Longer ones before those that they begin with.
const SIGNS: [&str; 18] =
    ["==", "!=", "<=", ">=", "..", "<", ">", "+", "-", "*", "/", "%", "(", ")", "[", "]", ",", "="];

/// What helps where a number has a unit.
pub(super) const UNITLESS: &str =
    "numbers of an expression have no units: lengths are in the unit of the scan";

/// Signs of other languages, and what is written here.
const FOREIGN: [(&str, &str); 6] =
    [("&&", "and"), ("||", "or"), ("&", "and"), ("|", "or"), ("!", "not"), ("<>", "!=")];

/// Takes `text` apart; the last token is the end.
pub(super) fn tokens(text: &str) -> Result<Vec<Token>, ExpressionFault> {
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(first) = text[at..].chars().next() {
        if first.is_whitespace() {
            at += first.len_utf8();
            continue;
        }
        let (kind, len) = token(&text[at..], first).map_err(|fault| moved(fault, at))?;
        tokens.push(Token { kind, span: at..at + len });
        at += len;
    }
    tokens.push(Token { kind: TokenKind::End, span: text.len()..text.len() });
    Ok(tokens)
}

fn moved(fault: ExpressionFault, by: usize) -> ExpressionFault {
    ExpressionFault { span: fault.span.start + by..fault.span.end + by, ..fault }
}

/// The token that `text` begins with, and its length.
fn token(text: &str, first: char) -> Result<(TokenKind, usize), ExpressionFault> {
    if first.is_ascii_digit() {
        return number(text);
    }
    if first.is_alphabetic() || first == '_' {
        let len = length(text, |c| c.is_alphanumeric() || c == '_');
        return Ok((TokenKind::Word(text[..len].to_owned()), len));
    }
    if first == '`' {
        let told = "the name in backticks does not end";
        let len = text[1..].find('`').ok_or_else(|| ExpressionFault::new(0..1, told))?;
        return match len {
            0 => Err(ExpressionFault::new(0..2, "there is no name between the backticks")),
            _ => Ok((TokenKind::Name(text[1..=len].to_owned()), len + 2)),
        };
    }
    let foreign = FOREIGN.iter().find(|(sign, _)| text.starts_with(sign));
    if let (Some((sign, here)), false) = (foreign, text.starts_with("!=")) {
        let told = format!("`{sign}` is no sign of an expression");
        return Err(ExpressionFault::new(0..sign.len(), told).help(format!("write `{here}`")));
    }
    if let Some(sign) = SIGNS.iter().find(|sign| text.starts_with(**sign)) {
        return Ok((TokenKind::Sign(sign), sign.len()));
    }
    let help = match first {
        '"' | '\'' => "dimensions hold numbers; a name with spaces stands in backticks",
        '.' => "write a digit before the point",
        ':' => "a range is written with two points: `Classification in 2..6`",
        _ => "",
    };
    let shown = if is_control(first) { '\u{fffd}' } else { first };
    let told = format!("`{shown}` is no sign of an expression");
    Err(ExpressionFault::new(0..first.len_utf8(), told).help(help))
}

/// Bytes of the letters that `text` begins with for which `is_part` holds.
fn length(text: &str, is_part: impl Fn(char) -> bool) -> usize {
    text.find(|c| !is_part(c)).unwrap_or(text.len())
}

/// A decimal number: digits, which may be grouped by `_`, a fraction, an exponent.
fn number(text: &str) -> Result<(TokenKind, usize), ExpressionFault> {
    let digits = |from: usize| from + length(&text[from..], |c| c.is_ascii_digit() || c == '_');
    let is_digit = |at: usize| text[at..].starts_with(|c: char| c.is_ascii_digit());
    let mut len = digits(0);
    // Two points are a range.
    if text[len..].starts_with('.') && is_digit(len + 1) {
        len = digits(len + 1);
    }
    if text[len..].starts_with(['e', 'E']) {
        let sign = usize::from(text[len + 1..].starts_with(['+', '-']));
        if is_digit(len + 1 + sign) {
            len = digits(len + 1 + sign);
        }
    }
    let behind = length(&text[len..], |c| c.is_alphanumeric() || c == '_');
    if behind > 0 {
        let (number, unit) = (&text[..len], &text[len..len + behind]);
        let told = format!("`{number}{unit}` is no number");
        return Err(ExpressionFault::new(0..len + behind, told).help(UNITLESS));
    }
    match text[..len].replace('_', "").parse::<f64>() {
        Ok(value) if value.is_finite() => Ok((TokenKind::Number(value), len)),
        _ => Err(ExpressionFault::new(0..len, "the number is too large")),
    }
}
