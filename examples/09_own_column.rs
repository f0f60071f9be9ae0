//! Reach for this when a stage of yours computes something that others are to use: a column. Here
//! one stage says how rough the surface is at every point, a later one evens that out over the
//! neighbours, and the output has both.
//!
//! `cargo run --example 09_own_column`

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use std::io::Read as _;

use pointmill::point::Column;
use pointmill::report::Tally;
use pointmill::stage::{Needs, Role, RoleName, ScanFacts, StageKind, StagePlace, TileOp};
use pointmill::tile::Tile;
use pointmill::{Graph, Overrides, Quiet, Registry, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whoever knows these constants knows the columns; no other place lists them.
const ROUGHNESS: Column<f32> = Column::new("Roughness", &[]);
const EVENED: Column<f32> = Column::new("EvenRoughness", &[]);

/// How far the neighbours are above or below, on average, in world units.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
struct Rough {
    neighbors: usize,
    /// World units of a lattice step, known when the scan is.
    #[serde(skip)]
    step: f64,
}

impl StageKind for Rough {
    const KIND: &'static str = "rough";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Computes how rough the surface is.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::TileOp(Box::new(self)))
    }
}

impl TileOp for Rough {
    fn needs(&self) -> Needs {
        Needs::none().neighbors(self.neighbors).writes(&ROUGHNESS)
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        self.step = scan.lattice.step;
        Ok(())
    }

    fn run(&self, tile: &mut Tile, _: &mut Tally) -> Result<()> {
        // Taken out while the tile is searched, and put back.
        let mut roughness = tile.columns.take(&ROUGHNESS)?;
        tile.each_neighborhood(self.neighbors, |i, neighbors| {
            // Offsets are in lattice steps.
            let steps: u64 = neighbors.offsets().iter().map(|o| o[2].unsigned_abs()).sum();
            let mean = steps as f64 / neighbors.offsets().len() as f64;
            roughness[i] = (mean * self.step) as f32;
        })?;
        tile.columns.put(roughness);
        Ok(())
    }
}

/// The mean roughness of the neighbours.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
struct Even {
    neighbors: usize,
}

impl StageKind for Even {
    const KIND: &'static str = "even";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Evens the roughness out.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::TileOp(Box::new(self)))
    }
}

impl TileOp for Even {
    // Neighbours may lie in other tiles: that their values are read must be said.
    fn needs(&self) -> Needs {
        Needs::none().reads_of_neighbors(&ROUGHNESS, self.neighbors).writes(&EVENED)
    }

    fn run(&self, tile: &mut Tile, _: &mut Tally) -> Result<()> {
        let mut evened = tile.columns.take(&EVENED)?;
        tile.each_neighborhood_with(self.neighbors, &ROUGHNESS, |i, _, values| {
            evened[i] = values.iter().sum::<f32>() / values.len() as f32;
        })?;
        tile.columns.put(evened);
        Ok(())
    }
}

const PIPELINE: &str = r#"
[[stage]]
kind = "synth"
scene = "als"
points = 50_000

[[stage]]
kind = "rough"
neighbors = 8

[[stage]]
kind = "even"
neighbors = 8

[[stage]]
kind = "write"
path = "rough.ply"
dimensions = ["Roughness", "EvenRoughness"]
"#;

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("rough.ply");
    let text = PIPELINE.replace("rough.ply", &path.to_string_lossy());
    let registry = Registry::builtin().with::<Rough>().with::<Even>();
    let plan = Graph::parse(&text, "rough.toml", &registry)?.plan(&Overrides::default())?;
    println!("{plan}");
    plan.run(&Quiet)?;

    let mut header = vec![0; 1024];
    let read = std::fs::File::open(&path)?.read(&mut header)?;
    let header = String::from_utf8_lossy(&header[..read]);
    let added: Vec<&str> = header.lines().filter(|line| line.ends_with("Roughness")).collect();
    println!("{}", added.join("\n"));
    assert_eq!(added, ["property float Roughness", "property float EvenRoughness"]);
    Ok(())
}

#[cfg(test)]
mod tests {
    use pointmill::testing::Conformance;

    use super::*;

    fn rough() -> Rough {
        Rough { neighbors: 8, step: 0.0 }
    }

    #[test]
    fn rough_keeps_its_promises() {
        Conformance::of(rough()).check().unwrap();
    }

    #[test]
    fn even_keeps_its_promises() {
        Conformance::of(Even { neighbors: 4 }).after(rough()).check().unwrap();
    }
}
