//! The one error type: what went wrong, where, and what to do about it.

use std::fmt;
use std::path::{Path, PathBuf};

/// The result of anything in this crate that can fail.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What kind of failure an [`Error`] is; the command line's exit code follows from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// The operating system refused to read, write or create something.
    Io,
    /// A file's content is not what its format allows.
    Data,
    /// The pipeline or the command line asks for something that cannot be.
    Pipeline,
    /// The memory budget or the disk is too small; the message names the number that would do.
    Memory,
    /// The user asked to stop.
    Interrupted,
    /// pointmill broke a promise of its own, such as a ledger that does not balance.
    Internal,
}

/// A failure with its place, its cause and, where there is one, the remedy.
///
/// Displayed on one line as `place: message`; [`Error::help`] is the remedy and
/// [`std::error::Error::source`] the cause beneath.
pub struct Error(Box<Inner>);

struct Inner {
    kind: ErrorKind,
    path: Option<PathBuf>,
    offset: Option<u64>,
    message: String,
    help: Option<String>,
    source: Option<Box<dyn std::error::Error + Send + Sync>>,
}

impl Error {
    /// An error of `kind` that says `message`.
    pub fn new(kind: ErrorKind, message: impl Into<String>) -> Self {
        Error(Box::new(Inner {
            kind,
            path: None,
            offset: None,
            message: message.into(),
            help: None,
            source: None,
        }))
    }

    /// A refusal of the operating system at `path`; `doing` completes "cannot …".
    pub fn io(path: impl AsRef<Path>, doing: &str, cause: std::io::Error) -> Self {
        use std::io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
        let help = match cause.kind() {
            QuotaExceeded | StorageFull => Some("free some disk space, or write elsewhere"),
            FileTooLarge => Some(
                "the file would be larger than the file system or a limit of the shell (`ulimit -f`) \
                 allows: raise the limit, or write elsewhere",
            ),
            _ => None,
        };
        let error = Error::new(ErrorKind::Io, format!("cannot {doing}")).at(path).because(cause);
        if let Some(help) = help { error.help(help) } else { error }
    }

    /// Content of `path` that its format does not allow.
    pub fn data(path: impl AsRef<Path>, message: impl Into<String>) -> Self {
        Error::new(ErrorKind::Data, message).at(path)
    }

    /// A pipeline or command line that cannot be.
    pub fn pipeline(message: impl Into<String>) -> Self {
        Error::new(ErrorKind::Pipeline, message)
    }

    /// A budget that does not suffice.
    pub fn memory(message: impl Into<String>) -> Self {
        Error::new(ErrorKind::Memory, message)
    }

    /// The user's request to stop.
    pub fn interrupted() -> Self {
        Error::new(ErrorKind::Interrupted, "interrupted")
    }

    /// A promise of our own that did not hold.
    pub fn internal(message: impl Into<String>) -> Self {
        Error::new(ErrorKind::Internal, message)
    }

    /// Adds the file that the error is about.
    pub fn at(mut self, path: impl AsRef<Path>) -> Self {
        self.0.path.get_or_insert_with(|| path.as_ref().to_owned());
        self
    }

    /// The same error about `to` if it is one about `from`, a file that the user never named.
    pub fn readdress(mut self, from: &Path, to: &Path) -> Self {
        if self.path() == Some(from) {
            self.0.path = Some(to.to_owned());
        }
        self
    }

    /// Adds the byte of the file where it went wrong.
    pub fn at_byte(mut self, offset: u64) -> Self {
        self.0.offset.get_or_insert(offset);
        self
    }

    /// Adds what the user can do.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.0.help = Some(help.into());
        self
    }

    /// Adds the cause beneath.
    pub fn because(mut self, cause: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        self.0.source = Some(cause.into());
        self
    }

    /// What kind of failure this is.
    pub fn kind(&self) -> ErrorKind {
        self.0.kind
    }

    /// The file it is about, if it is about one.
    pub fn path(&self) -> Option<&Path> {
        self.0.path.as_deref()
    }

    /// The byte of that file, where one can be named.
    pub fn byte(&self) -> Option<u64> {
        self.0.offset
    }

    /// What the user can do, where something can be done.
    pub fn remedy(&self) -> Option<&str> {
        self.0.help.as_deref()
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.0.path, self.0.offset) {
            (Some(path), Some(byte)) => write!(f, "{}: at byte {byte}: ", path.display())?,
            (Some(path), None) => write!(f, "{}: ", path.display())?,
            _ => {}
        }
        f.write_str(&self.0.message)
    }
}

impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}: {self}", self.0.kind)?;
        if let Some(cause) = &self.0.source {
            write!(f, ": {cause}")?;
        }
        if let Some(help) = &self.0.help {
            write!(f, " (help: {help})")?;
        }
        Ok(())
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.0.source.as_deref().map(|e| e as _)
    }
}
