//! Printing that survives a reader who has gone.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

use super::console::Told;
use crate::{Error, Result};

/// Prints a result and one line's end on stdout. A reader who has gone (`| head`) wants no more: that
/// is no error.
pub(super) fn result(text: impl Display) -> Result<()> {
    let text = text.to_string();
    let mut stdout = io::stdout().lock();
    match writeln!(stdout, "{}", text.trim_end()).and_then(|()| stdout.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::io("stdout", "write", e)),
        _ => Ok(()),
    }
}

/// Prints a warning on stderr.
pub(super) fn warning(message: &str) {
    line(&format!("warning: {message}"));
}

/// Prints a line or several on stderr.
pub(super) fn message(text: impl Display) {
    line(text.to_string().trim_end());
}

/// Prints an event as one line on stderr.
pub(super) fn event(event: &serde_json::Value) {
    line(&event.to_string());
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
    // In one piece, whatever other threads print; nobody is left to tell that stderr is gone.
    let _ = io::stderr().lock().write_all(format!("{text}\n").as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

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
