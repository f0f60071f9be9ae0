//! The one error type: what went wrong, where, and what to do about it.

use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};

/// The result of anything in this crate that can fail.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// True for characters that a terminal obeys rather than shows: control characters, those that end
/// a line, and those that turn the direction of a text.
pub(crate) fn is_control(c: char) -> bool {
    let turns = matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}');
    c.is_control() || turns || matches!(c, '\u{2028}' | '\u{2029}' | '\u{2066}'..='\u{2069}')
}

/// The paths that mean standard input and output.
pub(crate) const STANDARD_INPUT: &str = "/dev/stdin";
pub(crate) const STANDARD_OUTPUT: &str = "/dev/stdout";

/// A path as messages show it: what a terminal would obey and what is no text is escaped, and what
/// is no file but a stream of the process is called so.
pub(crate) fn shown(path: &Path) -> impl fmt::Display + '_ {
    struct Shown<'a>(&'a [u8]);
    impl fmt::Display for Shown<'_> {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            for chunk in self.0.utf8_chunks() {
                for c in chunk.valid().chars() {
                    match is_control(c) {
                        true => write!(f, "{}", c.escape_default())?,
                        false => write!(f, "{c}")?,
                    }
                }
                chunk.invalid().iter().try_for_each(|byte| write!(f, "\\x{byte:02x}"))?;
            }
            Ok(())
        }
    }
    use std::os::unix::ffi::OsStrExt;
    Shown(match path.to_str() {
        Some(STANDARD_INPUT) => b"standard input",
        Some(STANDARD_OUTPUT) => b"standard output",
        _ => path.as_os_str().as_bytes(),
    })
}

/// What helps where `path` does not exist: what it is relative to.
pub(crate) fn whereabouts(path: &Path) -> Option<String> {
    if path.starts_with("~") {
        return Some(
            "`~` means your home folder in a shell alone: write its whole name".to_owned(),
        );
    }
    let folder = std::env::current_dir().ok().filter(|_| path.is_relative())?;
    Some(format!("the path is relative to the folder you are in, {}", shown(&folder)))
}

/// What helps where the process, or the whole system, may not have more files open.
fn too_many_open(cause: &std::io::Error) -> Option<&'static str> {
    use rustix::io::Errno;
    match Errno::from_io_error(cause)? {
        Errno::MFILE => Some(
            "the shell allows a process no more open files (`ulimit -n` tells how many): raise the \
             limit, such as by `ulimit -n 1024`, or give fewer inputs at once",
        ),
        Errno::NFILE => Some("the whole system has too many files open: close other programs"),
        _ => None,
    }
}

/// Words as a sentence lists them, `last` before the last one: `las, laz or ply`.
pub(crate) fn listed<S: AsRef<str>>(words: impl IntoIterator<Item = S>, last: &str) -> String {
    let words: Vec<S> = words.into_iter().collect();
    let join = |words: &[S]| words.iter().map(AsRef::as_ref).collect::<Vec<_>>().join(", ");
    match &words[..] {
        [first @ .., end] if !first.is_empty() => {
            format!("{} {last} {}", join(first), end.as_ref())
        }
        all => join(all),
    }
}

/// The valid word that a misspelt one was meant to be, if one is near: two letters in five wrong
/// at most, neighbours that are swapped counting as one and case not at all; the first in the list
/// among equals.
pub(crate) fn nearest<'a>(word: &str, valid: &'a [String]) -> Option<&'a String> {
    // Only so many letters are compared: a word may be as long as a file.
    let letters = |s: &str| -> String { s.chars().take(64).flat_map(char::to_lowercase).collect() };
    let distance = |v: &str| strsim::osa_distance(&letters(word), &letters(v));
    let near = valid.iter().map(|v| (distance(v), v)).min_by_key(|(d, _)| *d)?;
    let letters = word.chars().count().max(near.1.chars().count());
    (near.0 <= (2 * letters / 5).max(1) && near.0 < letters).then_some(near.1)
}

/// What kind of failure an [`Error`] is; the command line's exit code follows from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ErrorKind {
    /// The operating system refused to read, write or create something.
    Io,
    /// A file's content is not what its format allows.
    Data,
    /// The pipeline or the command line asks for something that cannot be.
    Pipeline,
    /// The memory budget or the disk is too small; the message names the number that would do.
    Memory,
    /// The run is done and its outputs are written, but a rule of its pipeline does not hold.
    NotAccepted,
    /// The user asked to stop.
    Interrupted,
    /// pointmill broke a promise of its own, such as a ledger that does not balance.
    Internal,
}

/// A failure with its place, its cause and, where there is one, the remedy.
///
/// Displayed on one line as `place: message`; [`Error::help`] is the remedy and
/// [`std::error::Error::source`] the cause beneath.
///
/// ```
/// use pointmill::{Error, ErrorKind};
///
/// let error = Error::data("scan.toy", "a record ends early").at_byte(96).help("write it again");
/// assert_eq!(error.kind(), ErrorKind::Data);
/// assert_eq!(error.to_string(), "scan.toy: at byte 96: a record ends early");
/// assert_eq!(error.remedy(), Some("write it again"));
/// ```
pub struct Error(Box<Inner>);

struct Inner {
    kind: ErrorKind,
    path: Option<PathBuf>,
    offset: Option<u64>,
    message: String,
    help: Option<String>,
    source: Option<Box<dyn std::error::Error + Send + Sync>>,
}

/// What a stage asked for and did not declare.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Undeclared {
    /// A column, its own or that of neighbours.
    Column,
    /// Neighbours.
    Neighbors,
}

impl fmt::Display for Undeclared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("what a stage looks at it has to say in its needs")
    }
}

