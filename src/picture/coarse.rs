//! What of a scan a picture needs: all points, or the coarsest levels of its octree that have as
//! many as there are pixels.

use super::look::{Frame, Look};
use super::settings::{Settings, View};
use crate::Result;
use crate::stage::Source;

/// Points for a pixel seen from above, where most are seen; from a side most are behind others.
const ABOVE: u64 = 1;
const ASIDE: u64 = 4;
/// Pixels that a point of coarse levels is wide at least: on the average one a pixel leaves holes,
/// more so as levels are not everywhere as dense.
const DOT: u32 = 2;
/// Part of these that is looked at first.
const FIRST_LOOK: u64 = 8;

/// A scan that is drawn, and those of its points that do.
pub(super) struct Drawn<'a> {
    whole: &'a dyn Source,
    coarser: Option<Box<dyn Source>>,
}

impl<'a> Drawn<'a> {
    /// What is looked at for a panel of `most` pixels across and down.
    pub fn at_first(whole: &'a dyn Source, most: [u32; 2]) -> Drawn<'a> {
        let pixels = u64::from(most[0]) * u64::from(most[1]);
        Drawn { whole, coarser: whole.coarser(pixels / FIRST_LOOK) }
    }

    /// What is drawn in a panel of this frame.
    pub fn within(whole: &'a dyn Source, frame: &Frame, view: View) -> Drawn<'a> {
        let each = if view == View::Above { ABOVE } else { ASIDE };
        Drawn { whole, coarser: whole.coarser(frame.pixels() * each) }
    }

    /// The points that do.
    pub fn source(&self) -> &dyn Source {
        self.coarser.as_deref().unwrap_or(self.whole)
    }

    /// True if these are not all.
    pub fn is_coarser(&self) -> bool {
        self.coarser.is_some()
    }

    /// The first look: it has the number of all points.
    pub fn look(&self, settings: &Settings) -> Result<Look> {
        let mut look = Look::at(self.source(), settings)?;
        if self.is_coarser() {
            look.points = self.whole.points();
            let claimed = self.whole.claimed_box();
            claimed.iter().for_each(|corners| look.widen(*corners, settings.view));
        }
        Ok(look)
    }

    /// Pixels that a point is wide, where it is `common` among those of whole scans.
    pub fn dot(&self, common: u32) -> u32 {
        if self.is_coarser() { common.max(DOT) } else { common }
    }
}
