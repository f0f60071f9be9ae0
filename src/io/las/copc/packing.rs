//! Compressing nodes on any thread. Nodes become ripe one by one, where points are put in order,
//! which one thread does at a time; compressing them takes far longer. So a thread that comes to
//! encode a batch of records first compresses a node that waits, and chunks are written in the
//! order in which their nodes became ripe.

use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex};

use super::hierarchy::VoxelKey;
use super::names::{RETURN, TIME};
use super::octree::{LEAF_POINTS, RipeNode};
use crate::host::lock;
use crate::io::las::encode::LasEncoder;
use crate::io::las::laz::Compression;
use crate::point::{PointBatch, ascending};
use crate::stage::{Encode, Encoded};
use crate::{Error, Result};

/// Nodes that wait at most, before the thread that adds one compresses one.
const WAITING: usize = 4;
/// Nodes that wait and are compressed at most, about, each of as many records as a piece has.
pub const HELD_NODES: usize = WAITING + 2;
/// Bits that the place of a record in its piece takes.
const PLACE_BITS: u32 = 28;
const _: () = assert!(LEAF_POINTS < 1 << PLACE_BITS);

/// A compressed node.
#[derive(Debug)]
pub struct PackedNode {
    /// Which node it is.
    pub key: VoxelKey,
    /// Its points.
    pub points: u64,
    /// Its chunk; nothing where it has no points.
    pub chunk: Vec<u8>,
}

#[derive(Default)]
struct Queue {
    /// Nodes that became ripe so far, and chunks that were taken.
    numbered: u64,
    taken: u64,
    waiting: VecDeque<(u64, RipeNode)>,
    packed: BTreeMap<u64, PackedNode>,
}

/// Nodes on their way to chunks, shared by all threads.
pub struct Packing {
    compression: Compression,
    queue: Mutex<Queue>,
}

impl Packing {
    /// Without a node.
    pub fn new(compression: Compression) -> Self {
        Packing { compression, queue: Mutex::default() }
    }

    /// Bytes of a record.
    pub fn stride(&self) -> usize {
        self.compression.stride
    }

    /// Adds a node.
    pub fn add(&self, node: RipeNode) -> Result<()> {
        let waits = {
            let mut queue = lock(&self.queue);
            let number = queue.numbered;
            queue.numbered += 1;
            queue.waiting.push_back((number, node));
            queue.waiting.len()
        };
        if waits > WAITING { self.work().map(drop) } else { Ok(()) }
    }

    /// Compresses a node that waits; false if none does.
    pub fn work(&self) -> Result<bool> {
        let Some((number, node)) = lock(&self.queue).waiting.pop_front() else { return Ok(false) };
        let packed = self.pack(node)?;
        lock(&self.queue).packed.insert(number, packed);
        Ok(true)
    }

    /// The next chunk in order, if it is done.
    pub fn take(&self) -> Option<PackedNode> {
        let queue = &mut *lock(&self.queue);
        let next = queue.packed.remove(&queue.taken)?;
        queue.taken += 1;
        Some(next)
    }

    fn pack(&self, node: RipeNode) -> Result<PackedNode> {
        let stride = self.compression.stride;
        let bytes: usize = node.pieces.iter().map(|piece| piece.len()).sum();
        let points = (bytes / stride) as u64;
        if i32::try_from(points).is_err() {
            let told = "a node of the octree has more points than COPC counts to";
            return Err(Error::pipeline(told).help("leave out copies of points first"));
        }
        let pieces = node.pieces.into_iter();
        let pieces = pieces.map(|piece| Ok(Cow::Owned(in_time(&piece.records()?, stride))));
        let chunk = match points {
            0 => Vec::new(),
            _ => self.compression.encode_each(pieces, Vec::with_capacity(bytes / 4))?,
        };
        Ok(PackedNode { key: node.key, points, chunk })
    }

    /// Upper estimate of what compressing a node holds: a piece, the same in order, and the output.
    pub fn bytes(&self, piece_points: usize) -> u64 {
        3 * (piece_points * self.compression.stride) as u64 + self.compression.state_bytes()
    }
}

/// Records by time and return number, then as they are: neighbours in time differ least, which
/// makes chunks small.
fn in_time(records: &[u8], stride: usize) -> Vec<u8> {
    let key = |record: &[u8]| {
        let time = record.get(TIME..).and_then(<[u8]>::first_chunk);
        let time = f64::from_le_bytes(time.copied().unwrap_or_default());
        (ascending(time), u32::from(record[RETURN] & 0b1111) << PLACE_BITS)
    };
    let keys = records.chunks_exact(stride).map(key).zip(0u32..);
    let mut order: Vec<(u64, u32)> = keys.map(|((time, of), at)| (time, of | at)).collect();
    order.sort_unstable();
    let mut sorted = Vec::with_capacity(records.len());
    for (_, at) in order {
        let at = (at & ((1 << PLACE_BITS) - 1)) as usize * stride;
        sorted.extend_from_slice(&records[at..at + stride]);
    }
    sorted
}

/// Encodes batches of records as they are, and compresses nodes.
pub struct CopcEncoder {
    /// What encodes the records.
    pub records: Arc<LasEncoder>,
    /// The nodes.
    pub packing: Arc<Packing>,
}

impl Encode for CopcEncoder {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        self.packing.work()?;
        self.records.encode(batch)
    }
}
