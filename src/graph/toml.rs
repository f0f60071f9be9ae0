//! A graph as the text that would make it.

use serde::Serialize;
use serde_json::{Map, Value};

use super::{Graph, GraphStage};
use crate::stage::Role;
use crate::{Error, Result};

#[derive(Serialize)]
struct Document {
    #[serde(skip_serializing_if = "Map::is_empty")]
    run: Map<String, Value>,
    #[serde(skip_serializing_if = "Map::is_empty")]
    accept: Map<String, Value>,
    stage: Vec<Map<String, Value>>,
}

impl Graph {
    /// The graph as the text of a pipeline file that makes the same.
    ///
    /// # Errors
    ///
    /// A stage that no text can name, such as a closure.
    pub fn to_toml(&self) -> Result<String> {
        let run = literal_table(table_of(&self.settings)?);
        let accept = literal_table(table_of(&self.accept)?);
        let document = Document { run, accept, stage: tables(self)? };
        toml::to_string(&document)
            .map_err(|cause| Error::internal("the graph is no TOML").because(cause))
    }

    /// The name of each stage that has one or needs one, because another takes from it that does
    /// not stand right below.
    fn names(&self) -> Vec<Option<String>> {
        let mut above: Option<usize> = None;
        let mut needed = vec![false; self.stages.len()];
        for (n, stage) in self.stages.iter().enumerate() {
            if !is_chain(stage, above) {
                stage.from.iter().for_each(|&from| needed[from] = true);
            }
            if !matches!(stage.role, Role::Sink(_)) {
                above = Some(n);
            }
        }
        let name = |(n, stage): (usize, &GraphStage)| {
            let made = needed[n].then(|| format!("{}-{}", stage.kind, n + 1));
            stage.name.clone().or(made)
        };
        self.stages.iter().enumerate().map(name).collect()
    }
}

/// The stages as their tables, in whose texts a `${` stands for itself.
pub(super) fn tables(graph: &Graph) -> Result<Vec<Map<String, Value>>> {
    let (names, mut above) = (graph.names(), None);
    let mut all = Vec::new();
    for (n, one) in graph.stages.iter().enumerate() {
        all.push(literal_table(table(one, &names, n, above)?));
        if !matches!(one.role, Role::Sink(_)) {
            above = Some(n);
        }
    }
    Ok(all)
}

/// True if a text need not say what a stage takes from.
fn is_chain(stage: &GraphStage, above: Option<usize>) -> bool {
    matches!(stage.role, Role::Source(_)) || stage.from.iter().copied().eq(above)
}

/// A stage as its table.
fn table(
    stage: &GraphStage,
    names: &[Option<String>],
    number: usize,
    above: Option<usize>,
) -> Result<Map<String, Value>> {
    let given = stage.given.as_ref().and_then(Value::as_object).ok_or_else(|| {
        let told = format!("stage {} (`{}`) is of the program", number + 1, stage.kind);
        Error::pipeline(format!("{told}: no text can name it"))
    })?;
    let mut table = Map::new();
    table.insert("kind".to_owned(), stage.kind.clone().into());
    if let Some(name) = &names[number] {
        table.insert("name".to_owned(), name.clone().into());
    }
    if !is_chain(stage, above) {
        let from: Vec<Value> =
            stage.from.iter().map(|&from| names[from].clone().unwrap_or_default().into()).collect();
        let from = if let [one] = &from[..] { one.clone() } else { from.into() };
        table.insert("from".to_owned(), from);
    }
    table.extend(given.iter().map(|(key, value)| (key.clone(), value.clone())));
    Ok(table)
}

/// The keys of a table that are not as they are without being given.
pub(super) fn table_of<T: Serialize + Default>(given: &T) -> Result<Map<String, Value>> {
    let all = |table: &T| match serde_json::to_value(table) {
        Ok(Value::Object(all)) => Ok(all),
        _ => Err(Error::internal("the settings of a pipeline are no table")),
    };
    let (given, default) = (all(given)?, all(&T::default())?);
    let differs = |(key, value): &(String, Value)| default.get(key) != Some(value);
    Ok(given.into_iter().filter(differs).collect())
}

/// The same table with texts that refer to nothing: a `${` in them stands for itself.
pub(super) fn literal_table(table: Map<String, Value>) -> Map<String, Value> {
    table.into_iter().map(|(key, of)| (key, literal(of))).collect()
}

/// The same value, in whose texts a `${` stands for itself.
pub(crate) fn literal(of: Value) -> Value {
    match of {
        Value::String(text) => text.replace("${", "$${").into(),
        Value::Array(list) => list.into_iter().map(literal).collect(),
        Value::Object(table) => literal_table(table).into(),
        other => other,
    }
}
