//! What a format of files is: how its files are named and told from others, how they are read,
//! described and written. Formats are open as stages are: an embedding program registers its own.
//!
//! What does not depend on the format (the path of an output, the order of its records, one output
//! for each input, errors that name the file) is not a format's to do: `read` and `write` do it for
//! all of them.

use std::borrow::Cow;
use std::ffi::OsStr;
use std::fmt;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use schemars::{JsonSchema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use super::findings::{Findings, Rule};
use super::keys::{ReadKeys, WriteKeys};
use super::sink::{ChunkSize, Sink};
use super::source::Source;
use super::walk::PointWalk;
use super::whole::{WHOLE_RULES, read_whole};
use crate::point::{Metadata, PointBatch, Schema};
use crate::{Error, Result};

/// Creates a sink for records of a schema.
pub type CreateFor<'a> = dyn Fn(&Arc<Schema>) -> Result<Box<dyn Sink>> + 'a;

/// A format of files that hold points. `examples/10_own_format.rs` has one of its own from end to
/// end; those that are there are in a registry:
///
/// ```
/// use std::path::Path;
///
/// use pointmill::Registry;
///
/// let registry = Registry::builtin();
/// let format = registry.formats().of(Path::new("scan.LAZ")).expect("a registered extension");
/// assert_eq!((format.name(), format.family()), ("laz", "LAS"));
/// assert!(!format.sniff(b"ply\nformat ascii 1.0\n"));
/// ```
pub trait Format: Send + Sync {
    /// Its name, which `read.format` and `write.format` take.
    fn name(&self) -> &'static str;

    /// What the names of its files end with, in lower case and without the dot before it; it may
    /// have dots in it. Of several formats the longest that fits decides.
    fn extension(&self) -> &'static str {
        self.name()
    }

    /// The family of its records, as [`Layout::family`](crate::point::Layout::family) has it. Files
    /// of formats of one family are read together, and records go from one to the other as they
    /// are.
    fn family(&self) -> &'static str;

    /// What it is, in a few words.
    fn about(&self) -> &'static str;

    /// What messages call a file of the family, with the article: "a LAS or LAZ file".
    fn called(&self) -> &'static str;

    /// True if a file that begins with these bytes (512, or all that it has) is of this family.
    fn sniff(&self, first: &[u8]) -> bool;

    /// Opens files of the family as one source, as [`OpenSource::open`](super::OpenSource::open)
    /// has it.
    ///
    /// # Errors
    ///
    /// Files that cannot be read, that do not fit together, or whose headers their lengths refute.
    /// A file that does not begin as one of the family is [`foreign`]: the caller tells what it is.
    fn open(&self, files: &[PathBuf], keys: &ReadKeys) -> Result<Box<dyn Source>>;

    /// The keys of [`ReadKeys`] that `read` takes for it.
    fn read_keys(&self) -> &'static [&'static str] {
        &[]
    }

    /// True if files of its extension are points wherever they are, so that `read` takes them out
    /// of a folder; false for an extension that other files have, too.
    fn owns_extension(&self) -> bool {
        true
    }

    /// What the header of a file says, as `info` shows it: a table with `format` and `points`.
    ///
    /// # Errors
    ///
    /// What the header refutes, with its byte; a file that does not begin as one of the family is
    /// [`foreign`].
    fn describe(&self, path: &Path) -> Result<serde_json::Value>;

    /// Holds the file at `path` to the rules of its specification and enters those that do not
    /// hold, the points looked at as `walk` says. Without a specification to go by, a file is to be
    /// read to its end and to have as many points as it says.
    ///
    /// # Errors
    ///
    /// What ends the look at the file; the caller enters it as a fault.
    fn validate(&self, path: &Path, walk: &PointWalk<'_>, findings: &mut Findings) -> Result<()> {
        let source = self.open(&[path.to_owned()], &ReadKeys::default())?;
        read_whole(&*source, walk, findings)
    }

    /// The rules that [`validate`](Format::validate) holds files to.
    fn rules(&self) -> Vec<&'static Rule> {
        WHOLE_RULES.to_vec()
    }

    /// What the file at `path` says of how it was made, as its sink wrote [`Metadata::note`]; None
    /// if it says nothing.
    ///
    /// # Errors
    ///
    /// As [`describe`](Format::describe).
    fn note(&self, _path: &Path) -> Result<Option<String>> {
        Ok(None)
    }

    /// A file that the records of the input at `path` refer to, and the extension that a copy has
    /// beside outputs ([`Input::beside`](super::Input::beside)).
    fn beside(&self, _path: &Path) -> Option<(PathBuf, &'static str)> {
        None
    }

    /// Given if points of its files are arranged in space: they come in canonical order, its sink
    /// is told where they are ([`Sink::arrange`]), and chunks that are appended to it have the
    /// place of each ([`Encoded::places`](super::Encoded::places)), which `write` adds to what the
    /// format encodes. The name of a format of the same family that holds the same where that
    /// cannot be.
    fn arranged(&self) -> Option<&'static str> {
        None
    }

    /// What `metadata` of this format's inputs has and outputs of other families do not hold, each
    /// said as what follows "this format does not hold".
    fn lost(&self, _metadata: &Metadata) -> Vec<String> {
        Vec::new()
    }

    /// The sink for the records that come from one of several inputs, whose own `metadata` this is,
    /// where records of that input alone would be of another schema than `schema`: brings records
    /// back to it before they go into what `create` makes for it.
    ///
    /// # Errors
    ///
    /// Those of `create`, and a record type of the input that the schema does not hold.
    fn of_one(
        &self,
        _staged: &Path,
        schema: &Arc<Schema>,
        _metadata: &Metadata,
        create: &CreateFor<'_>,
    ) -> Result<Box<dyn Sink>> {
        create(schema)
    }

    /// True if its files hold dimensions that stages computed ([`Metadata::computed`]), which come
    /// with [`PointBatch::columns`]; else an output that is to have some is refused.
    fn holds_computed(&self) -> bool {
        false
    }

    /// True if its files say of which coordinate reference system the coordinates are.
    fn holds_crs(&self) -> bool {
        true
    }

    /// True if its files say what GPS times count.
    fn holds_gps_time_kind(&self) -> bool {
        true
    }

    /// What to do instead where `write` does not write it; None if it does.
    fn unwritten(&self) -> Option<&'static str> {
        None
    }

    /// The keys among `scale`, `offset`, `point_format`, `encoding`, `colors`, `separator`,
    /// `decimals` and `header` that `write` takes for it.
    fn keys(&self) -> &'static [&'static str] {
        &[]
    }

    /// The chunks of what [`create`](Format::create) would open.
    ///
    /// # Errors
    ///
    /// What the format cannot hold of records of `schema` and the user did not drop, as `create`.
    fn chunk(
        &self,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<ChunkSize>;

    /// Creates a file at `staged`, as [`CreateSink::create`](super::CreateSink::create) has it.
    ///
    /// # Errors
    ///
    /// Dimensions that the format cannot hold and the user did not drop, and an output that the
    /// system refuses.
    fn create(
        &self,
        staged: &Path,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
        whole: bool,
    ) -> Result<Box<dyn Sink>>;

    /// Bytes that an open output holds besides its chunks, where its points are
    /// [arranged](Format::arranged).
    ///
    /// # Errors
    ///
    /// As [`chunk`](Format::chunk).
    fn arranging_bytes(
        &self,
        _keys: &WriteKeys,
        _schema: &Arc<Schema>,
        _metadata: &Metadata,
    ) -> Result<u64> {
        Ok(0)
    }

    /// See [`CreateSink::disk_bytes`](super::CreateSink::disk_bytes).
    ///
    /// # Errors
    ///
    /// As [`chunk`](Format::chunk).
    fn disk_bytes(
        &self,
        _keys: &WriteKeys,
        _schema: &Arc<Schema>,
        _metadata: &Metadata,
    ) -> Result<[u64; 2]> {
        Ok([0; 2])
    }

    /// See [`CreateSink::carries`](super::CreateSink::carries).
    fn carries(&self, _keys: &WriteKeys, _schema: &Schema) -> bool {
        false
    }

    /// See [`CreateSink::likes_time`](super::CreateSink::likes_time).
    fn likes_time(&self) -> bool {
        false
    }

    /// See [`CreateSink::wants_beside`](super::CreateSink::wants_beside).
    fn wants_beside(&self) -> bool {
        false
    }

    /// See [`CreateSink::unread`](super::CreateSink::unread).
    fn unread<'a>(&self, _keys: &'a WriteKeys) -> &'a [String] {
        &[]
    }

    /// See [`CreateSink::checks`](super::CreateSink::checks).
    fn checks(&self, _keys: &WriteKeys, _schema: &Schema) -> bool {
        false
    }

    /// See [`CreateSink::check`](super::CreateSink::check).
    ///
    /// # Errors
    ///
    /// A record that the output cannot hold.
    fn check(&self, _keys: &WriteKeys, _metadata: &Metadata, _records: &PointBatch) -> Result<()> {
        Ok(())
    }
}

