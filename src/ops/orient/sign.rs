//! What all ways of orienting normals have in common.

use crate::Result;
use crate::geom::angle::is_known;
use crate::point::{Column, NORMAL, names};
use crate::report::Tally;
use crate::tile::Tile;

pub(super) const TIME: Column<f64> = Column::new(names::GPS_TIME, &[]);

/// Turns the normals of a tile for which `is_turned` holds, given the index of the position and the
/// normal; none where nothing tells. Those of the rim, too: cells that reach into the tile are
/// decided by them.
pub(super) fn turn(
    tile: &mut Tile,
    tally: &mut Tally,
    is_turned: impl Fn(&Tile, usize, [f32; 3]) -> Option<bool>,
) -> Result<()> {
    let mut normals = tile.columns.take(&NORMAL)?;
    let (mut changed, mut unknown) = (0, 0);
    for (i, normal) in normals.iter_mut().enumerate() {
        if !is_known(*normal) || !tile.is_chosen(i) {
            continue;
        }
        let counted = u64::from(tile.core.contains(&i));
        match is_turned(tile, i, *normal) {
            None => unknown += counted,
            Some(false) => {}
            Some(true) => {
                // −0 + 0 = 0
                *normal = normal.map(|c| -c + 0.0);
                changed += counted;
            }
        }
    }
    tile.columns.put(normals);
    tile.oriented = true;
    tally.count("orient_turned", changed);
    tally.count("orient_unknown", unknown);
    Ok(())
}
