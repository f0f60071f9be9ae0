//! The stage kinds and formats that a pipeline file may name: a value, so that a program can add
//! its own.

use std::collections::BTreeMap;

use schemars::{Schema, SchemaGenerator};
use serde_json::{Map, Value, json};

use super::described::TableDescription;
use super::keys;
use super::mistake::Mistake;
use super::node::Node;
use super::schema;
use super::schema::StageTable;
use crate::stage::{Format, Formats, Role, RoleName, StageKind, StagePlace};
use crate::{Error, Result};

/// The stage kinds and formats that a pipeline file may name.
///
/// ```
/// use pointmill::ops::{Grid, Median};
/// use pointmill::{Graph, Registry};
///
/// // No more than is wanted; `Registry::builtin` has all that there is.
/// let registry = Registry::empty().with::<Grid>().with::<Median>();
/// assert!(registry.has("grid") && !registry.has("read"));
///
/// let refused = Graph::parse("stage = [{kind = 'gird', side = 1.0}]", "thin.toml", &registry);
/// assert!(refused.unwrap_err().to_string().contains("grid"), "the nearest word");
/// ```
#[derive(Clone, Default)]
pub struct Registry {
    kinds: BTreeMap<&'static str, RegisteredKind>,
    formats: Formats,
    is_unread: bool,
}

type ReadStage = fn(&Node, &StagePlace) -> Result<BuiltStage, Vec<Mistake>>;

/// A stage in its role.
pub(crate) struct BuiltStage {
    pub role: Role,
    /// Its keys as reports have them.
    pub keys: Value,
    /// Its keys as a text gives them; None if no text can.
    pub given: Option<Value>,
}

#[derive(Clone, Copy)]
struct RegisteredKind {
    about: &'static str,
    either: &'static [&'static str],
    main: Option<&'static str>,
    is_limited: bool,
    role: RoleName,
    schema: fn(&mut SchemaGenerator) -> Schema,
    defaults: fn() -> Map<String, Value>,
    read: ReadStage,
}

impl Registry {
    /// No kinds and no formats.
    pub fn empty() -> Self {
        Registry::default()
    }

    /// The same and `K`, which takes the place of a kind of that name.
    #[must_use]
    pub fn with<K: StageKind>(mut self) -> Self {
        self.kinds.insert(
            K::KIND,
            RegisteredKind {
                about: K::ABOUT,
                either: K::EITHER,
                main: K::MAIN,
                is_limited: K::IS_LIMITED,
                role: K::ROLE,
                schema: K::json_schema,
                defaults: defaults::<K>,
                read: read::<K>,
            },
        );
        self
    }

    /// The same and `format`, which takes the place of one of its name.
    #[must_use]
    pub fn with_format(mut self, format: impl Format + 'static) -> Self {
        self.formats = self.formats.with(format);
        self
    }

    /// The same for pipelines that are drawn or explained and not run: files that they name need
    /// not be there.
    #[must_use]
    pub fn unread(self) -> Self {
        Registry { is_unread: true, ..self }
    }

    /// Where a stage of a text stands.
    pub(super) fn place(&self, origin: &str, line: usize) -> StagePlace {
        let place = StagePlace::new(origin, line).knowing(&self.formats);
        if self.is_unread { place.unread() } else { place }
    }

    /// The formats.
    pub fn formats(&self) -> &Formats {
        &self.formats
    }

