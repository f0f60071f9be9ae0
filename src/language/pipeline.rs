//! The text of a pipeline before it is a graph: where it is from, and the form that it is in.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fmt;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::draft;
use super::draft::Draft;
use super::explained::{Explained, WrittenKeys};
use super::foreign;
use super::form::TextForm;
use super::line;
use super::mistake;
use super::mistake::{Mistake, SourceText};
use super::node::KeyEntry;
use super::origins::Origins;
use super::parameter::Parameter;
use super::params;
use super::params::{Declared, declared};
use super::registry::Registry;
use super::set::Set;
use super::text::build;
use crate::error::shown;
use crate::graph::Graph;
use crate::io::{open_plain, sniff};
use crate::stage::Formats;
use crate::{Error, Result};

/// Bytes of the longest pipeline file: whoever names a scan in its place waits for no gigabytes.
const LONGEST: u64 = 16 << 20;

#[doc = include_str!("../../docs/pipeline.md")]
#[derive(Clone)]
pub struct PipelineText {
    form: TextForm,
    origin: String,
    text: String,
    /// The file that it was read from, which no output may replace.
    file: Option<PathBuf>,
    environment: Arc<Variables>,
}

/// What the variables of an environment are, by their names.
type Variables = dyn Fn(&str) -> Option<OsString> + Send + Sync;

impl PipelineText {
    /// The text of a file; `origin` is the name of the file for errors, empty for a text that the
    /// user does not know: then errors name what is wrong without a place in it.
    ///
    /// ```
    /// use pointmill::{PipelineText, Registry};
    ///
    /// let text = r#"{"stage": [
    ///     {"kind": "synth", "scene": "plane", "points": 1000},
    ///     {"kind": "write", "path": "plane.laz"}
    /// ]}"#;
    /// let graph = PipelineText::new(text, "plane.json").graph(&Registry::builtin(), &[])?;
    /// assert_eq!(graph.stages.len(), 2);
    /// # Ok::<(), pointmill::Error>(())
    /// ```
    pub fn new(text: impl Into<String>, origin: impl Into<String>) -> Self {
        let (text, origin) = (text.into(), origin.into());
        let form = TextForm::of(&text, &origin);
        PipelineText { form, origin, text, file: None, environment: Arc::new(|_| None) }
    }

    /// The same text, which refers to the variables of `environment` by `${ENV:NAME}`. Without it
    /// there are none: the library looks at no environment by itself.
    ///
    /// ```
    /// use pointmill::{PipelineText, Registry};
    ///
    /// let text = "stage = [
    ///     {kind = 'synth', scene = 'plane', points = '${ENV:POINTS:-10k}'},
    ///     {kind = 'write', path = '${ENV:FOLDER}/plane.laz'},
    /// ]";
    /// let text = PipelineText::new(text, "plane.toml")
    ///     .with_environment(|name| (name == "FOLDER").then(|| "out".into()));
    /// assert!(text.graph(&Registry::builtin(), &[]).is_ok());
    /// ```
    #[must_use]
    pub fn with_environment(
        self,
        environment: impl Fn(&str) -> Option<OsString> + Send + Sync + 'static,
    ) -> Self {
        PipelineText { environment: Arc::new(environment), ..self }
    }

    /// A pipeline in one line: stages between ` ! `, such as
    /// `read in.laz ! normals ! write out.ply`. A stage is its kind, the value of its main key (the
    /// path of `read` and `write`), and `key=value`; values are as [`Set::parse`] takes them, those
    /// with spaces in quotes, lists in brackets.
    ///
    /// ```
    /// use pointmill::{PipelineText, Registry};
    ///
    /// let line = "synth plane points=1000 ! grid side=0.5 ! write plane.laz scale=[0.1, 0.1, 1]";
    /// assert!(PipelineText::is_line(line));
    /// assert!(PipelineText::line(line).graph(&Registry::builtin(), &[]).is_ok());
    /// ```
    pub fn line(text: impl Into<String>) -> Self {
        let text = PipelineText::new(text, "the pipeline");
        PipelineText { form: TextForm::Line, ..text }
    }

    /// True for a text that has a `!` between spaces, which makes it a pipeline and no name of a
    /// file.
    pub fn is_line(text: &str) -> bool {
        line::is_line(text)
    }

    /// The text of the file at `path`; a scan, which begins as one of `formats` does, is told
    /// apart.
    ///
    /// # Errors
    ///
    /// A file that cannot be read or that is no text.
    pub fn read(path: &Path, formats: &Formats) -> Result<Self> {
        let (mut file, about) = open_plain(path)?;
        let failed = |e| Error::io(path, "read the pipeline", e);
        let mut bytes = Vec::new();
        file.by_ref().take(sniff::BYTES as u64).read_to_end(&mut bytes).map_err(failed)?;
        if formats.sniffed(&bytes).is_some() {
            let name = shown(path);
            return Err(sniff::not("a pipeline file", path, &bytes, formats)
                .help(format!("a scan is reduced by `pointmill reduce {name} -o OUT`")));
        }
        if about.len() > LONGEST {
            let told = format!(
                "this is no pipeline: it has {} bytes, and {LONGEST} are read",
                about.len()
            );
            return Err(Error::pipeline(told).at(path));
        }
        file.take(LONGEST).read_to_end(&mut bytes).map_err(failed)?;
        let text = String::from_utf8(bytes).map_err(|e| {
            let valid = e.utf8_error().valid_up_to() as u64;
            Error::pipeline("the pipeline is not UTF-8 text").at(path).at_byte(valid)
        })?;
        let text = PipelineText::new(text, shown(path).to_string());
        Ok(PipelineText { file: Some(path.to_owned()), ..text })
    }