/// The error of the file at `path`, which does not begin as `called` does.
pub fn foreign(path: &Path, called: &str) -> Error {
    Error::data(path, format!("this is not {called}, by its first bytes")).at_byte(0)
}

/// The name of a registered format, as a key of a stage takes it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FormatName(pub String);

impl JsonSchema for FormatName {
    fn schema_name() -> Cow<'static, str> {
        "FormatName".into()
    }

    /// Which names there are is for the registry to say.
    fn json_schema(_: &mut SchemaGenerator) -> schemars::Schema {
        json_schema!({ "type": "string", "format": FormatName::SCHEMA })
    }
}

impl FormatName {
    /// What the `format` of its schema is.
    pub(crate) const SCHEMA: &'static str = "name-of-a-format";
}

/// The formats that are registered, in the order in which they were. Cloning it copies no format.
#[derive(Clone, Default)]
pub struct Formats(Vec<Arc<dyn Format>>);

impl Formats {
    /// The same and `format`, which takes the place of one of its name.
    #[must_use]
    pub fn with(mut self, format: impl Format + 'static) -> Self {
        self.0.retain(|other| other.name() != format.name());
        self.0.push(Arc::new(format));
        self
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &Arc<dyn Format>> {
        self.0.iter()
    }

    /// Their names.
    pub fn names(&self) -> Vec<&'static str> {
        self.iter().map(|format| format.name()).collect()
    }

