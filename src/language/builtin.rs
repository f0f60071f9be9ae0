//! The stage kinds and formats that pointmill has.

use super::registry::Registry;
use crate::io::ends::{Discard, Mesh, Read, Write};
use crate::io::las::{LAS, LAZ};
use crate::io::ply::PLY;
use crate::ops::normals::Normals;
use crate::ops::{
    Assign, Cells, Crop, Cut, Drop, Filter, Fourier, GaussianImage, Graded, Grid, Median, Merge,
    Orientation, Outliers, Sample, Scanline, Smooth, Stats, Tap, Transformation, Triangles,
    Wavelet,
};
use crate::synth::Synth;

impl Registry {
    /// The stage kinds and formats that pointmill has.
    pub fn builtin() -> Self {
        Registry::empty()
            .with::<Read>()
            .with::<Synth>()
            .with::<Merge>()
            .with::<Write>()
            .with::<Mesh>()
            .with::<Discard>()
            .with::<Filter>()
            .with::<Drop>()
            .with::<Crop>()
            .with::<Transformation>()
            .with::<Assign>()
            .with::<Stats>()
            .with::<Tap>()
            .with::<Outliers>()
            .with::<Smooth>()
            .with::<Normals>()
            .with::<Orientation>()
            .with::<Cells>()
            .with::<GaussianImage>()
            .with::<Median>()
            .with::<Graded>()
            .with::<Cut>()
            .with::<Grid>()
            .with::<Sample>()
            .with::<Scanline>()
            .with::<Triangles>()
            .with::<Wavelet>()
            .with::<Fourier>()
            .with_format(LAS)
            .with_format(LAZ)
            .with_format(PLY)
    }
}
