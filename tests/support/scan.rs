//! A scan held as records: made up, read, cut, moved, shuffled, and split into files.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pointmill::io::las;
use pointmill::point::{Layout, Metadata, Position, Schema, Value};
use pointmill::stage::{Lattice, OpenSource, Source};
use pointmill::synth::{Scene, Synthetic};

use super::random::Random;
use super::records;

/// The records of a scan and what its file says besides.
#[derive(Clone)]
pub struct Scan {
    pub schema: Arc<Schema>,
    pub metadata: Metadata,
    pub records: Vec<u8>,
}

impl Scan {
    /// A scan that is made up.
    pub fn synthetic(scene: Scene, points: u64, seed: u64) -> Scan {
        let source =
            Synthetic { scene, points, seed, noise: None, ..Synthetic::default() }.open().unwrap();
        Scan::of(&*source, usize::MAX)
    }

    /// A LAS scan of point format 2 whose points have these colours, all three alike, along x.
    pub fn colored(colors: &[u16]) -> Scan {
        let schema = Arc::new(las::layout(2, &[], [0.01; 3], [0.0; 3]));
        let mut records = vec![0; colors.len() * schema.stride];
        for (i, (record, color)) in records.chunks_mut(schema.stride).zip(colors).enumerate() {
            record[..4].copy_from_slice(&(i as i32).to_le_bytes());
            for channel in 0..3 {
                record[20 + 2 * channel..][..2].copy_from_slice(&color.to_le_bytes());
            }
        }
        Scan { metadata: las::fresh(&schema, None), schema, records }
    }

    /// A copy whose records lie elsewhere in stored coordinates: `to` gets the number of each and
    /// where it lies.
    pub fn moved(&self, mut to: impl FnMut(usize, [i32; 3]) -> [i32; 3]) -> Scan {
        let mut scan = self.clone();
        for (i, record) in scan.records.chunks_exact_mut(scan.schema.stride).enumerate() {
            let mut stored = [0; 3];
            for (axis, bytes) in record[..12].as_chunks::<4>().0.iter().enumerate() {
                stored[axis] = i32::from_le_bytes(*bytes);
            }
            let stored = to(i, stored);
            for (bytes, v) in record[..12].as_chunks_mut::<4>().0.iter_mut().zip(stored) {
                *bytes = v.to_le_bytes();
            }
        }
        scan
    }

    /// At most the first `limit` records of a file.
    pub fn read(path: &Path, limit: usize) -> Scan {
        Scan::of(&*records::open(&[path.to_owned()]).unwrap(), limit)
    }

    fn of(source: &dyn Source, limit: usize) -> Scan {
        let records = records::read_source(source, limit).unwrap();
        Scan { schema: source.schema().clone(), metadata: source.metadata().clone(), records }
    }

    pub fn points(&self) -> usize {
        self.records.len() / self.schema.stride
    }

    pub fn record(&self, i: usize) -> &[u8] {
        &self.records[i * self.schema.stride..(i + 1) * self.schema.stride]
    }

    /// The scan with the given records, in that order.
    pub fn pick(&self, order: &[usize]) -> Scan {
        let records = order.iter().flat_map(|&i| self.record(i)).copied().collect();
        Scan { records, ..self.clone() }
    }

    pub fn lattice(&self) -> Lattice {
        Lattice::of(&self.schema, None).unwrap()
    }

    /// The position of every record.
    pub fn positions(&self) -> Vec<Position> {
        let mut positions = Vec::new();
        self.lattice().place(
            &self.schema,
            &self.records,
            |_, p| positions.push(p),
            |i, why| panic!("record {i}: {why:?}"),
        );
        positions
    }

    /// The `points` records in the smallest square column around the record in the middle.
    pub fn crop(&self, points: usize) -> Scan {
        let positions = self.positions();
        let center = positions[positions.len() / 2];
        let mut order: Vec<usize> = (0..positions.len()).collect();
        let distance = |i: &usize| {
            let p = positions[*i];
            (p[0].abs_diff(center[0]).max(p[1].abs_diff(center[1])), *i)
        };
        order.sort_by_key(distance);
        order.truncate(points);
        order.sort_unstable();
        self.pick(&order)
    }