    /// The format of that name.
    ///
    /// # Errors
    ///
    /// If there is none.
    pub fn named(&self, name: &FormatName) -> Result<&Arc<dyn Format>> {
        self.iter().find(|format| format.name() == name.0).ok_or_else(|| {
            let told = format!("there is no format `{}`", name.0);
            Error::pipeline(told).help(format!("formats: {}", self.names().join(", ")))
        })
    }

    /// The format that the extension of `path` names, its case aside.
    pub fn of(&self, path: &Path) -> Option<&Arc<dyn Format>> {
        let name = path.file_name()?;
        let is_of = |format: &&Arc<dyn Format>| stem(name, format.extension()).is_some();
        self.iter().filter(is_of).max_by_key(|format| format.extension().len())
    }

    /// The name of the file at `path` without its extension, which may be that of a format and have
    /// dots in it.
    pub fn stem<'a>(&self, path: &'a Path) -> Option<&'a OsStr> {
        let own = self.of(path).and_then(|format| stem(path.file_name()?, format.extension()));
        own.or(path.file_stem())
    }

    /// `format`, or the one that takes its place where points are not [arranged](Format::arranged).
    pub fn unarranged<'a>(&'a self, format: &'a Arc<dyn Format>) -> &'a Arc<dyn Format> {
        let other = format.arranged().and_then(|other| self.iter().find(|f| f.name() == other));
        other.unwrap_or(format)
    }

    /// A format of the family whose files begin with these bytes.
    pub fn sniffed(&self, first: &[u8]) -> Option<&Arc<dyn Format>> {
        self.iter().find(|format| format.sniff(first))
    }

    /// The formats of a family.
    pub fn of_family<'a>(&'a self, family: &'a str) -> impl Iterator<Item = &'a Arc<dyn Format>> {
        self.iter().filter(move |format| format.family() == family)
    }
}

/// `name` without `extension` and the dot before it; None if it ends with another or is no more.
fn stem<'a>(name: &'a OsStr, extension: &str) -> Option<&'a OsStr> {
    let name = name.as_bytes();
    let dot = name.len().checked_sub(extension.len() + 1).filter(|dot| *dot > 0)?;
    let (stem, end) = name.split_at(dot);
    let is_its = end.strip_prefix(b".")?.eq_ignore_ascii_case(extension.as_bytes());
    is_its.then(|| OsStr::from_bytes(stem))
}

impl fmt::Debug for Formats {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.names()).finish()
    }
}
