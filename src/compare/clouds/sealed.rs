//! The places of a scan, in Morton order, in memory or on disk: decoded, sorted and merged as a run
//! does it, with no record beside them but for its normal, where that is compared.

use std::sync::Arc;

use super::normals::{NORMAL_BYTES, RecordNormals};
use crate::budget::{Budget, Lease};
use crate::engine::Watch;
use crate::geom::lattice::{Lattice, Misplaced};
use crate::graph::Nonfinite;
use crate::host::Threads;
use crate::point::{
    Chooser, Dimension, Endian, Layout, PointBatch, Position, Scalar, Schema, Selection, names,
};
use crate::report::Grouped;
use crate::stage::{BATCH, Source};
use crate::store::{Intake, SealedTiles, SpillArea, TileStore, seal};
use crate::{Error, ErrorKind, Result};

/// Bytes of a record in the store where its place is all that is kept of it.
const STRIDE: usize = 1;
/// What is stored of these.
const NOTHING: [u8; BATCH * STRIDE] = [0; BATCH * STRIDE];

/// Bytes of what is kept of a record besides its place.
pub fn stride(has_normals: bool) -> usize {
    if has_normals { NORMAL_BYTES } else { STRIDE }
}

/// How records come to their places.
pub enum Placing {
    /// As steps that are those of the lattice.
    Steps(Lattice),
    /// By their coordinates in the world, whatever their schema.
    World(Lattice),
}

impl Placing {
    /// A lattice for two scans: that of their coordinates where they have the same one, else 2^-30.
    pub fn of(schemas: [&Arc<Schema>; 2], step: Option<f64>) -> Result<Placing> {
        let [a, b] = schemas.map(|schema| schema.coordinates());
        let is_same = a == b
            && schemas[0].layout.steps == schemas[1].layout.steps
            && schemas[0].endian == schemas[1].endian;
        if is_same {
            return Ok(Placing::Steps(Lattice::of(schemas[0], step)?));
        }
        let axis = |(n, name)| Dimension::new(name, Scalar::F64, n * size_of::<f64>());
        let world = Schema {
            layout: Layout::plain("world"),
            endian: Endian::Little,
            stride: 3 * size_of::<f64>(),
            dimensions: names::XYZ.into_iter().enumerate().map(axis).collect(),
        };
        Ok(Placing::World(Lattice::of(&world, step)?))
    }

    /// The lattice.
    pub fn lattice(&self) -> &Lattice {
        match self {
            Placing::Steps(lattice) | Placing::World(lattice) => lattice,
        }
    }

    fn place(
        &self,
        batch: &PointBatch,
        mut place: impl FnMut(usize, Position),
        mut misplaced: impl FnMut(usize, Misplaced),
    ) {
        let schema = batch.schema();
        let lattice = match self {
            Placing::Steps(lattice) => {
                return lattice.place(schema, batch.records(), place, misplaced);
            }
            Placing::World(lattice) => lattice,
        };
        let Some(axes) = schema.coordinates() else { return };
        for (i, record) in batch.iter().enumerate() {
            let world = axes.map(|axis| axis.world(record, schema.endian));
            match lattice.nearest(world) {
                Some(position) => place(i, position),
                None if world.iter().all(|v| v.is_finite()) => misplaced(i, Misplaced::TooFar),
                None => misplaced(i, Misplaced::NotFinite),
            }
        }
    }
}

/// How the places of a scan are sealed.
pub struct SealSettings<'a> {
    pub placing: &'a Placing,
    pub left_out: &'a Selection,
    /// Whether normals are kept of records that have them.
    pub has_normals: bool,
    pub nonfinite: Nonfinite,
    /// Records that a thread sorts at once.
    pub run_records: usize,
    pub area: &'a Arc<SpillArea>,
    pub budget: &'a Budget,
    pub threads: Threads<'a>,
    pub watch: &'a dyn Watch,
}

/// What a thread works with.
struct SealArena<'a> {
    intake: Intake<'a>,
    batch: PointBatch,
    positions: Vec<Position>,
    normals: Vec<u8>,
}