    /// The kinds by name, each with what it does.
    pub fn kinds(&self) -> impl Iterator<Item = (&'static str, &'static str)> + '_ {
        self.kinds.iter().map(|(name, kind)| (*name, kind.about))
    }

    /// True if there is a kind of that name.
    pub fn has(&self, kind: &str) -> bool {
        self.kinds.contains_key(kind)
    }

    /// The role of that kind; none if there is no such kind.
    pub(crate) fn role(&self, kind: &str) -> Option<RoleName> {
        self.kinds.get(kind).map(|kind| kind.role)
    }

    /// The key of a stage of that kind whose value a line of words may give without naming it.
    pub(crate) fn main(&self, kind: &str) -> Option<&'static str> {
        self.kinds.get(kind).and_then(|kind| kind.main)
    }

    /// True if a stage of that kind takes the keys that limit it to some records.
    pub(crate) fn is_limited(&self, kind: &str) -> bool {
        self.kinds.get(kind).is_none_or(|kind| kind.is_limited)
    }

    /// What there is to know of a kind of stage; none if there is no such kind.
    pub fn describe(&self, kind: &str) -> Option<TableDescription> {
        let (name, kind) = self.kinds.get_key_value(kind)?;
        let table = self.table(name, kind, &mut schema::generator());
        Some(TableDescription::of(name, kind.about, &table.schema).of_stage(
            kind.role,
            kind.main,
            &table.limits,
        ))
    }

    /// What there is to know of the keys that limit a stage to some records, which stages take
    /// besides their own: all of them if they work on tiles.
    pub fn describe_limits(&self) -> TableDescription {
        let limits = schema::limits(&mut schema::generator(), &self.formats, RoleName::OnTiles);
        TableDescription::of_docs("limits", &limits)
    }

    /// What there is to know of the table `[run]`.
    pub fn describe_run(&self) -> TableDescription {
        let run = schema::run(&mut schema::generator(), &self.formats);
        TableDescription::of_docs("run", &run)
    }

    /// What there is to know of the table `[accept]`.
    pub fn describe_accept(&self) -> TableDescription {
        let accept = schema::accept(&mut schema::generator(), &self.formats);
        TableDescription::of_docs("accept", &accept)
    }

    /// The JSON Schema (2020-12) of a pipeline file that may name these kinds and formats, for
    /// editors to complete and check by. What only a run can know it does not say: whether keys go
    /// together, or whether a file is there.
    pub fn schema(&self) -> Value {
        let mut generator = schema::generator();
        let run = schema::run(&mut generator, &self.formats);
        let accept = schema::accept(&mut generator, &self.formats);
        let stages =
            self.kinds.iter().map(|(name, kind)| self.table(name, kind, &mut generator)).collect();
        schema::pipeline([run, accept], stages, generator.take_definitions(true))
    }

    fn table(
        &self,
        name: &'static str,
        kind: &RegisteredKind,
        generator: &mut SchemaGenerator,
    ) -> StageTable {
        let own = schema::table((kind.schema)(generator), (kind.defaults)(), &self.formats);
        let limits = match (kind.is_limited, kind.role) {
            (true, role @ (RoleName::Transform | RoleName::OnTiles)) => {
                schema::limits(generator, &self.formats, role)
            }
            _ => Map::new(),
        };
        StageTable { name, about: kind.about, role: kind.role, schema: own, limits }
    }

    /// Keys that `key` of a stage of that kind takes the place of.
    pub(crate) fn others(&self, kind: &str, key: &str) -> impl Iterator<Item = &'static str> {
        let either = self.kinds.get(kind).map_or(&[][..], |kind| kind.either);
        let either = if either.contains(&key) { either } else { &[] };
        either.iter().copied().filter(move |other| *other != key)
    }

    /// Builds a stage from its keys; none if there is no such kind.
    pub(crate) fn build(
        &self,
        kind: &str,
        keys: &Node,
        at: &StagePlace,
    ) -> Option<Result<BuiltStage, Vec<Mistake>>> {
        self.kinds.get(kind).map(|kind| (kind.read)(keys, at))
    }
}

fn read<K: StageKind>(keys: &Node, at: &StagePlace) -> Result<BuiltStage, Vec<Mistake>> {
    let stage: K = keys::read(K::KIND, keys, &at.formats().names())?;
    built(stage, at).map_err(|error| {
        let blamed = at.blamed();
        let place = blamed.as_deref().and_then(|key| keys.at(key)).unwrap_or(&keys.place);
        vec![Mistake::of(place.clone(), &error)]
    })
}

/// Puts a stage in its role.
pub(crate) fn built<K: StageKind>(stage: K, at: &StagePlace) -> Result<BuiltStage> {
    let given = given_keys(&stage)?;
    let is_reported = |key: &str| !K::PLACES.contains(&key);
    let keys =
        given.iter().filter(|(key, _)| is_reported(key)).map(|(k, v)| (k.clone(), v.clone()));
    let keys = keys.collect::<Map<_, _>>().into();
    let role = stage.build(at).and_then(in_its_role::<K>)?;
    Ok(BuiltStage { role, keys, given: Some(given.into()) })
}

/// The role that a kind says it plays, which its author may have got wrong.
fn in_its_role<K: StageKind>(role: Role) -> Result<Role> {
    match role.name() {
        name if name == K::ROLE => Ok(role),
        RoleName::Transform if K::ROLE == RoleName::OnTiles => Ok(role),
        name => Err(Error::internal(format!(
            "the stage kind `{}` says that its role is {:?}, and it is {name:?}",
            K::KIND,
            K::ROLE
        ))),
    }
}

/// The keys of a stage of which none is given, with what they are then; none where one must be.
fn defaults<K: StageKind>() -> Map<String, Value> {
    let stage = serde_json::from_value::<K>(json!({})).ok();
    let keys = stage.and_then(|stage| serde_json::to_value(stage).ok());
    match keys {
        Some(Value::Object(keys)) => keys,
        _ => Map::new(),
    }
}

/// The stage's keys with all defaults filled in, sorted by name; those without a value are left
/// out.
fn given_keys<K: StageKind>(stage: &K) -> Result<Map<String, Value>> {
    let value = serde_json::to_value(stage).map_err(|e| {
        Error::internal(format!("cannot list the keys of `{}`", K::KIND)).because(e)
    })?;
    Ok(match value {
        Value::Object(keys) => keys
            .into_iter()
            .filter(|(_, value)| !value.is_null())
            .collect::<BTreeMap<_, _>>()
            .into_iter()
            .collect(),
        _ => Map::new(),
    })
}
