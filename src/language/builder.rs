//! The same graph as a text's, put together in code: stages as values, closures among them.

use std::path::PathBuf;

use super::registry::{BuiltStage, Registry, built};
use crate::expression::Condition;
use crate::graph::{Graph, GraphStage, LimitKeys, RunSettings};
use crate::io::{Read, Write};
use crate::point::{PointBatch, Schema};
use crate::report::Tally;
use crate::stage::{
    CreateSink, Formats, Needs, OpenSource, Role, StageKind, StagePlace, Transform,
};
use crate::{Error, Result};

/// Puts a [`Graph`] together: each stage takes from the one before it that gives points, or from
/// those that [`from`](GraphBuilder::from) names.
///
/// ```
/// use pointmill::ops::normals::Normals;
/// use pointmill::ops::{Cells, Median};
/// use pointmill::synth::{Scene, Synthetic};
/// use pointmill::{Graph, Overrides, Quiet};
///
/// # fn main() -> pointmill::Result<()> {
/// # let folder = tempfile::tempdir().expect("a folder");
/// # let out = folder.path().join("reduced.laz");
/// let graph = Graph::builder()
///     .source(Synthetic { scene: Scene::Part, points: 20_000, ..Synthetic::default() })
///     .keep(|record, schema| record[schema.stride - 1] % 3 != 1)
///     .stage(Normals::default())
///     .stage(Cells::default())
///     .stage(Median::default())
///     .write(&out)
///     .build()?;
/// let done = graph.plan(&Overrides::default())?.run(&Quiet)?;
/// assert!(done.report.result.ledger.kept < 20_000);
/// # Ok(())
/// # }
/// ```
pub struct GraphBuilder {
    graph: Graph,
    formats: Formats,
    /// The last stage that gives points.
    above: Option<usize>,
    /// What the next stage takes from, if that was named.
    from: Option<Vec<String>>,
    wrong: Vec<Error>,
}

impl Graph {
    /// A graph to be put together, which knows the formats that pointmill has.
    pub fn builder() -> GraphBuilder {
        GraphBuilder {
            graph: Graph::default(),
            formats: Registry::builtin().formats().clone(),
            above: None,
            from: None,
            wrong: Vec::new(),
        }
    }
}

impl GraphBuilder {
    /// What the run may use and where it leaves things.
    #[must_use]
    pub fn settings(mut self, settings: RunSettings) -> Self {
        self.graph.settings = settings;
        self
    }

    /// Reads and writes the formats of `registry` instead.
    #[must_use]
    pub fn formats(self, registry: &Registry) -> Self {
        GraphBuilder { formats: registry.formats().clone(), ..self }
    }

    /// Reads a file, the files of a folder or of a pattern: a stage `read`.
    #[must_use]
    pub fn read(self, path: impl Into<String>) -> Self {
        self.stage(Read { path: vec![path.into()], ..Read::default() })
    }

    /// Writes a file, in the format that its extension says: a stage `write`.
    #[must_use]
    pub fn write(self, path: impl Into<PathBuf>) -> Self {
        self.stage(Write { path: Some(path.into()), ..Write::default() })
    }

    /// A stage of any kind that a text may name.
    #[must_use]
    pub fn stage<K: StageKind>(mut self, stage: K) -> Self {
        let at = StagePlace::new("", 0).knowing(&self.formats);
        match built(stage, &at) {
            Ok(built) => {
                let mut builder = self.push(K::KIND, built);
                if let Some(stage) = builder.graph.stages.last_mut() {
                    stage.is_limited = K::IS_LIMITED;
                }
                builder
            }
            Err(error) => {
                self.wrong.push(error);
                self
            }
        }
    }

    /// A stage in its role, which no text can name: `kind` is what messages and the report call it.
    #[must_use]
    pub fn role(self, kind: &str, role: Role) -> Self {
        let empty = || serde_json::json!({});
        self.push(kind, BuiltStage { role, keys: empty(), given: None })
    }

    /// A source of the program's own.
    #[must_use]
    pub fn source(self, source: impl OpenSource + 'static) -> Self {
        self.role("source", Role::Source(Box::new(source)))
    }

    /// A sink of the program's own.
    #[must_use]
    pub fn sink(self, sink: impl CreateSink + 'static) -> Self {
        self.role("sink", Role::Sink(Box::new(sink)))
    }

