//! Reach for this when the built-in stages do not do what you need: a transform (keep one class of
//! points as they stream by) and a tile op (of every cell the lowest point, in the place of
//! `median`), added to the registry and named by a pipeline text like any other stage.
//!
//! Whether a stage keeps what it says is for a test to tell: see the end of this file.
//!
//! `cargo run --example 08_own_stage`

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use pointmill::ops::removal::represent;
use pointmill::point::{NORMAL, PointBatch, names};
use pointmill::report::Tally;
use pointmill::stage::{Needs, Role, RoleName, StageKind, StagePlace, TileOp, Transform};
use pointmill::tile::Tile;
use pointmill::{Error, Result};
use pointmill::{Graph, Overrides, Quiet, Registry};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Keeps the points of one class. The fields are the stage's keys in a pipeline file.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
struct Class {
    class: u8,
}

impl StageKind for Class {
    const KIND: &'static str = "class";
    const ROLE: RoleName = RoleName::Transform;
    const ABOUT: &'static str = "Keeps the points of one class.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::Transform(Box::new(self)))
    }
}

impl Transform for Class {
    // What a stage reads is checked before the run: an input without classes is refused there.
    fn needs(&self) -> Needs {
        Needs::none().looks_at([names::CLASSIFICATION]).removes(None)
    }

    fn apply(&self, batch: &mut PointBatch, _tally: &mut Tally) -> Result<()> {
        let schema = batch.schema().clone();
        let dimension = schema
            .find(names::CLASSIFICATION)
            .ok_or_else(|| Error::internal("the plan let records without a class pass"))?;
        let class = f64::from(self.class);
        batch.retain(|_, record| dimension.get(record, schema.endian).as_f64() == class);
        Ok(())
    }
}

/// Keeps the lowest point of every cell.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
struct Lowest {}

impl StageKind for Lowest {
    const KIND: &'static str = "lowest";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Keeps the lowest point of every cell.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::TileOp(Box::new(self)))
    }
}

impl TileOp for Lowest {
    fn needs(&self) -> Needs {
        let needs = Needs::none().reads(&NORMAL).takes_cells().removes(None);
        needs.bytes_per_point(size_of::<(usize, usize, [f64; 3])>()) // of `stands_for`
    }

    // A cell may reach beyond the tile. All its members are there, whichever tile looks at it, so
    // every tile comes to the same choice; each says what becomes of the positions in its own core.
    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let normals = tile.columns.get(&NORMAL)?;
        let mut stands_for = Vec::with_capacity(tile.positions.len());
        for group in tile.cells.groups() {
            let members = tile.cells.members[group].iter().map(|&i| i as usize);
            // Positions are distinct and indices follow Morton order, so this breaks all ties.
            let height = |&i: &usize| (tile.positions[i][2], i);
            let Some(lowest) = members.clone().min_by_key(height) else { continue };
            let others = members.filter(|i| tile.core.contains(i) && *i != lowest);
            let normal = normals[lowest].map(f64::from);
            stands_for.extend(others.map(|i| (i, lowest, normal)));
        }
        let removed = stands_for.into_iter();
        let removed = removed.map(|(i, kept, normal)| represent(tile, i, kept, normal)).sum();
        // The ledger must balance: what a stage removes, it enters.
        tally.remove(Lowest::KIND, "represented", removed);
        Ok(())
    }
}

const PIPELINE: &str = r#"
[[stage]]
kind = "synth"
scene = "als"
points = 100_000

[[stage]]
kind = "class"
class = 2           # ground

[[stage]]
kind = "normals"

[[stage]]
kind = "cells"
max_angle = 0.3

[[stage]]
kind = "lowest"

[[stage]]
kind = "write"
path = "ground.laz"
"#;

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let text = PIPELINE.replace("ground.laz", &folder.path().join("ground.laz").to_string_lossy());
    let registry = Registry::builtin().with::<Class>().with::<Lowest>();
    let plan = Graph::parse(&text, "ground.toml", &registry)?.plan(&Overrides::default())?;
    let done = plan.run(&Quiet)?;

    println!("{done}");
    for removed in &done.report.result.ledger.removed {
        println!("{} removed {} points as {}", removed.stage, removed.records, removed.reason);
    }
    Ok(())
}

/// What proves the stages, with the feature `testing`: each runs on scans that the check makes, in
/// all the ways that must not matter.
#[cfg(test)]
mod tests {
    use pointmill::ops::Cells;
    use pointmill::ops::normals::Normals;
    use pointmill::testing::Conformance;

    use super::*;

    #[test]
    fn class_keeps_its_promises() {
        Conformance::of(Class { class: 2 }).check().unwrap();
    }

    #[test]
    fn lowest_keeps_its_promises() {
        let check = Conformance::of(Lowest {});
        check.after(Normals::default()).after(Cells::default()).check().unwrap();
    }
}
