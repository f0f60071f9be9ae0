//! Records under the names that they have in an output. Only names change: a record's bytes stay,
//! so nothing is copied for it.

use std::borrow::Cow;
use std::sync::Arc;

use crate::io::convert::{check_drop, meant_names};
use crate::io::rows::names::{meant, shared};
use crate::point::names::XYZ;
use crate::point::{PointBatch, Schema};
use crate::stage::{Renamed, WriteKeys};
use crate::{Error, Result};

/// What a format is asked to write: records under their names in the output, and keys that speak
/// of these.
pub(super) struct Reshaped<'a> {
    pub keys: Cow<'a, WriteKeys>,
    pub schema: Cow<'a, Arc<Schema>>,
}

impl<'a> Reshaped<'a> {
    /// Of records of `schema`, as `keys` want it.
    ///
    /// # Errors
    ///
    /// Names that are not there, and names that two dimensions would have.
    pub fn of(keys: &'a WriteKeys, schema: &'a Arc<Schema>) -> Result<Self> {
        if keys.map.is_empty() && keys.types.is_empty() && keys.drop.is_empty() {
            return Ok(Reshaped { keys: Cow::Borrowed(keys), schema: Cow::Borrowed(schema) });
        }
        let (mut keys, mut named) = (keys.clone(), Schema::clone(schema));
        let find = |name: &mut String| *name = meant(name, schema).to_owned();
        keys.drop.iter_mut().for_each(find);
        for Renamed { from, to } in &mut keys.map {
            find(from);
            if let Some(shared) = shared(to) {
                shared.clone_into(to);
            }
        }
        let map = &keys.map;
        map.iter().try_for_each(|renamed| check_one(renamed, &keys, schema))?;
        if !map.is_empty() {
            check_drop(schema, &keys.drop)?;
        }
        let is_moved = |name: &str| map.iter().any(|renamed| renamed.from == name);
        let is_taken = |name: &str| map.iter().any(|renamed| renamed.to == name);
        // What is dropped for another to have its name is not there any more.
        named.dimensions.retain(|d| is_moved(&d.name) || !is_taken(&d.name));
        for dimension in &mut named.dimensions {
            if let Some(renamed) = map.iter().find(|renamed| renamed.from == dimension.name) {
                dimension.name.clone_from(&renamed.to);
            }
        }
        for retyped in &mut keys.types {
            retyped.name = meant(&retyped.name, &named).to_owned();
        }
        let drop = keys.drop.iter().filter(|name| !is_taken(name)).cloned().collect();
        keys.drop = drop;
        check_types(&keys, &named)?;
        Ok(Reshaped { keys: Cow::Owned(keys), schema: Cow::Owned(Arc::new(named)) })
    }

    /// The same records under the names of the output.
    pub fn records(&self, batch: &PointBatch) -> PointBatch {
        let mut named = PointBatch::new(Arc::clone(&self.schema), batch.len());
        named.extend(batch.records());
        named.source = batch.source;
        named.columns.clone_from(&batch.columns);
        named
    }
}

/// Refuses what cannot be done of one entry of `map`.
fn check_one(one: &Renamed, keys: &WriteKeys, schema: &Schema) -> Result<()> {
    let (Renamed { from, to }, WriteKeys { map, drop, .. }) = (one, keys);
    let refuse = |told: String| Error::pipeline(format!("`write.map` has `{one}`{told}"));
    if XYZ.iter().any(|axis| axis == from || axis == to) {
        return Err(refuse(": coordinates keep their names".to_owned()));
    }
    if schema.find(from).is_none() {
        let told = refuse(format!(", and the input has no `{from}`"));
        return Err(told.help(meant_names(from, "there are", schema)));
    }
    if drop.contains(from) {
        return Err(refuse(format!(", and `write.drop` leaves `{from}` out")));
    }
    let sides = |other: &&Renamed| other.from == *from || other.to == *to;
    if map.iter().filter(sides).count() > 1 {
        return Err(refuse(", and another entry has one of the two names".to_owned()));
    }
    if keys.computed.contains(to) {
        return Err(refuse(format!(", and `write.dimensions` computes `{to}`")));
    }
    let is_free = schema.find(to).is_none()
        || drop.contains(to)
        || map.iter().any(|renamed| renamed.from == *to);
    match is_free {
        true => Ok(()),
        false => Err(refuse(format!(", and the input has `{to}`, too"))
            .help(format!("`write.drop = [{to:?}]` gives that one up"))),
    }
}

/// Refuses types of dimensions that the output does not have.
fn check_types(keys: &WriteKeys, named: &Schema) -> Result<()> {
    for (i, retyped) in keys.types.iter().enumerate() {
        let name = &retyped.name;
        let refuse = |told: String| Error::pipeline(format!("`write.types` has `{retyped}`{told}"));
        if named.find(name).is_none() {
            let told = refuse(format!(", and there is no `{name}`"));
            return Err(told.help(meant_names(name, "there are", named)));
        }
        if keys.drop.contains(name) {
            return Err(refuse(format!(", and `write.drop` leaves `{name}` out")));
        }
        if keys.types[..i].iter().any(|other| other.name == *name) {
            return Err(refuse(", and another entry has that name".to_owned()));
        }
    }
    Ok(())
}
