//! The stage kinds and formats that pointmill has.

use super::registry::Registry;
use crate::io::e57::E57;
use crate::io::ends::{Discard, Mesh, Read, Write};
use crate::io::las::{COPC, LAS, LAZ};
use crate::io::pcd::PCD;
use crate::io::ply::PLY;
use crate::io::text::{ASC, CSV, PTS, PTX, TXT, XYZ};
use crate::io::vertices::{OBJ, OFF, STL};
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
            .with_format(COPC)
            .with_format(PLY)
            .with_format(PCD)
            .with_format(E57)
            .with_format(OBJ)
            .with_format(OFF)
            .with_format(STL)
            .with_format(PTX)
            .with_format(PTS)
            .with_format(XYZ)
            .with_format(TXT)
            .with_format(CSV)
            .with_format(ASC)
    }
}
