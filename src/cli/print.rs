//! Printing that survives a reader who has gone.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

use super::words::Told;
use crate::error::is_control;
use crate::{Error, Result};

/// Prints a result and one line's end on stdout. A reader who has gone (`| head`) wants no more:
/// that is no error.
pub(super) fn result(text: impl Display) -> Result<()> {
    let text = escaped(&text.to_string());
    let mut stdout = io::stdout().lock();
    match writeln!(stdout, "{}", text.trim_end()).and_then(|()| stdout.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::io("stdout", "write", e)),
        _ => Ok(()),
    }
}

/// Prints JSON as a result, of several lines or one.
pub(super) fn json(text: &str) -> Result<()> {
    result(json_escaped(text))
}

/// Prints a warning on stderr: one line, whatever names are in it.
pub(super) fn warning(message: &str) {
    line(&format!("warning: {}", message.replace('\n', "\\n")));
}

/// Prints a line or several on stderr.
pub(super) fn message(text: impl Display) {
    line(text.to_string().trim_end());
}

/// Prints help to stdout, or what is wrong with the arguments to stderr.
pub(super) fn usage(told: &clap::Error) {
    let text = told.render().to_string();
    match escaped(&text) == text {
        true => drop(told.print()), // in colours; nobody is left to tell that a terminal is gone
        false => line(&text),
    }
}

/// Prints an event as one line on stderr.
pub(super) fn event(event: &serde_json::Value) {
    line(&json_escaped(&event.to_string()));
}

/// `text` without what a terminal would obey rather than show, but for the ends of its lines and
/// tabs: names and texts of files hold what they like.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match is_control(c) && c != '\n' && c != '\t' {
            true => out.extend(c.escape_default()),
            false => out.push(c),
        }
    }
    out
}

/// The same JSON: such characters stand in its texts alone, as far as they are not escaped there
/// already, and are escaped as JSON escapes.
pub(super) fn json_escaped(json: &str) -> String {
    let mut out = String::with_capacity(json.len());
    for c in json.chars() {
        match is_control(c) && c != '\n' {
            true => out += &format!("\\u{:04x}", u32::from(c)), // all of them have four digits
            false => out.push(c),
        }
    }
    out
}

/// Prints an error on stderr: place and message, the causes beneath it, what the user can do.
pub(super) fn error(told: &Told<'_>) {
    line(&rendered(told));
}

fn rendered(told: &Told<'_>) -> String {
    let mut text = format!("error: {}", told.message);
    for (i, cause) in told.causes.iter().enumerate() {
        text += &format!("\n{:indent$}{cause}", "", indent = 2 * (i + 1));
    }
    if let Some(help) = &told.help {
        text += &format!("\nhelp: {help}");
    }
    text
}

fn line(text: &str) {
    let text = escaped(text);
    // In one piece, whatever other threads print; nobody is left to tell that stderr is gone.
    let _ = io::stderr().lock().write_all(format!("{text}\n").as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_escaped() {
        let name = "a\u{1b}[2J\u{202e}\u{9b}é🏔.laz\ttab\nline";
        assert_eq!(escaped(name), "a\\u{1b}[2J\\u{202e}\\u{9b}é🏔.laz\ttab\nline");
        let json = serde_json::json!({ "name": name });
        let told = json_escaped(&json.to_string());
        assert!(!told.chars().any(is_control), "{told}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&told).unwrap(), json);
    }

    #[test]
    fn an_error_says_place_cause_and_remedy() {
        let cause = io::Error::new(ErrorKind::NotFound, "no such file");
        let error = Error::io("a.laz", "open", cause).help("look in b");
        let told = Told {
            error: &error,
            message: error.to_string(),
            causes: vec!["no such file".to_owned()],
            help: error.remedy().map(str::to_owned),
        };
        assert_eq!(rendered(&told), "error: a.laz: cannot open\n  no such file\nhelp: look in b");
    }
}