    /// The graph that the text means where the values of `sets`, in their order, take the place of
    /// its own. Files that stages name are looked up, not opened.
    ///
    /// # Errors
    ///
    /// All mistakes of the text and of `sets` at once, each with its place.
    pub fn graph(&self, registry: &Registry, sets: &[Set]) -> Result<Graph> {
        let Drafted { sources, mut draft, used } = self.draft(registry, sets)?;
        params::fill(&mut draft, &used, &*self.environment);
        self.built(draft, &sources, registry)
    }

    /// The pipeline that the text means with these values, and for each value where it is from. No
    /// input is opened.
    ///
    /// # Errors
    ///
    /// As [`graph`](PipelineText::graph).
    pub fn explain(&self, registry: &Registry, sets: &[Set]) -> Result<Explained> {
        let Drafted { sources, mut draft, used } = self.draft(registry, sets)?;
        let origins = Origins::of(&draft, &sources, &*self.environment);
        let written = WrittenKeys::of(&draft);
        let params = params::fill(&mut draft, &used, &*self.environment);
        let graph = self.built(draft, &sources, registry)?;
        Explained::new(&graph, &written, &params, &origins, registry)
    }

    /// The tables of the text with the values of `sets`, references not replaced yet.
    fn draft(&self, registry: &Registry, sets: &[Set]) -> Result<Drafted> {
        let sources: Arc<[SourceText]> =
            std::iter::once(self.source()).chain(sets.iter().map(Set::source)).collect();
        let entries = self.entries(registry).map_err(|wrong| mistake::tell(wrong, &sources))?;
        let mut draft = draft::read(entries, self.text.len(), self.form, registry);
        let used = params::used(&draft);
        for (i, set) in sets.iter().enumerate() {
            draft.apply(set, i + 1, registry);
        }
        Ok(Drafted { sources, draft, used })
    }

    fn built(
        &self,
        draft: Draft,
        sources: &Arc<[SourceText]>,
        registry: &Registry,
    ) -> Result<Graph> {
        let (graph, mistakes) = build(draft, self.file.as_deref(), sources, registry);
        if mistakes.is_empty() { Ok(graph) } else { Err(mistake::tell(mistakes, sources)) }
    }

    /// The parameters that the text declares, in its order.
    ///
    /// # Errors
    ///
    /// What is wrong with the text as such and with the declarations; nothing else is looked at.
    pub fn parameters(&self) -> Result<Vec<Parameter>> {
        let told = |mistakes| mistake::tell(mistakes, &[self.source()]);
        if self.form == TextForm::Line {
            return Ok(Vec::new());
        }
        let entries = foreign::parse(&self.text, self.form).map_err(told)?;
        let mut mistakes = Vec::new();
        let params = entries.iter().filter(|entry| entry.key == "params");
        let declared: Vec<Declared> =
            params.flat_map(|entry| declared(&entry.node, &mut mistakes)).collect();
        match mistakes.is_empty() {
            true => Ok(declared.into_iter().filter_map(Declared::told).collect()),
            false => Err(told(mistakes)),
        }
    }

    fn source(&self) -> SourceText {
        let (origin, text) = (self.origin.clone(), self.text.clone());
        SourceText { origin, text, has_lines: self.form != TextForm::Line, setting: None }
    }

    fn entries(&self, registry: &Registry) -> Result<Vec<KeyEntry>, Vec<Mistake>> {
        match self.form {
            TextForm::Line => line::parse(&self.text, registry),
            form => foreign::parse(&self.text, form),
        }
    }
}

/// A text as tables.
struct Drafted {
    /// The text, then those of arguments.
    sources: Arc<[SourceText]>,
    draft: Draft,
    /// The parameters that the text refers to.
    used: BTreeSet<String>,
}

impl fmt::Debug for PipelineText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {:?}", self.origin, self.text)
    }
}

impl Graph {
    /// Reads a pipeline file's text; `origin` is the name of its file for errors, empty for a text
    /// that the user does not know: then errors name what is wrong without a place in it.
    ///
    /// Files that stages name are looked up, not opened.
    ///
    /// # Errors
    ///
    /// All mistakes of the text at once, each with its line and column.
    pub fn parse(text: &str, origin: &str, registry: &Registry) -> Result<Graph> {
        Graph::parse_with(text, origin, registry, &[])
    }

    /// Reads a pipeline in one line, as [`PipelineText::line`] is.
    ///
    /// # Errors
    ///
    /// All mistakes of the line at once, each with a caret below it.
    pub fn parse_line(text: &str, registry: &Registry) -> Result<Graph> {
        PipelineText::line(text).graph(registry, &[])
    }

    /// Reads a pipeline in which the values of `sets`, in their order, take the place of the
    /// text's.
    ///
    /// # Errors
    ///
    /// As [`parse`](Graph::parse), those of `sets` included.
    pub fn parse_with(
        text: &str,
        origin: &str,
        registry: &Registry,
        sets: &[Set],
    ) -> Result<Graph> {
        PipelineText::new(text, origin).graph(registry, sets)
    }

    /// Reads the pipeline file at `path`, as [`parse_with`](Graph::parse_with).
    ///
    /// # Errors
    ///
    /// As [`parse`](Graph::parse), and a file that cannot be read or that is no pipeline.
    pub fn read(path: &Path, registry: &Registry, sets: &[Set]) -> Result<Graph> {
        PipelineText::read(path, registry.formats())?.graph(registry, sets)
    }
}
