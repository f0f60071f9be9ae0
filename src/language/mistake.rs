//! Mistakes of a pipeline: each with its place, the line's text and the nearest valid word.

use std::fmt::Write as _;

use super::place::TextPlace;
use crate::error::{is_control, nearest};
use crate::{Error, ErrorKind};

/// Mistakes that are told in full; a file with more of them is not a pipeline.
const MOST_TOLD: usize = 20;

/// Characters of a line that are shown.
const WIDEST: usize = 160;

/// One of the texts that make up a pipeline.
#[derive(Debug, Clone)]
pub(crate) struct SourceText {
    /// The file's name, or the argument's (`--set`); empty for a text that the user does not know.
    pub origin: String,
    /// What it says.
    pub text: String,
    /// True for a file: its lines have numbers.
    pub has_lines: bool,
    /// The setting that the argument stands for, where its name says it (`--keep`): messages at
    /// this place need not name it again.
    pub setting: Option<String>,
}

impl SourceText {
    /// The name of the text with the line that byte `at` is in, if its lines have numbers.
    pub fn line(&self, at: usize) -> String {
        let number = self.text[..floor(&self.text, at)].matches('\n').count() + 1;
        match (self.has_lines, self.origin.as_str()) {
            (false, origin) => origin.to_owned(),
            (true, "") => format!("line {number}"),
            (true, origin) => format!("{origin}:{number}"),
        }
    }

    /// `message` as it is told behind the name of this text.
    fn shortened<'a>(&self, message: &'a str) -> &'a str {
        let Some(setting) = &self.setting else { return message };
        let key = setting.rsplit('.').next().unwrap_or(setting);
        let told = |name: &str| message.strip_prefix(&format!("`{name}`"));
        // The value is shown below the message.
        let assigned = || Some(message.strip_prefix(&format!("`{setting} = "))?.split_once('`')?.1);
        match told(setting).or_else(|| told(key)).or_else(assigned) {
            Some(rest) => {
                let rest = rest.trim_start_matches(':').trim_start();
                rest.strip_prefix(key).and_then(|rest| rest.strip_prefix(' ')).unwrap_or(rest)
            }
            None => message,
        }
    }
}

/// Something wrong at a place.
#[derive(Debug, Clone)]
pub(crate) struct Mistake {
    place: TextPlace,
    message: String,
    note: String,
    kind: ErrorKind,
}

impl Mistake {
    /// `message` at `place`.
    pub fn new(place: TextPlace, message: impl Into<String>) -> Self {
        Mistake { place, message: message.into(), note: String::new(), kind: ErrorKind::Pipeline }
    }

    /// A word that is none of the `valid` ones; `all` says what those are ("keys").
    pub fn word<S: AsRef<str>>(
        place: TextPlace,
        message: impl Into<String>,
        word: &str,
        all: &str,
        valid: impl IntoIterator<Item = S>,
    ) -> Self {
        Mistake::new(place, message).note(advice(word, all, valid))
    }

    /// An error that a stage gave, at `place`.
    pub fn of(place: TextPlace, error: &Error) -> Self {
        let mut message = error.to_string();
        let mut cause = std::error::Error::source(error);
        while let Some(inner) = cause {
            let _ = write!(message, ": {inner}"); // writing to a String cannot fail
            cause = inner.source();
        }
        let mistake = Mistake::new(place, message).note(error.remedy().unwrap_or_default());
        Mistake { kind: error.kind(), ..mistake }
    }

    /// Adds what the user can do, shown behind the caret.
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// The same mistake elsewhere.
    pub fn moved_to(self, place: TextPlace) -> Self {
        Mistake { place, ..self }
    }

    fn render(&self, sources: &[SourceText]) -> String {
        let Some(source) = sources.get(self.place.source) else { return self.message.clone() };
        let text = &source.text;
        let start = floor(text, self.place.start);
        let from = text[..start].rfind('\n').map_or(0, |i| i + 1);
        let to = text[start..].find('\n').map_or(text.len(), |i| start + i);
        let line = text[from..to].trim_end_matches('\r');
        let end = floor(text, self.place.end.clamp(start, from + line.len().max(start - from)));
        let number = text[..from].matches('\n').count() + 1;
        let before = &text[from..start];
        let (place, gutter) = if source.has_lines {
            let column = before.chars().count() + 1;
            (format!("{}:{number}:{column}", source.origin), number.to_string())
        } else {
            (source.origin.clone(), String::new())
        };
        let carets = text[start..end].chars().count().max(1);
        let (shown, pad) = around(line, before, carets);
        // Words of the text are quoted in it: a line's end there is no line's end here.
        let message = source.shortened(&self.message).replace('\n', "\\n");
        if source.origin.is_empty() {
            // The user knows no such text: its places would say nothing.
            let note =
                if self.note.is_empty() { String::new() } else { format!("\n  = {}", self.note) };
            return format!("{message}{note}");
        }
        let mut out = format!("{place}: {message}");
        let blank = " ".repeat(gutter.len());
        if pad.chars().count() + carets <= WIDEST {
            let carets = "^".repeat(carets);
            let _ = write!(out, "\n  {gutter} | {shown}\n  {blank} | {pad}{carets}");
        }
        if !self.note.is_empty() {
            let _ = write!(out, "\n  {blank} = {}", self.note);
        }
        out
    }
}

