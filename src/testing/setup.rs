//! How a run of a check is set up: what must not matter.

use std::fmt;
use std::num::NonZeroUsize;
use std::path::Path;

use crate::geom::simd::{Level, Simd};
use crate::graph::{RunSettings, SimdSetting, SpillSetting, Treatment};
use crate::stage::Order;

/// What a run may be set up by. The plain one has one tile, one thread and one part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Setup {
    /// Points of a tile; none: all of them.
    pub tile_points: Option<usize>,
    /// True if every tile sees the whole scan.
    pub whole_rims: bool,
    pub threads: usize,
    /// True if all points wait on disk, and the run has the least memory that does.
    pub is_tight: bool,
    pub simd: SimdSetting,
    pub parts: usize,
    /// Records of a batch at most.
    pub batch: usize,
    /// By which the records are put in another order.
    pub shuffled: Option<u64>,
    /// By which dimensions that no stage declares get other values.
    pub altered: Option<u64>,
    /// True if a stage that works on tiles, and does nothing, stands above.
    pub behind_tiles: bool,
    /// The order of what is collected: that of the input lets stages stream.
    pub order: Order,
}

impl Setup {
    pub const PLAIN: Setup = Setup {
        tile_points: None,
        whole_rims: false,
        threads: 1,
        is_tight: false,
        simd: SimdSetting::Auto,
        parts: 1,
        batch: usize::MAX,
        shuffled: None,
        altered: None,
        behind_tiles: false,
        order: Order::Canonical,
    };

    /// The settings of a run with so much memory.
    pub fn settings(&self, memory: u64, scratch: &Path) -> RunSettings {
        RunSettings {
            memory: Some(memory),
            threads: NonZeroUsize::new(self.threads),
            tile_points: self.tile_points.and_then(NonZeroUsize::new),
            scratch: Some(scratch.to_owned()),
            // Flags are values like all others here.
            withheld: Treatment::Keep,
            simd: self.simd,
            spill: if self.is_tight { SpillSetting::Always } else { SpillSetting::Auto },
            ..RunSettings::default()
        }
    }
}

/// The instruction sets that this processor has.
pub(super) fn instruction_sets() -> impl Iterator<Item = SimdSetting> {
    Simd::all().map(|simd| match simd.level() {
        Level::Portable => SimdSetting::Portable,
        Level::Avx2 => SimdSetting::Avx2,
        Level::Avx512 => SimdSetting::Avx512,
    })
}

/// What differs from the plain one.
impl fmt::Display for Setup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plain = Setup::PLAIN;
        let mut told = Vec::new();
        match (self.tile_points, self.whole_rims) {
            (None, _) => {}
            (Some(points), false) => told.push(format!("tiles of {points} points")),
            (Some(points), true) => {
                told.push(format!("tiles of {points} points, each of which sees the whole scan"))
            }
        }
        if self.threads != plain.threads {
            told.push(format!("{} threads", self.threads));
        }
        if self.is_tight {
            told.push("all points on disk and little memory".to_owned());
        }
        if self.simd != plain.simd {
            told.push(format!("instruction set {:?}", self.simd).to_lowercase());
        }
        if self.parts != plain.parts {
            told.push(format!("{} files", self.parts));
        }
        if self.batch != plain.batch {
            told.push(format!("batches of {} records", self.batch));
        }
        if self.shuffled.is_some() {
            told.push("records in another order".to_owned());
        }
        if self.altered.is_some() {
            told.push("other values in dimensions that are not declared".to_owned());
        }
        if self.behind_tiles {
            told.push("behind a stage that works on tiles".to_owned());
        }
        if self.order != plain.order {
            told.push("as a stream".to_owned());
        }
        if told.is_empty() {
            told.push("one tile, one thread, one file".to_owned());
        }
        f.write_str(&told.join(", "))
    }
}
