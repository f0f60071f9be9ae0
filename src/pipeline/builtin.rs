//! The stage kinds that pointmill has.

use super::kinds::{Read, Synth, Write};
use super::registry::{Registry, StageKind, StagePlace};
use crate::Result;
use crate::ops::normals::Normals;
use crate::ops::{Cells, Median};
use crate::stage::Role;

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

macro_rules! tile_op {
    ($stage:ty, $kind:literal, $about:literal) => {
        impl StageKind for $stage {
            const KIND: &'static str = $kind;
            const ABOUT: &'static str = $about;

            fn build(self, _: &StagePlace) -> Result<Role> {
                Ok(Role::TileOp(Box::new(self)))
            }
        }
    };
}

tile_op!(
    Normals,
    "normals",
    "Computes a surface normal at every point from its nearest neighbours."
);
tile_op!(Median, "median", "Keeps the median point of every cell.");

impl StageKind for Cells {
    const KIND: &'static str = "cells";
    const ABOUT: &'static str = "Divides the scan into cells whose normals agree.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        self.check().map_err(|(key, error)| at.blame(key, error))?;
        Ok(match self.keep {
            Some(_) => Role::ScanOp(Box::new(self)),
            None => Role::TileOp(Box::new(self)),
        })
    }
}