/// As much of a line as is shown, and the space below it before the carets, which stand behind
/// `before`: the beginning of the line if they are there, else what is around them.
fn around(line: &str, before: &str, carets: usize) -> (String, String) {
    // One character each, so that the carets stay below what they mean.
    let plain = |c: char| if c != '\t' && is_control(c) { '\u{fffd}' } else { c };
    let blank = |c: char| if c == '\t' { '\t' } else { ' ' };
    let column = before.chars().count();
    if column + carets <= WIDEST || carets > WIDEST / 2 {
        let shown = line.chars().take(WIDEST).map(plain).collect();
        return (shown, before.chars().map(blank).collect());
    }
    let cut = column + carets - WIDEST / 2;
    let shown: String = line.chars().skip(cut).take(WIDEST - 1).map(plain).collect();
    let pad: String = before.chars().skip(cut).map(blank).collect();
    (format!("…{shown}"), format!(" {pad}"))
}

/// All mistakes as one error, in the order of their places.
///
/// Its kind is [`ErrorKind::Pipeline`], unless all of them are of one other kind.
pub(crate) fn tell(mut mistakes: Vec<Mistake>, sources: &[SourceText]) -> Error {
    mistakes.sort_by(|a, b| a.place.cmp(&b.place));
    let kind = match mistakes.first() {
        Some(first) if mistakes.iter().all(|m| m.kind == first.kind) => first.kind,
        _ => ErrorKind::Pipeline,
    };
    let told: Vec<String> = mistakes.iter().take(MOST_TOLD).map(|m| m.render(sources)).collect();
    if let [one] = &told[..] {
        return Error::new(kind, one.clone());
    }
    let mut message = format!("{} mistakes\n{}", mistakes.len(), told.join("\n"));
    if mistakes.len() > MOST_TOLD {
        let _ = write!(message, "\nand {} more", mistakes.len() - MOST_TOLD);
    }
    Error::new(kind, message)
}

/// "did you mean `x`? keys: x, y, z" for a word that is not among `valid`.
pub(crate) fn advice<S: AsRef<str>>(
    word: &str,
    all: &str,
    valid: impl IntoIterator<Item = S>,
) -> String {
    let mut valid: Vec<String> = valid.into_iter().map(|v| v.as_ref().to_owned()).collect();
    valid.sort();
    valid.dedup();
    if valid.is_empty() {
        return format!("{all}: none");
    }
    let list = format!("{all}: {}", valid.join(", "));
    match nearest(word, &valid).map(String::as_str).or_else(|| elsewhere(word, &valid)) {
        Some(near) => format!("did you mean `{near}`? {list}"),
        None => list,
    }
}

/// Words of other programs, and what they may be here.
const ELSEWHERE: [(&str, &[&str]); 18] = [
    ("filename", &["path", "file"]),
    ("input", &["path"]),
    ("output", &["path"]),
    ("limits", &["where"]),
    ("expression", &["where"]),
    ("value", &["set"]),
    ("assignment", &["set"]),
    ("cell", &["side"]),
    ("cell_size", &["side"]),
    ("size", &["side"]),
    ("length", &["side"]),
    ("radius", &["radius", "distance"]),
    ("mean_k", &["neighbors"]),
    ("knn", &["neighbors"]),
    ("min_k", &["min_neighbors"]),
    ("bounds", &["box"]),
    ("wkt", &["polygon"]),
    ("step", &["every"]),
];

/// What a word of another program is among those that are `valid`.
fn elsewhere<'a>(word: &str, valid: &'a [String]) -> Option<&'a str> {
    let (_, here) = ELSEWHERE.iter().find(|(other, _)| *other == word)?;
    here.iter().find_map(|here| valid.iter().find(|word| word == here)).map(String::as_str)
}

fn floor(text: &str, mut at: usize) -> usize {
    at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_at_the_end_of_the_text_or_inside_a_letter_is_rendered() {
        let sources = [file("a = 'ö'\r\nb")];
        let at = |span| Mistake::new(TextPlace::new(0, span), "wrong").render(&sources);
        assert_eq!(at(10..10), "p.toml:2:1: wrong\n  2 | b\n    | ^");
        assert_eq!(at(99..120), "p.toml:2:2: wrong\n  2 | b\n    |  ^");
        assert_eq!(at(6..8), "p.toml:1:6: wrong\n  1 | a = 'ö'\n    |      ^^");
    }

    #[test]
    fn a_place_far_behind_the_beginning_of_a_line_is_shown_with_what_is_around_it() {
        let text = format!("{}here{}", "ö ".repeat(200), " x".repeat(200));
        let at = text.find("here").unwrap();
        let told = Mistake::new(TextPlace::new(0, at..at + 4), "wrong").render(&[file(&text)]);
        let lines: Vec<Vec<char>> = told.lines().map(|line| line.chars().collect()).collect();
        assert!(told.starts_with("p.toml:1:401: wrong\n  1 | …"), "{told}");
        let caret = lines[2].iter().position(|c| *c == '^').unwrap();
        assert_eq!(lines[1][caret..caret + 4], ['h', 'e', 'r', 'e']);
        assert_eq!(lines[2][caret..], ['^'; 4]);
        assert!(lines[1].len() <= WIDEST + 6);
    }

    fn file(text: &str) -> SourceText {
        SourceText { origin: "p.toml".into(), text: text.into(), has_lines: true, setting: None }
    }
}
