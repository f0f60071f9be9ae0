//! What of a tile a stage did not declare, kept from it while it works: a stage that reads it finds
//! what it would find in a pipeline where no other stage asks for it.

use crate::point::{Columns, names};
use crate::stage::Needs;
use crate::tile::{Partition, Tile};

/// What is kept from a stage.
pub(super) struct Hidden {
    columns: Columns,
    classes: Option<Vec<u8>>,
    cells: Option<Partition>,
}

impl Hidden {
    /// Takes out of `tile` what `needs` do not name.
    pub fn of(tile: &mut Tile, needs: &Needs) -> Hidden {
        let reads_classes = needs.dimensions.iter().any(|name| name == names::CLASSIFICATION);
        let sees_cells = needs.takes_cells || needs.makes_cells;
        let declared = |kind| needs.reads.contains(&kind) || needs.writes.contains(&kind);
        Hidden {
            columns: tile.columns.take_out(|kind| !declared(kind)),
            classes: (!reads_classes).then(|| std::mem::take(&mut tile.classes)),
            cells: (!sees_cells).then(|| std::mem::take(&mut tile.cells)),
        }
    }

    /// Puts it back.
    pub fn give_back(self, tile: &mut Tile) {
        tile.columns.put_back(self.columns);
        if let Some(classes) = self.classes {
            tile.classes = classes;
        }
        if let Some(cells) = self.cells {
            tile.cells = cells;
        }
    }
}