    /// The same on a grid of so many stored steps, so that distances tie.
    pub fn snapped(&self, steps: i32) -> Scan {
        let mut scan = self.clone();
        for record in scan.records.chunks_exact_mut(self.schema.stride) {
            for stored in record[..12].as_chunks_mut::<4>().0 {
                let value = i32::from_le_bytes(*stored);
                *stored = (value.div_euclid(steps) * steps).to_le_bytes();
            }
        }
        scan
    }

    /// The same with copies: whole records, records that share no more than their position, and one
    /// position a thousand times.
    pub fn with_copies(&self, seed: u64) -> Scan {
        let mut random = Random(seed);
        let mut scan = self.clone();
        let (points, stride) = (self.points(), self.schema.stride);
        let favourite = random.below(points);
        for i in 0..points / 10 + 1000 {
            let of = if i < 1000 { favourite } else { random.below(points) };
            let at = scan.records.len();
            scan.records.extend_from_slice(self.record(of));
            if i % 2 == 0 {
                let last = scan.records[at..].last_mut().unwrap();
                *last = last.wrapping_add(random.below(3) as u8);
            }
            assert_eq!(scan.records.len(), at + stride);
        }
        scan
    }

    /// The same with copies, and one point far from all others.
    pub fn with_copies_and_an_outlier(&self, seed: u64) -> Scan {
        let mut scan = self.with_copies(seed);
        let at = scan.records.len();
        scan.records.extend_from_slice(self.record(0));
        let schema = self.schema.clone();
        for axis in schema.coordinates().unwrap() {
            let far = if axis.scalar.is_float() {
                Value::Double(1e6)
            } else {
                Value::Signed(2_000_000_011)
            };
            assert!(axis.put(&mut scan.records[at..], schema.endian, far));
        }
        scan
    }

    /// The same (of point format 6 to 10) with classes and flags at random, so that copies of one
    /// record differ in them: every seventh record has another class, and each flag is set on about
    /// one record of twenty.
    pub fn with_classes_and_flags(&self, seed: u64) -> Scan {
        /// Where the flags and the class of a record are (LAS 1.4 R15, table 16).
        const FLAGS: usize = 15;
        const CLASS: usize = 16;
        let mut random = Random(seed);
        let mut scan = self.clone();
        for record in scan.records.chunks_exact_mut(self.schema.stride) {
            let flag = |set: bool, bit: u8| if set { 1 << bit } else { 0 };
            let flags = (0..4).fold(0, |all, bit| all | flag(random.below(20) == 0, bit));
            record[FLAGS] = record[FLAGS] & 0xf0 | flags;
            if random.below(7) == 0 {
                record[CLASS] = random.one_of(&[1, 2, 5, 6]);
            }
        }
        scan
    }

    /// Writes it as it is, in the format that the extension names.
    pub fn write(&self, path: &Path) {
        let sink = records::sink(path, &self.schema, &self.metadata).unwrap();
        records::write(sink, &self.schema, &self.records).unwrap();
    }

    /// Writes it into `files` files of `folder`, cut at random (some may be empty): LAS and LAZ by
    /// turns, or PLY. They are given in the scan's order.
    pub fn write_split(&self, folder: &Path, files: usize, random: &mut Random) -> Vec<PathBuf> {
        let mut cuts: Vec<usize> = (1..files).map(|_| random.below(self.points() + 1)).collect();
        cuts.extend([0, self.points()]);
        cuts.sort_unstable();
        let extensions =
            if self.schema.layout == Layout::plain("PLY") { ["ply"; 2] } else { ["las", "laz"] };
        cuts.windows(2)
            .enumerate()
            .map(|(i, cut)| {
                let path = folder.join(format!("{i}.{}", random.one_of(&extensions)));
                self.pick(&(cut[0]..cut[1]).collect::<Vec<_>>()).write(&path);
                path
            })
            .collect()
    }
}
