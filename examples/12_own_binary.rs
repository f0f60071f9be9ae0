//! Reach for this when others are to use stages of yours: a whole command line with them. It has
//! all commands of `pointmill`, which know the stages: `stages` lists them with their keys, `run` runs
//! pipelines that name them, `check` tells what is wrong with those, `schema` is for editors.
//!
//! `cargo run --example 12_own_binary -- stages fold`

use std::process::ExitCode;

use pointmill::point::{PointBatch, Value, names};
use pointmill::report::Tally;
use pointmill::stage::{Needs, Role, RoleName, StageKind, StagePlace, Transform};
use pointmill::{Error, Registry, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Folds classes into one.
///
/// What users read of a stage are these comments: the first paragraph in lists, all of it behind
/// `stages fold`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Fold {
    /// The classes that go into one.
    // `classes` is taken: it limits any stage.
    old: Vec<u8>,
    /// The class that they become.
    new: u8,
}

impl StageKind for Fold {
    const KIND: &'static str = "fold";
    const ROLE: RoleName = RoleName::Transform;
    const ABOUT: &'static str = "Folds classes into one.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::Transform(Box::new(self)))
    }
}

impl Transform for Fold {
    fn needs(&self) -> Needs {
        Needs::none().looks_at([names::CLASSIFICATION]).changes([names::CLASSIFICATION])
    }

    fn apply(&self, batch: &mut PointBatch, _: &mut Tally) -> Result<()> {
        let schema = batch.schema().clone();
        let field = schema
            .find(names::CLASSIFICATION)
            .ok_or_else(|| Error::internal("the plan let records without a class pass"))?;
        for record in batch.records_mut().chunks_exact_mut(schema.stride) {
            let class = field.get(record, schema.endian).as_f64();
            let is_folded = self.old.iter().any(|folded| f64::from(*folded) == class);
            if is_folded && !field.put(record, schema.endian, Value::Unsigned(self.new.into())) {
                return Err(Error::pipeline(format!("records cannot have class {}", self.new)));
            }
        }
        Ok(())
    }
}

fn main() -> ExitCode {
    pointmill::cli::main(&Registry::builtin().with::<Fold>())
}
