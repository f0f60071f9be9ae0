//! A COPC file held to the rules of COPC 1.0: its info record and hierarchy here, its points by
//! whoever reads them.

use super::hierarchy::{NodeChunk, VoxelKey};
use super::names::{HIERARCHY, INFO, INFO_AT, INFO_BYTES, POINT_FORMATS};
use super::nodes::{self, shown};
use super::rules as r;
use crate::Result;
use crate::io::las::chunks::Chunks;
use crate::io::las::file::InputFile;
use crate::io::las::header::Header;
use crate::io::las::input::{LasInput, Storage};
use crate::io::las::vlr::VLR_HEAD;
use crate::stage::Findings;

/// Steps that a point may lie outside of its node: writers find that before or after they round.
const SLACK: f64 = 1.0;
/// How far the cube may fall short of the box, by its size: what rounding loses.
const ROUNDING: f64 = 1e-9;

/// A record of COPC as it stands in the file.
pub struct CopcRecord<'a> {
    pub number: u16,
    /// Where its head and its payload begin, and where it ends.
    pub at: u64,
    pub payload_at: u64,
    pub end: u64,
    pub is_extended: bool,
    pub payload: &'a [u8],
}

/// What the info record says.
#[derive(Debug, Clone, Copy)]
pub struct CopcInfo {
    center: [f64; 3],
    half: f64,
    /// Smallest and largest GPS time.
    times: [f64; 2],
    root: (u64, u64),
}

/// The octree of a COPC file.
pub struct CopcTree {
    info: CopcInfo,
    nodes: Vec<(VoxelKey, NodeChunk)>,
}

/// Where points of a node are allowed to be, by the number of its first point.
#[derive(Debug, Clone)]
pub struct NodeBox {
    pub first: u64,
    pub key: VoxelKey,
    /// Smallest and largest stored coordinates.
    pub lo: [i64; 3],
    /// See `lo`.
    pub hi: [i64; 3],
}

