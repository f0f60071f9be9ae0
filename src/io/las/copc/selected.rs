//! The chunks of a COPC file that hold the points of a box, down to a resolution: those of the
//! nodes of its octree that meet the box, on the levels down to the first that is as fine (COPC
//! 1.0, "info VLR" and "COPC hierarchy VLR").

use std::collections::BTreeMap;

use super::hierarchy::{NodeChunk, VoxelKey};
use super::names::{HIERARCHY, INFO, INFO_AT, INFO_BYTES, USER};
use super::nodes;
use crate::io::las::file::InputFile;
use crate::io::las::input::LasInput;
use crate::io::las::table::{Chunk, ChunkList};
use crate::io::las::vlr::EVLR_HEAD;
use crate::quantity::CropBox;
use crate::stage::Findings;
use crate::{Error, Result};

/// What the info record says of the octree.
struct OctreeInfo {
    center: [f64; 3],
    half: f64,
    /// Distance between the points of the root.
    spacing: f64,
    /// Byte and length of the root's page.
    root: (u64, u64),
}

impl OctreeInfo {
    fn of(bytes: &[u8; INFO_BYTES]) -> OctreeInfo {
        let word = |n: usize| -> [u8; 8] { std::array::from_fn(|i| bytes[8 * n + i]) };
        let float = |n: usize| f64::from_le_bytes(word(n));
        let long = |n: usize| u64::from_le_bytes(word(n));
        let (center, half, spacing) = ([0, 1, 2].map(float), float(3), float(4));
        OctreeInfo { center, half, spacing, root: (long(5), long(6)) }
    }

    fn is_usable(&self) -> bool {
        let numbers = self.center.iter().chain([&self.half, &self.spacing]);
        numbers.into_iter().all(|v| v.is_finite()) && self.half > 0.0 && self.spacing > 0.0
    }

    /// True if the node can hold points of the box. `slack` is what rounding may move them by.
    fn meets(&self, key: VoxelKey, bounds: &CropBox, slack: f64) -> bool {
        let side = 2.0 * self.half / f64::from(key.level).exp2();
        let each = bounds.lo().iter().zip(bounds.hi()).zip(key.at).zip(self.center);
        each.into_iter().all(|(((lo, hi), at), center)| {
            let start = center - self.half + f64::from(at) * side;
            start - slack <= *hi && start + side + slack >= *lo
        })
    }

    /// The level down to which points are read: the first whose points are as near to each other.
    fn level(&self, resolution: f64) -> i32 {
        (self.spacing / resolution).log2().ceil().clamp(0.0, 31.0) as i32
    }
}

/// True if the file has an octree.
pub fn has_octree(input: &LasInput) -> bool {
    input.vlrs.iter().any(|vlr| vlr.is(USER, INFO))
}

