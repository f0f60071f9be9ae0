//! What a pipeline file may name: the kind of a stage, whose keys are the fields of a struct.

use std::cell::RefCell;

use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::format::Formats;
use super::{Role, RoleName};
use crate::{Error, Result};

/// What a `[[stage]]` of a pipeline file may be. The struct's fields are the stage's keys.
///
/// Keys that are no field are refused whatever the struct says; a field without a serde default is
/// a key that must be given. `flatten` and `untagged` hide keys and places and are not supported.
///
/// The doc comments are its manual page, which the command `stages` prints and editors show: that
/// of the struct up to its first example, those of the fields and, where a field is an enum, those
/// of its variants. A field whose type reads its value itself says what it takes by
/// `#[schemars(...)]`; the `title` of its schema is what that is in words.
pub trait StageKind: DeserializeOwned + Serialize + JsonSchema {
    /// Its name in a file: one plain word, or two with a hyphen.
    const KIND: &'static str;

    /// The role that [`build`](StageKind::build) puts it in, which decides which keys it takes
    /// besides its own. A kind that works on tiles may stream with some keys: it says `OnTiles`.
    const ROLE: RoleName;

    /// What it does, in one sentence.
    const ABOUT: &'static str;

    /// Keys that say where files are rather than what is computed: they stay out of the report's
    /// `pipeline`, which must not depend on where a scan lies and how it is split into files.
    const PLACES: &'static [&'static str] = &[];

    /// Keys of which a stage takes one: an argument that gives one takes the place of the others,
    /// where a file gives several the stage tells.
    const EITHER: &'static [&'static str] = &[];

    /// The key that a pipeline in one line may give without its name: `read in.laz` is
    /// `read path=in.laz`.
    const MAIN: Option<&'static str> = None;

    /// True if it takes `where`, `classes`, `with` and `without` besides its own keys, to work on
    /// some records and let the others pass; false if that is what its own keys are about.
    const IS_LIMITED: bool = true;

    /// Puts the stage in its role. Called once every key fits its field; an error is told with the
    /// stage's place in the file, or that of a key if it went through [`StagePlace::blame`].
    ///
    /// # Errors
    ///
    /// Keys that do not go together, or values that no key of the kind can have.
    fn build(self, at: &StagePlace) -> Result<Role>;
}

/// Where in a pipeline file a stage stands.
///
/// Relative paths in a pipeline file are relative to the working directory, as they are on the
/// command line, so that `--set read.path=…` and the file mean the same.
#[derive(Debug)]
pub struct StagePlace {
    file: String,
    line: usize,
    formats: Formats,
    is_unread: bool,
    blamed: RefCell<Option<String>>,
}

impl StagePlace {
    /// A stage at line `line` (from 1) of `file`; no format is known there.
    pub fn new(file: impl Into<String>, line: usize) -> Self {
        let (formats, blamed) = (Formats::default(), RefCell::new(None));
        StagePlace { file: file.into(), line, formats, is_unread: false, blamed }
    }

    /// The same where no file is to be looked at: see [`is_unread`](StagePlace::is_unread).
    #[must_use]
    pub fn unread(self) -> Self {
        StagePlace { is_unread: true, ..self }
    }

    /// True if the pipeline will not run, but is drawn or explained: a stage need not find the
    /// files that it names, and may play its role by [`Unread`](super::Unread).
    pub fn is_unread(&self) -> bool {
        self.is_unread
    }

    /// The same, `formats` being the ones that it may name.
    #[must_use]
    pub fn knowing(self, formats: &Formats) -> Self {
        StagePlace { formats: formats.clone(), ..self }
    }

    /// The formats that are registered.
    pub fn formats(&self) -> &Formats {
        &self.formats
    }

    /// The pipeline file, as the user named it.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The line of its `kind`, from 1.
    pub fn line(&self) -> usize {
        self.line
    }

    /// Returns `error`, noting that the value of `key` is to blame for it.
    pub fn blame(&self, key: &str, error: Error) -> Error {
        self.blamed.replace(Some(key.to_owned()));
        error
    }

    /// The key that is to blame, if one was named.
    pub(crate) fn blamed(&self) -> Option<String> {
        self.blamed.borrow().clone()
    }
}
