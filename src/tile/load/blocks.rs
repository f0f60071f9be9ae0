//! A region looked at block after block, in the memory of one.

use super::Loader;
use crate::Result;
use crate::point::Bounds;
use crate::tile::Tile;

impl Loader {
    /// Calls `visit` with the positions of `region` that the pass sees, in Morton order: with a
    /// tile for each block of the scan that has any, without a core, a zone of its own or columns.
    /// So a region may have more positions than a tile takes.
    ///
    /// # Errors
    ///
    /// Those of reading the store.
    pub(crate) fn each_block(
        &mut self,
        region: &Bounds,
        mut visit: impl FnMut(&mut Tile),
    ) -> Result<()> {
        let tiles = self.tiles.clone();
        let is_fine = self.sieve.is_fine(&tiles);
        tiles.blocks_meeting(region, |b| {
            self.tile.clear(Bounds::EMPTY, *region);
            self.core.clear();
            match is_fine {
                true => self.sift(b, region)?,
                false => self.take(b, region)?,
            }
            if let Some(dimensions) = &mut self.dimensions {
                dimensions.numbers.clear();
            }
            visit(&mut self.tile);
            Ok(())
        })
    }
}
