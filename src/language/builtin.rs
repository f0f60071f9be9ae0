//! The stage kinds that pointmill has.

use super::registry::Registry;
use crate::io::ends::{Read, Write};
use crate::ops::normals::Normals;
use crate::ops::{Cells, Filter, Grid, Median, Outliers};
use crate::synth::Synth;

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
