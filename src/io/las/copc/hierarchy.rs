//! The hierarchy of a COPC file: which nodes of the octree there are, and where their chunks stand
//! (COPC 1.0, "COPC hierarchy VLR").
//!
//! A page lists the nodes of some levels below one; where there are many nodes, deeper ones are in
//! pages of their own, so that a viewer fetches those of the places that it draws.

use std::collections::{BTreeMap, BTreeSet};

use crate::io::las::text::field;
use crate::io::las::vlr::EVLR_HEAD;

/// Bytes of an entry.
pub const ENTRY_BYTES: usize = 32;
/// Nodes that one page holds without being cut.
const PAGE_NODES: usize = 1024;
/// Levels of a page where it is cut.
const PAGE_LEVELS: i32 = 5;

/// A node of the octree: its level, 0 for the root, and its place among those of its level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct VoxelKey {
    /// Its level.
    pub level: i32,
    /// Its place along x, y and z, from 0.
    pub at: [i32; 3],
}

/// The root.
pub const ROOT: VoxelKey = VoxelKey { level: 0, at: [0; 3] };

impl VoxelKey {
    /// The node above.
    pub fn parent(self) -> VoxelKey {
        VoxelKey { level: self.level - 1, at: self.at.map(|at| at >> 1) }
    }
}

/// Where the points of a node are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NodeChunk {
    /// The first byte of its chunk; of a node without points, 0.
    pub start: u64,
    /// Bytes of its chunk.
    pub bytes: i32,
    /// Points in it; -1 in the place of a page.
    pub points: i32,
}

/// The nodes of a file.
#[derive(Debug, Default)]
pub struct Hierarchy {
    nodes: BTreeMap<VoxelKey, NodeChunk>,
}

impl Hierarchy {
    /// Adds a node.
    pub fn add(&mut self, key: VoxelKey, chunk: NodeChunk) {
        self.nodes.insert(key, chunk);
    }

    /// The pages, the first of them that of the root, as they stand from byte `start` of the file
    /// on; and the bytes of the first.
    pub fn pages(&self, start: u64) -> (Vec<u8>, u64) {
        let tops = self.tops();
        let mut pages: BTreeMap<VoxelKey, Vec<(VoxelKey, NodeChunk)>> = BTreeMap::new();
        for (&key, &chunk) in &self.nodes {
            let mut top = key;
            while !tops.contains(&top) {
                top = top.parent();
            }
            pages.entry(top).or_default().push((key, chunk));
        }
        // The page above one refers to it: a page has an entry more for each of those.
        let above = |top: VoxelKey| {
            let mut above = top.parent();
            while above.level > 0 && !tops.contains(&above) {
                above = above.parent();
            }
            above
        };
        let mut below: BTreeMap<VoxelKey, Vec<VoxelKey>> = BTreeMap::new();
        for &top in pages.keys().filter(|top| top.level > 0) {
            below.entry(above(top)).or_default().push(top);
        }
        let entries = |top: &VoxelKey| pages[top].len() + below.get(top).map_or(0, Vec::len);
        let mut places = BTreeMap::new();
        let mut at = start;
        for top in pages.keys() {
            let bytes = (entries(top) * ENTRY_BYTES) as u64;
            places.insert(*top, (at, bytes));
            at += bytes;
        }
        let mut out = Vec::with_capacity((at - start) as usize);
        for (top, nodes) in &pages {
            let referred = below.get(top).into_iter().flatten().map(|lower| {
                let (start, bytes) = places[lower];
                (*lower, NodeChunk { start, bytes: bytes as i32, points: -1 })
            });
            nodes
                .iter()
                .copied()
                .chain(referred)
                .for_each(|(key, chunk)| put(&mut out, key, chunk));
        }
        let first = places.values().next().map_or(0, |(_, bytes)| *bytes);
        (out, first)
    }

    /// The nodes at whose heads pages begin.
    fn tops(&self) -> BTreeSet<VoxelKey> {
        let mut tops = BTreeSet::from([ROOT]);
        if self.nodes.len() > PAGE_NODES {
            let keys = self.nodes.keys();
            tops.extend(keys.filter(|key| key.level % PAGE_LEVELS == 0));
        }
        tops
    }
}

fn put(out: &mut Vec<u8>, key: VoxelKey, chunk: NodeChunk) {
    out.extend(key.level.to_le_bytes());
    out.extend(key.at.iter().flat_map(|at| at.to_le_bytes()));
    out.extend(chunk.start.to_le_bytes());
    out.extend(chunk.bytes.to_le_bytes());
    out.extend(chunk.points.to_le_bytes());
}

/// Head and payload of a new extended record.
pub fn extended(user: &str, record: u16, description: &str, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0; EVLR_HEAD];
    bytes[2..18].copy_from_slice(&field::<16>(user));
    bytes[18..20].copy_from_slice(&record.to_le_bytes());
    bytes[20..28].copy_from_slice(&(payload.len() as u64).to_le_bytes());
    bytes[28..].copy_from_slice(&field::<32>(description));
    bytes.extend_from_slice(payload);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(page: &[u8]) -> Vec<(VoxelKey, NodeChunk)> {
        let word =
            |bytes: &[u8], at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let entry = |bytes: &[u8]| {
            let at = [4, 8, 12].map(|at| word(bytes, at));
            let start = u64::from_le_bytes(bytes[16..24].try_into().unwrap());
            let chunk = NodeChunk { start, bytes: word(bytes, 24), points: word(bytes, 28) };
            (VoxelKey { level: word(bytes, 0), at }, chunk)
        };
        page.chunks_exact(ENTRY_BYTES).map(entry).collect()
    }

    #[test]
    fn every_node_is_reached_from_the_root_page() {
        for depth in [0, 2, 5, 12] {
            let mut hierarchy = Hierarchy::default();
            let mut all = BTreeMap::new();
            for level in 0..=depth {
                for n in 0..(1 << level.min(9)) {
                    let key = VoxelKey { level, at: [n, 0, n >> 1] };
                    let points = if n % 7 == 3 { 0 } else { n + 1 };
                    let chunk = NodeChunk { start: n as u64, bytes: points * 3, points };
                    hierarchy.add(key, chunk);
                    all.insert(key, chunk);
                }
            }
            // Nodes of deep levels have others above them.
            for key in all.keys().copied().collect::<Vec<_>>() {
                let mut key = key;
                while key.level > 0 {
                    key = key.parent();
                    let none = NodeChunk { start: 0, bytes: 0, points: 0 };
                    let chunk = *all.entry(key).or_insert(none);
                    hierarchy.add(key, chunk);
                }
            }
            let (bytes, first) = hierarchy.pages(1000);
            let mut waiting = vec![(ROOT, 1000, first)];
            let (mut found, mut pages) = (BTreeMap::new(), 0);
            while let Some((top, at, length)) = waiting.pop() {
                let at = (at - 1000) as usize;
                pages += 1;
                for (key, chunk) in entries(&bytes[at..at + length as usize]) {
                    match chunk.points {
                        -1 => waiting.push((key, chunk.start, chunk.bytes as u64)),
                        _ => assert!(found.insert(key, chunk).is_none(), "{key:?} twice"),
                    }
                    assert!(key.level >= top.level);
                }
            }
            assert_eq!(found, all, "{depth}");
            assert_eq!(pages > 1, all.len() > PAGE_NODES, "{pages} pages of {}", all.len());
        }
    }
}
