//! The nodes of a COPC file as its hierarchy has them, whatever it says: each page is held against
//! the rules before it is followed.

use std::collections::{BTreeMap, BTreeSet};

use super::hierarchy::{ENTRY_BYTES, NodeChunk, ROOT, VoxelKey};
use super::rules as r;
use crate::Result;
use crate::io::las::file::InputFile;
use crate::stage::Findings;

/// Nodes that are held; no scan that fits a disk has as many.
const MOST_NODES: usize = 1 << 22;
/// Entries of a page that are read at once.
const ENTRIES: usize = 4096;
/// Levels that a key can have, so that its places fit in 32 bits.
const LEVELS: i32 = 31;

/// A page: the node at whose head it begins, its first byte, its bytes.
type FoundPage = (VoxelKey, u64, u64);

/// The nodes that have points, by their first byte.
pub fn read(
    file: &InputFile,
    record: (u64, u64),
    root: (u64, u64),
    findings: &mut Findings,
) -> Result<Vec<(VoxelKey, NodeChunk)>> {
    let mut walk = NodeWalk { file, record, nodes: BTreeMap::new(), findings };
    let mut waiting = vec![(ROOT, root.0, root.1)];
    let mut seen = BTreeSet::new();
    while let Some(page) = waiting.pop() {
        if !seen.insert(page.1) {
            walk.findings.at(&r::PAGES, page.1, "a page that another entry refers to, too");
        } else if walk.is_page(page) && !walk.page(page, &mut waiting)? {
            let told = format!("more than {MOST_NODES} nodes, which are not looked at");
            walk.findings.at(&r::PAGES, page.1, told);
            break;
        }
    }
    Ok(walk.done())
}

struct NodeWalk<'a> {
    file: &'a InputFile,
    /// First byte of the record that holds the pages, and the byte behind it.
    record: (u64, u64),
    nodes: BTreeMap<VoxelKey, NodeChunk>,
    findings: &'a mut Findings,
}

impl NodeWalk<'_> {
    fn is_page(&mut self, (_, start, bytes): FoundPage) -> bool {
        let (from, end) = self.record;
        let is_inside = start >= from && start.checked_add(bytes).is_some_and(|e| e <= end);
        if !is_inside {
            let told = format!(
                "a page of {bytes} bytes from byte {start} on, and the record has bytes {from} to \
                 {end}"
            );
            self.findings.at(&r::PAGES, start, told);
        } else if bytes == 0 || !bytes.is_multiple_of(ENTRY_BYTES as u64) {
            self.findings.at(&r::PAGES, start, format!("a page of {bytes} bytes"));
        }
        is_inside
    }

    /// Reads the entries of a page; false if there are more nodes than are held.
    fn page(&mut self, (_, start, bytes): FoundPage, waiting: &mut Vec<FoundPage>) -> Result<bool> {
        let (mut at, end) = (start, start + bytes / ENTRY_BYTES as u64 * ENTRY_BYTES as u64);
        while at < end {
            let length = (end - at).min((ENTRIES * ENTRY_BYTES) as u64);
            let stretch = self.file.bytes(at, length as usize)?;
            for entry in stretch.as_chunks::<ENTRY_BYTES>().0 {
                self.entry(entry, at, waiting);
                at += ENTRY_BYTES as u64;
            }
            if self.nodes.len() + waiting.len() > MOST_NODES {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn entry(&mut self, entry: &[u8; ENTRY_BYTES], at: u64, waiting: &mut Vec<FoundPage>) {
        let word = |at: usize| i32::from_le_bytes(std::array::from_fn(|i| entry[at + i]));
        let start = u64::from_le_bytes(std::array::from_fn(|i| entry[16 + i]));
        let key = VoxelKey { level: word(0), at: [4, 8, 12].map(word) };
        let (bytes, points) = (word(24), word(28));
        let fits = |place: i32| place >= 0 && i64::from(place) < 1i64 << key.level;
        if !(0..=LEVELS).contains(&key.level) || !key.at.into_iter().all(fits) {
            self.findings.at(&r::KEY, at, format!("there is no node {}", shown(key)));
        } else if points < -1 || bytes < 0 {
            let told = format!("{points} points in {bytes} bytes in node {}", shown(key));
            self.findings.at(&r::NODE, at, told);
        } else if points == -1 {
            waiting.push((key, start, bytes as u64));
        } else if self.nodes.insert(key, NodeChunk { start, bytes, points }).is_some() {
            self.findings.at(&r::KEY, at, format!("node {} again", shown(key)));
        }
    }

    /// The nodes with points, once each has its parent.
    fn done(self) -> Vec<(VoxelKey, NodeChunk)> {
        for key in self.nodes.keys().filter(|key| key.level > 0) {
            if !self.nodes.contains_key(&key.parent()) {
                let told = format!("node {}, and the node above it is not there", shown(*key));
                self.findings.whole(&r::KEY, told);
            }
        }
        let filled = self.nodes.into_iter().filter(|(_, chunk)| chunk.points > 0);
        let mut filled: Vec<_> = filled.collect();
        filled.sort_by_key(|(_, chunk)| chunk.start);
        filled
    }
}

/// A node as viewers write it: level, x, y and z.
pub fn shown(VoxelKey { level, at: [x, y, z] }: VoxelKey) -> String {
    format!("{level}-{x}-{y}-{z}")
}
