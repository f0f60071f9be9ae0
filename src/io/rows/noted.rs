//! The comments in which a header says how its file was made.

use std::sync::Arc;

use crate::Result;
use crate::point::{Metadata, RunNote};

/// What begins the comment that holds the text, and its further pieces.
const NOTE: &str = "pointmill: ";
const NOTE_MORE: &str = "pointmill+ ";

/// The lines of a header that say how its file was made: a draft of the same length until that is
/// known.
#[derive(Clone, Default)]
pub(crate) struct NotedLines {
    note: Option<Arc<RunNote>>,
    begins: &'static str,
    /// The lines.
    pub text: String,
}

impl NotedLines {
    /// Those of a file of `metadata`, where this begins a comment; and what is to be told if they
    /// are too long for a header.
    pub fn of(metadata: &Metadata, begins: &'static str) -> (NotedLines, Option<String>) {
        let note = metadata.note.clone().filter(|note| note.draft().len() <= LONGEST);
        let is_left_out = metadata.note.is_some() && note.is_none();
        let told = "how it was made is too long for a header and not in it";
        let text = note.as_ref().map_or(String::new(), |note| lines(begins, note.draft()));
        (NotedLines { note, begins, text }, is_left_out.then(|| told.to_owned()))
    }

    /// Puts what is known now in the place of the draft.
    pub fn settle(&mut self) -> Result<()> {
        if let Some(note) = &self.note {
            self.text = lines(self.begins, note.text()?);
        }
        Ok(())
    }
}

/// Bytes of the longest text: headers of 1 MiB are read, and some readers make room for less.
const LONGEST: usize = 256 << 10;

/// The header lines that hold `text` behind what begins a comment. They are of one length for all
/// texts of a length that have their blanks at the same places.
fn lines(begins: &str, text: &str) -> String {
    let begin = |n: usize| if n == 0 { NOTE } else { NOTE_MORE };
    let each = pieces(text).into_iter().enumerate();
    each.map(|(n, piece)| format!("{begins}{}{piece}\n", begin(n))).collect()
}

/// Takes the text out of the comments of a header; None if they have none.
pub(crate) fn take(comments: &mut Vec<String>) -> Option<String> {
    let first = comments.iter().position(|comment| comment.starts_with(NOTE))?;
    let more = comments[first + 1..].iter().take_while(|c| c.starts_with(NOTE_MORE)).count();
    let taken = comments.drain(first..=first + more);
    let text = |comment: String| {
        let rest = comment.strip_prefix(NOTE).or_else(|| comment.strip_prefix(NOTE_MORE));
        rest.unwrap_or_default().to_owned()
    };
    Some(taken.map(text).collect())
}

/// Bytes of one piece of a long text: some readers refuse header lines of 1,024 bytes.
const PIECE: usize = 900;

/// A text in pieces that fit a header line. Line ends become blanks, and no piece ends in a blank,
/// which readers may take off.
pub fn pieces(text: &str) -> Vec<String> {
    let mut pieces = vec![String::new()];
    for word in text.replace(['\n', '\r'], " ").split_inclusive(|c: char| !c.is_whitespace()) {
        match pieces.last_mut() {
            Some(last) if last.len() + word.len() <= PIECE || last.is_empty() => *last += word,
            _ => pieces.push(word.to_owned()),
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_taken_from_among_other_comments() {
        let text = format!("{{\"a\": [{}]}}", "1 2, ".repeat(1000));
        let lines = format!("comment before\n{}comment pointmill+ x\n", lines("comment ", &text));
        let mut all: Vec<String> =
            lines.lines().map(|line| line["comment ".len()..].to_owned()).collect();
        // One that is no piece of it, as another comes between.
        all.insert(all.len() - 1, "between".to_owned());
        assert_eq!(take(&mut all).unwrap(), text);
        assert_eq!(all, ["before", "between", "pointmill+ x"]);
        assert_eq!(take(&mut all), None);
    }

    #[test]
    fn a_long_text_is_cut_where_no_blank_is_lost() {
        let text = format!("A {}{} Ω end", "word ".repeat(400), " ".repeat(30));
        let cut = pieces(&text);
        assert!(cut.len() >= 3 && cut.iter().all(|p| p.len() <= PIECE), "{}", cut.len());
        assert!(cut.iter().all(|p| p.trim_end() == p));
        assert_eq!(cut.concat(), text);
    }
}
