//! The stage kinds that pointmill has.

use super::kinds::{Read, Synth, Write};
use super::registry::{Registry, StageKind, StagePlace};
use crate::Result;
use crate::ops::normals::Normals;
use crate::ops::{Cells, Filter, Grid, Median, Outliers};
use crate::stage::{Role, TileOp};

impl Registry {
    /// The stage kinds that pointmill has.
    pub fn builtin() -> Self {
        Registry::empty()
            .with::<Read>()
            .with::<Synth>()
            .with::<Write>()
            .with::<Filter>()
            .with::<Outliers>()
            .with::<Normals>()
            .with::<Cells>()
            .with::<Median>()
            .with::<Grid>()
    }
}

fn tile_op(stage: impl TileOp + 'static) -> Role {
    Role::TileOp(Box::new(stage))
}

impl StageKind for Filter {
    const KIND: &'static str = "filter";
    const ABOUT: &'static str = "Removes records by class and flags.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        self.check().map_err(|(key, error)| at.blame(key, error))?;
        Ok(Role::Transform(Box::new(self)))
    }
}

impl StageKind for Outliers {
    const KIND: &'static str = "outliers";
    const ABOUT: &'static str = "Removes points that are far from all others.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        self.role().map_err(|(key, error)| at.blame(key, error))
    }
}

impl StageKind for Normals {
    const KIND: &'static str = "normals";
    const ABOUT: &'static str =
        "Computes a surface normal at every point from its nearest neighbours.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        self.check().map_err(|(key, error)| at.blame(key, error))?;
        Ok(tile_op(self))
    }
}

impl StageKind for Cells {
    const KIND: &'static str = "cells";
    const ABOUT: &'static str = "Divides the scan into cells whose normals agree.";
    const EITHER: &'static [&'static str] = &["keep", "max_angle"];

    fn build(self, at: &StagePlace) -> Result<Role> {
        self.check().map_err(|(key, error)| at.blame(key, error))?;
        Ok(match self.keep {
            Some(_) => Role::ScanOp(Box::new(self)),
            None => tile_op(self),
        })
    }
}

impl StageKind for Median {
    const KIND: &'static str = "median";
    const ABOUT: &'static str = "Keeps the median point of every cell.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        self.check().map_err(|(key, error)| at.blame(key, error))?;
        Ok(tile_op(self))
    }
}

impl StageKind for Grid {
    const KIND: &'static str = "grid";
    const ABOUT: &'static str = "Keeps one point of every cube of a uniform grid.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(tile_op(self))
    }
}
