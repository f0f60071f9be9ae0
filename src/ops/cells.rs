//! The stage `cells`: cubes of points, divided until the normals of each part agree.

mod auto;
mod dirichlet;
mod division;
mod entry;
mod gather;
mod grouping;
mod keys;
mod limit;
mod noise;
mod octants;
mod outlook;
mod settings;
mod target;
mod threshold;

use serde_json::Value;

use super::lengths::{LARGEST_SIDE, rounded};
use crate::Result;
use crate::geom::lattice::Lattice;
use crate::point::{NORMAL, Units, names};
use crate::quantity::{Length, Setting};
use crate::report::Tally;
use crate::stage::{Forecast, Needs, Role, RoleName, ScanFacts, StageKind, StagePlace, TileOp};
use crate::tile::Tile;

use division::{Division, DivisionCounts};
pub(super) use grouping::Grouping;
pub use keys::Cells;
pub(super) use keys::POSITIONS_PER_CUBE;
use keys::SettledCells;
use outlook::Outlook;
pub use settings::{By, Measure, Reference, Side, Split};
pub use target::Keep;
pub(in crate::ops) use target::KeepGiven;
use threshold::Threshold;

/// Bytes a position: member, turned, end of a group, end of an initial cell, room to divide.
const BYTES: usize = 4 + 1 + 4 + 4 + 4;
/// Bytes a position where positions are sorted by cell.
const SORTING_BYTES: usize = 32;
/// Bytes a position where those of a part are sorted by angle.
const ANGLE_BYTES: usize = 16;

impl StageKind for Cells {
    const KIND: &'static str = "cells";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Divides the scan into cells whose normals agree.";
    const EITHER: &'static [&'static str] = &["keep", "max_angle"];

    fn build(self, at: &StagePlace) -> Result<Role> {
        self.check().map_err(|(key, error)| at.blame(key, error))?;
        Ok(match self.keep {
            Some(_) => Role::ScanOp(Box::new(self)),
            None => Role::TileOp(Box::new(self)),
        })
    }
}

impl TileOp for Cells {
    fn needs(&self) -> Needs {
        let aligned = match self.settled {
            Some(settled) => settled.is_aligned(),
            None => self.side == Side::Auto || self.side == Side::Spread && self.keep.is_none(),
        };
        let class = self.by.contains(&By::Classification).then_some(names::CLASSIFICATION);
        let side = self.settled.map_or(0, |settled| settled.steps);
        let bytes = BYTES
            + if aligned { 0 } else { SORTING_BYTES }
            + if self.split == Split::Dirichlet { ANGLE_BYTES } else { 0 };
        let needs = Needs::none().looks_at(class).reads(&NORMAL).makes_cells();
        needs.cells(side, aligned).bytes_per_point(bytes)
    }

    fn for_share(&mut self, share: f64) {
        self.keep.iter_mut().for_each(|keep| keep.for_share(share));
    }

    fn convert(&mut self, units: &Units) -> Result<()> {
        if let Side::Length(side) = &mut self.side {
            *side = side.in_scan(units, "cells.side")?;
        }
        if let Some(side) = &mut self.max_side {
            *side = side.in_scan(units, "cells.max_side")?;
        }
        if let Some(Setting::Given(spacing)) = &mut self.min_spacing {
            *spacing = spacing.in_scan(units, "cells.min_spacing")?;
        }
        self.check().map_err(|(_, error)| error)
    }

    fn lengths(&self) -> Vec<(&'static str, Length)> {
        let side = match self.side {
            Side::Length(length) => Some(length),
            Side::Auto | Side::Spread => None,
        };
        let lengths = [
            ("cells.side", side),
            ("cells.max_side", self.max_side),
            ("cells.min_spacing", self.min_spacing.and_then(Setting::given)),
        ];
        lengths.into_iter().filter_map(|(key, length)| Some((key, length?))).collect()
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        self.check().map_err(|(_, error)| error)?;
        let steps = match self.side {
            // What "spread" comes to is known when samples are: these are as wide as the others.
            Side::Auto | Side::Spread => 1 << self.auto_level(scan.levels, scan.points),
            Side::Length(length) => scan.lattice.steps(length.value()).min(LARGEST_SIDE),
        };
        let bound = |length: Length| scan.lattice.steps(length.value()).unsigned_abs();
        self.settled = Some(SettledCells {
            steps,
            length: steps as f64 * scan.lattice.step,
            max_side: self.max_side.map_or(u64::MAX, bound),
            min_spacing: self.min_spacing.and_then(Setting::given).map_or(0, bound),
            max_angle: self.max_angle(),
            target: None,
        });
        self.outlook = Some(Outlook::of(scan));
        Ok(())
    }

    fn warnings(&self, lattice: &Lattice) -> Vec<String> {
        let each = self.lengths().into_iter();
        each.filter_map(|(address, length)| rounded(lattice, address, length.value())).collect()
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let limit = self.limit()?;
        let (mut cells, crossing) = self.initial_cells(tile)?;
        let mut division = Division::new(self.rule(limit)?, tile)?;
        let initial = std::mem::take(&mut cells.ends);
        cells.ends.reserve_exact(cells.members.len());
        let mut start = 0;
        for end in initial {
            division.run(start..end as usize, &mut cells, |_, _| {});
            start = end as usize;
        }
        tally.work("crossing_cells", crossing);
        self.count(division.counts(), tally);
        tile.cells = cells;
        Ok(())
    }

    fn decisions(&self) -> Vec<(String, Value)> {
        let settled = self.settled.iter().flat_map(|settled| {
            [("side".into(), settled.length.into()), ("side_steps".into(), settled.steps.into())]
        });
        settled.chain(self.threshold.iter().flat_map(Threshold::decisions)).collect()
    }

    fn sample_side(&self) -> Option<i64> {
        Some(self.settled.map_or(0, |settled| settled.steps))
    }

    fn sample(&self, tile: &mut Tile) -> Result<Vec<f64>> {
        noise::sample(self, tile)
    }

    fn forecast(&mut self, samples: &[Vec<f64>]) -> Forecast {
        noise::forecast(self, samples)
    }
}

impl Cells {
    fn count(&self, counts: DivisionCounts, tally: &mut Tally) {
        tally.count("cells_initial", counts.initial);
        tally.count("cells", counts.cells);
        if counts.cut_deep > 0 {
            tally.count("cells_cut_deep", counts.cut_deep);
        }
        if self.max_side.is_some() {
            tally.count("cells_by_max_side", counts.by_max_side);
        }
        if self.min_spacing.is_some() {
            tally.count("cells_by_min_spacing", counts.by_min_spacing);
        }
    }
}