/// The chunks of the nodes of `input`, which has an octree, that meet `bounds`, on the levels down
/// to a `resolution`, and down to the first with which they have `enough` of so many points.
///
/// Fails, with what to do instead, if the octree cannot be followed.
pub fn select(
    input: &LasInput,
    file: &InputFile,
    bounds: Option<&CropBox>,
    (resolution, enough): (Option<f64>, Option<(u64, u64)>),
) -> Result<ChunkList> {
    let broken = |byte: u64, why: &str| {
        file.wrong(byte, format!("the octree of this COPC file cannot be followed: {why}"))
            .help("read it whole: leave `read.box` and `read.resolution` out, and use `crop`")
    };
    let info = input.vlrs.iter().find(|vlr| vlr.is(USER, INFO));
    let bytes = info.and_then(|vlr| vlr.payload().first_chunk::<INFO_BYTES>());
    let info = bytes.map(OctreeInfo::of).filter(OctreeInfo::is_usable);
    let info = info.ok_or_else(|| broken(INFO_AT, "its info record says no cube"))?;
    let pages = input.evlrs.iter().find(|evlr| evlr.is(USER, HIERARCHY));
    let pages = pages.ok_or_else(|| broken(INFO_AT, "there is no record with its hierarchy"))?;
    let record = (pages.position() + EVLR_HEAD as u64, pages.position() + pages.len());
    let mut findings = Findings::default();
    let found = nodes::read(file, record, info.root, &mut findings)?;
    if let Some(fault) = findings.first_fault() {
        return Err(broken(record.0, &fault));
    }
    let slack = input.own_header().scale().into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    let deepest = resolution.map_or(i32::MAX, |resolution| info.level(resolution));
    let mut wanted = found;
    wanted.retain(|(key, _)| {
        key.level <= deepest && bounds.is_none_or(|bounds| info.meets(*key, bounds, slack))
    });
    if let Some(enough) = enough {
        let deepest = enough_levels(&wanted, enough);
        wanted.retain(|(key, _)| key.level <= deepest);
    }
    let mut chunks = ChunkList::default();
    for (_, chunk) in wanted {
        let (bytes, points) = (u64::from(chunk.bytes as u32), u64::from(chunk.points as u32));
        let end = chunk.start.checked_add(bytes).filter(|end| *end <= file.len());
        let end = end.ok_or_else(|| broken(chunk.start, "a node is behind the end of the file"))?;
        if !chunks.push(Chunk { start: chunk.start, end, points, whole: true }) {
            return Err(Error::data(file.path(), "it has more nodes of few points than are held"));
        }
    }
    Ok(chunks.closed())
}

/// The first level down to which `nodes` have as large a share of their points as `enough` is of
/// all.
fn enough_levels(nodes: &[(VoxelKey, NodeChunk)], (enough, of_all): (u64, u64)) -> i32 {
    let mut levels: BTreeMap<i32, u128> = BTreeMap::new();
    for (key, chunk) in nodes {
        *levels.entry(key.level).or_default() += u128::from(chunk.points as u32);
    }
    let all: u128 = levels.values().sum();
    let mut sum = 0;
    for (level, points) in levels {
        sum += points;
        if sum * u128::from(of_all) >= all * u128::from(enough) {
            return level;
        }
    }
    i32::MAX
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_read_down_to_the_first_that_makes_the_points_enough() {
        let node = |level, points| {
            (VoxelKey { level, at: [0; 3] }, NodeChunk { start: 0, bytes: 1, points })
        };
        let nodes = [node(2, 60), node(0, 10), node(1, 15), node(1, 15)];
        for (enough, level) in
            [(0, 0), (10, 0), (11, 1), (40, 1), (41, 2), (100, 2), (101, i32::MAX)]
        {
            assert_eq!(enough_levels(&nodes, (enough, 100)), level, "{enough}");
            assert_eq!(enough_levels(&nodes, (3 * enough, 300)), level, "of more files: {enough}");
        }
    }

    #[test]
    fn nodes_that_meet_a_box_and_levels_that_are_coarse() {
        let info = OctreeInfo { center: [8.0; 3], half: 8.0, spacing: 0.5, root: (0, 0) };
        let bounds = |numbers: &[f64]| CropBox::try_from(numbers.to_vec()).unwrap();
        let key = |level, at| VoxelKey { level, at };
        let flat = bounds(&[9.0, 1.0, 10.0, 2.0]);
        assert!(info.meets(key(0, [0; 3]), &flat, 0.0));
        assert!(info.meets(key(1, [1, 0, 1]), &flat, 0.0));
        assert!(!info.meets(key(1, [0, 0, 0]), &flat, 0.0));
        assert!(info.meets(key(1, [0, 0, 0]), &flat, 1.0));
        let high = bounds(&[9.0, 1.0, 9.0, 10.0, 2.0, 10.0]);
        assert!(!info.meets(key(1, [1, 0, 0]), &high, 0.0));
        assert_eq!([8.0, 0.5, 0.4, 0.25, 1e-30].map(|r| info.level(r)), [0, 0, 1, 1, 31]);
    }
}
