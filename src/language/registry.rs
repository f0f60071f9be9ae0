//! The stage kinds and formats that a pipeline file may name: a value, so that a program can add
//! its own.

use std::collections::BTreeMap;

use super::keys;
use super::mistake::Mistake;
use super::node::Node;
use crate::stage::{Format, Formats, Role, StageKind, StagePlace};
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
}

type ReadStage = fn(&Node, &StagePlace) -> Result<BuiltStage, Vec<Mistake>>;

/// A stage in its role.
pub(crate) struct BuiltStage {
    pub role: Role,
    /// Its keys as reports have them.
    pub keys: serde_json::Value,
    /// Its keys as a text gives them; None if no text can.
    pub given: Option<serde_json::Value>,
}

#[derive(Clone, Copy)]
struct RegisteredKind {
    about: &'static str,
    either: &'static [&'static str],
    main: Option<&'static str>,
    is_limited: bool,
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

    /// The key of a stage of that kind whose value a line of words may give without naming it.
    pub(crate) fn main(&self, kind: &str) -> Option<&'static str> {
        self.kinds.get(kind).and_then(|kind| kind.main)
    }

    /// True if a stage of that kind takes the keys that limit it to some records.
    pub(crate) fn is_limited(&self, kind: &str) -> bool {
        self.kinds.get(kind).is_none_or(|kind| kind.is_limited)
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
    let keys = keys.collect::<serde_json::Map<_, _>>().into();
    let role = stage.build(at)?;
    Ok(BuiltStage { role, keys, given: Some(given.into()) })
}

/// The stage's keys with all defaults filled in, sorted by name; those without a value are left
/// out.
fn given_keys<K: StageKind>(stage: &K) -> Result<serde_json::Map<String, serde_json::Value>> {
    let value = serde_json::to_value(stage).map_err(|e| {
        Error::internal(format!("cannot list the keys of `{}`", K::KIND)).because(e)
    })?;
    Ok(match value {
        serde_json::Value::Object(keys) => keys
            .into_iter()
            .filter(|(_, value)| !value.is_null())
            .collect::<BTreeMap<_, _>>()
            .into_iter()
            .collect(),
        _ => serde_json::Map::new(),
    })
}