impl SealSettings<'_> {
    /// The places of all records of `source` that are not left out. `sorting` is for what threads
    /// hold until all are read.
    pub fn seal(&self, source: &dyn Source, sorting: Lease) -> Result<SealedTiles> {
        let schema = source.schema();
        let is_read = |name: &str| {
            names::XYZ.contains(&name)
                || self.left_out.names().contains(&name)
                || self.has_normals && names::NORMAL.contains(&name)
        };
        let unread = schema.dimensions.iter().map(|d| d.name.clone());
        let unread: Vec<String> = unread.filter(|name| !is_read(name)).collect();
        let chosen = (!self.left_out.is_all()).then(|| self.left_out.of(schema));
        let normals = RecordNormals::of(schema).filter(|_| self.has_normals);
        let stride = stride(self.has_normals);
        let store = TileStore::new(self.area, self.budget, stride, false);
        self.watch.phase("decode", Some(source.points()));
        let mut dropped = 0;
        self.threads.items(source.parts(), || {}).run(
            || SealArena {
                intake: Intake::new(&store, self.run_records),
                batch: PointBatch::new(schema.clone(), BATCH),
                positions: Vec::with_capacity(BATCH),
                normals: Vec::new(),
            },
            |arena, index| {
                let mut part = source.part_without(index, &unread)?;
                let mut nowhere = 0;
                loop {
                    arena.batch.clear();
                    part.read(&mut arena.batch)?;
                    if arena.batch.is_empty() {
                        return Ok(nowhere);
                    }
                    nowhere += self.take(source, (chosen.as_ref(), normals.as_ref()), arena)?;
                    self.advance(arena.batch.len() as u64)?;
                }
            },
            |nowhere: u64| dropped += nowhere,
            |mut arena| arena.intake.flush(),
        )?;
        drop(sorting);
        if dropped > 0 {
            let told = "points whose coordinates are not finite have no distance, and are left out";
            self.watch.warn(&format!("{told}, {} of them", Grouped(dropped)));
        }
        self.watch.phase("merge", Some(source.points()));
        seal(store, self.threads, &|records| self.advance(records))
    }

    fn advance(&self, points: u64) -> Result<()> {
        self.watch.advance(points);
        if self.watch.cancelled() { Err(Error::interrupted()) } else { Ok(()) }
    }

    /// Hands the places of a batch to the intake; how many records have none, if these are left
    /// out.
    fn take(
        &self,
        source: &dyn Source,
        (chosen, normals): (Option<&Chooser>, Option<&RecordNormals<'_>>),
        arena: &mut SealArena<'_>,
    ) -> Result<u64> {
        let SealArena { intake, batch, positions, normals: stored } = arena;
        positions.clear();
        stored.clear();
        let record = |i: usize| {
            let stride = batch.schema().stride;
            &batch.records()[i * stride..(i + 1) * stride]
        };
        let is_chosen = |i: usize| chosen.is_none_or(|chosen| chosen.holds(record(i)));
        let mut nowhere = Vec::new();
        self.placing.place(
            batch,
            |i, position| {
                if is_chosen(i) {
                    positions.push(position);
                    normals.iter().for_each(|normals| normals.store(record(i), stored));
                }
            },
            |i, why| {
                if is_chosen(i) {
                    nowhere.push((i, why));
                }
            },
        );
        for (n, positions) in positions.chunks(BATCH).enumerate() {
            let records = match normals {
                None => &NOTHING[..positions.len() * STRIDE],
                Some(_) => &stored[n * BATCH * NORMAL_BYTES..][..positions.len() * NORMAL_BYTES],
            };
            intake.take(positions, records, &[])?;
        }
        let drops =
            |why: &Misplaced| *why == Misplaced::NotFinite && self.nonfinite == Nonfinite::Drop;
        match nowhere.iter().find(|(_, why)| !drops(why)) {
            None => Ok(nowhere.len() as u64),
            Some((i, why)) => Err(misplaced(source, batch, record(*i), *why)),
        }
    }
}

fn misplaced(source: &dyn Source, batch: &PointBatch, record: &[u8], why: Misplaced) -> Error {
    let schema = batch.schema();
    let axes = schema.coordinates();
    let point = axes.map(|axes| axes.map(|d| d.world(record, schema.endian))).unwrap_or_default();
    let (what, help) = match why {
        Misplaced::NotFinite => {
            ("is not finite", "`run.nonfinite = \"drop\"` leaves such points out")
        }
        Misplaced::TooFar => ("lies too far away", "move the scan nearer to its origin"),
    };
    let error = Error::new(ErrorKind::Data, format!("the point {point:?} {what}")).help(help);
    match source.inputs().get(batch.source as usize) {
        Some(input) => error.at(&input.path),
        None => error,
    }
}
