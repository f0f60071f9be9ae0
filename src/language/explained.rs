//! A pipeline as it takes effect: every key of every table with its value, and where that is from.

use std::collections::BTreeMap;
use std::fmt;

use serde_json::{Map, Value, json};

use super::described::{KeyDescription, TableDescription};
use super::draft::{Draft, StageDraft};
use super::node;
use super::node::Node;
use super::origins::Origins;
use super::parameter::value_words;
use super::place::TextPlace;
use super::registry::Registry;
use crate::error::is_control;
use crate::graph::{Graph, GraphStage, literal};
use crate::stage::RoleName;
use crate::{Error, Result};

/// The origin of a value that neither the text nor an argument gives.
const DEFAULT: &str = "default";
/// Behind the origin of a value that stages settle.
const SETTLED: &str = "chosen from the scan in a run";
/// The texts that leave a value to the scan.
const LEFT_TO_SCAN: [&str; 2] = ["auto", "spread"];
/// Characters of an assignment beyond which its comment follows without being aligned.
const WIDEST: usize = 48;

/// A pipeline with all defaults filled in, and the origin of every value.
///
/// As text it is a pipeline file in TOML that makes the same graph. Each of its lines ends in a
/// comment: the line of the file that the value is from, the argument, parameter or variable of the
/// environment, or `default`. Keys without a value, and those that limit a stage which is not
/// limited, are comments as a whole; so are parameters, whose values stand where they are used.
///
/// ```
/// use pointmill::{PipelineText, Registry, Set};
///
/// let text = "stage = [
///     {kind = 'synth', scene = 'plane', points = '10k'},
///     {kind = 'write', path = 'plane.laz'},
/// ]";
/// let set = Set::parse("write.path=out.laz")?;
/// let explained = PipelineText::new(text, "p.toml").explain(&Registry::builtin(), &[set])?;
/// let told = explained.to_string();
/// let says = |begin: &str, end: &str| {
///     told.lines().any(|line| line.starts_with(begin) && line.ends_with(end))
/// };
/// assert!(says("points = 10000 ", "# p.toml:2"));
/// assert!(says("seed = 0 ", "# default"));
/// assert!(says("path = \"out.laz\" ", "# --set"));
/// # Ok::<(), pointmill::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Explained {
    params: Vec<ExplainedKey>,
    run: Vec<ExplainedKey>,
    /// None where nothing says what is accepted.
    accept: Vec<ExplainedKey>,
    /// The keys of each stage, `kind`, `name` and `from` among them.
    stages: Vec<Vec<ExplainedKey>>,
}

/// A key with its value and where that is from.
#[derive(Debug, Clone)]
struct ExplainedKey {
    key: String,
    /// Null where it has none.
    value: Value,
    origin: String,
    /// False for what a file need not say.
    is_said: bool,
}

/// The keys of a draft, each with the place where it is written.
pub(super) struct WrittenKeys {
    run: BTreeMap<String, TextPlace>,
    accept: BTreeMap<String, TextPlace>,
    stages: Vec<(StageDraft, BTreeMap<String, TextPlace>)>,
}

impl WrittenKeys {
    pub fn of(draft: &Draft) -> Self {
        let keys = |table: &Node| {
            table.entries().iter().map(|entry| (entry.key.clone(), entry.at.clone())).collect()
        };
        let stages = draft.stages.iter().map(|stage| (stage.clone(), keys(&stage.keys)));
        let (run, accept) = (keys(&draft.run), keys(&draft.accept));
        WrittenKeys { run, accept, stages: stages.collect() }
    }
}

impl Explained {
    /// `graph`, which was made of `written` keys and the values of parameters.
    pub(super) fn new(
        graph: &Graph,
        written: &WrittenKeys,
        params: &BTreeMap<String, Node>,
        origins: &Origins,
        registry: &Registry,
    ) -> Result<Self> {
        let param = |(name, node): (&String, &Node)| ExplainedKey {
            key: name.clone(),
            value: value_words(node).into(),
            origin: origins.param(name).to_owned(),
            is_said: false,
        };
        let tables = (serde_json::to_value(&graph.settings), serde_json::to_value(&graph.accept));
        let (Ok(Value::Object(settings)), Ok(Value::Object(rules))) = tables else {
            return Err(Error::internal("the settings of a pipeline are no table"));
        };
        let run =
            table(&registry.describe_run(), &settings, |key| origin(&written.run, origins, key));
        let mut accept =
            table(&registry.describe_accept(), &rules, |key| origin(&written.accept, origins, key));
        accept.retain(|key| key.is_said);
        let stages = graph.stages.iter().zip(&written.stages);
        let stages = stages.map(|(stage, (draft, keys))| {
            let mut all = heading(draft, origins);
            all.extend(stage_keys(stage, keys, origins, registry));
            all
        });
        let params = params.iter().map(param).collect();
        Ok(Explained { params, run, accept, stages: stages.collect() })
    }