    /// Records for which `keep` holds; it is given their bytes and what these are.
    #[must_use]
    pub fn keep(self, keep: impl Fn(&[u8], &Schema) -> bool + Send + Sync + 'static) -> Self {
        self.transform("keep", Needs::none().removes(None), move |batch| {
            let schema = batch.schema().clone();
            batch.retain(|_, record| keep(record, &schema));
            Ok(())
        })
    }

    /// A closure that changes or removes records as they stream by, and says in `needs` which
    /// dimensions it looks at and which it changes. It is called from several threads at once, for
    /// a record perhaps twice, and removes records by [`PointBatch::retain`].
    #[must_use]
    pub fn transform(
        self,
        kind: &str,
        needs: Needs,
        apply: impl Fn(&mut PointBatch) -> Result<()> + Send + Sync + 'static,
    ) -> Self {
        self.role(kind, Role::Transform(Box::new(ClosureTransform { needs, apply })))
    }

    /// Limits the last stage to the records for which a condition holds; the others pass by.
    #[must_use]
    pub fn only(mut self, condition: &str) -> Self {
        match Condition::parse(condition) {
            Ok(condition) => {
                let condition = Some(condition);
                self.limited(LimitKeys { condition, ..LimitKeys::default() })
            }
            Err(error) => {
                self.wrong.push(error);
                self
            }
        }
    }

    /// Limits the last stage to some records; the others pass by.
    #[must_use]
    pub fn limited(mut self, limits: LimitKeys) -> Self {
        match self.graph.stages.last_mut() {
            Some(stage) if stage.can_be_limited() => stage.limit(limits),
            Some(stage) => {
                let told = format!("a stage `{}` cannot be limited to some records", stage.kind);
                self.wrong.push(Error::pipeline(told));
            }
            None => self.wrong.push(Error::pipeline("there is no stage to be limited")),
        }
        self
    }

    /// Names the last stage, for [`from`](GraphBuilder::from).
    #[must_use]
    pub fn named(mut self, name: &str) -> Self {
        let taken = self.graph.stages.iter().any(|stage| stage.name.as_deref() == Some(name));
        match self.graph.stages.last_mut() {
            _ if taken => {
                self.wrong.push(Error::pipeline(format!("two stages are named `{name}`")));
            }
            Some(stage) => stage.name = Some(name.to_owned()),
            None => self.wrong.push(Error::pipeline("there is no stage to be named")),
        }
        self
    }

    /// The next stage takes from the stages of these names instead of the one above: a branch, or
    /// several sources that are merged.
    #[must_use]
    pub fn from<S: Into<String>>(mut self, names: impl IntoIterator<Item = S>) -> Self {
        self.from = Some(names.into_iter().map(Into::into).collect());
        self
    }

    /// The graph.
    ///
    /// # Errors
    ///
    /// Everything that is wrong with the stages and with how they hang together.
    pub fn build(mut self) -> Result<Graph> {
        Error::all(std::mem::take(&mut self.wrong))?;
        self.graph.refuse_mistakes()?;
        Ok(self.graph)
    }

    fn push(mut self, kind: &str, BuiltStage { role, keys, given }: BuiltStage) -> Self {
        let (is_source, is_sink) = (matches!(role, Role::Source(_)), matches!(role, Role::Sink(_)));
        let from = match self.from.take() {
            None if is_source => Vec::new(),
            None => self.above.into_iter().collect(),
            Some(names) => names.iter().filter_map(|name| self.find(name)).collect(),
        };
        let number = self.graph.add(kind, role, &from);
        if !is_sink {
            self.above = Some(number);
        }
        let stage = &mut self.graph.stages[number];
        (stage.keys, stage.given) = (keys, given);
        self
    }

    /// The number of the stage called `name`; that there is none is kept for the end.
    fn find(&mut self, name: &str) -> Option<usize> {
        let is_it = |stage: &GraphStage| stage.name.as_deref() == Some(name);
        let found = self.graph.stages.iter().position(is_it);
        if found.is_none() {
            self.wrong.push(Error::pipeline(format!("no stage above is named `{name}`")));
        }
        found
    }
}

/// A closure as a stage that streams.
struct ClosureTransform<F> {
    needs: Needs,
    apply: F,
}

impl<F: Fn(&mut PointBatch) -> Result<()> + Send + Sync> Transform for ClosureTransform<F> {
    fn needs(&self) -> Needs {
        self.needs.clone()
    }

    fn apply(&self, batch: &mut PointBatch, _: &mut Tally) -> Result<()> {
        (self.apply)(batch)
    }
}
