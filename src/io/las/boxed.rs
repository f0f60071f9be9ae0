//! Which points of LAS files are read: those in a box, of an octree those down to a resolution.

use super::chunks::Chunks;
use super::copc::selected::{has_octree, select};
use super::header::Header;
use super::input::{LasInput, Storage};
use super::read::Shift;
use crate::error::shown;
use crate::point::PointBatch;
use crate::quantity::CropBox;
use crate::stage::{Part, ReadKeys};
use crate::{Error, Result};

/// How far from a step a corner may be to be on it, in steps: decimals are seldom exact in binary.
const NEAR: f64 = 1e-3;

/// What is wanted of the points of all inputs.
#[derive(Debug, Clone, Default)]
pub struct Wanted {
    bounds: Option<CropBox>,
    resolution: Option<f64>,
    /// Of how many of how many points levels of an octree are enough.
    enough: Option<(u64, u64)>,
}

impl Wanted {
    /// What `keys` want.
    pub fn of(keys: &ReadKeys) -> Wanted {
        Wanted { bounds: keys.bounds.clone(), resolution: keys.resolution, enough: None }
    }

    /// The same, but of octrees no more levels than have `enough` of `all` points.
    pub fn of_all(self, enough: u64, all: u64) -> Wanted {
        Wanted { enough: Some((enough, all)), ..self }
    }

    /// True if not all points are.
    pub fn is_some(&self) -> bool {
        self.bounds.is_some() || self.resolution.is_some() || self.enough.is_some()
    }

    /// Leaves the chunks of `input` out that have none of the points.
    pub fn apply(&self, input: &mut LasInput) -> Result<()> {
        if !self.is_some() {
            return Ok(());
        }
        if !has_octree(input) {
            return match self.resolution {
                None => Ok(()),
                Some(_) => Err(Error::data(&input.path, "only COPC files have a resolution")
                    .help("leave `read.resolution` out, or convert the file to COPC first")),
            };
        }
        let file = input.reopen()?;
        let chunks = select(input, &file, self.bounds.as_ref(), (self.resolution, self.enough))?;
        if let Storage::Laz(_, known) = &mut input.storage {
            *known = Chunks::Known(chunks);
        }
        Ok(())
    }

    /// The part `inner` of a file with this header, whose stored coordinates it moves by `shift`,
    /// without the points outside of the box.
    pub fn part(&self, inner: Box<dyn Part>, header: &Header, shift: Shift) -> Box<dyn Part> {
        match &self.bounds {
            None => inner,
            Some(bounds) => {
                let bounds = StoredBox::of(bounds, header, shift);
                Box::new(BoxedPart { inner, bounds })
            }
        }
    }

    /// The part of the box of corners that is wanted.
    pub fn within(&self, [mut lo, mut hi]: [[f64; 3]; 2]) -> [[f64; 3]; 2] {
        for (axis, (from, to)) in self.sides().enumerate() {
            lo[axis] = lo[axis].max(from).min(hi[axis]);
            hi[axis] = hi[axis].min(to).max(lo[axis]);
        }
        [lo, hi]
    }

    fn sides(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let sides = |bounds: &'_ CropBox| -> Vec<(f64, f64)> {
            bounds.lo().iter().copied().zip(bounds.hi().iter().copied()).collect()
        };
        self.bounds.as_ref().map(sides).unwrap_or_default().into_iter()
    }

    /// What is to be known of inputs of which none has a point there.
    pub fn told(&self, input: &LasInput) -> Option<String> {
        let is_empty = self.is_some() && input.points() == 0 && input.own_header().points() > 0;
        is_empty.then(|| format!("{}: no node of its octree is in the box", shown(&input.path)))
    }
}

/// A box in stored coordinates, of two axes or three.
struct StoredBox(Vec<(i64, i64)>);

impl StoredBox {
    fn of(bounds: &CropBox, header: &Header, shift: Shift) -> StoredBox {
        let axes = header.scale().into_iter().zip(header.offset()).zip(shift.0);
        let each = bounds.lo().iter().zip(bounds.hi()).zip(axes);
        StoredBox(
            each.map(|((lo, hi), ((scale, offset), shift))| {
                let [one, two] = [lo, hi].map(|v| (v - offset) / scale);
                let (lo, hi) = (one.min(two), one.max(two));
                let (lo, hi) = ((lo - NEAR).ceil() as i64, (hi + NEAR).floor() as i64);
                (lo.saturating_add(shift), hi.saturating_add(shift))
            })
            .collect(),
        )
    }

    fn holds(&self, record: &[u8]) -> bool {
        let stored = record.as_chunks::<4>().0;
        self.0
            .iter()
            .zip(stored)
            .all(|((lo, hi), bytes)| (*lo..=*hi).contains(&i64::from(i32::from_le_bytes(*bytes))))
    }
}

struct BoxedPart {
    inner: Box<dyn Part>,
    bounds: StoredBox,
}

impl Part for BoxedPart {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        loop {
            self.inner.read(batch)?;
            if batch.is_empty() {
                return Ok(());
            }
            batch.retain(|_, record| self.bounds.holds(record));
            // An empty batch is the end.
            if !batch.is_empty() {
                return Ok(());
            }
        }
    }
}