    /// The same for programs: `params`, `run`, `accept` and each of `stages` are lists of objects
    /// with a `key`, its `value` (null where it has none) and its `origin`, as the comments of the
    /// text have it.
    pub fn to_json(&self) -> Value {
        let key = |one: &ExplainedKey| {
            let ExplainedKey { key, value, origin, .. } = one;
            json!({ "key": key, "value": value, "origin": origin })
        };
        let keys = |keys: &[ExplainedKey]| keys.iter().map(key).collect::<Value>();
        let stages: Value = self.stages.iter().map(|stage| keys(stage)).collect();
        let (params, run, accept) = (keys(&self.params), keys(&self.run), keys(&self.accept));
        json!({ "params": params, "run": run, "accept": accept, "stages": stages })
    }
}

/// The keys of a stage that every kind has.
fn heading(draft: &StageDraft, origins: &Origins) -> Vec<ExplainedKey> {
    let said = |key: &str, value: Value, at: &TextPlace| ExplainedKey {
        key: key.to_owned(),
        value,
        origin: origins.line(at),
        is_said: true,
    };
    let kind = draft.kind.iter().map(|(kind, at)| said("kind", kind.as_str().into(), at));
    let name = draft.name.iter().map(|(name, at)| said("name", name.as_str().into(), at));
    let from = draft.from.iter().filter_map(|from| {
        let names: Value = from.iter().map(|(name, _)| name.as_str()).collect();
        Some(said("from", names, &from.first()?.1))
    });
    kind.chain(name).chain(from).collect()
}

/// The other keys of a stage.
fn stage_keys(
    stage: &GraphStage,
    written: &BTreeMap<String, TextPlace>,
    origins: &Origins,
    registry: &Registry,
) -> Vec<ExplainedKey> {
    let given = stage.given.as_ref().and_then(Value::as_object).cloned().unwrap_or_default();
    let Some(described) = registry.describe(&stage.kind) else { return Vec::new() };
    let mut keys = table(&described, &given, |key| origin(written, origins, key));
    let is_on_tiles = stage.role.name() == RoleName::OnTiles;
    let is_left = |value: &Value| LEFT_TO_SCAN.iter().any(|word| value == word);
    for key in keys.iter_mut().filter(|key| is_on_tiles && is_left(&key.value)) {
        key.origin = format!("{}, {SETTLED}", key.origin);
    }
    keys
}

/// The keys of a table in the order of its description, with their values in `given`.
fn table(
    described: &TableDescription,
    given: &Map<String, Value>,
    origin: impl Fn(&str) -> String,
) -> Vec<ExplainedKey> {
    let key = |KeyDescription { name, .. }: &KeyDescription, default: Option<&Value>| {
        let value = given.get(name);
        ExplainedKey {
            key: name.clone(),
            is_said: value.is_some_and(|value| !value.is_null()),
            value: value.or(default).cloned().unwrap_or_default(),
            origin: origin(name),
        }
    };
    // Of the stage's own keys one may be without a value because another is given.
    let own = described.keys.iter().map(|one| key(one, None));
    own.chain(described.limits.iter().map(|one| key(one, one.default.as_ref()))).collect()
}

fn origin(written: &BTreeMap<String, TextPlace>, origins: &Origins, key: &str) -> String {
    written.get(key).and_then(|at| origins.key(at)).unwrap_or(DEFAULT).to_owned()
}

impl fmt::Display for Explained {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.params.is_empty() {
            writeln!(f, "# Parameters, whose values stand where they are used:")?;
            lines(f, &self.params)?;
            writeln!(f)?;
        }
        writeln!(f, "[run]")?;
        lines(f, &self.run)?;
        if !self.accept.is_empty() {
            writeln!(f, "\n[accept]")?;
            lines(f, &self.accept)?;
        }
        self.stages.iter().try_for_each(|stage| {
            writeln!(f, "\n[[stage]]")?;
            lines(f, stage)
        })
    }
}

/// A line a key, its origin behind it.
fn lines(f: &mut fmt::Formatter<'_>, keys: &[ExplainedKey]) -> fmt::Result {
    let assignment = |one: &ExplainedKey| match (&one.value, one.is_said) {
        (Value::Null, _) => format!("# {} has no value", one.key),
        (value, said) => {
            let value = node::from_json(&literal(value.clone()), &TextPlace::new(0, 0..0));
            format!("{}{} = {value}", if said { "" } else { "# " }, one.key)
        }
    };
    let all: Vec<String> = keys.iter().map(assignment).collect();
    let widths = all.iter().map(|line| line.chars().count()).filter(|width| *width <= WIDEST);
    let widest = widths.max().unwrap_or_default();
    all.iter().zip(keys).try_for_each(|(line, ExplainedKey { origin, .. })| {
        // A comment ends with its line.
        let origin: String =
            origin.chars().map(|c| if is_control(c) { '\u{fffd}' } else { c }).collect();
        writeln!(f, "{line:widest$}  # {origin}")
    })
}