/// Checks what the records of COPC say; the octree, if there is one that can be followed. `header`
/// is minor version, header size, point format and whether points are compressed.
pub fn check(
    file: &InputFile,
    records: &[CopcRecord<'_>],
    (minor, size, format, is_compressed): (u8, u16, u8, bool),
    findings: &mut Findings,
) -> Result<Option<CopcTree>> {
    if minor != 4 || u64::from(size) + VLR_HEAD as u64 != INFO_AT || !is_compressed {
        let how = if is_compressed { "compressed" } else { "not compressed" };
        findings.at(&r::VERSION, 24, format!("LAS 1.{minor}, {size} bytes, {how}"));
    }
    if !POINT_FORMATS.contains(&format) {
        findings.at(&r::POINT_FORMAT, 104, format!("{format}"));
    }
    let Some(info) = info(records, findings) else { return Ok(None) };
    let pages = |record: &&CopcRecord<'_>| record.is_extended && record.number == HIERARCHY;
    let (start, bytes) = info.root;
    let Some(record) = records.iter().find(pages) else {
        findings.whole(&r::HIERARCHY, "there is no such record");
        return Ok(None);
    };
    let end = start.checked_add(bytes);
    if start < record.payload_at || end.is_none_or(|end| end > record.end) || bytes == 0 {
        let told = format!(
            "a root page of {bytes} bytes at byte {start}, and the record has bytes {} to {}",
            record.payload_at, record.end
        );
        findings.at(&r::HIERARCHY, INFO_AT + 40, told);
        return Ok(None);
    }
    let nodes = nodes::read(file, (record.payload_at, record.end), info.root, findings)?;
    Ok(Some(CopcTree { info, nodes }))
}

fn info(records: &[CopcRecord<'_>], findings: &mut Findings) -> Option<CopcInfo> {
    let mut all = records.iter().filter(|record| !record.is_extended && record.number == INFO);
    let Some(first) = all.next() else {
        findings.whole(&r::INFO, "there is no such record");
        return None;
    };
    let length = first.payload.len();
    if first.payload_at != INFO_AT || length != INFO_BYTES {
        findings.at(&r::INFO, first.at, format!("one of {length} bytes at byte {}", first.at));
    }
    if let Some(second) = all.next() {
        findings.at(&r::INFO, second.at, "a second one");
    }
    let bytes = first.payload.first_chunk::<INFO_BYTES>()?;
    let word = |at: usize| -> [u8; 8] { std::array::from_fn(|i| bytes[at + i]) };
    let float = |n: usize| f64::from_le_bytes(word(8 * n));
    let long = |n: usize| u64::from_le_bytes(word(8 * n));
    if let Some(odd) = bytes[72..].iter().position(|&b| b != 0) {
        findings.at(&r::INFO_RESERVED, first.payload_at + 72 + odd as u64, "another byte");
    }
    let (center, half, spacing) = ([0, 1, 2].map(float), float(3), float(4));
    let is_cube = center.iter().all(|v| v.is_finite()) && half > 0.0 && half.is_finite();
    if !is_cube {
        let told = format!("a center of {center:?} and a half size of {half}");
        findings.at(&r::CUBE, first.payload_at, told);
    }
    if !(spacing > 0.0 && spacing.is_finite()) {
        findings.at(&r::SPACING, first.payload_at + 32, format!("{spacing}"));
    }
    is_cube.then(|| CopcInfo {
        center,
        half,
        times: [float(7), float(8)],
        root: (long(5), long(6)),
    })
}

impl CopcTree {
    /// Holds the octree against the header and the chunks of a file that is open; where points of
    /// each node may be, as far as nodes are chunks.
    pub fn hold(&self, input: &LasInput, findings: &mut Findings) -> Vec<NodeBox> {
        self.holds_box(&input.header, findings);
        let points: u64 = self.nodes.iter().map(|(_, chunk)| chunk.points as u64).sum();
        if points != input.header.points() {
            let told = format!("{points}, and the header counts {}", input.header.points());
            findings.whole(&r::NODE_COUNT, told);
        }
        let Storage::Laz(compression, Chunks::Known(chunks)) = &input.storage else {
            return Vec::new();
        };
        if compression.chunk_points.is_some() && input.header.points() > 0 {
            findings.whole(&r::VARYING, "chunks of equally many points each");
        }
        let (mut nodes, mut boxes) = (self.nodes.iter().peekable(), Vec::new());
        let mut first = 0;
        for chunk in (0..chunks.parts()).flat_map(|part| chunks.part(part)) {
            while let Some((key, node)) = nodes.next_if(|(_, node)| node.start < chunk.start) {
                no_chunk(*key, node, findings);
            }
            if let Some((key, node)) = nodes.next_if(|(_, node)| node.start == chunk.start) {
                let own = (chunk.end - chunk.start, chunk.points);
                if own != (node.bytes as u64, node.points as u64) {
                    let told = format!(
                        "node {} has {} points in {} bytes, and the chunk there {} in {}",
                        shown(*key),
                        node.points,
                        node.bytes,
                        own.1,
                        own.0
                    );
                    findings.at(&r::NODE, node.start, told);
                }
                boxes.push(self.node_box(first, *key, &input.header));
            } else {
                let told = format!("a chunk of {} points that is no node's", chunk.points);
                findings.at(&r::NODE, chunk.start, told);
            }
            first += chunk.points;
        }
        nodes.for_each(|(key, node)| no_chunk(*key, node, findings));
        boxes
    }

    fn holds_box(&self, header: &Header, findings: &mut Findings) {
        let CopcInfo { center, half, .. } = self.info;
        let [lo, hi] = header.bounds();
        let slack = half * ROUNDING;
        for axis in (0..3).filter(|_| header.points() > 0) {
            let [low, high] = [center[axis] - half - slack, center[axis] + half + slack];
            if lo[axis] < low || hi[axis] > high {
                let told = format!(
                    "{} from {low} to {high} and in the header from {} to {}",
                    ["x", "y", "z"][axis],
                    lo[axis],
                    hi[axis]
                );
                findings.at(&r::CUBE_HOLDS, INFO_AT, told);
            }
        }
    }

    fn node_box(&self, first: u64, key: VoxelKey, header: &Header) -> NodeBox {
        let CopcInfo { center, half, .. } = self.info;
        let (scale, offset) = (header.scale(), header.offset());
        let side = half / 2f64.powi(key.level - 1);
        let stored = |axis: usize, more: i32| {
            let world = center[axis] - half + f64::from(key.at[axis] + more) * side;
            (world - offset[axis]) / scale[axis]
        };
        let lo = [0, 1, 2].map(|axis| (stored(axis, 0) - SLACK).floor() as i64);
        let hi = [0, 1, 2].map(|axis| (stored(axis, 1) + SLACK).ceil() as i64);
        NodeBox { first, key, lo, hi }
    }

    /// Holds the GPS times of the info record against those of the points.
    pub fn hold_times(&self, [least, most]: [f64; 2], findings: &mut Findings) {
        let [low, high] = self.info.times;
        if least <= most && (low != least || high != most) {
            let told = format!("{low} to {high}, and the points have {least} to {most}");
            findings.at(&r::TIMES, INFO_AT + 56, told);
        }
    }
}

fn no_chunk(key: VoxelKey, node: &NodeChunk, findings: &mut Findings) {
    let told =
        format!("node {} is at byte {}, where no chunk of its own begins", shown(key), node.start);
    findings.at(&r::NODE, node.start, told);
}

/// Enters a point whose time is before that of the point before it in its node.
pub fn unsorted(findings: &mut Findings, point: u64, [earlier, time]: [f64; 2]) {
    findings.point(&r::SORTED, point, None, || format!("{time} behind {earlier}"));
}

/// Enters a point that is not in the box of its node.
pub fn outside(findings: &mut Findings, node: &NodeBox, point: u64, stored: [i32; 3]) {
    findings.point(&r::NODE_BOX, point, None, || {
        format!("stored coordinates {stored:?} in node {}", shown(node.key))
    });
}
