//! The stage kinds that pointmill has. (The computing ones here are stand-ins that only have keys.)

use serde::{Deserialize, Serialize};

use super::kinds::{Read, Synth, Write};
use super::registry::{Registry, StageKind, StagePlace};
use crate::Result;
use crate::report::Tally;
use crate::stage::{Needs, Role, TileOp};
use crate::tile::Tile;

impl Registry {
    /// The stage kinds that pointmill has.
    pub fn builtin() -> Self {
        Registry::empty()
            .with::<Read>()
            .with::<Synth>()
            .with::<Write>()
            .with::<Normals>()
            .with::<Cells>()
            .with::<Median>()
    }
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Method {
    Varady,
    Pca,
}

#[derive(Serialize, Deserialize)]
#[serde(default)]
struct Normals {
    neighbors: u32,
    method: Method,
}

impl Default for Normals {
    fn default() -> Self {
        Normals { neighbors: 10, method: Method::Varady }
    }
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Split {
    Voronoi,
    Octant,
}

#[derive(Serialize, Deserialize)]
#[serde(default)]
struct Cells {
    side: serde_json::Value,
    max_angle: serde_json::Value,
    min_points: u32,
    split: Split,
}

impl Default for Cells {
    fn default() -> Self {
        Cells { side: "auto".into(), max_angle: 0.1.into(), min_points: 1, split: Split::Voronoi }
    }
}

#[derive(Serialize, Deserialize)]
struct Median;

struct Nothing;

impl TileOp for Nothing {
    fn needs(&self) -> Needs {
        Needs::default()
    }

    fn run(&self, _: &mut Tile, _: &mut Tally) -> Result<()> {
        Ok(())
    }
}

macro_rules! stand_in {
    ($stage:ty, $kind:literal) => {
        impl StageKind for $stage {
            const KIND: &'static str = $kind;
            const ABOUT: &'static str = $kind;

            fn build(self, _: &StagePlace) -> Result<Role> {
                Ok(Role::TileOp(Box::new(Nothing)))
            }
        }
    };
}

stand_in!(Normals, "normals");
stand_in!(Cells, "cells");
stand_in!(Median, "median");