impl std::error::Error for Undeclared {}

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
        use std::io::ErrorKind::{FileTooLarge, NotFound, QuotaExceeded, StorageFull};
        let path = path.as_ref();
        let help = match cause.kind() {
            QuotaExceeded | StorageFull => {
                Some("free some disk space, or write elsewhere".to_owned())
            }
            FileTooLarge => Some(
                "the file would be larger than the file system or a limit of the shell \
                 (`ulimit -f`) allows: raise the limit, or write elsewhere"
                    .to_owned(),
            ),
            NotFound => whereabouts(path),
            _ => too_many_open(&cause).map(str::to_owned),
        };
        let error = Error::new(ErrorKind::Io, format!("cannot {doing}")).at(path).because(cause);
        match help {
            Some(help) => error.help(help),
            None => error,
        }
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

    /// Something that a stage asks for without having declared it; `told` begins with "a stage".
    pub(crate) fn undeclared(what: Undeclared, told: String) -> Self {
        Error::internal(told).because(what)
    }

    /// What a stage asked for and did not declare, if it is about that.
    pub(crate) fn is_undeclared(&self) -> Option<Undeclared> {
        self.0.source.as_ref()?.downcast_ref().copied()
    }

    /// The same, which names the stage where it is about what that did not declare.
    pub(crate) fn of_stage(mut self, kind: &str) -> Self {
        if self.is_undeclared().is_some()
            && let Some(rest) = self.0.message.strip_prefix("a stage")
        {
            self.0.message = format!("the stage `{kind}`{rest}");
        }
        self
    }

    /// Adds the file that the error is about.
    pub fn at(mut self, path: impl AsRef<Path>) -> Self {
        self.0.path.get_or_insert_with(|| path.as_ref().to_owned());
        self
    }

    /// The same error about `to` if it is one about `from`, a file that the user never named.
    pub(crate) fn readdress(mut self, from: &Path, to: &Path) -> Self {
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

    /// Fails if there are `errors`, with all of them as one.
    pub(crate) fn all(errors: Vec<Error>) -> Result<()> {
        if errors.is_empty() { Ok(()) } else { Err(Error::several(errors)) }
    }

    /// These errors as one, which lists them where they are several.
    pub(crate) fn several(mut errors: Vec<Error>) -> Error {
        // Stages that share a limit, as those of a command do, share what is wrong with it.
        let mut told = BTreeSet::new();
        errors.retain(|error| told.insert(error.to_string()));
        if errors.len() == 1 {
            return errors.remove(0);
        }
        let number = errors.len();
        let all: Vec<String> = errors.iter().map(Error::with_causes).collect();
        // Of several kinds, that which is for the user of the pipeline to mend.
        let kinds = || errors.iter().map(Error::kind);
        let kind = kinds().find(|kind| *kind == ErrorKind::Pipeline);
        let kind = kind.or_else(|| kinds().next()).unwrap_or(ErrorKind::Internal);
        Error::new(kind, format!("{number} mistakes\n{}", all.join("\n")))
    }

    /// All that it says, its causes and its remedy included.
    fn with_causes(&self) -> String {
        let first = std::error::Error::source(self);
        let causes = std::iter::successors(first, |cause| cause.source());
        let causes: String = causes.map(|cause| format!(": {cause}")).collect();
        match self.remedy() {
            Some(help) => format!("{self}{causes}\n  = {help}"),
            None => format!("{self}{causes}"),
        }
    }

    /// Adds the cause beneath.
    pub fn because(mut self, cause: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        self.0.source = Some(cause.into());
        self
    }

    /// What it says, without its place.
    pub(crate) fn message(&self) -> &str {
        &self.0.message
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
            (Some(path), Some(byte)) => write!(f, "{}: at byte {byte}: ", shown(path))?,
            (Some(path), None) => write!(f, "{}: ", shown(path))?,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_word_is_one_slip_away() {
        let valid = ["neighbors", "method", "orient"].map(String::from);
        assert_eq!(nearest("neighbours", &valid), Some(&valid[0]));
        assert_eq!(nearest("mehtod", &valid), Some(&valid[1]));
        assert_eq!(nearest("ORIENT", &valid), Some(&valid[2]));
        assert_eq!(nearest("colour", &valid), None);
        assert_eq!(nearest("", &valid), None);
    }

    #[test]
    fn the_last_word_of_a_list_stands_behind_its_conjunction() {
        assert_eq!(listed(["las", "laz", "ply"], "or"), "las, laz or ply");
        assert_eq!(listed(["LAS", "LAZ"], "and"), "LAS and LAZ");
        assert_eq!(listed(["ply"], "or"), "ply");
        assert_eq!(listed([""; 0], "or"), "");
    }

    #[test]
    fn too_many_open_files_have_a_remedy() {
        use rustix::io::Errno;
        for (errno, help) in [(Errno::MFILE, "`ulimit -n 1024`"), (Errno::NFILE, "other programs")]
        {
            let error = Error::io("a.laz", "open it", errno.into());
            assert!(error.remedy().is_some_and(|told| told.contains(help)), "{error:?}");
        }
        assert_eq!(Error::io("a.laz", "open it", Errno::ACCESS.into()).remedy(), None);
    }

    #[test]
    fn a_shown_path_has_nothing_that_a_terminal_obeys() {
        use std::os::unix::ffi::OsStrExt;
        let name = std::ffi::OsStr::from_bytes(b"a\xff\x1b[2J\xe2\x80\xae\n\xc3\xa9.laz");
        let told = shown(name.as_ref()).to_string();
        assert_eq!(told, "a\\xff\\u{1b}[2J\\u{202e}\\n\u{e9}.laz");
        let error = Error::data(name, "odd");
        assert_eq!(error.to_string(), format!("{told}: odd"));
    }
}
